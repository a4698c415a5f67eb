"""Simulated hands calibrated from their own recordings; residuals of real ones by person and hand."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from harness import Result, benchmark

import graspdb
from graspdb.ingestion import ingest
from graspdb.simulate import NoiseParameters, simulate_session
from graspdb.simulate.accuracy import measure_accuracy
from graspdb.simulate.subjects import PROPORTION_SD

TESTS = Path(__file__).parents[1]
DATA = Path(os.environ.get("GRASPDB_TEST_DATA", TESTS.parents[1] / "shared" / "data"))
NOISE = NoiseParameters(marker_sd=0.001, skin_sd=0.002, occlusion=0.2)


@benchmark("calibrated hand")
def calibrated_hand() -> list[Result]:
    """Ingest simulated people: 1 mm of noise, 2 mm of skin movement, a fifth of the markers missing."""
    results = []
    for spread in (0.0, PROPORTION_SD):
        with TemporaryDirectory() as folder:
            session, db = Path(folder) / "session", Path(folder) / "grasps"
            simulate_session(session, subjects=2, seed=1, noise=NOISE, proportion_sd=spread)
            ingest(session, db, workers=2)
            with graspdb.open(db) as database:
                accuracy = measure_accuracy(session, database)
        for what, error in (("tips", accuracy.tip_error), ("20 sites", accuracy.site_error)):
            note = f"bar 1.5 mm; bones' lengths vary by {100 * spread:g} % about usual proportions"
            results.append(Result(f"calibrated hand, {what}", 1e3 * error, None, "mm", note=note))
    return results


@benchmark("sig18")
def sig18() -> list[Result]:
    """Ingest three people's hands in the air; print the residual of each marker in the notes."""
    with TemporaryDirectory() as folder:
        ingest(TESTS / "fixtures" / "sig18", Path(folder) / "grasps", data_root=DATA, workers=2)
        with graspdb.open(Path(folder) / "grasps") as database:
            trials = database.sql("SELECT trial, residual_rms FROM trials ORDER BY trial").rows()
            hands = database.sql(
                "SELECT subject, side, markers, marker_residuals FROM hands ORDER BY 1, 2"
            ).rows()
            sites = database.sql("SELECT trial, sites FROM frames WHERE sites IS NOT NULL").rows()
    note = "the data carry 2.6 mm of white noise in space"
    results = [
        Result(f"residual {t.split('/')[1][:14]}", 1e3 * rms, None, "mm", note=note) for t, rms in trials
    ]
    for subject, side, markers, residuals in hands:
        each = ", ".join(f"{m} {1e3 * r:.1f}" for m, r in zip(markers, residuals, strict=True))
        rms = float(np.sqrt(np.mean(np.square(residuals))))
        results.append(Result(f"calibration {subject} {side}", 1e3 * rms, None, "mm", note=each))
    results.append(Result("bones' change of length", 1e3 * _change(sites), None, "mm", note="bar 0"))
    return results


def _change(rows: list[tuple[str, list[list[float]]]]) -> float:
    """Return the largest change of a bone's length within a trial [m]."""
    changes = []
    for trial in {row[0] for row in rows}:
        sites = np.array([row[1] for row in rows if row[0] == trial]).reshape(-1, 5, 4, 3)
        changes.append(np.ptp(np.linalg.norm(np.diff(sites, axis=2), axis=3), axis=0).max())
    return float(max(changes))
