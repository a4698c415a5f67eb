"""Files in object storage, as DuckDB reads them without an extension.

DuckDB's own reader of S3 is an extension, which cannot be assumed. Delta Lake's is there in any case and has
credentials and endpoint from the same environment as the writer; DuckDB reads through it as a file system of
fsspec.
"""

import threading
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final

from graspdb_schemas.errors import MissingLibraryError

if TYPE_CHECKING:
    import duckdb

OPTIONS: Final = {
    "aws_conditional_put": "etag",
    "connect_timeout": "5s",
    "max_retries": "4",
    "retry_timeout": "30s",
}
"""Options of object storage: commits that refuse to overwrite, and an end to waiting for a server."""

_NEVER_CHANGED: Final = datetime(1970, 1, 1, tzinfo=UTC)


def is_url(text: str) -> bool:
    """Whether a text is a URL, not a path."""
    return "://" in text


def open_object(url: str) -> Any:
    """Open an object for reading; a binary file.

    Raises
    ------
    OSError
        There is none, or it cannot be reached.
    """
    from deltalake.fs import DeltaStorageHandler

    place, _slash, name = url.rpartition("/")
    return DeltaStorageHandler(place, OPTIONS).open_input_file(name)


def read_through(connection: "duckdb.DuckDBPyConnection", files: Iterable[str]) -> None:
    """Let a connection read files of which the names are URLs, if any are.

    Raises
    ------
    MissingLibraryError
        fsspec, through which DuckDB asks for them, is not installed.
    """
    if not any(is_url(file) for file in files):
        return
    try:
        import fsspec
    except ImportError as error:
        remedy = "Install it with pip install 'graspdb[s3]'."
        raise MissingLibraryError("fsspec", str(error), remedy) from error
    connection.register_filesystem(_files(fsspec.AbstractFileSystem))


def _files(base: Any) -> Any:
    """Return a file system of fsspec that reads what Delta Lake can open."""
    from deltalake.fs import DeltaStorageHandler

    class ObjectFiles(base):  # type: ignore[misc]
        """Files by URL. Files of a snapshot never change, so their time says nothing."""

        protocol = "s3"
        cachable = False

        def __init__(self) -> None:
            super().__init__()
            self._buckets: dict[str, Any] = {}

        @classmethod
        def _strip_protocol(cls, path: str) -> str:
            return path

        def _open(self, path: str, mode: str = "rb", **_: Any) -> "ReadFile":
            if mode != "rb":
                raise PermissionError(f"{path} can only be read")
            bucket, _slash, name = path.removeprefix("s3://").partition("/")
            if bucket not in self._buckets:
                self._buckets[bucket] = DeltaStorageHandler(f"s3://{bucket}", OPTIONS)
            return ReadFile(self._buckets[bucket].open_input_file(name))

        def info(self, path: str, **_: Any) -> dict[str, Any]:
            with self._open(path) as file:
                return {"name": path, "size": file.size, "type": "file"}

        def exists(self, path: str, **_: Any) -> bool:
            try:
                self.info(path)
            except OSError:
                return False
            return True

        def glob(self, path: str, **_: Any) -> list[str]:
            return [path]

        def modified(self, path: str) -> datetime:  # noqa: ARG002
            return _NEVER_CHANGED

    return ObjectFiles()


class ReadFile:
    """A file that several threads read: DuckDB's threads share one, and each seeks before it reads.

    Attributes
    ----------
    size : int
        Its length in bytes.
    """

    def __init__(self, file: Any) -> None:
        self.size: int = file.size()
        self._file = file
        self._lock = threading.Lock()
        self._own = threading.local()

    def __enter__(self) -> "ReadFile":
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.close()

    def tell(self) -> int:
        """Return the place of this thread."""
        return getattr(self._own, "place", 0)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Move this thread's place."""
        self._own.place = (0, self.tell(), self.size)[whence] + offset
        return self.tell()

    def read(self, n_bytes: int = -1) -> bytes:
        """Return bytes from this thread's place on, fewer at the end."""
        place = self.tell()
        left = max(0, self.size - place)
        with self._lock:
            self._file.seek(place)
            data = bytes(self._file.read(left if n_bytes < 0 else min(n_bytes, left)))
        self._own.place = place + len(data)
        return data

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._file.close()
