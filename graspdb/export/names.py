"""Where the files of a trial or a grasp lie in an export."""

import re
from pathlib import Path
from typing import Final

_UNSAFE: Final = re.compile(r'[\x00-\x1f\x7f"%*:<>?\\|]|^\.|[. ]$')
"""What no part of a path may have on some system, and the sign that stands for it."""


def path_of(folder: Path, split: str, key: str) -> Path:
    """Return the path of a trial or grasp: a folder for each part of its key, below that of its split.

    Characters that some file system refuses, and dots at either end, are written as in an URL (``%3A``), so
    that no two keys share a path and none leaves the folder. The folders above it are made.

    Parameters
    ----------
    folder : Path
        Folder of the export.
    split : str
        Side of the split; empty without one.
    key : str
        Key of a trial, a hand in it or a grasp, with parts between slashes.
    """
    parts = [_UNSAFE.sub(lambda found: f"%{ord(found[0]):02X}", part) or "%" for part in key.split("/")]
    path = folder.joinpath(*([split] if split else []), *parts)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def with_ending(path: Path, ending: str) -> Path:
    """Return a path with an ending behind its whole name, dots in it included."""
    return path.with_name(path.name + ending)
