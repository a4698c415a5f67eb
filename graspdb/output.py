"""Answers as text and files: a table to look at, CSV, JSON, Parquet."""

import csv
import io
import json
import math
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import IO, Any, Final, TypeAlias

import pyarrow as pa
import pyarrow.parquet as pq

from graspdb_queries.engine import Stream
from graspdb_schemas.errors import GraspDBError

Rows: TypeAlias = Stream | pa.RecordBatchReader
"""Rows of an answer, batch by batch."""

_TABLE_ROWS: Final = 200
"""Rows that a table shows; the other forms have all."""

_CELL: Final = 60
"""Characters of a cell of a table."""


class OutputError(GraspDBError):
    """An answer cannot be written."""

    def __init__(self, path: object, found: str, remedy: str) -> None:
        self.path = path
        self.found = found
        super().__init__(f"{path}: {found}. {remedy}")


def write_rows(rows: Rows, form: str, path: Path | None) -> None:
    """Write the rows of an answer, batch by batch.

    Parameters
    ----------
    rows : Stream or pyarrow.RecordBatchReader
        The answer.
    form : str
        table, csv, json or parquet.
    path : Path or None
        Where to; standard output if None.

    Raises
    ------
    OutputError
        The file cannot be written, or Parquet would go to a terminal.
    """
    if form == "parquet" and path is None and sys.stdout.isatty():
        raise OutputError("standard output", "Parquet is not text for a terminal", "Name a file with -o.")
    with _opened(path) as file:
        if form == "parquet":
            _write_parquet(rows, file)
            return
        text = io.TextIOWrapper(file, encoding="utf-8", errors="surrogateescape", newline="")
        try:
            {"table": write_table, "csv": _write_csv, "json": _write_json}[form](rows, text)
            text.flush()
        finally:
            text.detach()


@contextmanager
def _opened(path: Path | None) -> Iterator[IO[bytes]]:
    """Open standard output, or a file, which is taken away again where the answer fails half-way."""
    if path is None:
        yield sys.stdout.buffer
        sys.stdout.buffer.flush()
        return
    try:
        file = path.open("wb")
    except OSError as error:
        raise OutputError(
            path, f"cannot be written: {error.strerror}", "Name another file with -o."
        ) from error
    try:
        with file:
            yield file
    except BaseException:
        if path.is_file():
            path.unlink()
        raise


def _write_parquet(rows: Rows, file: IO[bytes]) -> None:
    with pq.ParquetWriter(file, rows.schema) as writer:
        for batch in rows:
            writer.write_batch(batch)


def _write_csv(rows: Rows, text: IO[str]) -> None:
    """Write CSV: nothing for null, JSON for lists and maps."""
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(rows.schema.names)
    text.flush()
    for row in _rows(rows):
        writer.writerow([_cell(value) for value in row])


def _write_json(rows: Rows, text: IO[str]) -> None:
    """Write a JSON array of objects, one a line; numbers that JSON has not, NaN and infinity, become null."""
    names = _distinct(rows.schema.names)
    separator = "[\n"
    for row in _rows(rows):
        text.write(separator + _json(dict(zip(names, row, strict=True))))
        separator = ",\n"
    text.write("[]\n" if separator == "[\n" else "\n]\n")


def write_table(rows: Rows, text: IO[str], width: int = 0) -> None:
    """Write columns side by side, the first rows of them.

    Parameters
    ----------
    rows : Stream or pyarrow.RecordBatchReader
        The answer.
    text : text file
        Where to.
    width : int
        Characters of a cell at most; 0 for what suits the terminal.
    """
    width = width or min(_CELL, shutil.get_terminal_size().columns)
    shown = list(islice(_rows(rows), _TABLE_ROWS + 1))
    more, shown = len(shown) > _TABLE_ROWS, shown[:_TABLE_ROWS]
    cells = [[_short(value, width) for value in row] for row in shown]
    names = rows.schema.names
    widths = [max([len(name), *(len(row[i]) for row in cells)]) for i, name in enumerate(names)]
    right = [pa.types.is_integer(kind) or pa.types.is_floating(kind) for kind in rows.schema.types]
    for row in [names, ["-" * width for width in widths], *cells]:
        aligned = (
            cell.rjust(width) if to_right else cell.ljust(width)
            for cell, width, to_right in zip(row, widths, right, strict=True)
        )
        text.write("  ".join(aligned).rstrip() + "\n")
    if more:
        text.write(f"The first {_TABLE_ROWS} rows; --format csv, json or parquet gives all.\n")
    else:
        text.write(f"{len(shown)} row{'' if len(shown) == 1 else 's'}\n")


def _rows(rows: Rows) -> Iterator[tuple[Any, ...]]:
    for batch in rows:
        columns = [column.to_pylist(maps_as_pydicts="lossy") for column in batch.columns]
        yield from zip(*columns, strict=True)


def _cell(value: Any) -> Any:
    """Return a value as CSV has it."""
    if isinstance(value, (list, dict)):
        return _json(value)
    return str(value).lower() if isinstance(value, bool) else value


def _short(value: Any, width: int) -> str:
    """Return a value on one line of a table, cut where it is long."""
    if isinstance(value, float):
        return f"{value:.6g}"
    text = "" if value is None else str(_cell(value))
    text = "".join(character if character.isprintable() else " " for character in text)
    return text if len(text) <= width else text[: width - 3] + "..."


def _json(value: Any) -> str:
    return json.dumps(_plain(value), ensure_ascii=False, default=str, allow_nan=False)


def _plain(value: Any) -> Any:
    """Return a value of which JSON can be made."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    return value


def _distinct(names: list[str]) -> list[str]:
    """Return names of which none occurs twice: a, a_1, a_2."""
    seen: dict[str, int] = {}
    distinct = []
    for name in names:
        count = seen.get(name, 0)
        seen[name] = count + 1
        distinct.append(f"{name}_{count}" if count else name)
    return distinct
