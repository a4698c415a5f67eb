"""One version of every table, pinned so that together they are one state of the database."""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import compress
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from deltalake import DeltaTable
from deltalake.exceptions import DeltaError

from graspdb.store.compacted import WrittenRows, free_of_dead_rows
from graspdb.store.fence import Patience
from graspdb.store.history import AsOf, tables_as_of
from graspdb.store.layout import first_line, open_table, stored_format, written_format
from graspdb.store.location import Location, ObjectStorage, open_parquet
from graspdb.store.stored_rows import for_each_file
from graspdb_queries.source import TableSource
from graspdb_schemas.errors import DatabaseError
from graspdb_schemas.tables import SCHEMA_VERSION, SESSION_TABLES, TABLES, TRIAL_TABLES

_TEXT: Final = pa.string()
_COUNTS: Final = TABLES["trials"].field("table_rows").type

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
    table_rows : pyarrow.MapArray of string to integer
        How many rows each trial has in other tables; null where its row does not say.
    """

    trials: pa.Array
    context: pa.Array
    table_rows: pa.MapArray

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
    ids = committed_ids(root, trials)
    written = cache(lambda: WrittenRows(ids.trials, ids.table_rows))
    return Snapshot(
        path=root,
        format=stored_format(trials),
        versions={name: table.version() for name, table in tables.items()},
        sources={name: _source(root, name, table, written, ids.of(name)) for name, table in tables.items()},
    )


def latest_tables(root: Location) -> dict[str, DeltaTable]:
    """Open every table so that together they are one state."""
    patience = Patience(root)
    trials = open_table(root, "trials")
    while True:
        tables = {name: trials if name == "trials" else open_table(root, name) for name in TABLES}
        latest = open_table(root, "trials")
        if latest.version() == trials.version() or _still_named(root, trials, latest):
            return tables
        trials = latest
        patience.pause()


def _still_named(root: Location, trials: DeltaTable, latest: DeltaTable) -> bool:
    return committed_ids(root, trials).all_in(committed_ids(root, latest))


def committed_ids(root: Location, trials: DeltaTable) -> CommittedIds:
    """Return the ingest_ids that a version of `trials` makes visible.

    Raises
    ------
    DatabaseError
        A file of it is missing or damaged.
    """
    try:
        parts = for_each_file(_ids_in, table_files(root, "trials", trials).paths.to_pylist())
    except (OSError, pa.ArrowException) as error:
        raise DatabaseError(
            root, f"table 'trials' cannot be read: {first_line(error)}", "Restore the folder from a copy."
        ) from error
    columns = [
        pa.chunked_array([part[i] for part in parts], kind) for i, kind in enumerate((_TEXT, _TEXT, _COUNTS))
    ]
    return CommittedIds(columns[0].combine_chunks(), columns[1].unique(), columns[2].combine_chunks())


def _ids_in(file: str) -> tuple[pa.Array, pa.Array, pa.Array]:
    """Return what `CommittedIds` says of one file; its texts may be of any type that Arrow has for texts."""
    with open_parquet(file, repeated=["context.list.element"]) as parquet:
        rows = parquet.read(columns=["ingest_id", "context", "table_rows"])
    ids, context, table_rows = (
        rows[name].combine_chunks() for name in ("ingest_id", "context", "table_rows")
    )
    named = context.flatten()
    if not pa.types.is_dictionary(named.type):
        named = named.cast(_TEXT)
    return ids.cast(_TEXT), named.unique().cast(_TEXT), table_rows.cast(_COUNTS)


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

    def filter(self, mask: pa.Array) -> "TableFiles":
        """Return some of the files."""
        columns = (self.paths, self.n_rows, self.least, self.greatest)
        return TableFiles(*(column.filter(mask) for column in columns))

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
    root: Location, name: str, table: DeltaTable, written: Callable[[], WrittenRows], committed: pa.Array
) -> TableSource:
    """Tell files of which all rows count from those of which some do; leave out the others."""
    files = table_files(root, name, table)
    may_lack = written_format(table) < SCHEMA_VERSION
    single = files.single
    if name != "trials" and pc.any(single).as_py():
        files = files.filter(pc.or_(pc.invert(single), pc.is_in(files.least, committed)))
        single = files.single
    whole = np.ones(len(single), bool) if name == "trials" else single.to_numpy(zero_copy_only=False)
    if name in TRIAL_TABLES and not whole.all():
        rows = written().within(name)
        whole |= free_of_dead_rows(files.least, files.greatest, files.n_rows, rows)
    whole &= files.n_rows.is_valid().to_numpy(zero_copy_only=False)
    paths, counts = files.paths.to_pylist(), files.n_rows.to_pylist()
    return TableSource(
        files=tuple(compress(paths, whole)),
        n_rows=tuple(compress(counts, whole)),
        mixed_files=tuple(compress(paths, ~whole)),
        committed=committed,
        may_lack_columns=may_lack,
    )
