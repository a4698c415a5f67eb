"""The files that a manifest names: found inside its own folders, or refused."""

from dataclasses import dataclass
from pathlib import Path, PureWindowsPath

from graspdb_schemas.errors import Problem, nearest


@dataclass(frozen=True)
class SessionFolders:
    """The folders that a manifest may name files in.

    Attributes
    ----------
    folders : tuple of Path
        Resolved folders, searched in this order: the data root where there is one, then the
        session's own folder.
    """

    folders: tuple[Path, ...]

    def locate(self, key: str, name: str) -> Path | Problem:
        """Return the file that a key names, or what is wrong with it.

        Parameters
        ----------
        key : str
            The key, for the message.
        name : str
            What stands there: a path relative to one of the folders.

        Returns
        -------
        Path or Problem
            The resolved file, which lies in one of the folders, or the problem.
        """
        allowed = f"a path inside {' or '.join(str(folder) for folder in self.folders)}"
        if Path(name).is_absolute() or PureWindowsPath(name).drive:
            return Problem(key, f"{name!r}, an absolute path", allowed)
        if ".." in Path(name).parts:
            return Problem(key, f"{name!r}, which climbs with '..'", allowed)
        try:
            return self._search(key, name, allowed)
        except (OSError, RuntimeError, ValueError):  # over-long names, loops of links, NUL
            return Problem(key, f"{name!r}, which is no path", allowed)

    def _search(self, key: str, name: str, allowed: str) -> Path | Problem:
        for folder in self.folders:
            file = (folder / name).resolve()
            if not file.exists():
                continue
            if not any(file.is_relative_to(root) for root in self.folders):
                return Problem(key, f"{name!r}, which leads to {file}", allowed)
            if not file.is_file():
                return Problem(key, f"{name!r}, which is not a file", "a file")
            return file
        return Problem(key, f"{name!r}, which does not exist", allowed + self._hint(name))

    def _hint(self, name: str) -> str:
        if "\\" in name:
            return "; folders are separated by '/'"
        for folder in self.folders:
            place = (folder / name).parent
            if place.is_dir() and place.resolve().is_relative_to(folder):
                hint = nearest(Path(name).name, [file.name for file in place.iterdir()])
                if hint:
                    return hint
        return ""
