"""The charts of a report."""

from dataclasses import replace
from typing import Final

from graspdb.pages.charts import (
    Chart,
    Mark,
    Series,
    columns,
    scatter,
    shades,
    spreads,
)
from graspdb.pages.scales import Scale, Tick, names, numbers
from graspdb.report.contents import Synergies
from graspdb.report.quality import Quality, Spread
from graspdb.report.timelines import Curve, Hold, Timeline
from graspdb_schemas.vocabulary import DIGITS

_MM: Final = 1e3

_DARKEST: Final = 0.5
"""Share of markers unused from here on in the darkest shade."""

_WIDTH: Final = 350
_CURVES: Final = 78
"""Height of the part of a time line that has curves [pixel]."""

_LANE: Final = 7
"""Height of the lane of a digit [pixel]."""


def _bare(key: str, session: str) -> str:
    """Return a trial's key without its session."""
    return key.removeprefix(f"{session}/")


def residuals(quality: Quality, session: str) -> Chart | None:
    """Return the residual of every trial over its share of missing markers."""
    by_subject: dict[str, list[tuple[float, float, str]]] = {}
    for trial in quality.trials:
        if trial.residual_rms is not None and trial.missing_fraction is not None:
            point = (100 * trial.missing_fraction, _MM * trial.residual_rms, _bare(trial.trial, session))
            by_subject.setdefault(trial.subject or "", []).append(point)
    if not by_subject:
        return None
    series = [Series(name, *zip(*points, strict=True)) for name, points in by_subject.items()]
    title = "Residual of every trial over its share of missing markers"
    return scatter(title, series, "hand markers missing [%]", "rms residual [mm]")


def unused(quality: Quality, session: str) -> Chart | None:
    """Return the share of hand markers that tracking did not use, over every trial."""
    rows = [(_bare(trial.trial, session), trial.unused) for trial in quality.trials if trial.unused]
    if not rows:
        return None
    return shades("Hand markers not used, over time", rows, _DARKEST, "part of the trial")


def marker_residuals(quality: Quality) -> Chart | None:
    """Return the residual of every marker."""
    return _spreads("Residual of every marker over the trials", quality.residuals, "rms residual [mm]")


def uncertainty(quality: Quality) -> Chart | None:
    """Return the standard deviation of every site."""
    title = "Standard deviation of every site over the trials"
    return _spreads(title, quality.uncertainty, "standard deviation in space [mm]")


def _spreads(title: str, rows: tuple[Spread, ...], x_title: str) -> Chart | None:
    if not rows:
        return None
    values = [
        (row.name, [_MM * v for v in (row.least, row.lower, row.median, row.upper, row.greatest)])
        for row in rows
    ]
    return spreads(title, values, x_title, width=480)


def missing(quality: Quality) -> Chart | None:
    """Return the share of frames in which each marker is not seen."""
    if not quality.missing:
        return None
    shares = [100 * share for share in quality.missing.values()]
    title = "Share of the frames in which each marker is not seen"
    return columns(title, list(quality.missing), shares, "frames [%]", width=760)


def explained(synergies: Synergies) -> Chart:
    """Return the share of the variance that each synergy explains."""
    shown = synergies.explained[:8]
    labels = [str(i + 1) for i in range(len(shown))]
    title = "Share of the variance that each synergy explains"
    return columns(title, labels, [100 * v for v in shown], "variance [%]", x_title="synergy", width=360)


def synergy_plane(synergies: Synergies, session: str) -> Chart:
    """Return the grasps in the plane of the first two synergies."""
    by_object: dict[str, list[tuple[float, float, str]]] = {}
    for grasp, name, first, second in synergies.places:
        by_object.setdefault(name, []).append((first, second, _bare(grasp, session)))
    series = [Series(name, *zip(*points, strict=True)) for name, points in by_object.items()]
    title = "Grasps in the plane of the first two synergies"
    return scatter(title, series, "synergy 1 [rad]", "synergy 2 [rad]")


def timeline(line: Timeline) -> tuple[Chart, ...]:
    """Return a chart for each hand of a trial: aperture, the object's height, and contacts by digit."""
    return tuple(_timeline(line, side, curve) for side, curve in line.curves.items())


def _timeline(line: Timeline, side: str, curve: Curve) -> Chart:
    left, top = 46, 6
    floor = top + _CURVES
    bottom = floor + 6 + _LANE * len(DIGITS)
    x = _times(line.begin, line.end, left, _WIDTH - 8)
    lengths = [_MM * v for v in (*curve.aperture, *curve.height) if v is not None]
    y = numbers(lengths, floor, top, zero=True)
    y = Scale(y.low, y.high, y.start, y.end, y.ticks[:: max(1, len(y.ticks) // 3)])
    lanes = names(DIGITS, floor + 6, bottom)
    marks = [Mark("bar", ((left, floor + 6), (_WIDTH - 8 - left, bottom - floor - 6)), "lane")]
    for css, title, values in (("s0", "grip aperture", curve.aperture), ("s5", "height", curve.height)):
        places = tuple((x(t), y(_MM * v)) for t, v in zip(curve.times, values, strict=True) if v is not None)
        marks += [Mark("line", places, css, title)] if places else []
    for touch in (touch for touch in line.touches if touch.side == side):
        corner = (x(touch.begin), lanes(DIGITS.index(touch.digit)) - 2.5)
        said = f"{touch.digit}: {touch.begin:.2f} to {touch.end:.2f} s"
        marks.append(Mark("bar", (corner, (max(x(touch.end) - x(touch.begin), 0.8), 5)), touch.digit, said))
    for hold in (hold for hold in line.holds if hold.side == side):
        marks += _events(hold, x, top, bottom)
    title = f"{line.trial}, {side} hand: grip aperture, height of the object and contacts by digit"
    return Chart(
        title, _WIDTH, bottom + 32, x, Scale(0, 1, bottom, top, y.ticks), "time [s]", "mm", tuple(marks)
    )


def _events(hold: Hold, x: Scale, top: float, bottom: float) -> list[Mark]:
    times = {"onset": hold.onset, "lift": hold.lift, "release": hold.release}
    return [
        Mark("rule", ((x(time), top), (x(time), bottom)), event, f"{event} at {time:.2f} s")
        for event, time in times.items()
        if time is not None
    ]


def _times(begin: float, end: float, left: float, right: float) -> Scale:
    """Return a scale from the begin of a trial to its end, and no further, with ticks at round times."""
    scale = Scale(begin, end, left, right, ())
    whole = numbers([begin, end], left, right)
    step = (whole.high - whole.low) / (len(whole.ticks) - 1)
    at = [(whole.low + i * step, tick.label) for i, tick in enumerate(whole.ticks)]
    return replace(scale, ticks=tuple(Tick(scale(time), label) for time, label in at if begin <= time <= end))
