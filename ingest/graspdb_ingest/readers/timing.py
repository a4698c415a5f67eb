"""Frame rates: as a file states them, and as its frame and time columns show them."""

import math
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_schemas.errors import RecordingError

_SLOWEST: Final = 1.0
_FASTEST: Final = 20_000.0
_DIGITS: Final = 18
"""Digits of a number of frames, at most; Python refuses to read numbers of thousands."""
_UNEVEN: Final = 0.3
"""Share of a frame's duration by which a time may be off the even spacing; rounding stays below."""


def stated_rate(path: Path, value: object, where: str) -> float:
    """Return a frame rate [Hz] that a file states.

    Parameters
    ----------
    path : Path
        The file, for the message.
    value : object
        The rate as a number or as text.
    where : str
        Where the file states it.

    Raises
    ------
    RecordingError
        If it is no number, not positive, or no rate of any camera.
    """
    try:
        rate = float(str(value).strip())
    except ValueError:
        rate = math.nan
    if not _SLOWEST <= rate <= _FASTEST:
        raise RecordingError(
            path,
            f"{where} states a frame rate of {str(value).strip() or 'nothing'}",
            f"Export it with its true rate, {_SLOWEST:g} to {_FASTEST:g} Hz.",
        )
    return rate


def rate_from_times(path: Path, times: NDArray[np.float64]) -> float:
    """Return the frame rate [Hz] of evenly spaced times [s], shape (n_frames,).

    Raises
    ------
    RecordingError
        If there are fewer than two, one is missing, or they are not evenly spaced.
    """
    if times.size < 2 or not np.isfinite(times).all():
        found = f"it has {times.size} frames" if times.size < 2 else "its time column has blank cells"
        raise RecordingError(
            path, f"{found}, so its rate is unknown", "Export it with the time of each frame."
        )
    step = float(times[-1] - times[0]) / (times.size - 1)
    even = times[0] + step * np.arange(times.size)
    off = np.abs(times - even)
    if not step > 0 or float(off.max()) > _UNEVEN * step:
        steps = np.diff(times)
        raise RecordingError(
            path,
            f"its times are not evenly spaced: steps of {steps.min():g} to {steps.max():g} s, "
            f"the largest after {times[int(steps.argmax())]:g} s",
            "Export every frame at one rate; leave the cells of missing markers blank.",
        )
    rate = float(f"{1.0 / step:.9g}")  # rounded, since differences of times carry rounding of their own
    if not _SLOWEST <= rate <= _FASTEST:
        raise RecordingError(
            path, f"its time column gives a rate of {rate:g} Hz", "Give the times in seconds."
        )
    return rate


def check_frame_numbers(path: Path, numbers: NDArray[np.float64]) -> None:
    """Check that frames, shape (n_frames,), are numbered without gaps; blank numbers pass.

    Raises
    ------
    RecordingError
        If a frame is missing, since every later time would be wrong.
    """
    if numbers.size < 2 or np.isnan(numbers).all():
        return
    steps = np.diff(numbers)
    odd = np.flatnonzero(~((steps == steps[0]) & (steps > 0)))
    if odd.size:
        i = int(odd[0])
        raise RecordingError(
            path,
            f"its frames are not numbered evenly: {numbers[i]:g} is followed by {numbers[i + 1]:g}",
            "Export every frame; leave the cells of missing markers blank.",
        )


def check_frame_count(path: Path, promised: str, n_frames: int) -> None:
    """Check that a file has the frames that its header promises; a header may leave it open.

    Raises
    ------
    RecordingError
        If there are fewer.
    """
    if promised.isdecimal() and (len(promised) > _DIGITS or n_frames < int(promised)):
        shown = promised if len(promised) <= _DIGITS else f"{promised[:_DIGITS]}..."
        raise RecordingError(
            path,
            f"its header promises {shown} frames and it has {n_frames}",
            "It was cut short: export or copy it again.",
        )


def start_of(path: Path, times: NDArray[np.float64], rate: float, where: str) -> float:
    """Return the time of the first frame [s], after comparing a time column with the stated rate.

    Parameters
    ----------
    path : Path
        The file.
    times : ndarray, shape (n_frames,)
        Times of the frames [s]; a column that is blank or all zero says nothing.
    rate : float
        Stated rate [Hz].
    where : str
        Where it is stated.

    Raises
    ------
    RecordingError
        If times and rate differ by more than 1 % (and more than one and a half frames).
    """
    if times.size == 0 or not np.isfinite(times[[0, -1]]).all() or not times.any():
        return 0.0
    duration, expected = float(times[-1] - times[0]), (times.size - 1) / rate
    if abs(duration - expected) > max(0.01 * expected, 1.5 / rate):
        raise RecordingError(
            path,
            f"{where} states {rate:g} Hz, but its time column covers {duration:g} s with {times.size} frames",
            "Export it again so that rate and times agree.",
        )
    return float(times[0])
