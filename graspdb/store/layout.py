"""The folder of a database: one Delta Lake table for each declared table, and its format version."""

import re
from functools import cache
from typing import Final

import deltalake
import pyarrow as pa
from deltalake import DeltaTable
from deltalake.exceptions import CommitFailedError, DeltaError, TableNotFoundError

from graspdb.store.location import Location, ObjectStorage, names_in, storage_options, unreachable
from graspdb_schemas.errors import DatabaseError
from graspdb_schemas.tables import SCHEMA_VERSION, TABLE_DOCS, TABLES

FORMAT_KEY: Final = "graspdb.format"
"""Table property that holds the format version."""

FIRST_FORMAT_KEY: Final = "graspdb.first_format"
"""Table property that holds the format that a table had before it was brought up to date."""

LOG_RETENTION_KEY: Final = "delta.logRetentionDuration"
"""Table property that says how long entries of the log are kept."""

_KEYS: Final = ("ingest_id", "session", "trial", "grasp", "subject", "object", "frame")
"""Columns of which the log keeps the least and greatest value of each file."""

_CREATION_ORDER: Final = (*(name for name in TABLES if name != "trials"), "trials")
"""`trials` comes last: a folder that has it is a whole database."""

_FORBIDDEN: Final = re.compile(r"[\[\]^|\\%*?\x00-\x1f\x7f]")
"""What Delta Lake's paths cannot have, and what DuckDB takes for a pattern."""


def create(root: Location) -> None:
    """Create what a database lacks in a folder that is empty, absent or half created.

    Any number of processes may do so at once. A whole database is left as it is.

    Raises
    ------
    DatabaseError
        The folder holds something else, or cannot be written.
    """
    check_path(root)
    if _has_table(root, "trials"):
        return
    strangers = sorted(name for name in names_in(root) if name not in TABLES)
    if strangers:
        raise DatabaseError(
            root,
            f"not a graspdb database, and not empty: it holds {strangers[0]!r}",
            "Name a new or an empty folder.",
        )
    for name in _CREATION_ORDER[:-1]:
        # Its version says nothing of rows: two processes that create a table at once may commit twice.
        if _has_table(root, name) and open_table(root, name).file_uris():
            # Rows are written once `trials` is there: another process has made it since the look above.
            if _has_table(root, "trials"):
                return
            raise DatabaseError(
                root, f"table 'trials' is missing, yet {name!r} has rows", "Restore the folder from a copy."
            )
    for name in _CREATION_ORDER:
        _create_table(root, name)


def open_table(root: Location, name: str, version: int | None = None) -> DeltaTable:
    """Open one table and check that it is what this version of graspdb declares.

    Raises
    ------
    DatabaseError
        The folder is no database, the table is missing, of a newer format or unreadable.
    """
    check_path(root)
    try:
        table = DeltaTable(str(root / name), version=version, storage_options=storage_options(root))
        _check_format(root, name, table)
    except TableNotFoundError:
        raise _not_found(root, name) from None
    except DeltaError as error:
        raise DatabaseError(
            root, f"table {name!r} cannot be read: {first_line(error)}", "Restore the folder from a copy."
        ) from error
    except OSError as error:
        raise unreachable(root, error) from error
    return table


def _has_table(root: Location, name: str) -> bool:
    try:
        return DeltaTable.is_deltatable(str(root / name), storage_options(root))
    except (DeltaError, OSError) as error:
        raise unreachable(root, error) from error


def read_rows(name: str, table: DeltaTable, columns: list[str], predicate: str | None = None) -> pa.Table:
    """Return columns of a table at its loaded version, with the declared types.

    A column that the table's format did not have yet is null.
    """
    stored = {field.name for field in table.schema().fields}
    rows = pa.table(table.scan(columns=[c for c in columns if c in stored], predicate=predicate).read_all())
    for column in columns:
        if column not in stored:
            rows = rows.append_column(column, pa.nulls(rows.num_rows, TABLES[name].field(column).type))
    declared = pa.schema([TABLES[name].field(column) for column in columns])
    return rows.select(columns).cast(declared).combine_chunks()


def stored_format(table: DeltaTable) -> int:
    """Return the format of a table that has been opened."""
    return int(table.metadata().configuration[FORMAT_KEY])


def written_format(table: DeltaTable) -> int:
    """Return the oldest format that files of a table may have."""
    properties = table.metadata().configuration
    return int(properties.get(FIRST_FORMAT_KEY, properties[FORMAT_KEY]))


def bring_up_to_date(root: Location, name: str, table: DeltaTable) -> None:
    """Add the columns that a table of an older format lacks, so that rows of this format can be written.

    Files stay as they are. Any number of processes may do so at once.

    Raises
    ------
    DatabaseError
        The table cannot be changed.
    """
    while stored_format(table) < SCHEMA_VERSION:
        try:
            stored = {field.name for field in table.schema().fields}
            missing = [field for field in _delta_fields(name) if field.name not in stored]
            if missing:
                table.alter.add_columns(missing)
            table.alter.set_table_properties(
                {FORMAT_KEY: str(SCHEMA_VERSION), FIRST_FORMAT_KEY: str(written_format(table))},
                raise_if_not_exists=False,
            )
        except (DeltaError, OSError) as error:
            before = table.version()
            table.update_incremental()
            if table.version() == before:
                raise DatabaseError(
                    root,
                    f"table {name!r} cannot be brought to format {SCHEMA_VERSION}: {first_line(error)}",
                    "What was committed before is safe; free space or permissions, then run again.",
                ) from error


def check_path(root: Location) -> None:
    """Raise where tables cannot be kept at a path.

    Raises
    ------
    DatabaseError
        The path is a file, or has a character that paths of tables cannot have.
    """
    if isinstance(root, ObjectStorage):
        return  # its characters are looked at where the URL is read
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


def _create_table(root: Location, name: str) -> None:
    """Create one table unless it is there, also where another process creates it at this moment."""
    configuration = {
        FORMAT_KEY: str(SCHEMA_VERSION),
        "delta.dataSkippingStatsColumns": ",".join(key for key in _KEYS if key in TABLES[name].names),
        # Looking for expired logs lists the whole log at every commit.
        "delta.enableExpiredLogCleanup": "false",
    }
    try:
        DeltaTable.create(
            str(root / name),
            TABLES[name],
            mode="ignore",
            name=name,
            description=TABLE_DOCS[name],
            configuration=configuration,
            raise_if_key_not_exists=False,
            storage_options=storage_options(root),
        )
    except CommitFailedError:
        open_table(root, name)
    except (DeltaError, OSError) as error:
        raise DatabaseError(
            root, f"cannot create it: {first_line(error)}", "Name a folder that you may write to."
        ) from error


def _not_found(root: Location, name: str) -> DatabaseError:
    """Say what is missing where a table is."""
    if not root.exists():
        return DatabaseError(
            root, "no such folder", "Name a database with --db or GRASPDB, or make one with graspdb ingest."
        )
    present = [other for other in TABLES if other in names_in(root)]
    if not present:
        return DatabaseError(
            root, "not a graspdb database: it holds none of its tables", "Name the folder of a database."
        )
    if name == "trials":
        return DatabaseError(
            root, "table 'trials' is missing", "Run graspdb ingest to finish creating it, or restore a copy."
        )
    return DatabaseError(root, f"table {name!r} is missing", "Restore the folder from a copy.")


def _check_format(root: Location, name: str, table: DeltaTable) -> None:
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
    may_lack = int(stored) < SCHEMA_VERSION
    for field in _delta_fields(name):
        lacking = field.name not in columns and may_lack and field.nullable
        if columns.get(field.name) != str(field.type) and not lacking:
            raise DatabaseError(
                root,
                f"table {name!r} has no column {field.name!r} of the declared type",
                "It was written by another version of graspdb; ingest the sessions into a new folder.",
            )


@cache
def _delta_fields(name: str) -> list[deltalake.Field]:
    """Return the declared columns of a table as Delta Lake has them."""
    plain = pa.schema([field.remove_metadata() for field in TABLES[name]])
    return list(deltalake.Schema.from_arrow(plain).fields)
