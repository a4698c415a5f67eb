"""Files of several ingests are read without a filter only if all their rows count."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from handmade import session_tables, trial_tables
from hypothesis import given
from hypothesis import strategies as st

import graspdb
from graspdb.store import Store
from graspdb.store.compacted import RowsWithin, WrittenRows, free_of_dead_rows
from graspdb.store.layout import open_table
from graspdb.store.snapshot import take_snapshot
from graspdb_schemas.tables import TRIAL_TABLES

Files = list[list[tuple[int, int]]]
"""Of each file, the number of an ingest and how many of its rows are there."""


@st.composite
def layouts(draw: st.DrawFn) -> tuple[Files, set[int]]:
    """Return files, each ingest's rows spread over some of them, and the ingests that are committed."""
    n_files, n_ingests = draw(st.integers(1, 6)), draw(st.integers(1, 8))
    files: Files = [[] for _ in range(n_files)]
    for ingest in range(n_ingests):
        for file in draw(st.sets(st.integers(0, n_files - 1), min_size=1, max_size=2)):
            files[file].append((ingest, draw(st.integers(1, 3))))
    return [file for file in files if file], draw(st.sets(st.integers(0, n_ingests - 1)))


def rows_within(written: Mapping[str, int | None]) -> RowsWithin | None:
    """Return what ingests wrote to a table, of which they also wrote one row to another."""
    said = [None if n is None else [("other", 1), ("frames", n)] for n in written.values()]
    of_tables = pa.array(said, pa.map_(pa.string(), pa.int32()))
    return WrittenRows(pa.array(list(written), pa.string()), of_tables).within("frames")


@given(layout=layouts())
def test_no_file_with_dead_rows_is_taken_whole(layout: tuple[Files, set[int]]) -> None:
    files, committed = layout
    # Files of one ingest that does not count are left out before.
    read = [file for file in files if len(file) > 1 or file[0][0] in committed]
    written = {i: sum(n for file in files for ingest, n in file if ingest == i) for i in committed}
    free = free_of_dead_rows(
        pa.array([f"{min(file)[0]:03}" for file in read], pa.string()),
        pa.array([f"{max(file)[0]:03}" for file in read], pa.string()),
        pa.array([sum(n for _, n in file) for file in read], pa.int64()),
        rows_within({f"{i:03}": n for i, n in written.items()}),
    )
    clean = np.array([all(ingest in committed for ingest, _ in file) for file in read], bool)
    assert not (free & ~clean).any()
    if clean.all():
        assert free.all()


def test_what_is_not_known_is_filtered() -> None:
    ids, rows, within = pa.array(["a", "b"]), pa.array([1, 1]), rows_within({"a": 1, "b": 1})
    assert free_of_dead_rows(ids, ids, rows, within).all()
    assert not free_of_dead_rows(ids, ids, pa.array([1, None]), within).any()
    assert not free_of_dead_rows(ids, ids, rows, rows_within({"a": 1, "b": None})).any()
    assert not free_of_dead_rows(pa.array(["a", None]), ids, rows, within).any()


def counts(path: Path) -> dict[str, int]:
    with graspdb.open(path) as database:
        return {name: database.info().rows[name] for name in TRIAL_TABLES}


def test_compacted_files_are_read_whole_until_rows_die(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "db")
    store.commit_session(session_tables())
    store.commit_trials([trial_tables(1), trial_tables(2)])
    store.commit_trial(trial_tables(3, sites=["thumb_tip"]))
    expected = {"markers": 12, "frames": 12, "grasps": 3, "contacts": 7, "features": 3}
    for _ in range(2):
        snapshot = take_snapshot(store.path)
        assert all(not snapshot.sources[name].mixed_files for name in TRIAL_TABLES)
        found = counts(store.path)
        assert {name: found[name] for name in expected} == expected
        for name in TRIAL_TABLES:
            open_table(store.path, name).optimize.compact()
    assert len(take_snapshot(store.path).sources["contacts"].files) == 1

    # A trial that is replaced leaves rows that do not count, in the file with those of the others.
    store.commit_trial(trial_tables(2, input_key="new", sites=["thumb_tip"]))
    assert take_snapshot(store.path).sources["contacts"].mixed_files
    assert counts(store.path)["contacts"] == expected["contacts"] - 2
    store.sweep()
    assert not take_snapshot(store.path).sources["contacts"].mixed_files
    assert counts(store.path)["contacts"] == expected["contacts"] - 2
