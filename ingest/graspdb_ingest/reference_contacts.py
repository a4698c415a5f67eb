"""Measured centres of pressure, as force panels give them: what contact points are validated against."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa

from graspdb_ingest.columns import list_column
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.readers.text import number_block, read_lines
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.errors import RecordingError, nearest
from graspdb_schemas.vocabulary import DIGITS

_COLUMNS: Final = ("time", "digit", "x", "y", "z")
_FORM: Final = "Give it the columns time [s], digit, x, y and z, separated by commas."
_FAR: Final = 3.0
"""Further than this from the object's origin nothing touches it [m]."""


@dataclass(frozen=True, eq=False)
class ReferenceContacts:
    """Centres of pressure over time, each of one digit.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Times on the recording's clock [s].
    digits : tuple of str
        Which digit pressed.
    positions : ndarray, shape (n, 3)
        Centres of pressure in the object frame [m].
    """

    times: Floats
    digits: tuple[str, ...]
    positions: Floats


def read_reference_contacts(path: Path, scale: float) -> ReferenceContacts:
    """Read a CSV file of measured centres of pressure: ``time, digit, x, y, z`` in the object's frame.

    Rows without a time or a position are left out, since nothing was pressed in them.

    Parameters
    ----------
    path : Path
        The file.
    scale : float
        Factor from its lengths to metres.

    Raises
    ------
    RecordingError
        If columns are missing, a digit is unknown, a cell is no number, nothing is left, or positions
        are so far from the object that their unit must be another one.
    """
    text = read_lines(path)
    titles = [title.strip().strip('"').lower() for title in text.lines[0].split(",")] if text.lines else []
    missing = [name for name in _COLUMNS if name not in titles]
    if missing:
        raise RecordingError(path, f"it has no column {', '.join(missing)}", _FORM)
    used = [titles.index(name) for name in ("time", "x", "y", "z")]
    values = number_block(text, 1, ",", titles, used)
    place = titles.index("digit")
    rows = [(i + 2, line.split(",")) for i, line in enumerate(text.lines[1:]) if line.strip(", \t")]
    digits = [_digit(path, number, cells[place] if place < len(cells) else "") for number, cells in rows]
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    if not len(known):
        raise RecordingError(path, "it has no row with a time and a position", _FORM)
    positions = scale * values[known, 1:]
    furthest = float(np.abs(positions).max())
    if furthest > _FAR:
        found = f"a centre of pressure lies {furthest:.3g} m from the object's origin"
        raise RecordingError(path, found, "Its lengths are to be in the manifest's `units`.")
    return ReferenceContacts(values[known, 0], tuple(digits[i] for i in known), positions)


def _digit(path: Path, line: int, cell: str) -> str:
    name = cell.strip().strip('"').strip().lower()
    if name not in DIGITS:
        found = f"line {line}: the digit {name!r}"
        raise RecordingError(path, found, f"Digits are {', '.join(DIGITS)}{nearest(name, DIGITS)}.")
    return name


def reference_rows(trial: str, reference: ReferenceContacts) -> pa.Table:
    """Return the rows of the table `reference_contacts`."""
    return pa.Table.from_pydict(
        {
            "trial": pa.repeat(trial, len(reference.times)),
            "time": reference.times,
            "digit": list(reference.digits),
            "position": list_column(reference.positions),
        },
        schema=rows_schema("reference_contacts"),
    )
