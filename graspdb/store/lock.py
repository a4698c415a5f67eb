"""Keeping vacuums away from writes that are under way.

A writer puts its files on disk before its commit names them. In between they look like what a killed
writer leaves behind. A vacuum that takes everything unnamed, whatever its age, therefore waits until nobody
is writing.
The operating system gives the lock back when a process ends, also when it is killed. Object storage has no
locks; `lease` has what stands for them there.
"""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from graspdb.store.fence import Patience
from graspdb.store.lease import Work, leased
from graspdb.store.location import Location, ObjectStorage
from graspdb_schemas.errors import DatabaseError

LOCK_FILE: Final = "_graspdb.lock"
"""File in the folder of `trials`; Delta Lake takes no notice of names that begin with an underscore."""


@contextmanager
def writing(root: Location) -> Iterator[None]:
    """Keep vacuums of young files away; any number of writers may be at work."""
    with _locked(root, fcntl.LOCK_SH):
        yield


@contextmanager
def alone(root: Location) -> Iterator[None]:
    """Keep writers away."""
    with _locked(root, fcntl.LOCK_EX):
        yield


@contextmanager
def _locked(root: Location, how: int) -> Iterator[None]:
    if isinstance(root, ObjectStorage):
        with leased(root, Work.ALONE if how == fcntl.LOCK_EX else Work.WRITING):
            yield
        return
    patience = Patience(root)
    try:
        file = (root / "trials" / LOCK_FILE).open("ab")
    except OSError as error:
        raise DatabaseError(
            root,
            f"cannot write to it: {error.strerror}",
            "What was committed before is safe; free space or permissions, then run again.",
        ) from error
    with file:
        while True:
            try:
                fcntl.flock(file, how | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                patience.pause()
        yield
