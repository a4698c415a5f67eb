"""Verify finds whatever is done to a database behind its back, and says in which table."""

from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from deltalake import DeltaTable, write_deltalake
from handmade import session_tables, trial_tables

import graspdb
from graspdb.store import Store
from graspdb_schemas.errors import DatabaseError
from graspdb_schemas.tables import TABLES


@pytest.fixture
def store(tmp_path: Path) -> Store:
    opened = Store.create_or_open(tmp_path / "db")
    opened.commit_session(session_tables())
    opened.commit_trials([trial_tables(number) for number in range(3)])
    return opened


def rewrite(path: Path, name: str, change: Callable[[pa.Table], pa.Table]) -> None:
    """Write a table anew, changed, as another program might."""
    table = DeltaTable(str(path / name))
    rows = pa.table(table.scan().read_all())
    write_deltalake(table, change(rows), mode="overwrite")


def column(name: str, change: Callable[[list[object]], list[object]]) -> Callable[[pa.Table], pa.Table]:
    """Return a change of one column."""

    def changed(rows: pa.Table) -> pa.Table:
        place = rows.column_names.index(name)
        values = pa.array(change(rows[name].to_pylist()), rows.schema.field(place).type)
        return rows.set_column(place, rows.schema.field(place), values)

    return changed


def test_a_database_is_whole_also_with_dead_rows_and_after_compaction(store: Store) -> None:
    store.commit_trial(trial_tables(1, input_key="new"))
    found = graspdb.verify(store.path)
    assert found.whole
    assert found.tables["frames"].dead_rows == 4
    assert (found.tables["frames"].rows, found.tables["frames"].files) == (12, 2)
    store.optimize()
    assert graspdb.verify(store.path).whole
    assert graspdb.verify(store.path).tables["frames"].dead_rows == 0


@pytest.mark.parametrize(
    ("table", "change", "problem"),
    [
        ("frames", column("time", lambda v: [*v[:-1], 9.0]), "have changed since their commit"),
        ("frames", lambda rows: rows.slice(1), "has 3 rows, and 4 were committed"),
        ("frames", lambda rows: pa.concat_tables([rows, rows.slice(0, 1)]), "rows, and 4 were committed"),
        ("features", lambda rows: rows.slice(0, 1), "are missing"),
        ("hands", column("radii", lambda v: [[0.02] * 20 for _ in v]), "rows of s/anna have changed"),
        ("object_points", column("area", lambda v: [*v[:-1], 1.0]), "rows of s/mug have changed"),
        ("trials", column("task", lambda v: ["push" for _ in v]), "the row of s/anna_mug_0 has changed"),
        ("trials", lambda rows: pa.concat_tables([rows, rows]), "there more than once: s/anna_mug_"),
        ("objects", lambda rows: rows.slice(0, 0), "without exactly one row of their object"),
        ("subjects", lambda rows: rows.slice(0, 0), "without the row of their subject"),
        ("contacts", column("grasp", lambda v: ["s/none", *v[1:]]), "of a grasp that there is not: s/none"),
        ("contacts", column("point", lambda v: [5, *v[1:]]), "at a point that the object has not"),
        ("frames", column("frame", lambda v: [4, *v[1:]]), "at a frame that the trial has not"),
        ("grasps", column("subject", lambda v: ["ben", *v[1:]]), "of another session, subject or object"),
    ],
)
def test_changed_rows_are_found(
    store: Store, table: str, change: Callable[[pa.Table], pa.Table], problem: str
) -> None:
    rewrite(store.path, table, change)
    found = graspdb.verify(store.path)
    assert not found.whole
    everything = [text for each in found.tables.values() for text in each.problems]
    assert any(problem in text for text in everything), everything


@pytest.mark.parametrize("name", ["trials", "frames", "object_points"])
def test_damaged_files_are_found(store: Store, name: str) -> None:
    file = next((store.path / name).glob("*.parquet"))
    content = file.read_bytes()
    for damage, problem in (
        (content[:-1], "and the log says"),
        (b"PAR1" + b"x" * (len(content) - 8) + b"PAR1", "cannot be read"),
    ):
        file.write_bytes(damage)
        assert problem in graspdb.verify(store.path).tables[name].problems[0]
    file.unlink()
    assert "is missing" in graspdb.verify(store.path).tables[name].problems[0]


def test_a_flipped_byte_among_the_values_is_found(store: Store) -> None:
    file = next((store.path / "frames").glob("*.parquet"))
    content = bytearray(file.read_bytes())
    chunk = pq.read_metadata(file).row_group(0)
    values = next(c for i in range(chunk.num_columns) if (c := chunk.column(i)).path_in_schema == "time")
    content[values.data_page_offset + values.total_compressed_size - 3] ^= 0x10
    file.write_bytes(content)
    assert not graspdb.verify(store.path).whole


def test_a_lost_table_and_a_newer_one_are_found(store: Store) -> None:
    table = DeltaTable(str(store.path / "contacts"))
    table.alter.set_table_properties({"graspdb.format": "99"}, raise_if_not_exists=False)
    (store.path / "grasps").rename(store.path.parent / "elsewhere")
    found = graspdb.verify(store.path)
    assert "its format is 99" in found.tables["contacts"].problems[0]
    assert found.tables["grasps"].problems == ("table 'grasps' is missing",)
    assert not any(found.tables[name].problems for name in TABLES if name not in ("grasps", "contacts"))


def test_what_is_no_database_is_said_to_be_none(tmp_path: Path) -> None:
    with pytest.raises(DatabaseError, match="holds none of its tables"):
        graspdb.verify(tmp_path)
