"""The order of commits: one at a time on `trials`, and none across a sweep.

Delta Lake lets two appends through at once. A commit that names an application's transaction, though,
fails if another commit has named the same one since its table was read. Every commit to `trials` names
`COMMIT`, so each was checked against exactly the version before it; sweeps count in `SWEEP`.
"""

import random
import time
from typing import Final

from deltalake import CommitProperties, DeltaTable, Transaction

from graspdb.store.location import Location
from graspdb_schemas.errors import DatabaseError

COMMIT: Final = "graspdb.commit"
SWEEP: Final = "graspdb.sweep"

_PATIENCE: Final = 120.0
"""How long to try against other writers before giving up [s]."""

_LONGEST_PAUSE: Final = 0.1
"""Longest pause between two attempts [s]."""


def generation(trials: DeltaTable) -> int:
    """Return how many sweeps the version of `trials` has seen."""
    return trials.transaction_version(SWEEP) or 0


def commit_properties(trials: DeltaTable, action: str, **counts: int) -> CommitProperties:
    """Return properties that make a commit fail unless it follows the version that was read.

    What it does, such as ``ingest``, and to how many trials, is kept for the database's history.
    """
    transactions = [Transaction(COMMIT, trials.version() + 1)]
    if action == "sweep":
        transactions.append(Transaction(SWEEP, generation(trials) + 1))
    kept = {"graspdb.action": action, **{f"graspdb.{name}": n for name, n in counts.items()}}
    return CommitProperties(app_transactions=transactions, custom_metadata=kept)


class Patience:
    """Pauses between attempts against other writers: random, growing, and not without end."""

    def __init__(self, root: Location) -> None:
        self._root = root
        self._start = time.monotonic()
        self._longest = 0.005

    def pause(self) -> None:
        """Wait before the next attempt.

        Raises
        ------
        DatabaseError
            Other writers have kept this one waiting for two minutes.
        """
        if time.monotonic() - self._start > _PATIENCE:
            raise DatabaseError(
                self._root,
                f"other writers left no turn for {_PATIENCE:.0f} s",
                "Run again when fewer of them are at work.",
            )
        time.sleep(random.uniform(0, self._longest))
        self._longest = min(_LONGEST_PAUSE, 2 * self._longest)
