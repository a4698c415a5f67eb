"""Charts as vector graphics: where everything stands, in pixels; ``templates/chart.svg`` writes it down.

A chart has no colours of its own, only names of classes, which the page's style gives colours for light,
dark and paper. It needs no script, and its texts are escaped as all others of a page.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from graspdb.pages.scales import Scale, Tick, names, numbers

N_SERIES: Final = 8
"""Series that the style tells apart by colour; dots also differ by shape."""

_LETTER: Final = 6.2
"""Width of a letter, about [pixel]."""

_LONGEST: Final = 28
"""Letters of a name along x; longer ones are cut."""

_LEFT, _RIGHT, _TOP, _BOTTOM = 52, 22, 10, 36
"""Margins about the field of a chart [pixel]."""


@dataclass(frozen=True)
class Mark:
    """Something drawn in a chart.

    Attributes
    ----------
    kind : {'line', 'dot', 'bar', 'rule'}
        A line through points; a dot; a rectangle from a corner, with a size; a straight line.
    points : tuple of (float, float)
        Points [pixel]; of a bar its corner and its size.
    css : str
        Classes of the style.
    title : str
        What is said when one points at it.
    shape : int
        Of a dot: which of the shapes.
    opacity : float
        0 to 1.
    """

    kind: Literal["line", "dot", "bar", "rule"]
    points: tuple[tuple[float, float], ...]
    css: str
    title: str = ""
    shape: int = 0
    opacity: float = 1.0

    @property
    def path(self) -> str:
        """The points as SVG writes them."""
        return " ".join(f"{x:g},{y:g}" for x, y in self.points)


@dataclass(frozen=True)
class Key:
    """An entry of the legend: the series' class, its shape and its name."""

    css: str
    shape: int
    label: str


@dataclass(frozen=True)
class Chart:
    """A chart, ready to be written down.

    Attributes
    ----------
    title : str
        What it shows, for who cannot see it.
    width, height : float
        [pixel]
    x, y : Scale
        Its axes.
    x_title, y_title : str
        What they are, with units.
    marks : tuple of Mark
        What is drawn, in this order.
    legend : tuple of Key
        Names of the series.
    slanted : bool
        Whether the names along x are too long to stand upright.
    """

    title: str
    width: float
    height: float
    x: Scale
    y: Scale
    x_title: str = ""
    y_title: str = ""
    marks: tuple[Mark, ...] = ()
    legend: tuple[Key, ...] = field(default=())
    slanted: bool = False


@dataclass(frozen=True)
class Series:
    """Points of one kind: name, x, y, and what each point is called."""

    name: str
    x: Sequence[float | None]
    y: Sequence[float | None]
    titles: Sequence[str] = ()


def series_css(i: int) -> str:
    """Return the class of the i-th series."""
    return f"s{i % N_SERIES}"


def _legend(series: Sequence[Series]) -> tuple[Key, ...]:
    return tuple(Key(series_css(i), i, one.name) for i, one in enumerate(series)) if len(series) > 1 else ()


def scatter(
    title: str,
    series: Sequence[Series],
    x_title: str,
    y_title: str,
    *,
    joined: bool = False,
    labels: Sequence[str] = (),
    size: tuple[float, float] = (520, 320),
) -> Chart:
    """Return points, by series, in a plane; joined by lines on request.

    Where there are `labels`, x counts them, and they stand along the axis.
    """
    width, height = size
    slanted, below = _slant(labels, width)
    along = _LEFT, width - _RIGHT
    x = names(labels, *along) if labels else numbers(_known([v for one in series for v in one.x]), *along)
    y = numbers(_known([v for one in series for v in one.y]), height - below, _TOP)
    marks: list[Mark] = []
    for i, one in enumerate(series):
        places = [
            (k, (x(a), y(b)))
            for k, (a, b) in enumerate(zip(one.x, one.y, strict=True))
            if a is not None and b is not None and np.isfinite([a, b]).all()
        ]
        if joined and places:
            marks.append(Mark("line", tuple(place for _, place in places), series_css(i), one.name))
            continue
        marks += [
            Mark("dot", (place,), series_css(i), one.titles[k] if one.titles else one.name, i)
            for k, place in places
        ]
    return Chart(title, width, height, x, y, x_title, y_title, tuple(marks), _legend(series), slanted)


def columns(
    title: str,
    labels: Sequence[str],
    values: Sequence[float | None],
    y_title: str,
    *,
    x_title: str = "",
    width: float = 520,
) -> Chart:
    """Return a bar for each name."""
    slanted, below = _slant(labels, width)
    height = 230 + below
    x, y = (
        names(labels, _LEFT, width - _RIGHT),
        numbers(list(_known(values)), height - below, _TOP, zero=True),
    )
    broad = 0.72 * (x(1) - x(0))
    marks = [
        Mark(
            "bar", ((x(i) - broad / 2, min(y(v), y(0))), (broad, abs(y(v) - y(0)))), "s0", f"{label}: {v:.4g}"
        )
        for i, (label, v) in enumerate(zip(labels, values, strict=True))
        if v is not None and np.isfinite(v)
    ]
    return Chart(title, width, height, x, y, x_title, y_title, tuple(marks), slanted=slanted)


def spreads(
    title: str,
    rows: Sequence[tuple[str, Sequence[float]]],
    x_title: str,
    *,
    width: float = 520,
) -> Chart:
    """Return for each name a line from least to greatest, a bar of the quartiles, a dot at the median."""
    left = _LETTER * max((len(name) for name, _ in rows), default=0) + 16
    height = 15 * len(rows) + _TOP + _BOTTOM
    x = numbers([v for _, values in rows for v in values], left, width - _RIGHT, zero=True)
    y = names([name for name, _ in rows], _TOP, height - _BOTTOM)
    marks: list[Mark] = []
    for i, (name, (least, lower, median, upper, greatest)) in enumerate(rows):
        quartiles, whole = f"{lower:.3g} to {upper:.3g}", f"{least:.3g} to {greatest:.3g}"
        said = f"{name}: median {median:.3g}, quartiles {quartiles}, {whole}"
        marks.append(Mark("rule", ((x(least), y(i)), (x(greatest), y(i))), "whisker", said))
        marks.append(Mark("bar", ((x(lower), y(i) - 4), (max(x(upper) - x(lower), 1), 8)), "s0 soft", said))
        marks.append(Mark("dot", ((x(median), y(i)),), "s0 small", said))
    return Chart(title, width, height, x, y, x_title, "", tuple(marks))


def shades(
    title: str,
    rows: Sequence[tuple[str, Sequence[float | None]]],
    greatest: float,
    x_title: str,
    *,
    width: float = 720,
) -> Chart:
    """Return a row of shades for each name: the darker, the nearer a value is to the greatest shown."""
    left = _LETTER * max((len(name) for name, _ in rows), default=0) + 16
    line = 9 if len(rows) > 60 else 13
    height = line * len(rows) + _TOP + _BOTTOM
    n = max((len(values) for _, values in rows), default=1)
    x, y = Scale(0, n, left, width - _RIGHT, ()), names([name for name, _ in rows], _TOP, height - _BOTTOM)
    ticks = tuple(Tick(x(share * n), f"{100 * share:.0f} %") for share in (0, 0.25, 0.5, 0.75, 1))
    marks: list[Mark] = []
    for i, (name, values) in enumerate(rows):
        levels = [None if v is None or v <= 0 else max(1, min(8, round(8 * v / greatest))) for v in values]
        edges = [0, *(k for k in range(1, len(levels)) if levels[k] != levels[k - 1]), len(levels)]
        for begin, end in pairwise(edges):
            if begin < end and (level := levels[begin]) is not None:
                share = float(np.mean([v for v in values[begin:end] if v is not None]))
                corner, size = (x(begin), y(i) - line / 2 + 0.5), (x(end) - x(begin), line - 1)
                marks.append(Mark("bar", (corner, size), "shade", f"{name}: {share:.0%}", opacity=level / 8))
    return Chart(title, width, height, Scale(0, n, x.start, x.end, ticks), y, x_title, "", tuple(marks))


def _slant(labels: Sequence[str], width: float) -> tuple[bool, float]:
    """Return whether names are too long to stand upright along x, and the margin that they need below."""
    longest = max((len(label) for label in labels), default=0)
    slanted = longest * _LETTER * max(len(labels), 1) > width - _LEFT - _RIGHT
    return slanted, _BOTTOM + (0.62 * _LETTER * min(longest, _LONGEST) if slanted else 0)


def _known(values: Sequence[float | None]) -> list[float]:
    return [value for value in values if value is not None]
