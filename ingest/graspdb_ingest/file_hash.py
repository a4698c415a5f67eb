"""Hashes of files, and of what a manifest says."""

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

HASH_LENGTH: Final = 16
"""Hexadecimal digits of the hash of one part of a trial's inputs."""


def file_sha256(path: Path) -> str | None:
    """Return the sha256 of a file's content as hexadecimal digits, None where it cannot be read."""
    try:
        status = path.stat()
        return _digest(path, status.st_mtime_ns, status.st_size)
    except OSError:
        return None


def value_hash(value: Any) -> str:
    """Return a short hash of plain values: texts, numbers, lists and dicts of them."""
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:HASH_LENGTH]


@lru_cache(maxsize=4096)
def _digest(path: Path, _modified: int, _size: int) -> str:
    """Hash a file once as long as its time and size stay."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
