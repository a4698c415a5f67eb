"""Which reader reads which file: by its ending and, where formats share one, by its content."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import RecordingError, nearest

ReadFunction = Callable[[Path, float], Recording]
SniffFunction = Callable[[bytes], bool]

_HEAD: Final = 4096
"""Bytes that content is judged by."""


@dataclass(frozen=True)
class Reader:
    """A registered reader.

    Attributes
    ----------
    name : str
        What the format is called.
    endings : tuple of str
        File name endings, lower case, with their dot.
    read : callable
        Takes the path and the factor from its lengths to metres where it does not say its unit.
    sniff : callable
        Whether the first bytes of a file look like this format.
    """

    name: str
    endings: tuple[str, ...]
    read: ReadFunction
    sniff: SniffFunction


_READERS: Final[list[Reader]] = []


def _anything(_head: bytes) -> bool:
    return True


def reader(
    name: str, *endings: str, sniff: SniffFunction = _anything
) -> Callable[[ReadFunction], ReadFunction]:
    """Register the decorated function as the reader of a format.

    Parameters
    ----------
    name : str
        What the format is called in messages.
    *endings : str
        File name endings that it has, such as ``".trc"``.
    sniff : callable, optional
        Tells the format by a file's first bytes; needed where formats share an ending. Without it
        the reader takes what no other reader of that ending does.
    """

    def register(read: ReadFunction) -> ReadFunction:
        _READERS.append(Reader(name, tuple(ending.lower() for ending in endings), read, sniff))
        return read

    return register


def readers() -> tuple[Reader, ...]:
    """Return the registered readers, first registered first."""
    return tuple(_READERS)


def read_recording(path: Path, default_scale: float) -> Recording:
    """Read marker trajectories from a file of any known format.

    Parameters
    ----------
    path : Path
        The file; its ending, and where formats share an ending its content, decide the reader.
    default_scale : float
        Metres in one of the file's length units, for files that do not say theirs.

    Returns
    -------
    Recording
        Positions in metres, NaN where a marker was not seen; nothing is filled in.

    Raises
    ------
    RecordingError
        If the file is not what its ending claims, or holds no usable trajectories.
    """
    head = _head_of(path)
    ending = path.suffix.lower()
    candidates = [entry for entry in _READERS if ending in entry.endings]
    if not candidates:
        known = sorted({known for entry in _READERS for known in entry.endings})
        hint = nearest(ending, known)
        raise RecordingError(
            path,
            f"its ending {ending!r} belongs to no known format" if ending else "its name has no ending",
            f"Known endings: {', '.join(known)}{hint}. Export the recording as C3D where you can.",
        )
    for entry in sorted(candidates, key=lambda candidate: candidate.sniff is _anything):
        if entry.sniff(head):
            return entry.read(path, default_scale)
    names = " nor ".join(entry.name for entry in candidates)
    raise RecordingError(
        path, f"its content is neither {names}", "Export it again as one of these, or give its true ending."
    )


def _head_of(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise RecordingError(
            path, f"it cannot be opened ({error.strerror})", "Check the path and its permissions."
        ) from error
    if not head:
        raise RecordingError(path, "the file is empty", "Export the recording again, or copy it again.")
    return head
