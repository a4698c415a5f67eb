"""Text files as lines, and blocks of numbers out of them, with the cell named that is no number."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
from numpy.typing import NDArray

from graspdb_schemas.errors import RecordingError

_MISSING: Final = ("", "nan", "NaN", "NAN", "-nan", "null", "NULL", "Null", "NA", "N/A", "n/a", "-nan(ind)")
_AGAIN: Final = "Export the recording again, or copy it again."


@dataclass(frozen=True)
class TextLines:
    """A text file as lines.

    Attributes
    ----------
    path : Path
        The file.
    lines : list of str
        Its lines without their ends.
    ended : bool
        Whether the last line has an end, as complete files have.
    """

    path: Path
    lines: list[str]
    ended: bool

    def line(self, index: int) -> str:
        """Return a line, empty beyond the end."""
        return self.lines[index] if index < len(self.lines) else ""


def is_text(data: bytes) -> bool:
    """Whether bytes look like text: no zero bytes and hardly any control characters."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return True
    controls = sum(byte < 32 and byte not in b"\t\n\r\f" for byte in data)
    return b"\0" not in data and controls <= 0.01 * len(data)


def read_lines(path: Path) -> TextLines:
    """Read a text file in UTF-8, UTF-16 with its mark, or an 8-bit encoding.

    Raises
    ------
    RecordingError
        If it is binary.
    """
    data = path.read_bytes()
    if not is_text(data[:65536]):
        raise RecordingError(path, "it is binary where text is expected", "Give the file its true ending.")
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    ended = lines[-1] == ""
    return TextLines(path, lines[:-1] if ended else lines, ended)


def number_block(
    text: TextLines, first: int, delimiter: str, names: Sequence[str], used: Sequence[int]
) -> NDArray[np.float64]:
    """Return columns of a file's data rows as numbers.

    Rows may lack trailing cells, which are missing, and may have blank cells too many. Blank rows
    are left out.

    Parameters
    ----------
    text : TextLines
        The file.
    first : int
        Index of the first data line.
    delimiter : str
        Between cells.
    names : sequence of str
        What each column is called, for messages.
    used : sequence of int
        The columns to return.

    Returns
    -------
    ndarray, shape (n_rows, len(used))
        The numbers; NaN where a cell is blank, ``NaN`` or ``null``.

    Raises
    ------
    RecordingError
        If a cell is no number, a row has too many cells, or the last line breaks off.
    """
    blank = delimiter + " \t"
    rows = [(i, text.lines[i]) for i in range(first, len(text.lines)) if text.lines[i].strip(blank)]
    fitted = [_fit(text, i, row, delimiter, len(names)) for i, row in rows]
    if not fitted:
        return np.empty((0, len(used)))
    try:
        return _convert(fitted, delimiter, len(names), used)
    except pa.ArrowInvalid:
        values = [
            [_cell(text, i, names[j], row.split(delimiter)[j]) for j in used]
            for (i, _), row in zip(rows, fitted, strict=True)
        ]
        return np.array(values, dtype=np.float64)


def _fit(text: TextLines, index: int, row: str, delimiter: str, n_columns: int) -> str:
    """Return a row with the right number of cells."""
    extra = row.count(delimiter) + 1 - n_columns
    if extra == 0:
        return row
    if extra > 0:
        cells = row.split(delimiter)
        if any(cell.strip() for cell in cells[n_columns:]):
            raise RecordingError(
                text.path,
                f"line {index + 1} has {len(cells)} cells where the header has {n_columns} columns",
                _AGAIN,
            )
        return delimiter.join(cells[:n_columns])
    if index == len(text.lines) - 1 and not text.ended:
        raise RecordingError(text.path, f"it breaks off in line {index + 1}", _AGAIN)
    return row + delimiter * -extra


def _convert(rows: Sequence[str], delimiter: str, n_columns: int, used: Sequence[int]) -> NDArray[np.float64]:
    columns = [str(j) for j in range(n_columns)]
    wanted = [str(j) for j in used]
    table = pa_csv.read_csv(
        pa.BufferReader("\n".join(rows).encode()),
        read_options=pa_csv.ReadOptions(column_names=columns),
        parse_options=pa_csv.ParseOptions(delimiter=delimiter, quote_char=False),
        convert_options=pa_csv.ConvertOptions(
            column_types=dict.fromkeys(wanted, pa.float64()),
            include_columns=wanted,
            null_values=list(_MISSING),
        ),
    )
    values = np.empty((table.num_rows, len(used)))
    for j, column in enumerate(table.columns):
        values[:, j] = column.to_numpy()
    return values


def _cell(text: TextLines, index: int, name: str, cell: str) -> float:
    """Return one cell as a number, or say which it is."""
    bare = cell.strip().strip('"').strip()
    if bare in _MISSING:
        return np.nan
    try:
        if "_" in bare:  # which Python takes and no recording means
            raise ValueError
        return float(bare)
    except ValueError:
        raise RecordingError(
            text.path,
            f"line {index + 1}, column {name!r}: {bare!r} is not a number",
            "Mend or blank this cell.",
        ) from None
