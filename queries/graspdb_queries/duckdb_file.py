"""A DuckDB file of views on a snapshot's Parquet files, for any DuckDB client."""

import os
import uuid
from collections.abc import Mapping
from pathlib import Path

import duckdb

from graspdb_queries.object_storage import read_through
from graspdb_queries.source import TableSource, files_of
from graspdb_queries.views import build_database
from graspdb_schemas.errors import QueryError


def write_duckdb(path: Path, sources: Mapping[str, TableSource]) -> None:
    """Write a DuckDB file with the documented views and functions of a snapshot.

    The file holds no rows, but where the snapshot's Parquet files lie and which ingests count: it shows
    that snapshot for as long as these files stay.

    Parameters
    ----------
    path : Path
        The file; there must be none yet.
    sources : mapping of str to TableSource
        Files and committed rows of each table; paths are absolute.

    Raises
    ------
    QueryError
        There is such a file already, it cannot be written, or a file of the snapshot is missing or damaged.
    """
    if path.exists():
        raise _exists(path)
    if not path.parent.is_dir():
        raise QueryError(f"{path}: there is no folder {path.parent}", "Make it, or name another file.")
    unfinished = path.parent / f".{path.name}-{uuid.uuid4().hex}"
    try:
        with duckdb.connect(str(unfinished)) as connection:
            read_through(connection, files_of(sources))
            build_database(connection, sources)
        # Unlike a renamed file, a link takes nobody's place.
        os.link(unfinished, path)
    except FileExistsError:
        raise _exists(path) from None
    except OSError as error:
        raise QueryError(f"{path}: cannot be written: {error.strerror}", "Name another file.") from error
    except duckdb.Error as error:
        raise QueryError(
            str(error), "Name a file that you may write to; if a table's file is damaged, restore a copy."
        ) from error
    finally:
        for left in (unfinished, Path(f"{unfinished}.wal")):
            left.unlink(missing_ok=True)


def _exists(path: Path) -> QueryError:
    return QueryError(f"{path}: there is such a file already", "Name another, or remove this one first.")
