"""One version of every table, pinned so that together they are one state of the database."""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import pyarrow as pa
import pyarrow.compute as pc
from deltalake import DeltaTable
from deltalake.exceptions import DeltaError

from graspdb.store.compacted import free_of_dead_rows, written_rows
from graspdb.store.fence import Patience
from graspdb.store.history import AsOf, tables_as_of
from graspdb.store.layout import first_line, open_table, read_rows, stored_format, written_format
from graspdb.store.location import Location, ObjectStorage
from graspdb_queries.source import TableSource
from graspdb_schemas.errors import DatabaseError
from graspdb_schemas.tables import SCHEMA_VERSION, SESSION_TABLES, TABLES, TRIAL_TABLES

_PLAIN_NAME: Final = re.compile(r"[\w.-]+\.parquet")


@dataclass(frozen=True)
class Snapshot:
    """A state of the database that no writer can change.

    Attributes
    ----------
    path : Path or ObjectStorage
        The database's folder.
    format : int
        Version of its format.
    versions : mapping of str to int
        Version of each table.
    sources : mapping of str to TableSource
        Files and committed rows of each table, as the query engine reads them.
    """

    path: Location
    format: int
    versions: Mapping[str, int]
    sources: Mapping[str, TableSource]


@dataclass(frozen=True)
class CommittedIds:
    """The ingest_ids that a version of `trials` makes visible.

    Attributes
    ----------
    trials : pyarrow.Array of string
        Those of the trials' own rows.
    context : pyarrow.Array of string
        Those of the session-level rows that trials stand on.
    """

    trials: pa.Array
    context: pa.Array

    def of(self, name: str) -> pa.Array:
        """Return the ids that are visible in a table."""
        return self.context if name in SESSION_TABLES else self.trials

    def all_in(self, other: "CommittedIds") -> bool:
        """Whether every one of them is visible in the other version too."""
        return bool(
            pc.all(pc.is_in(self.trials, other.trials)).as_py() is not False
            and pc.all(pc.is_in(self.context, other.context)).as_py() is not False
        )


def take_snapshot(root: Location, as_of: AsOf | None = None) -> Snapshot:
    """Pin one version of every table: the latest, or those of an earlier state; see `tables_as_of`.

    `trials` is pinned first, so that the rows of every trial in it were written before the other tables
    are pinned. If by then a trial has been replaced or removed, a sweep may have taken its rows already,
    and the snapshot is taken again.

    Raises
    ------
    DatabaseError
        The folder is no database, or is damaged, or trials are replaced without end; or the earlier
        state is no longer kept.
    ParameterError
        There was no such state.
    """
    return snapshot_of(root, latest_tables(root) if as_of is None else tables_as_of(root, as_of))


def snapshot_of(root: Location, tables: Mapping[str, DeltaTable]) -> Snapshot:
    """Return the snapshot that open tables are."""
    trials = tables["trials"]
    ids = committed_ids(trials)
    rows = cache(lambda: read_rows("trials", trials, ["ingest_id", "table_rows"]))
    return Snapshot(
        path=root,
        format=stored_format(trials),
        versions={name: table.version() for name, table in tables.items()},
        sources={name: _source(root, name, table, rows, ids.of(name)) for name, table in tables.items()},
    )


def latest_tables(root: Location) -> dict[str, DeltaTable]:
    """Open every table so that together they are one state."""
    patience = Patience(root)
    trials = open_table(root, "trials")
    while True:
        tables = {name: trials if name == "trials" else open_table(root, name) for name in TABLES}
        latest = open_table(root, "trials")
        if latest.version() == trials.version() or committed_ids(trials).all_in(committed_ids(latest)):
            return tables
        trials = latest
        patience.pause()


def committed_ids(trials: DeltaTable) -> CommittedIds:
    """Return the ingest_ids that a version of `trials` makes visible."""
    rows = read_rows("trials", trials, ["ingest_id", "context"])
    context = rows["context"].combine_chunks().flatten().unique()
    return CommittedIds(rows["ingest_id"].combine_chunks().unique(), context)


@dataclass(frozen=True)
class TableFiles:
    """The files of one version of a table: names, rows, and least and greatest ingest_id of each.

    Attributes
    ----------
    paths : pyarrow.Array of string
        Absolute paths.
    n_rows : pyarrow.Array of integer
        Number of rows; null where the log does not say.
    least, greatest : pyarrow.Array of string
        Null where the log does not say.
    """

    paths: pa.Array
    n_rows: pa.Array
    least: pa.Array
    greatest: pa.Array

    @property
    def single(self) -> pa.Array:
        """Where all rows of a file are of one ingest, shape (n_files,)."""
        return pc.fill_null(pc.equal(self.least, self.greatest), False)


def table_files(root: Location, name: str, table: DeltaTable) -> TableFiles:
    """Return the files of a table, having checked that they lie in its folder.

    Raises
    ------
    DatabaseError
        A file's name leads out of the folder, or is a link, or the log cannot be read.
    """
    try:
        actions = pa.table(table.get_add_actions(flatten=True))
    except DeltaError as error:
        raise DatabaseError(
            root, f"table {name!r} cannot be read: {first_line(error)}", "Restore the folder from a copy."
        ) from error
    names = actions["path"].to_pylist()
    folder = (root if isinstance(root, ObjectStorage) else root.resolve()) / name
    links = set() if isinstance(folder, ObjectStorage) else _links(folder)
    for file in names:
        if not _PLAIN_NAME.fullmatch(file) or file in links:
            raise DatabaseError(
                root,
                f"table {name!r} names a file that is not in its folder: {file!r}",
                "A database reads nothing outside of itself; restore the folder from a copy.",
            )
    return TableFiles(
        pa.array([str(folder / file) for file in names], pa.string()),
        actions["num_records"].combine_chunks(),
        _column(actions, "min.ingest_id"),
        _column(actions, "max.ingest_id"),
    )


def _links(folder: Path) -> set[str]:
    """Return the names of symbolic links in a folder; the folder itself counts if it is one."""
    with os.scandir(folder) as entries:
        return {entry.name for entry in entries if folder.is_symlink() or entry.is_symlink()}


def _column(actions: pa.Table, name: str) -> pa.Array:
    """Return a column of text, or nulls where the log does not keep it."""
    if name not in actions.column_names:
        return pa.nulls(actions.num_rows, pa.string())
    return actions[name].combine_chunks().cast(pa.string())


def _source(
    root: Location, name: str, table: DeltaTable, table_rows: Callable[[], pa.Table], committed: pa.Array
) -> TableSource:
    """Tell files of which all rows count from those of which some do; leave out the others."""
    files = table_files(root, name, table)
    may_lack = written_format(table) < SCHEMA_VERSION
    if name == "trials":
        return TableSource(files=tuple(files.paths.to_pylist()), may_lack_columns=may_lack)
    seen = pc.or_(pc.invert(files.single), pc.is_in(files.least, committed))
    files = TableFiles(
        *(column.filter(seen) for column in (files.paths, files.n_rows, files.least, files.greatest))
    )
    whole = files.single
    if name in TRIAL_TABLES and pc.any(pc.invert(whole)).as_py():
        ids, written = written_rows(table_rows(), name)
        whole = pc.or_(
            whole, pa.array(free_of_dead_rows(files.least, files.greatest, files.n_rows, ids, written))
        )
    return TableSource(
        files=tuple(files.paths.filter(whole).to_pylist()),
        mixed_files=tuple(files.paths.filter(pc.invert(whole)).to_pylist()),
        committed=committed,
        may_lack_columns=may_lack,
    )
