"""A database of simulated recordings against the truth that made them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graspdb.database import Database
from graspdb.simulate.truth import TrialTruth, load_truth
from graspdb_ingest.hand.model import Floats
from graspdb_schemas.manifest_reader import parse_manifest
from graspdb_schemas.vocabulary import TIPS


@dataclass(frozen=True)
class Accuracy:
    """How near ingest comes to the truth, over all trials of a simulated session.

    Attributes
    ----------
    n_trials, n_grasps : int
        Trials compared, and grasps found in them; each trial has one true grasp.
    tip_error, site_error : float
        Mean distance of the five tips, and of all 20 sites, to their true places [m].
    lift_onset_error : float
        Median absolute difference of the lift onset to the true one [s]; NaN where none was found.
    contact_precision : float
        Share of the contact sites found at the snapshot that touch in truth.
    contact_recall : float
        Share of the sites that truly touch which were found.
    """

    n_trials: int
    n_grasps: int
    tip_error: float
    site_error: float
    lift_onset_error: float
    contact_precision: float
    contact_recall: float


@dataclass(frozen=True)
class _Trial:
    tips: Floats
    sites: Floats
    lift: float
    hits: int
    found: int
    true: int


def measure_accuracy(session: Path, database: Database) -> Accuracy:
    """Compare what a database says of a simulated session with its truth.

    Parameters
    ----------
    session : Path
        The folder that `simulate_session` wrote.
    database : Database
        A database that the session was ingested into.

    Returns
    -------
    Accuracy
        Errors over all trials. Of several grasps in a trial the one with the snapshot nearest to
        the true onset of lift counts; a trial without a grasp counts all its contacts as missed.
    """
    truth = load_truth(session)
    key = parse_manifest(session).id
    trials = [_compare(f"{key}/{name}", true, database) for name, true in truth.trials.items()]
    found, hits = sum(t.found for t in trials), sum(t.hits for t in trials)
    lifts = np.array([t.lift for t in trials])
    counted = database.sql("SELECT count(*) FROM grasps WHERE session = $session", session=key)
    return Accuracy(
        n_trials=len(trials),
        n_grasps=counted.rows()[0][0],
        tip_error=float(np.nanmean(np.concatenate([t.tips.ravel() for t in trials]))),
        site_error=float(np.nanmean(np.concatenate([t.sites.ravel() for t in trials]))),
        lift_onset_error=float(np.nanmedian(np.abs(lifts))) if np.isfinite(lifts).any() else float("nan"),
        contact_precision=hits / found if found else float("nan"),
        contact_recall=hits / sum(t.true for t in trials),
    )


def _compare(trial: str, true: TrialTruth, database: Database) -> _Trial:
    frames = database.sql("SELECT sites FROM frames WHERE trial = $trial ORDER BY frame", trial=trial)
    unknown = [[[np.nan] * 3] * 20]
    tracked = [row[0] or unknown[0] for row in frames.rows()] or unknown * len(true.times)
    errors = np.linalg.norm(np.array(tracked, dtype=float) - true.sites, axis=2)
    grasps = database.sql(
        "SELECT snapshot_time, lift_time, contact_sites FROM grasps WHERE trial = $trial", trial=trial
    ).rows()
    if not grasps:
        return _Trial(errors[:, list(TIPS)], errors, np.nan, 0, 0, len(true.contacts))
    _, lift, sites = min(grasps, key=lambda row: abs(row[0] - true.events.lift))
    return _Trial(
        tips=errors[:, list(TIPS)],
        sites=errors,
        lift=np.nan if lift is None else lift - true.events.lift,
        hits=len(set(sites) & set(true.contacts)),
        found=len(sites),
        true=len(true.contacts),
    )


def summary(accuracy: Accuracy) -> Mapping[str, str]:
    """Return the figures as text with their units, by what they say."""
    return {
        "trials, grasps found": f"{accuracy.n_trials}, {accuracy.n_grasps}",
        "mean error of the tips": f"{1e3 * accuracy.tip_error:.2f} mm",
        "mean error of the 20 sites": f"{1e3 * accuracy.site_error:.2f} mm",
        "lift onset, median error": f"{1e3 * accuracy.lift_onset_error:.0f} ms",
        "contact sites, precision": f"{accuracy.contact_precision:.3f}",
        "contact sites, recall": f"{accuracy.contact_recall:.3f}",
    }
