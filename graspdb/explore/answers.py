"""Answers to look at: the first rows as texts, and a chart of them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import pyarrow as pa

from graspdb.pages.charts import N_SERIES, Chart, Series, columns, scatter

ROWS: Final = 500
"""Rows of an answer that are shown, and that its chart is made of."""

_BARS: Final = 40
"""Bars, or names along an axis, that still can be read."""

_WIDTH, _HEIGHT = 760, 380
"""Size of a chart [pixel]."""

_CELL: Final = 200
"""Characters of a cell."""

KINDS: Final = ("points", "lines", "bars")


@dataclass(frozen=True)
class ChartForm:
    """What a chart of an answer shows.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    x, y : str
        Columns along the axes.
    by : str
        Column whose values are told apart by colour; empty if none.
    """

    kind: str
    x: str
    y: str
    by: str = ""


@dataclass(frozen=True)
class Answer:
    """The first rows of an answer.

    Attributes
    ----------
    names : tuple of str
        Its columns.
    numeric : tuple of bool
        Which of them are numbers.
    rows : tuple of tuple
        Values.
    more : bool
        Whether there are more rows.
    """

    names: tuple[str, ...]
    numeric: tuple[bool, ...]
    rows: tuple[tuple[Any, ...], ...]
    more: bool

    def cells(self) -> list[list[str]]:
        """Return the rows as texts."""
        return [[text(value) for value in row] for row in self.rows]

    def column(self, name: str) -> list[Any]:
        """Return the values of a column."""
        at = self.names.index(name)
        return [row[at] for row in self.rows]


def first_rows(batches: Iterable[pa.RecordBatch], schema: pa.Schema) -> Answer:
    """Return the first rows of an answer that comes batch by batch."""
    rows: list[tuple[Any, ...]] = []
    for batch in batches:
        part = batch.slice(0, ROWS + 1 - len(rows))
        rows.extend(zip(*(column.to_pylist(maps_as_pydicts="lossy") for column in part.columns), strict=True))
        if len(rows) > ROWS:
            break
    numeric = tuple(
        pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)
        for kind in schema.types
    )
    return Answer(tuple(schema.names), numeric, tuple(rows[:ROWS]), len(rows) > ROWS)


def text(value: Any) -> str:
    """Return a value as a cell of a table shows it."""
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return _cut("[" + ", ".join(text(item) for item in value[:_CELL]) + "]")
    if isinstance(value, dict):
        return _cut(", ".join(f"{key}: {text(item)}" for key, item in value.items()))
    return _cut(str(value))


def _cut(said: str) -> str:
    return said if len(said) <= _CELL else said[: _CELL - 1] + "…"


def suggested(answer: Answer) -> ChartForm | None:
    """Return the chart that suits an answer, or None where it has no numbers to draw.

    Few rows with a name are bars; others are points, of the first two columns of numbers. Columns that say
    the same in every row come last, and counts after measures.
    """
    numbers = [name for name, numeric in zip(answer.names, answer.numeric, strict=True) if numeric]
    numbers.sort(key=lambda name: _tells_little(answer.column(name)))
    texts = [
        name
        for name, numeric in zip(answer.names, answer.numeric, strict=True)
        if not numeric and all(isinstance(value, str) for value in answer.column(name))
    ]
    if not numbers or not answer.rows:
        return None
    labels = [name for name in texts if len(set(answer.column(name))) == len(answer.rows)]
    if labels and len(answer.rows) <= _BARS:
        return ChartForm("bars", labels[0], numbers[0])
    if len(numbers) < 2:
        return None
    groups = [name for name in texts if len(set(answer.column(name))) <= N_SERIES]
    return ChartForm("points", numbers[0], numbers[1], groups[0] if groups else "")


def _tells_little(values: Sequence[Any]) -> tuple[bool, bool]:
    """Return whether all values are one, and whether they are whole numbers: what sorts after others."""
    return len(set(values)) < 2, all(isinstance(value, int) for value in values)


def chart(answer: Answer, form: ChartForm) -> Chart | None:
    """Return a chart of an answer, or None where its columns do not allow it."""
    numeric = dict(zip(answer.names, answer.numeric, strict=True))
    if form.x not in numeric or not numeric.get(form.y, False):
        return None
    title, y = f"{form.y} over {form.x}", _floats(answer.column(form.y))
    if form.kind == "bars":
        bars = [text(value) for value in answer.column(form.x)[:_BARS]]
        return columns(title, bars, y[:_BARS], form.y, x_title=form.x, width=_WIDTH)
    labels = [] if numeric[form.x] else list(dict.fromkeys(map(text, answer.column(form.x))))
    if len(labels) > _BARS:
        return None
    if labels:
        x: list[float | None] = [float(labels.index(text(value))) for value in answer.column(form.x)]
    else:
        x = _floats(answer.column(form.x))
    grouped = answer.column(form.by) if form.by in numeric else [""] * len(answer.rows)
    series = _series([text(value) for value in grouped], x, y, _names(answer))
    joined = form.kind == "lines"
    return scatter(title, series, form.x, form.y, joined=joined, labels=labels, size=(_WIDTH, _HEIGHT))


def _series(
    groups: Sequence[str], x: Sequence[float | None], y: Sequence[float | None], titles: Sequence[str]
) -> list[Series]:
    """Return points by group: as many groups as can be told apart, in the order of their names."""
    members = {group: [i for i, one in enumerate(groups) if one == group] for group in sorted(set(groups))}
    return [
        Series(group, [x[i] for i in rows], [y[i] for i in rows], [titles[i] for i in rows])
        for group, rows in list(members.items())[:N_SERIES]
    ]


def _floats(values: Sequence[Any]) -> list[float | None]:
    return [None if value is None or not math.isfinite(value) else float(value) for value in values]


def _names(answer: Answer) -> list[str]:
    """Return what each point is called: its row's texts."""
    at = [i for i, numeric in enumerate(answer.numeric) if not numeric][:3]
    return [" · ".join(text(row[i]) for i in at) for row in answer.rows]
