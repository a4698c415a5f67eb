"""A checksum file: ``sha256sum --check SHA256SUMS`` tells whether an export arrived whole."""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final

NAME: Final = "SHA256SUMS"


def write_checksums(folder: Path) -> None:
    """Write the sha256 of every file of a folder, hidden ones left out, in the form of ``sha256sum``."""
    lines = []
    for path in sorted(_files(folder)):
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        lines.append(f"{digest}  {path.relative_to(folder).as_posix()}\n")
    (folder / NAME).write_text("".join(lines), encoding="utf-8")


def _files(folder: Path) -> Iterator[Path]:
    from graspdb.export.journal import UNFINISHED

    for path in folder.rglob("*"):
        inside = path.relative_to(folder).parts
        if path.is_file() and inside[0] != UNFINISHED and inside != (NAME,):
            yield path
