"""Whether a database is whole: its files, the hashes of its rows, and all references between its tables."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any, Final

import pyarrow as pa
from deltalake import DeltaTable

from graspdb.store.content import content_key
from graspdb.store.layout import open_table, written_format
from graspdb.store.location import Location, open_parquet, size_of
from graspdb.store.open_tables import content_key_of
from graspdb.store.references import broken_references
from graspdb.store.snapshot import TableFiles, latest_tables, snapshot_of, table_files
from graspdb.store.stored_rows import ingests
from graspdb_ingest.input_key import input_key
from graspdb_schemas.conform import rows_schema
from graspdb_schemas.errors import DatabaseError, QueryError
from graspdb_schemas.tables import SESSION_TABLES, TABLES, TRIAL_TABLES

_DAMAGE: Final = (OSError, pa.ArrowException)


@dataclass(frozen=True)
class VerifiedTable:
    """What was found of a table.

    Attributes
    ----------
    version, format : int or None
        Its version, and the oldest format of its files; None if it cannot be opened.
    files, rows, dead_rows : int
        Its files, its rows that readers see, and those that a sweep would delete.
    problems : tuple of str
        What is wrong; empty if all is well.
    """

    version: int | None
    format: int | None
    files: int
    rows: int
    dead_rows: int
    problems: tuple[str, ...]


@dataclass(frozen=True)
class Verified:
    """Whether a database is whole.

    Attributes
    ----------
    path : Path
        Its folder.
    tables : mapping of str to VerifiedTable
        What was found, by table.
    """

    path: Location
    tables: Mapping[str, VerifiedTable]

    @property
    def whole(self) -> bool:
        """Whether nothing is wrong."""
        return not any(table.problems for table in self.tables.values())


def verify(root: Location) -> Verified:
    """Read a whole database and check all that has to hold in it; nothing is written.

    That is: every table is there, of a format that can be read, with the declared columns; every file is
    there, of the size and with the number of rows that the log says; the rows of each trial, and of each
    session, subject, hand and object, have the number and the hash that was kept when they were committed;
    what a trial was made from fits its key; and every reference from one table to another leads somewhere.

    Raises
    ------
    DatabaseError
        The folder is no database.
    """
    opened, problems = _open(root)
    if any(problems.values()):
        return Verified(root, {name: _unread(opened.get(name), problems[name]) for name in TABLES})
    tables = latest_tables(root)
    files = {name: table_files(root, name, table) for name, table in tables.items()}
    for name, table in tables.items():
        problems[name] += _damaged_files(table, files[name])
    read: dict[str, _Counted] = {}
    if not any(problems.values()):
        read = _Rows(files, problems).check()
        try:
            for name, problem in broken_references(snapshot_of(root, tables).sources):
                problems[name].append(problem)
        except QueryError as error:
            problems["trials"].append(f"cannot be asked: {str(error).splitlines()[0]}")
    found = {}
    for name, table in tables.items():
        counted = read.get(name, _Counted())
        found[name] = VerifiedTable(
            table.version(),
            written_format(table),
            len(files[name].paths),
            counted.seen,
            counted.dead,
            tuple(problems[name]),
        )
    return Verified(root, found)


def _open(root: Location) -> tuple[dict[str, DeltaTable], dict[str, list[str]]]:
    """Open every table; return those that could be opened, and what is wrong with the others."""
    opened, problems = {}, {name: list[str]() for name in TABLES}
    for name in TABLES:
        try:
            opened[name] = open_table(root, name)
            table_files(root, name, opened[name])
        except DatabaseError as error:
            if not any((root / table / "_delta_log").is_dir() for table in TABLES):
                raise
            problems[name].append(error.found)
    return opened, problems


def _unread(table: DeltaTable | None, problems: list[str]) -> VerifiedTable:
    if table is None:
        return VerifiedTable(None, None, 0, 0, 0, tuple(problems))
    return VerifiedTable(
        table.version(), written_format(table), len(table.file_uris()), 0, 0, tuple(problems)
    )


def _damaged_files(table: DeltaTable, files: TableFiles) -> Iterator[str]:
    """Yield what is wrong with the files of a table, seen from outside."""
    sizes = pa.table(table.get_add_actions(flatten=True))["size_bytes"].to_pylist()
    for path, size, n_rows in zip(files.paths.to_pylist(), sizes, files.n_rows.to_pylist(), strict=True):
        file, there = PurePosixPath(path), size_of(path)
        if there is None:
            yield f"file {file.name} is missing"
        elif there != size:
            yield f"file {file.name} has {there} bytes, and the log says {size}"
        else:
            try:
                found = open_parquet(path).metadata.num_rows
            except _DAMAGE as error:
                yield f"file {file.name} cannot be read: {str(error).splitlines()[0]}"
                continue
            if found != n_rows:
                yield f"file {file.name} has {found} rows, and the log says {n_rows}"


@dataclass
class _Counted:
    """Rows of a table that readers see, and those that they do not."""

    seen: int = 0
    dead: int = 0

    def add(self, n_rows: int, counts: bool) -> None:
        if counts:
            self.seen += n_rows
        else:
            self.dead += n_rows


class _Rows:
    """The rows of a database against the numbers and hashes that were kept of them."""

    def __init__(self, files: Mapping[str, TableFiles], problems: Mapping[str, list[str]]) -> None:
        self._files = files
        self._problems = problems
        self._counted = {name: _Counted() for name in TABLES}
        self._trials: dict[str, dict[str, Any]] = {}
        self._hashed_context: set[str] = set()
        self._context: set[str] = set()

    def check(self) -> dict[str, _Counted]:
        """Read everything, add what is wrong to the problems, and return the numbers of rows."""
        for check in (self._read_trials, self._check_trial_tables, self._check_session_tables):
            check()
        return self._counted

    def _ingests(self, name: str, expected: Mapping[str, int]) -> Iterator[tuple[str, pa.Table]]:
        """Yield the rows of each ingest of a table; a damaged file is a problem and ends them."""
        try:
            yield from ingests(name, self._files[name].paths.to_pylist(), expected.get)
        except _DAMAGE as error:
            self._problems[name].append(f"a file cannot be read: {str(error).splitlines()[0]}")

    def _read_trials(self) -> None:
        """Read `trials`, and check the hash of each row and what its trial was made from."""
        own = rows_schema("trials").names
        for ingest_id, rows in self._ingests("trials", {}):
            self._counted["trials"].add(rows.num_rows, True)
            row = rows.to_pylist(maps_as_pydicts="strict")[0]
            kept = row.get("table_hashes")
            key = content_key({"trials": rows.select([name for name in own if name in rows.column_names])})
            if kept and kept.get("trials") != key:
                self._problems["trials"].append(f"the row of {row['trial']} has changed since its commit")
            if row.get("inputs") and input_key(row["inputs"]) != row["input_key"]:
                self._problems["trials"].append(f"inputs of {row['trial']} do not make its input_key")
            wanted = ("trial", "table_rows", "table_hashes")
            self._trials[ingest_id] = {name: row.get(name) for name in wanted}
            self._context.update(row["context"] or ())
            self._hashed_context.update((row["context"] or ()) if kept else ())

    def _check_trial_tables(self) -> None:
        """Check number and hash of the rows that each trial has in each table."""
        for name in TRIAL_TABLES:
            expected = {key: (row["table_rows"] or {}).get(name, 0) for key, row in self._trials.items()}
            hashes = {key: (row["table_hashes"] or {}).get(name) for key, row in self._trials.items()}
            found: set[str] = set()
            for ingest_id, rows in self._ingests(name, expected):
                row = self._trials.get(ingest_id)
                self._counted[name].add(rows.num_rows, row is not None)
                if row is None:
                    continue
                found.add(ingest_id)
                if row["table_rows"] is not None and rows.num_rows != expected[ingest_id]:
                    self._problems[name].append(
                        f"{row['trial']} has {rows.num_rows} rows, and {expected[ingest_id]} were committed"
                    )
                elif hashes[ingest_id] and content_key({name: rows}) != hashes[ingest_id]:
                    self._problems[name].append(f"rows of {row['trial']} have changed since their commit")
            lost = [row["trial"] for key, row in self._trials.items() if expected[key] and key not in found]
            self._problems[name].extend(f"rows of {trial} are missing" for trial in lost)

    def _check_session_tables(self) -> None:
        """Check the hashes at the end of the ids of rows that trials share, and that none is missing."""
        found: set[str] = set()
        objects: dict[str, pa.Table] = {}
        for name in SESSION_TABLES:
            points = {key: rows["n_points"][0].as_py() or 0 for key, rows in objects.items()}
            for ingest_id, rows in self._ingests(name, points if name == "object_points" else {}):
                self._counted[name].add(rows.num_rows, ingest_id in self._context)
                found.add(ingest_id)
                if name == "objects":
                    objects[ingest_id] = rows
                    continue
                unit = {name: rows}
                if name == "object_points" and ingest_id in objects:
                    unit["objects"] = objects.pop(ingest_id)
                self._check_unit(name, ingest_id, unit)
        for ingest_id, rows in objects.items():
            self._check_unit("objects", ingest_id, {"objects": rows})
        missing = sorted(self._context - found)
        if missing:
            self._problems["trials"].append(f"{len(missing)} rows that trials stand on are missing")

    def _check_unit(self, name: str, ingest_id: str, unit: Mapping[str, pa.Table]) -> None:
        if ingest_id in self._hashed_context and content_key(unit) != content_key_of(ingest_id):
            described = next(iter(unit.values())).slice(0, 1).to_pylist()[0]
            key = "/".join(str(described[k]) for k in ("session", "subject", "object") if described.get(k))
            self._problems[name].append(f"rows of {key} have changed since their commit")
