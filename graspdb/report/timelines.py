"""What happened in a trial: grip aperture, height of the object, contacts by digit."""

from dataclasses import dataclass
from typing import Final

from graspdb.database import Database

SAMPLES: Final = 160
"""Samples of a curve, at most."""


@dataclass(frozen=True)
class Curve:
    """A quantity over time, of one hand.

    Attributes
    ----------
    times : tuple of float
        [s]
    aperture, height : tuple of (float or None)
        Distance of thumb tip to index tip, and height of the object over its lowest place [m].
    """

    times: tuple[float, ...]
    aperture: tuple[float | None, ...]
    height: tuple[float | None, ...]


@dataclass(frozen=True)
class Touch:
    """A contact of a digit: from when to when [s]."""

    side: str
    digit: str
    begin: float
    end: float


@dataclass(frozen=True)
class Hold:
    """A grasp on a time line: its key and its times [s]; None where it has none."""

    grasp: str
    side: str
    onset: float | None
    lift: float | None
    release: float | None
    snapshot: float | None


@dataclass(frozen=True)
class Timeline:
    """One trial over time.

    Attributes
    ----------
    trial : str
        Its key.
    subject, object : str or None
        Who, what.
    begin, end : float
        Times of its first and its last frame [s].
    curves : mapping of str to Curve
        By hand: right, left.
    touches : tuple of Touch
        Contacts of digits.
    holds : tuple of Hold
        Grasps.
    """

    trial: str
    subject: str | None
    object: str | None
    begin: float
    end: float
    curves: dict[str, Curve]
    touches: tuple[Touch, ...]
    holds: tuple[Hold, ...]


def read_timelines(database: Database) -> tuple[Timeline, ...]:
    """Return the time lines of the trials that have more than one frame, in the order of their keys."""
    curves: dict[str, dict[str, Curve]] = {}
    for trial, side, times, apertures, heights in database.sql(_CURVES, samples=SAMPLES).rows():
        known = [height for height in heights if height is not None]
        raised = [None if height is None else height - min(known) for height in heights]
        curves.setdefault(trial, {})[side] = Curve(tuple(times), tuple(apertures), tuple(raised))
    touches: dict[str, list[Touch]] = {}
    for trial, *touch in database.sql(_TOUCHES).rows():
        touches.setdefault(trial, []).append(Touch(*touch))
    holds: dict[str, list[Hold]] = {}
    for trial, *hold in database.sql(_HOLDS).rows():
        holds.setdefault(trial, []).append(Hold(*hold))
    return tuple(
        Timeline(
            trial,
            subject,
            name,
            begin,
            end,
            curves.get(trial, {}),
            tuple(touches.get(trial, ())),
            tuple(holds.get(trial, ())),
        )
        for trial, subject, name, begin, end in database.sql(_TRIALS).rows()
    )


_TRIALS: Final = """
    SELECT trial, subject, object, begin_time, end_time
    FROM trials
    JOIN (SELECT trial, min(time) AS begin_time, max(time) AS end_time FROM frames GROUP BY trial)
        USING (trial)
    WHERE end_time > begin_time
    ORDER BY trial
"""

_CURVES: Final = """
    WITH verticals AS (
        SELECT trial, any_value(n_frames) AS n_frames, any_value(s.up) AS up
        FROM trials LEFT JOIN sessions s USING (session)
        GROUP BY trial
    ),
    samples AS (
        SELECT trial, side, frame * $samples::BIGINT // n_frames AS part, avg(time) AS time,
               avg(distance(site_position(sites, 'thumb_tip'), site_position(sites, 'index_tip')))
                   AS aperture,
               avg(dot_product(object_position, up)) AS height
        FROM frames JOIN verticals USING (trial)
        WHERE n_frames > 1
        GROUP BY trial, side, part
    )
    SELECT trial, side, list(time ORDER BY part), list(aperture ORDER BY part), list(height ORDER BY part)
    FROM samples
    GROUP BY trial, side
    ORDER BY trial, side
"""

_TOUCHES: Final = """
    SELECT trial, side, digit, first_time, last_time
    FROM contact_events
    WHERE digit IS NOT NULL AND last_time >= first_time
    ORDER BY trial, side, digit, first_time
"""

_HOLDS: Final = """
    SELECT trial, grasp, side, onset_time, lift_time, release_time, snapshot_time
    FROM grasps
    ORDER BY trial, grasp
"""
