"""Where a database is: a folder, or a place in object storage that a URL names."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeAlias

import pyarrow.parquet as pq
from deltalake.fs import DeltaStorageHandler
from pyarrow.fs import FileSelector, PyFileSystem

from graspdb_queries.object_storage import OPTIONS, is_url, open_object
from graspdb_schemas.errors import DatabaseError

_URL: Final = re.compile(r"s3://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](/[\w.=-]+)+")
"""A bucket's name as S3 allows it, and folders without characters that engines read as patterns."""

_COLOURS: Final = re.compile(r"\x1b\[\d*m")
"""What an error's message is painted with."""


@dataclass(frozen=True)
class ObjectStorage:
    """A place in object storage, with what is asked of a `Path` of a database.

    Attributes
    ----------
    url : str
        ``s3://bucket/folders``.
    """

    url: str

    def __str__(self) -> str:
        """Return the URL."""
        return self.url

    def __truediv__(self, name: str) -> "ObjectStorage":
        """Return a place below."""
        return ObjectStorage(f"{self.url}/{name}")

    def exists(self) -> bool:
        """Whether anything is there."""
        return bool(self.names())

    def is_dir(self) -> bool:
        """Whether anything is there: object storage has no folders but names that begin alike."""
        return self.exists()

    def names(self) -> list[str]:
        """Return the names of what is there, without what is below.

        Raises
        ------
        DatabaseError
            The storage cannot be reached, or denies it.
        """
        try:
            files = PyFileSystem(DeltaStorageHandler(self.url, OPTIONS))
            found = files.get_file_info(FileSelector("", allow_not_found=True))
        except (OSError, ValueError) as error:
            raise unreachable(self, error) from error
        return [info.path.rstrip("/").rpartition("/")[2] for info in found]


Location: TypeAlias = Path | ObjectStorage
"""Where a database is."""


def location(path: "str | os.PathLike[str] | ObjectStorage") -> Location:
    """Return where a database is, from what a user wrote.

    Raises
    ------
    DatabaseError
        A URL names no place that a database can be in.
    """
    if isinstance(path, ObjectStorage):
        return path
    text = os.fspath(path)
    if not is_url(text):
        return Path(text)
    url = text.rstrip("/")
    if not _URL.fullmatch(url):
        raise DatabaseError(
            text,
            "not a URL that a database can be at",
            "Write s3://bucket/folder, with letters, digits and . _ = - in its names.",
        )
    return ObjectStorage(url)


def names_in(place: Location) -> list[str]:
    """Return the names of what lies in a place, none where there is nothing."""
    if isinstance(place, ObjectStorage):
        return place.names()
    return [entry.name for entry in place.iterdir()] if place.exists() else []


def storage_options(place: Location) -> dict[str, str] | None:
    """Return the options that Delta Lake opens the tables of a database with."""
    return OPTIONS if isinstance(place, ObjectStorage) else None


def open_parquet(file: str, repeated: Sequence[str] = ()) -> pq.ParquetFile:
    """Open a Parquet file by its path or URL; columns of texts that repeat can be read as dictionaries."""
    return pq.ParquetFile(open_object(file) if is_url(file) else Path(file), read_dictionary=repeated)


def size_of(file: str) -> int | None:
    """Return the bytes of a file of a path or URL, None where there is none."""
    if not is_url(file):
        return Path(file).stat().st_size if Path(file).exists() else None
    try:
        return int(open_object(file).size())
    except OSError:
        return None


def has_file(file: str) -> bool:
    """Whether there is a file of a path or URL."""
    return size_of(file) is not None


def unreachable(place: object, error: Exception) -> DatabaseError:
    """Say that storage cannot be reached, and what it is told by."""
    reason = _COLOURS.sub("", " ".join(str(error).split())).replace("↳", "-") or type(error).__name__
    return DatabaseError(
        place,
        f"cannot be reached: {reason[:300].rstrip('. ')}",
        "Check the URL and the environment: AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_REGION; for other "
        "servers than Amazon's AWS_ENDPOINT_URL, and AWS_ALLOW_HTTP=true where it is http.",
    )
