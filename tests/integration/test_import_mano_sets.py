"""Data sets of MANO hands in one database: rows, provenance, one question to all, a second import."""

from pathlib import Path

import numpy as np
import pytest
from mano_sets import WRITERS, Truth

import graspdb
from graspdb.importing import import_data_set
from graspdb.ingestion import IngestReport
from graspdb_ingest.importers.base import ImportOptions
from graspdb_ingest.importers.registry import IMPORTERS
from graspdb_schemas.vocabulary import Side

FRAMES = {"grab": 40}
"""GRAB's rate is 120 Hz, and a hold needs its time."""


def run(form: str, folder: Path, truth: Truth) -> IngestReport:
    return import_data_set(form, folder / form, folder / "grasps", options=ImportOptions(mano=truth.mano))


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Truth]]:
    """Return the folder of the data sets and their database, and what is in them."""
    folder = tmp_path_factory.mktemp("sets")
    truths = {form: write(folder / form, FRAMES.get(form, 8)) for form, write in WRITERS.items()}
    for form, truth in truths.items():
        assert not run(form, folder, truth).rejected
    return folder, truths


def test_every_clip_says_where_it_comes_from(imported: tuple[Path, dict[str, Truth]]) -> None:
    folder, truths = imported
    with graspdb.open(folder / "grasps") as db:
        rows = db.sql("SELECT * FROM trials").arrow().to_pylist()
    by_trial = {row["trial"]: row for row in rows}
    for form, truth in truths.items():
        row, said = by_trial[f"{form}/{truth.trial}"], IMPORTERS[form].format
        assert (row["data_set"], row["data_set_version"], row["licence"]) == (
            said.title,
            said.version,
            said.licence,
        )
        assert (row["original_id"], row["object"], row["task"]) == (
            truth.identifier,
            truth.object,
            truth.task,
        )
        assert row["status"] == "ok"
        assert row["rate"] == pytest.approx(truth.rate)


def test_sites_of_all_frames_are_those_that_were_written(imported: tuple[Path, dict[str, Truth]]) -> None:
    folder, truths = imported
    with graspdb.open(folder / "grasps") as db:
        for form, truth in truths.items():
            for side, points in truth.key_points.items():
                question = "SELECT sites FROM frames WHERE trial = '{}' AND side = '{}' ORDER BY frame"
                rows = db.sql(question.format(f"{form}/{truth.trial}", side)).arrow().to_pylist()
                known = np.isfinite(points).all(axis=(1, 2))
                assert [row["sites"] is not None for row in rows] == known.tolist()
                found = np.array([row["sites"] for row in rows if row["sites"] is not None], dtype=float)
                np.testing.assert_allclose(found, points[known, 1:], rtol=0, atol=1e-6)


def test_one_question_reaches_all_sets(imported: tuple[Path, dict[str, Truth]]) -> None:
    folder, truths = imported
    question = "SELECT DISTINCT t.data_set FROM grasps g JOIN trials t USING (trial) WHERE len(g.digits) >= 2"
    with graspdb.open(folder / "grasps") as db:
        sets = {row["data_set"] for row in db.sql(question).arrow().to_pylist()}
        assert sets == {IMPORTERS[form].format.title for form in truths}
        maps = db.sql("SELECT kind, trial, len(points) AS touched FROM measured_maps").arrow().to_pylist()
    assert {(row["kind"], row["trial"]) for row in maps} == {("annotated", f"grab/{truths['grab'].trial}")}
    assert all(row["touched"] > 0 for row in maps)


def test_a_second_import_changes_nothing(imported: tuple[Path, dict[str, Truth]]) -> None:
    folder, truths = imported
    for form in ("dexycb", "arctic"):
        report = run(form, folder, truths[form])
        assert {str(trial.outcome) for trial in report.trials} == {"unchanged"}


def test_both_hands_are_kept_apart(imported: tuple[Path, dict[str, Truth]]) -> None:
    folder, truths = imported
    with graspdb.open(folder / "grasps") as db:
        for form, truth in truths.items():
            question = f"SELECT DISTINCT side FROM frames WHERE trial = '{form}/{truth.trial}'"
            sides = {Side(row["side"]) for row in db.sql(question).arrow().to_pylist()}
            assert sides == set(truth.key_points)
