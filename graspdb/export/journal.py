"""What an unfinished export has done, so that the same command goes on where it stopped."""

import hashlib
import json
import os
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import pyarrow as pa

from graspdb.export.errors import ExportError
from graspdb.export.registry import Written

UNFINISHED: Final = ".graspdb-export"
"""Folder of what is only there until an export is done; writers may keep files of their own in it."""


class Journal:
    """The parts that are done, one line each, behind a line that tells which export this is.

    Parameters
    ----------
    folder : Path
        Folder of the export; made where there is none.
    key : str
        Tells this export from any other; see `export_key`.

    Attributes
    ----------
    written : list of Written
        What came of the parts that are done.

    Raises
    ------
    ExportError
        The folder is not empty, and does not hold this export, unfinished.
    """

    def __init__(self, folder: Path, key: str) -> None:
        self.folder = folder
        self.file = folder / UNFINISHED / "journal.jsonl"
        self.written: list[Written] = []
        if folder.exists() and not folder.is_dir():
            raise ExportError(folder, "it is a file, not a folder", "Name another folder.")
        if folder.is_dir() and any(folder.iterdir()):
            self._go_on(key)
        else:
            self._begin(key)

    def _begin(self, key: str) -> None:
        self.made = not self.folder.exists()
        self.file.parent.mkdir(parents=True)
        self._append({"export": key})

    def _go_on(self, key: str) -> None:
        self.made = False
        if not self.file.is_file():
            raise ExportError(
                self.folder, "the folder is not empty", "Name another, or empty this one first."
            )
        lines = self._lines()
        if not lines or lines[0] != {"export": key}:
            raise ExportError(
                self.folder,
                "it holds another unfinished export: the query, the options or the database differ",
                "Name another folder, or remove this one first.",
            )
        self.written = [Written(**line) for line in lines[1:]]

    def _lines(self) -> list[Any]:
        """Return the lines that were written whole, having cut off one that was not."""
        text = self.file.read_bytes()
        whole = text[: text.rfind(b"\n") + 1]
        if len(whole) < len(text):
            with self.file.open("r+b") as file:
                file.truncate(len(whole))
        return [json.loads(line) for line in whole.splitlines()]

    def add(self, written: Written) -> None:
        """Note that another part is done; its files are on disk."""
        self._append(asdict(written))
        self.written.append(written)

    def _append(self, line: Any) -> None:
        with self.file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
            file.flush()
            os.fsync(file.fileno())

    def close(self) -> None:
        """Remove what was only there until the export is done."""
        shutil.rmtree(self.file.parent)

    def discard(self) -> None:
        """Remove all of an export that cannot be made, and the folder if it was made for it."""
        for path in self.folder.iterdir():
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        if self.made:
            self.folder.rmdir()


def export_key(form: str, options: Any, version: str, rows: pa.Table) -> str:
    """Return what tells an export from any other: format, options, version of graspdb, and the very rows."""
    digest = hashlib.sha256(json.dumps([form, options, version], sort_keys=True).encode())
    for name in ("trial", "ingest_id", "split"):
        for text in rows[name].to_pylist():
            digest.update(f"{text}\n".encode())
    for name in {"grasp", "grasps"} & set(rows.column_names):
        digest.update(repr(rows[name].to_pylist()).encode())
    return digest.hexdigest()
