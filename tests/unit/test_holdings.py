"""What `info` counts from logs and footers is what the query engine counts."""

from pathlib import Path

import pytest
from handmade import N_FRAMES, session_tables, trial_tables

import graspdb
from graspdb.database import Database
from graspdb.store import Store
from graspdb_schemas.errors import DatabaseError
from graspdb_schemas.tables import TABLES


def by_sql(database: Database) -> dict[str, int]:
    return {name: database.sql(f"SELECT count(*) FROM {name}").rows()[0][0] for name in TABLES}


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """Return a database with dead rows in joined files, two versions of an object, and a rejected trial."""
    store = Store.create_or_open(tmp_path / "db")
    for session in ("s", "t"):
        store.commit_session(session_tables(session, objects=("mug", "jug")))
        store.commit_trials([trial_tables(number, session) for number in range(4)])
    store.commit_session(session_tables("s", size=2.0, objects=("mug", "jug")))
    store.commit_trials([trial_tables(0, "s", input_key="new"), trial_tables(1, "s", input_key="new")])
    store.commit_trial(trial_tables(4, "s", object_="jug", status="rejected", reasons=["too short"]))
    return store


def test_counts_are_those_of_sql_before_and_after_housekeeping(store: Store) -> None:
    for tidy_up in (None, store.sweep, store.optimize):
        if tidy_up is not None:
            tidy_up()
        with graspdb.open(store.path) as database:
            info = database.info()
            assert info.rows == by_sql(database)
        assert info.rows["frames"] == 9 * N_FRAMES
        assert info.rejected == 1
        assert info.several_versions == ("object s/mug",)


def test_files_that_a_sweep_has_rewritten_are_counted_too(store: Store) -> None:
    store.optimize()
    for number, size in ((2, 3.0), (3, 4.0)):
        store.commit_session(session_tables("s", size=size, objects=("mug", "jug")))
        store.commit_trial(trial_tables(number, "s", input_key="newer"))
        store.commit_session(session_tables("t", size=size, objects=("mug", "jug")))
        store.commit_trials([trial_tables(other, "t", input_key=f"{number}") for other in range(number)])
        with graspdb.open(store.path) as database:
            assert database.snapshot.sources["frames"].mixed_files
            assert database.snapshot.sources["objects"].mixed_files
            assert database.info().rows == by_sql(database)
        store.sweep()
    store.remove("trial", ["s/anna_mug_0"])
    with graspdb.open(store.path) as database:
        assert database.info().rows == by_sql(database)


def test_one_session_is_counted_alone(store: Store) -> None:
    with graspdb.open(store.path) as database:
        part = database.session("t")
        assert part.info().rows == by_sql(part)
        assert part.info().rows["trials"] == 4
        assert part.info().rejected == 0


def test_hands_and_subjects_of_several_versions_are_named(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "db")
    for number, length in enumerate([0.18, 0.19]):
        tables = session_tables().tables
        subjects = tables["subjects"]
        subjects = subjects.set_column(
            subjects.column_names.index("hand_length"), "hand_length", [[length] * subjects.num_rows]
        )
        hands = tables["hands"]
        hands = hands.set_column(
            hands.column_names.index("radii"), "radii", [[[0.01 + number] * 20] * hands.num_rows]
        )
        store.commit_session(type(session_tables())({**tables, "subjects": subjects, "hands": hands}))
        store.commit_trial(trial_tables(number))
    with graspdb.open(store.path) as database:
        assert database.info().several_versions == ("hand s/anna/right", "subject s/anna")


def test_an_empty_database_holds_nothing(tmp_path: Path) -> None:
    with graspdb.open(Store.create_or_open(tmp_path / "db").path) as database:
        assert database.info().rows == dict.fromkeys(TABLES, 0)


@pytest.mark.parametrize("name", ["trials", "objects"])
def test_a_missing_file_is_said(store: Store, name: str) -> None:
    for file in (Path(str(store.path)) / name).glob("*.parquet"):
        file.unlink()
    with pytest.raises(DatabaseError, match=r"cannot be read.*estore the folder"):
        graspdb.open(store.path).info()
