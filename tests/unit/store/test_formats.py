"""Databases of every format that was ever written stay readable, and grow into the present one.

Each file in fixtures/databases was written by graspdb when its format was new, from the rows of `handmade`:
two trials of anna in session s, of which the second was replaced by one with a single contact, and one of ben
in t.
"""

import zipfile
from pathlib import Path

import pytest
from deltalake import DeltaTable
from handmade import N_FRAMES, N_POINTS, session_tables, trial_tables

import graspdb
from graspdb.store import Outcome, Store
from graspdb_schemas.tables import SCHEMA_VERSION, TABLES

FOLDER = Path(__file__).parents[2] / "fixtures" / "databases"
FORMATS = range(1, SCHEMA_VERSION + 1)


@pytest.fixture(params=FORMATS)
def golden(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    with zipfile.ZipFile(FOLDER / f"format-{request.param}.zip") as archive:
        archive.extractall(tmp_path / "db")
    return tmp_path / "db"


def check(database: graspdb.Database) -> None:
    assert sorted(database.table("trials")["trial"].to_pylist()) == [
        "s/anna_mug_0",
        "s/anna_mug_1",
        "t/ben_mug_5",
    ]
    counts = database.info().rows
    assert (counts["frames"], counts["object_points"], counts["contacts"]) == (3 * N_FRAMES, 2 * N_POINTS, 7)
    assert database.grasp("s/anna_mug_1/right/0").contact_sites == ("thumb_tip",)
    assert database.grasp("t/ben_mug_5/right/0").feature_cloud[:, 0].tolist() == [2.0, 6.0]
    for name, given in trial_tables(0).tables.items():
        rows = database.sql(f"SELECT * FROM {name} WHERE trial = 's/anna_mug_0'").table
        assert rows.select(given.column_names).to_pylist() == given.to_pylist(), name


def test_every_format_has_its_golden_database() -> None:
    assert [(FOLDER / f"format-{number}.zip").is_file() for number in FORMATS] == [True] * SCHEMA_VERSION


def test_a_golden_database_is_read_and_is_whole(golden: Path) -> None:
    before = sorted(golden.rglob("*"))
    with graspdb.open(golden) as database:
        check(database)
        for name, schema in TABLES.items():
            assert database.table(name).schema.equals(schema, check_metadata=True)
    assert graspdb.verify(golden).whole
    assert sorted(golden.rglob("*")) == before, "reading writes nothing"


def test_a_golden_database_takes_new_trials_and_tidies_up(golden: Path) -> None:
    store = Store.open(golden)
    store.commit_session(session_tables())
    assert store.commit_trial(trial_tables(0)).outcome == Outcome.UNCHANGED
    assert store.commit_trial(trial_tables(8)).outcome == Outcome.ADDED
    assert DeltaTable(str(golden / "trials")).metadata().configuration["graspdb.format"] == str(
        SCHEMA_VERSION
    )
    graspdb.optimize(golden)
    assert graspdb.verify(golden).whole
    assert graspdb.remove(golden, "trial", ["s/anna_mug_8"]).trials == ("s/anna_mug_8",)
    with graspdb.open(golden) as database:
        check(database)
        assert database.info().format == SCHEMA_VERSION


def test_two_writers_may_bring_it_up_to_date_at_once(golden: Path) -> None:
    first, second = Store.open(golden), Store.open(golden)
    for number, store in enumerate((first, second)):
        store.commit_session(session_tables())
        assert store.commit_trial(trial_tables(20 + number)).outcome == Outcome.ADDED
    assert graspdb.verify(golden).whole
