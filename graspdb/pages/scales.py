"""Scales of charts: where values and names stand along an axis, and what is written there."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

_FEW: Final = 5
"""About as many ticks as an axis has."""

_SAME: Final = 1e-9
"""Values that differ less than this share of them are shown as one."""

_NOTHING: Final = 1e-100
"""Values below are shown as zero."""


@dataclass(frozen=True)
class Tick:
    """A mark on an axis: where [pixel], and what it says."""

    at: float
    label: str


@dataclass(frozen=True)
class Scale:
    """Numbers, or names, along an axis.

    Attributes
    ----------
    low, high : float
        Values at both ends.
    start, end : float
        Where these are [pixel].
    ticks : tuple of Tick
        What is written along the axis.
    """

    low: float
    high: float
    start: float
    end: float
    ticks: tuple[Tick, ...]

    def __call__(self, value: float) -> float:
        """Return where a value is [pixel]."""
        share = (value - self.low) / (self.high - self.low)
        return round(self.start + share * (self.end - self.start), 1)


def numbers(values: Sequence[float], start: float, end: float, *, zero: bool = False) -> Scale:
    """Return a scale that has all of some values on it, from one round number to another.

    Parameters
    ----------
    values : sequence of float
        What is to be shown; those that are not finite do not count.
    start, end : float
        Its ends [pixel].
    zero : bool
        Whether it has zero on it, too.
    """
    finite = np.asarray([value for value in values if value is not None], dtype=float)
    finite = finite[np.isfinite(finite)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    if zero:
        low, high = min(low, 0.0), max(high, 0.0)
    greatest = max(abs(low), abs(high))
    if high - low <= _SAME * greatest or greatest < _NOTHING:
        reach = greatest if greatest >= _NOTHING else 1.0
        low, high = (0.0, reach) if zero and low >= 0 else (low - 0.5 * reach, high + 0.5 * reach)
    step = _round_step((high - low) / _FEW)
    first, last = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
    decimals = max(0, int(np.ceil(-np.log10(step) - 1e-9)))
    bare = Scale(float(first * step), float(last * step), start, end, ())
    ticks = [Tick(bare(value), _number(value, decimals)) for value in step * np.arange(first, last + 1)]
    return Scale(bare.low, bare.high, start, end, tuple(ticks))


def names(labels: Sequence[str], start: float, end: float) -> Scale:
    """Return a scale of names, one a whole number from 0, each in the middle of its part."""
    bare = Scale(-0.5, max(len(labels), 1) - 0.5, start, end, ())
    return Scale(
        bare.low, bare.high, start, end, tuple(Tick(bare(i), label) for i, label in enumerate(labels))
    )


def _round_step(least: float) -> float:
    """Return the least of 1, 2 and 5 times a power of ten that is not below a number."""
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least * (1 - 1e-9)))


def _number(value: float, decimals: int) -> str:
    if abs(value) >= 1e6 or decimals > 6:
        return f"{value:.3g}"
    return f"{value + 0.0:.{decimals}f}"
