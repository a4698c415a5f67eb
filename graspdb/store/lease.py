"""Locks in object storage: objects that say who is at work, and are gone when they have done.

Each puts its object first and looks for those of others then. The storage shows an object to all who look
after it was put; so of two that must not meet at least one sees the other. Nobody takes away the object of a
killed process: it counts no longer when it is old by the storage's own clock.
"""

import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import StrEnum
from typing import Any, Final

from deltalake.fs import DeltaStorageHandler
from pyarrow.fs import FileSelector

from graspdb.store.fence import Patience
from graspdb.store.location import ObjectStorage, unreachable
from graspdb_queries.object_storage import OPTIONS
from graspdb_schemas.errors import DatabaseError

LEASES: Final = "_graspdb"
"""Place of the objects below `trials`; Delta Lake takes no notice of names that begin with an underscore."""

_LONGEST: Final = 3600.0
"""Age after which an object is that of a killed process [s]."""


class Work(StrEnum):
    """What somebody is at: any number may write at once, and deleting what may be young is done alone."""

    WRITING = "writing"
    ALONE = "alone"


@contextmanager
def leased(root: ObjectStorage, work: Work) -> Iterator[None]:
    """Keep away those who must not be at work meanwhile.

    Raises
    ------
    DatabaseError
        Others do not end, or the storage cannot be reached.
    """
    storage: Any = DeltaStorageHandler(str(root / "trials" / LEASES), OPTIONS)
    own = f"{work}-{uuid.uuid4().hex}"
    try:
        try:
            _wait_for_turn(root, storage, own)
        except OSError as error:
            raise unreachable(root, error) from error
        yield
    finally:
        with suppress(OSError):
            storage.delete_file(own)


def _wait_for_turn(root: ObjectStorage, storage: Any, own: str) -> None:
    """Put the own object, and return when there is none of somebody who must not be at work meanwhile."""
    patience = Patience(root)

    def pause(name: str) -> None:
        try:
            patience.pause()
        except DatabaseError as error:
            raise _no_turn(root, name) from error

    while True:
        storage.open_output_stream(own).close()
        in_the_way = _in_the_way(storage, own)
        while in_the_way and all(name.startswith(Work.WRITING) for name in in_the_way):
            # They end, and nobody begins to write while the own object is there.
            pause(in_the_way[0])
            in_the_way = _in_the_way(storage, own)
        if not in_the_way:
            return
        # Two that wait for each other would wait forever.
        storage.delete_file(own)
        pause(in_the_way[0])


def _in_the_way(storage: Any, own: str) -> list[str]:
    """Return the objects of others who must not be at work with the own one; delete those of the dead."""
    found = storage.get_file_info_selector(FileSelector("", allow_not_found=True))
    put = {info.path: info.mtime.timestamp() for info in found}
    if own not in put:
        return [own]  # somebody took it for that of a killed process
    dead = [name for name, time in put.items() if name != own and put[own] - time > _LONGEST]
    for name in dead:
        storage.delete_file(name)
    kinds = tuple(Work) if own.startswith(Work.ALONE) else (Work.ALONE,)
    return [name for name in put if name not in (own, *dead) and name.startswith(kinds)]


def _no_turn(root: ObjectStorage, name: str) -> DatabaseError:
    return DatabaseError(
        root,
        f"somebody else is at work: {root / 'trials' / LEASES / name} is there",
        "Run again when they have done. If their process was killed, delete that object; it counts an hour.",
    )
