"""The folder of a database: one Delta Lake table for each declared table, and its format version."""

import re
from functools import cache
from pathlib import Path
from typing import Final

import deltalake
import pyarrow as pa
from deltalake import DeltaTable
from deltalake.exceptions import CommitFailedError, DeltaError, TableNotFoundError

from graspdb_schemas.errors import DatabaseError
from graspdb_schemas.tables import SCHEMA_VERSION, TABLE_DOCS, TABLES

FORMAT_KEY: Final = "graspdb.format"
"""Table property that holds the format version."""

_KEYS: Final = ("ingest_id", "session", "trial", "grasp", "subject", "object", "frame")
"""Columns of which the log keeps the least and greatest value of each file."""

_CREATION_ORDER: Final = (*(name for name in TABLES if name != "trials"), "trials")
"""`trials` comes last: a folder that has it is a whole database."""

_FORBIDDEN: Final = re.compile(r"[\[\]^|\\%*?\x00-\x1f\x7f]")
"""What Delta Lake's paths cannot have, and what DuckDB takes for a pattern."""


def create(root: Path) -> None:
    """Create what a database lacks in a folder that is empty, absent or half created.

    Any number of processes may do so at once. A whole database is left as it is.

    Raises
    ------
    DatabaseError
        The folder holds something else, or cannot be written.
    """
    check_path(root)
    if DeltaTable.is_deltatable(str(root / "trials")):
        return
    names = [entry.name for entry in root.iterdir()] if root.exists() else []
    strangers = sorted(name for name in names if name not in TABLES)
    if strangers:
        raise DatabaseError(
            root,
            f"not a graspdb database, and not empty: it holds {strangers[0]!r}",
            "Name a new or an empty folder.",
        )
    for name in _CREATION_ORDER[:-1]:
        # Its version says nothing of rows: two processes that create a table at once may commit twice.
        if DeltaTable.is_deltatable(str(root / name)) and open_table(root, name).file_uris():
            # Rows are written once `trials` is there: another process has made it since the look above.
            if DeltaTable.is_deltatable(str(root / "trials")):
                return
            raise DatabaseError(
                root, f"table 'trials' is missing, yet {name!r} has rows", "Restore the folder from a copy."
            )
    for name in _CREATION_ORDER:
        _create_table(root, name)


def open_table(root: Path, name: str, version: int | None = None) -> DeltaTable:
    """Open one table and check that it is what this version of graspdb declares.

    Raises
    ------
    DatabaseError
        The folder is no database, the table is missing, of a newer format or unreadable.
    """
    check_path(root)
    try:
        table = DeltaTable(str(root / name), version=version)
        _check_format(root, name, table)
    except TableNotFoundError:
        raise _not_found(root, name) from None
    except DeltaError as error:
        raise DatabaseError(
            root, f"table {name!r} cannot be read: {first_line(error)}", "Restore the folder from a copy."
        ) from error
    return table


def read_trials(trials: DeltaTable, columns: list[str], predicate: str | None = None) -> pa.Table:
    """Return columns of `trials` at its loaded version, with the declared types."""
    declared = pa.schema([TABLES["trials"].field(column) for column in columns])
    rows = pa.table(trials.scan(columns=columns, predicate=predicate).read_all())
    return rows.select(columns).cast(declared).combine_chunks()


def check_path(root: Path) -> None:
    """Raise where tables cannot be kept at a path.

    Raises
    ------
    DatabaseError
        The path is a file, or has a character that paths of tables cannot have.
    """
    if root.exists() and not root.is_dir():
        raise DatabaseError(root, "a file, not a folder", "A database is a folder; name one.")
    bad = _FORBIDDEN.search(str(root))
    if bad:
        raise DatabaseError(
            root, f"tables cannot be kept in a path with {bad[0]!r} in it", "Name another folder."
        )


def first_line(error: Exception) -> str:
    """Return the first line of an error's message, without a full stop."""
    text = str(error).strip() or type(error).__name__
    return text.splitlines()[0].rstrip(". ")


def _create_table(root: Path, name: str) -> None:
    """Create one table unless it is there, also where another process creates it at this moment."""
    configuration = {
        FORMAT_KEY: str(SCHEMA_VERSION),
        "delta.dataSkippingStatsColumns": ",".join(key for key in _KEYS if key in TABLES[name].names),
        # Looking for expired logs lists the whole log at every commit.
        "delta.enableExpiredLogCleanup": "false",
    }
    try:
        DeltaTable.create(
            root / name,
            TABLES[name],
            mode="ignore",
            name=name,
            description=TABLE_DOCS[name],
            configuration=configuration,
            raise_if_key_not_exists=False,
        )
    except CommitFailedError:
        open_table(root, name)
    except (DeltaError, OSError) as error:
        raise DatabaseError(
            root, f"cannot create it: {first_line(error)}", "Name a folder that you may write to."
        ) from error


def _not_found(root: Path, name: str) -> DatabaseError:
    """Say what is missing where a table is."""
    if not root.exists():
        return DatabaseError(
            root, "no such folder", "Name a database with --db or GRASPDB, or make one with graspdb ingest."
        )
    present = [other for other in TABLES if (root / other / "_delta_log").is_dir()]
    if not present:
        return DatabaseError(
            root, "not a graspdb database: it holds none of its tables", "Name the folder of a database."
        )
    if name == "trials":
        return DatabaseError(
            root, "table 'trials' is missing", "Run graspdb ingest to finish creating it, or restore a copy."
        )
    return DatabaseError(root, f"table {name!r} is missing", "Restore the folder from a copy.")


def _check_format(root: Path, name: str, table: DeltaTable) -> None:
    """Raise where a table's format is newer, or its columns are not those declared."""
    stored = table.metadata().configuration.get(FORMAT_KEY)
    if stored is None or not stored.isdecimal():
        raise DatabaseError(
            root, f"table {name!r} was not written by graspdb", "Name the folder of a graspdb database."
        )
    if int(stored) > SCHEMA_VERSION:
        raise DatabaseError(
            root,
            f"its format is {stored}, and this graspdb reads formats up to {SCHEMA_VERSION}",
            "Install a newer graspdb.",
        )
    columns = {field.name: str(field.type) for field in table.schema().fields}
    declared = _declared_columns(name)
    differing = [column for column in declared if columns.get(column) != declared[column]]
    if differing:
        raise DatabaseError(
            root,
            f"table {name!r} has no column {differing[0]!r} of the declared type",
            "It was written by another version of graspdb; ingest the sessions into a new folder.",
        )


@cache
def _declared_columns(name: str) -> dict[str, str]:
    """Return the declared columns of a table with their Delta Lake types."""
    plain = pa.schema([field.remove_metadata() for field in TABLES[name]])
    return {field.name: str(field.type) for field in deltalake.Schema.from_arrow(plain).fields}
