"""One tree of errors: each says what was found, where, and what to do next."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path


def nearest(name: str, allowed: Sequence[str]) -> str:
    """Return a hint such as ``"; did you mean 'index_pip'?"``, or nothing where no name is near."""
    close = get_close_matches(name, list(allowed), n=1)
    return f"; did you mean {close[0]!r}?" if close else ""


class GraspDBError(Exception):
    """Anything that a user of graspdb can cause and mend."""


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a manifest.

    Attributes
    ----------
    key : str
        Where it stands, such as ``subjects.s1.hand_length``.
    found : str
        What stands there.
    allowed : str
        What may stand there.
    """

    key: str
    found: str
    allowed: str

    def __str__(self) -> str:
        """Return one line: key, found, allowed."""
        return f"{self.key}: found {self.found}; allowed: {self.allowed}"


class ManifestError(GraspDBError):
    """A session's manifest does not describe a session; all its problems are listed."""

    def __init__(self, path: Path, problems: Sequence[Problem]) -> None:
        self.path = path
        self.problems = tuple(problems)
        lines = "\n".join(f"  {problem}" for problem in self.problems)
        count = "1 problem" if len(self.problems) == 1 else f"{len(self.problems)} problems"
        super().__init__(f"{path}: {count}\n{lines}\nMend these keys and run again.")


class RecordingError(GraspDBError):
    """A file of marker trajectories cannot be read as what it claims to be."""

    def __init__(self, path: Path, found: str, remedy: str) -> None:
        self.path = path
        self.found = found
        self.remedy = remedy
        super().__init__(f"{path}: {found}. {remedy}")


class MarkersNotFoundError(RecordingError):
    """A recording holds none of the markers that the manifest names."""

    def __init__(self, path: Path, wanted: Sequence[str], labels: Sequence[str]) -> None:
        self.wanted = tuple(wanted)
        self.labels = tuple(labels)
        super().__init__(
            path,
            f"none of the manifest's markers ({', '.join(wanted)}) is in it; "
            f"its labels are: {', '.join(labels) or 'none'}",
            "Map its labels to the marker set's with marker_names in session.yaml.",
        )


class HandModelError(GraspDBError):
    """A hand model cannot be built, or lacks what tracking needs."""

    def __init__(self, found: str, remedy: str) -> None:
        self.found = found
        self.remedy = remedy
        super().__init__(f"{found}. {remedy}")


class HandFileError(HandModelError):
    """A file does not hold a hand model that tracking can use."""

    def __init__(self, path: Path, found: str, remedy: str) -> None:
        self.path = path
        super().__init__(f"{path}: {found}", remedy)


class TrackingError(GraspDBError):
    """A hand cannot be followed, or its calibration cannot be found, in the markers given."""

    def __init__(self, reason: str, remedy: str) -> None:
        self.reason = reason
        self.remedy = remedy
        super().__init__(f"{reason}. {remedy}")


class ObjectError(GraspDBError):
    """An object's mesh or cloud cannot stand for its surface."""

    def __init__(self, path: Path, found: str, remedy: str) -> None:
        self.path = path
        self.found = found
        self.remedy = remedy
        super().__init__(f"{path}: {found}. {remedy}")


class MeasuredMapError(GraspDBError):
    """A file does not hold contact measured on an object's surface."""

    def __init__(self, path: Path, found: str, remedy: str) -> None:
        self.path = path
        self.found = found
        self.remedy = remedy
        super().__init__(f"{path}: {found}. {remedy}")


class ParameterError(GraspDBError, ValueError):
    """An argument is outside of what is allowed."""

    def __init__(self, name: str, found: object, allowed: str) -> None:
        self.name = name
        self.found = found
        self.allowed = allowed
        super().__init__(f"{name}: found {found!r}; allowed: {allowed}")


class DatabaseError(GraspDBError):
    """A folder is not a graspdb database, or not one that this version can use."""

    def __init__(self, path: object, found: str, remedy: str) -> None:
        self.path = path
        self.found = found
        self.remedy = remedy
        super().__init__(f"{path}: {found}. {remedy}")


class QueryError(GraspDBError):
    """A query cannot be answered."""

    def __init__(self, found: str, remedy: str) -> None:
        self.found = found
        self.remedy = remedy
        super().__init__(f"{found}\n{remedy}")


class MissingLibraryError(GraspDBError):
    """A library, or a system library that it needs, is not installed."""

    def __init__(self, library: str, found: str, remedy: str) -> None:
        self.library = library
        self.found = found
        self.remedy = remedy
        super().__init__(f"{library} cannot be loaded: {found}. {remedy}")


class ImportSourceError(GraspDBError):
    """A folder or file is not the data set that it is to be imported as, or not all of it."""

    def __init__(self, path: Path, found: str, remedy: str) -> None:
        self.path = path
        self.found = found
        self.remedy = remedy
        super().__init__(f"{path}: {found}. {remedy}")


class UnsafeFileError(ImportSourceError):
    """A file of a data set holds something that data do not need, and that could do harm."""
