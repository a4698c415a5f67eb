"""How good the recordings of a session are."""

from dataclasses import dataclass
from typing import Any, Final

from graspdb.database import Database
from graspdb_schemas.vocabulary import SITES

BINS: Final = 100
"""Parts that a trial is divided into where something is shown over time."""


@dataclass(frozen=True)
class TrialQuality:
    """How good one trial is.

    Attributes
    ----------
    trial : str
        Its key.
    subject, object : str or None
        Who, what.
    status : str or None
        ok or rejected.
    reasons : tuple of str
        Why it was rejected, or what to know of it.
    missing_fraction : float or None
        Share of hand-marker positions not seen.
    residual_rms : float or None
        Rms distance of hand markers to the tracked hand [m].
    unused : tuple of (float or None)
        Share of the hand markers that tracking did not use, in each of `BINS` parts of the trial.
    """

    trial: str
    subject: str | None
    object: str | None
    status: str | None
    reasons: tuple[str, ...]
    missing_fraction: float | None
    residual_rms: float | None
    unused: tuple[float | None, ...]


@dataclass(frozen=True)
class Spread:
    """A quantity over trials: its quartiles, its least and its greatest value.

    Attributes
    ----------
    name : str
        Whose: a marker or a site.
    least, lower, median, upper, greatest : float
        The values [m].
    """

    name: str
    least: float
    lower: float
    median: float
    upper: float
    greatest: float

    @property
    def values(self) -> tuple[float, ...]:
        """The five values, least first."""
        return self.least, self.lower, self.median, self.upper, self.greatest


@dataclass(frozen=True)
class Rerecord:
    """A trial that should be recorded again, and why."""

    trial: str
    why: tuple[str, ...]


@dataclass(frozen=True)
class Quality:
    """How good the recordings of a session are.

    Attributes
    ----------
    trials : tuple of TrialQuality
        In the order of their keys.
    residuals : tuple of Spread
        Of each hand marker, its rms distance to the tracked hand over the trials.
    missing : mapping of str to float
        Share of the frames in which each marker is not seen.
    uncertainty : tuple of Spread
        Of each site, its standard deviation in space over the trials.
    rerecord : tuple of Rerecord
        Trials that should be recorded again.
    """

    trials: tuple[TrialQuality, ...]
    residuals: tuple[Spread, ...]
    missing: dict[str, float]
    uncertainty: tuple[Spread, ...]
    rerecord: tuple[Rerecord, ...]

    @property
    def rejected(self) -> tuple[TrialQuality, ...]:
        """The trials that were rejected."""
        return tuple(trial for trial in self.trials if trial.status == "rejected")


def read_quality(database: Database) -> Quality:
    """Return the quality of all recordings of a database."""
    uncertainty = {spread.name: spread for spread in _spreads(database, _UNCERTAINTY)}
    again = database.query("rerecord").table.select(["trial", "why"]).to_pylist()
    return Quality(
        trials=_trials(database),
        residuals=_spreads(database, _RESIDUALS),
        missing=dict(database.sql(_MISSING).rows()),
        uncertainty=tuple(uncertainty[site] for site in SITES if site in uncertainty),
        rerecord=tuple(Rerecord(row["trial"], tuple(row["why"])) for row in again),
    )


def _trials(database: Database) -> tuple[TrialQuality, ...]:
    unused: dict[str, list[float | None]] = {}
    for trial, part, share in database.sql(_UNUSED, bins=BINS).rows():
        unused.setdefault(trial, [None] * BINS)[part] = share
    rows: list[dict[str, Any]] = database.sql(_TRIALS).table.to_pylist()
    return tuple(
        TrialQuality(**{**row, "reasons": tuple(row["reasons"])}, unused=tuple(unused.get(row["trial"], ())))
        for row in rows
    )


def _spreads(database: Database, statement: str) -> tuple[Spread, ...]:
    return tuple(Spread(*row) for row in database.sql(statement).rows())


_TRIALS: Final = """
    SELECT trial, subject, object, status, coalesce(reasons, []) AS reasons, missing_fraction, residual_rms
    FROM trials
    ORDER BY trial
"""

_UNUSED: Final = """
    WITH hands AS (
        SELECT trial, any_value(n_frames) AS n_frames, count(DISTINCT side) AS n_sides,
               cardinality(any_value(residual_rms_by_marker)) AS n_markers
        FROM frames JOIN trials USING (trial)
        GROUP BY trial
    )
    SELECT trial, least(frame * $bins::BIGINT // n_frames, $bins - 1)::BIGINT AS part,
           1 - avg(f.n_markers) * n_sides / h.n_markers AS share
    FROM frames f JOIN hands h USING (trial)
    WHERE h.n_markers > 0
    GROUP BY trial, part, n_sides, h.n_markers
    HAVING share IS NOT NULL
"""

_QUARTILES: Final = """
    min(value), quantile_cont(value, 0.25), median(value), quantile_cont(value, 0.75), max(value)
"""

_RESIDUALS: Final = f"""
    SELECT name, {_QUARTILES}
    FROM (
        SELECT unnest(map_keys(residual_rms_by_marker)) AS name,
               unnest(map_values(residual_rms_by_marker)) AS value
        FROM trials
    )
    WHERE isfinite(value)
    GROUP BY name
    ORDER BY name
"""

_MISSING: Final = """
    SELECT label, avg((position IS NULL OR list_count(position) < 3)::INT)
    FROM (SELECT unnest(labels) AS label, unnest(positions) AS position FROM markers)
    GROUP BY label
    ORDER BY label
"""

_UNCERTAINTY: Final = f"""
    WITH sites AS (SELECT trial, unnest($sites) AS name, unnest(sites_sd) AS value FROM frames),
    by_trial AS (
        SELECT trial, name, sqrt(avg(value ** 2)) AS value
        FROM sites WHERE isfinite(value) GROUP BY trial, name
    )
    SELECT name, {_QUARTILES} FROM by_trial GROUP BY name
""".replace("$sites", "[" + ", ".join(f"'{site}'" for site in SITES) + "]")
