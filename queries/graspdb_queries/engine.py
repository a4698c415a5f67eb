"""DuckDB over one snapshot: documented views, bound parameters, and no way out of the database."""

import tempfile
import uuid
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, wait
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any, Final, Self, TypeVar

import duckdb
import pyarrow as pa

from graspdb_queries.explain import query_error
from graspdb_queries.object_storage import read_through
from graspdb_queries.result import Result
from graspdb_queries.source import TableSource, files_of
from graspdb_queries.statements import read_only
from graspdb_queries.views import build_database
from graspdb_schemas.errors import ParameterError, QueryError, nearest

_BATCH_ROWS: Final = 65536
"""Rows of a batch of a stream."""

_GLANCE: Final = 0.05
"""How often a waiting caller looks for Ctrl-C [s]."""

T = TypeVar("T")


class Engine:
    """Answers SQL over one snapshot of a database; reads its Parquet files, and nothing else.

    Before the first query the engine is locked: no file but those of the snapshot can be opened, no
    extension loaded, no setting changed. Only SELECT statements are run, of which all parts read: what may be
    opened may also be written to otherwise.

    Parameters
    ----------
    sources : mapping of str to TableSource
        Files and committed rows of each table.

    Raises
    ------
    QueryError
        A file of the snapshot is missing or damaged.
    """

    def __init__(self, sources: Mapping[str, TableSource]) -> None:
        # What does not fit into memory is spilled here; DuckDB makes the folder, and removes it.
        spill = Path(tempfile.gettempdir()) / f"graspdb-{uuid.uuid4().hex}"
        self._connection = duckdb.connect(
            ":memory:",
            config={
                "temp_directory": str(spill),
                "autoinstall_known_extensions": "false",
                "autoload_known_extensions": "false",
                "allow_community_extensions": "false",
                "python_enable_replacements": "false",
            },
        )
        try:
            read_through(self._connection, files_of(sources))
            build_database(self._connection, sources)
            self._lock(sources)
        except duckdb.Error as error:
            raise QueryError(
                str(error), "A file is missing or damaged: restore the folder from a copy."
            ) from error
        except RuntimeError as error:
            # What DuckDB makes of Ctrl-C.
            if "interrupted" in str(error):
                raise KeyboardInterrupt from error
            raise

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connection."""
        self.close()

    def close(self) -> None:
        """Close the connection and remove what it spilled."""
        self._connection.close()

    def sql(self, statement: str, parameters: Mapping[str, Any] | None = None) -> Result:
        """Run one SELECT statement.

        Parameters
        ----------
        statement : str
            SQL of DuckDB; parameters are written ``$name``.
        parameters : mapping of str to value
            A value for each parameter.

        Raises
        ------
        QueryError
            The statement is not a SELECT, is wrong, or tries to leave the database.
        ParameterError
            A parameter is missing or not in the statement.
        """
        cursor = self._connection.cursor()
        bound = self._checked(cursor, statement, parameters or {})
        with _explained(statement):
            return Result(
                _interruptible(cursor, lambda: cursor.sql(statement, params=bound).to_arrow_table())
            )

    def stream(self, statement: str, parameters: Mapping[str, Any] | None = None) -> "Stream":
        """Run one SELECT statement and return its rows batch by batch, in bounded memory; see `sql`."""
        cursor = self._connection.cursor()
        bound = self._checked(cursor, statement, parameters or {})
        with _explained(statement):
            reader = _interruptible(
                cursor, lambda: cursor.sql(statement, params=bound).to_arrow_reader(_BATCH_ROWS)
            )
        return Stream(cursor, statement, reader)

    def _lock(self, sources: Mapping[str, TableSource]) -> None:
        """Leave the snapshot's files as the only ones that can be opened, for good."""
        # The files of a snapshot never change, so their footers are read once.
        self._connection.execute("SET parquet_metadata_cache = true")
        self._connection.execute("SET allowed_paths = $files", {"files": files_of(sources)})
        self._connection.execute("SET enable_external_access = false")
        self._connection.execute("SET lock_configuration = true")

    def _checked(
        self, cursor: duckdb.DuckDBPyConnection, statement: str, parameters: Mapping[str, Any]
    ) -> dict[str, Any] | None:
        """Return the parameters to bind, having checked that the statement only reads."""
        with _explained(statement):
            parsed = read_only(cursor, statement)
        wanted = sorted(parsed.named_parameters)
        for name in parameters:
            if name not in wanted:
                allowed = ", ".join(wanted) or "none, for the query has no parameters"
                raise ParameterError("parameter", name, allowed + nearest(name, wanted))
        for name in wanted:
            if name not in parameters:
                raise ParameterError(f"parameter {name}", "no value", "a value for each $name in the query")
        return dict(parameters) or None


class Stream:
    """Rows of an answer, batch by batch.

    Attributes
    ----------
    schema : pyarrow.Schema
        Columns of the answer.
    """

    def __init__(
        self, cursor: duckdb.DuckDBPyConnection, statement: str, reader: pa.RecordBatchReader
    ) -> None:
        self._cursor = cursor
        self._statement = statement
        self._reader = reader
        self.schema = reader.schema

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the stream."""
        self.close()

    def close(self) -> None:
        """Give up the rows that have not been read."""
        self._reader.close()
        self._cursor.close()

    def __iter__(self) -> Iterator[pa.RecordBatch]:
        """Yield the batches.

        Raises
        ------
        QueryError
            The query fails on the rows that follow.
        """
        with _explained(self._statement):
            while (batch := _interruptible(self._cursor, lambda: next(self._reader, None))) is not None:
                yield batch


def _interruptible(cursor: duckdb.DuckDBPyConnection, work: Callable[[], T]) -> T:
    """Do what takes DuckDB long, so that Ctrl-C ends it.

    While DuckDB waits for its threads it does not look for signals. So a thread of ours waits for it, and
    the caller's looks up now and then: some libraries take the signal in a way that wakes no waiting thread.
    """
    outcome: Future[T] = Future()

    def run() -> None:
        try:
            outcome.set_result(work())
        except BaseException as error:
            outcome.set_exception(error)

    helper = Thread(target=run, daemon=True)
    try:
        helper.start()
        while not wait([outcome], timeout=_GLANCE).done:
            pass
        return outcome.result()
    except BaseException:
        # Said again until it is heard: a query that has not quite begun forgets it.
        while helper.is_alive():
            cursor.interrupt()
            helper.join(_GLANCE)
        raise


@contextmanager
def _explained(statement: str) -> Iterator[None]:
    """Turn errors of DuckDB, and of Arrow reading from it, into QueryError."""
    try:
        yield
    except (duckdb.Error, OSError, pa.ArrowException) as error:
        raise query_error(str(error), statement) from error
