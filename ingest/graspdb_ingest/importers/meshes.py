"""Where the meshes of a data set's objects are."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

from graspdb_ingest.importers.base import ImportOptions
from graspdb_schemas.errors import ImportSourceError, nearest

MESH_ENDINGS: Final = (".obj", ".stl", ".ply", ".glb", ".off", ".pcd")
FOLDERS: Final = (".", "meshes", "objects", "models")
"""Folders beside the data, relative to its own, in which a mesh is looked for."""


def find_mesh(name: str, beside: Path, options: ImportOptions) -> Path:
    """Return the mesh of an object by its name.

    It is looked for in the folder that the user gives, else in the data's folder and the usual ones in it.

    Parameters
    ----------
    name : str
        The object; its mesh is ``<name>.obj``, or has another of `MESH_ENDINGS`.
    beside : Path
        Folder of the data.
    options : ImportOptions
        `objects` is a folder, or the one mesh that there is.

    Raises
    ------
    ImportSourceError
        There is none; the message says what there is.
    """
    if options.objects is not None and options.objects.is_file():
        return options.objects
    root = options.objects or beside
    if not root.is_dir():
        raise ImportSourceError(root, "there is no such folder of meshes", "Check --objects.")
    folders = [root / folder for folder in FOLDERS if (root / folder).is_dir()]
    for folder in folders:
        for ending in MESH_ENDINGS:
            if (folder / f"{name}{ending}").is_file():
                return folder / f"{name}{ending}"
    known = sorted({file.stem for file in _meshes(folders)})
    there = f"there is {_some(known)}{nearest(name, known)}" if known else "there is none at all"
    remedy = f"Put {name}.obj (or {', '.join(MESH_ENDINGS[1:])}) there, or name its folder with --objects."
    raise ImportSourceError(root, f"no mesh of object {name!r}; {there}", remedy)


def _meshes(folders: Iterable[Path]) -> Iterable[Path]:
    return (file for folder in folders for file in folder.iterdir() if file.suffix.lower() in MESH_ENDINGS)


def _some(names: list[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
