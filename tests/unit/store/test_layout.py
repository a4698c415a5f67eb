"""What is a database, and what is said about a folder that is none."""

import shutil
from pathlib import Path

import pyarrow as pa
import pytest
from deltalake import DeltaTable
from handmade import session_tables, trial_tables

import graspdb
from graspdb.store import Store
from graspdb.store.layout import FORMAT_KEY
from graspdb_schemas.errors import DatabaseError
from graspdb_schemas.tables import SCHEMA_VERSION, TABLES


def filled(path: Path) -> Store:
    store = Store.create_or_open(path)
    store.commit_session(session_tables())
    store.commit_trial(trial_tables(1))
    return store


def test_a_new_database_has_every_table_and_no_row(tmp_path: Path) -> None:
    Store.create_or_open(tmp_path / "new" / "db")
    with graspdb.open(tmp_path / "new" / "db") as database:
        for name, schema in TABLES.items():
            table = database.table(name)
            assert table.num_rows == 0
            assert table.schema.equals(schema, check_metadata=True)


def test_another_engine_finds_units_and_documentation_in_the_tables(tmp_path: Path) -> None:
    Store.create_or_open(tmp_path)
    found = pa.schema(DeltaTable(str(tmp_path / "contacts")).schema().to_arrow()).field("gap")
    assert found.metadata == TABLES["contacts"].field("gap").metadata


def test_opening_does_not_create(tmp_path: Path) -> None:
    with pytest.raises(DatabaseError, match="no such folder"):
        Store.open(tmp_path / "db")
    with pytest.raises(DatabaseError, match="no such folder"):
        graspdb.open(tmp_path / "db")
    assert not (tmp_path / "db").exists()


def test_a_folder_of_other_things_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("...")
    with pytest.raises(DatabaseError, match=r"not empty: it holds 'thesis\.tex'"):
        Store.create_or_open(tmp_path)
    with pytest.raises(DatabaseError, match="holds none of its tables"):
        graspdb.open(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_file_is_no_database(tmp_path: Path) -> None:
    (tmp_path / "db").write_text("")
    for attempt in (Store.create_or_open, Store.open, graspdb.open):
        with pytest.raises(DatabaseError, match="a file, not a folder"):
            attempt(tmp_path / "db")


@pytest.mark.parametrize("name", ["a[1]", "50%20", "x^2", "a|b", "back\\slash", "new\nline", "b*c", "d?e"])
def test_paths_that_cannot_hold_tables_are_refused(tmp_path: Path, name: str) -> None:
    for attempt in (Store.create_or_open, graspdb.open):
        with pytest.raises(DatabaseError, match="Name another folder"):
            attempt(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["sp ace", "it's", "subject=anna", "ü#", "-x", "$HOME", "~", "e{1,2}"])
def test_other_paths_work(tmp_path: Path, name: str) -> None:
    filled(tmp_path / name)
    with graspdb.open(tmp_path / name) as database:
        assert database.sql("SELECT subject, count(*) FROM grasps GROUP BY subject").rows() == [("anna", 1)]


@pytest.mark.parametrize("name", ["frames", "objects"])
def test_a_missing_table_is_named_and_not_made_anew(tmp_path: Path, name: str) -> None:
    filled(tmp_path / "db")
    shutil.rmtree(tmp_path / "db" / name)
    for attempt in (Store.create_or_open, Store.open, graspdb.open):
        with pytest.raises(DatabaseError, match=f"table '{name}' is missing"):
            attempt(tmp_path / "db")
    assert not (tmp_path / "db" / name).exists()


def test_without_trials_rows_are_not_thrown_away(tmp_path: Path) -> None:
    filled(tmp_path)
    shutil.rmtree(tmp_path / "trials")
    with pytest.raises(DatabaseError, match="'trials' is missing, yet 'sessions' has rows"):
        Store.create_or_open(tmp_path)
    with pytest.raises(DatabaseError, match="'trials' is missing"):
        graspdb.open(tmp_path)


def test_creating_goes_on_where_it_was_interrupted(tmp_path: Path) -> None:
    Store.create_or_open(tmp_path)
    for name in ("trials", "frames", "contacts"):
        shutil.rmtree(tmp_path / name)
    filled(tmp_path)
    with graspdb.open(tmp_path) as database:
        assert database.table("frames").num_rows == 4


def test_a_newer_format_is_refused(tmp_path: Path) -> None:
    filled(tmp_path)
    newer = {FORMAT_KEY: str(SCHEMA_VERSION + 1)}
    DeltaTable(str(tmp_path / "trials")).alter.set_table_properties(newer, raise_if_not_exists=False)
    for attempt in (Store.create_or_open, Store.open, graspdb.open):
        with pytest.raises(DatabaseError, match=f"format is {SCHEMA_VERSION + 1}.*Install a newer"):
            attempt(tmp_path)


def test_a_table_of_other_columns_is_refused(tmp_path: Path) -> None:
    filled(tmp_path)
    shutil.rmtree(tmp_path / "contacts")
    DeltaTable.create(
        tmp_path / "contacts",
        pa.schema([("grasp", pa.int64())]),
        configuration={FORMAT_KEY: str(SCHEMA_VERSION)},
        raise_if_key_not_exists=False,
    )
    with pytest.raises(DatabaseError, match="'contacts' has no column 'grasp' of the declared type"):
        graspdb.open(tmp_path)


def test_a_delta_table_of_others_is_refused(tmp_path: Path) -> None:
    DeltaTable.create(tmp_path / "trials", pa.schema([("a", pa.int64())]))
    for attempt in (Store.create_or_open, graspdb.open):
        with pytest.raises(DatabaseError, match="was not written by graspdb"):
            attempt(tmp_path)


def test_a_damaged_log_is_a_clear_error(tmp_path: Path) -> None:
    filled(tmp_path)
    for entry in (tmp_path / "grasps" / "_delta_log").glob("*.json"):
        entry.write_bytes(entry.read_bytes()[:40])
    with pytest.raises(DatabaseError, match="'grasps'"):
        graspdb.open(tmp_path)


def test_a_link_inside_the_database_is_refused(tmp_path: Path) -> None:
    filled(tmp_path / "db")
    file = next((tmp_path / "db" / "contacts").glob("*.parquet"))
    outside = file.rename(tmp_path / "elsewhere.parquet")
    file.symlink_to(outside)
    with pytest.raises(DatabaseError, match="'contacts' names a file that is not in its folder"):
        graspdb.open(tmp_path / "db")


def test_a_linked_table_is_refused(tmp_path: Path) -> None:
    filled(tmp_path / "db")
    outside = (tmp_path / "db" / "contacts").rename(tmp_path / "elsewhere")
    (tmp_path / "db" / "contacts").symlink_to(outside)
    with pytest.raises(DatabaseError, match="not in its folder"):
        graspdb.open(tmp_path / "db")


@pytest.mark.parametrize("prefix", ["../", "/", "file:///", "sub/"])
def test_a_log_that_names_files_outside_is_refused(tmp_path: Path, prefix: str) -> None:
    store = filled(tmp_path / "db")
    file = next((tmp_path / "db" / "contacts").glob("*.parquet"))
    log = tmp_path / "db" / "contacts" / "_delta_log" / f"{1:020}.json"
    log.write_text(log.read_text().replace(file.name, f"{prefix}{file.name}"))
    with pytest.raises(DatabaseError, match=r"not in its folder|cannot be read"):
        graspdb.open(store.path)


def test_a_lost_file_is_a_clear_error(tmp_path: Path) -> None:
    filled(tmp_path)
    next((tmp_path / "contacts").glob("*.parquet")).unlink()
    with graspdb.open(tmp_path) as database, pytest.raises(graspdb.GraspDBError, match="restore the folder"):
        database.sql("SELECT 1")
