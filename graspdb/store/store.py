"""The store: a folder of Delta Lake tables that trials are committed to and snapshots taken of."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Self

import pyarrow as pa
from deltalake import DeltaTable

from graspdb.store.commit import Committed, commit_trials, quoted
from graspdb.store.layout import create, open_table
from graspdb.store.snapshot import Snapshot, take_snapshot
from graspdb.store.sweep import sweep
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.tables import TABLES


class Store:
    """A database, open for writing.

    Any number of processes may have the same database open and commit to it. One `Store` is for one
    thread at a time.

    Attributes
    ----------
    path : Path
        The database's folder.
    """

    def __init__(self, path: Path, tables: Mapping[str, DeltaTable]) -> None:
        self.path = path
        self._tables = tables

    @classmethod
    def open(cls, path: str | PathLike[str]) -> Self:
        """Open a database that is there.

        Raises
        ------
        DatabaseError
            The folder is no database, or one of a newer format, or damaged.
        """
        root = Path(path)
        open_table(root, "trials")
        return cls(root, {name: open_table(root, name) for name in TABLES})

    @classmethod
    def create_or_open(cls, path: str | PathLike[str]) -> Self:
        """Open a database; create it in a folder that is empty or not there.

        Raises
        ------
        DatabaseError
            The folder holds something else, or cannot be written.
        """
        create(Path(path))
        return cls.open(path)

    def input_keys(self, session: str) -> dict[str, str]:
        """Return what each committed trial of a session was made from: trial -> input_key.

        A trial whose input_key would be the same again need not be ingested again.
        """
        trials = self._tables["trials"]
        trials.update_incremental()
        scan = trials.scan(columns=["trial", "input_key"], predicate=f"session IN ({quoted([session])})")
        rows = pa.table(scan.read_all())
        return dict(zip(rows["trial"].to_pylist(), rows["input_key"].to_pylist(), strict=True))

    def commit_trial(self, trial: TrialTables, *, force: bool = False) -> Committed:
        """Commit one trial; see `commit_trials`."""
        return self.commit_trials([trial], force=force)[0]

    def commit_trials(self, trials: Sequence[TrialTables], *, force: bool = False) -> tuple[Committed, ...]:
        """Commit trials in one step: readers see all of them, or none.

        A trial that stands in the database with the same input_key is left alone, and if all do then no
        table gets a new version. One with another input_key is replaced: at no moment are there two of
        it, or none.

        Parameters
        ----------
        trials : sequence of TrialTables
            The trials, each at most once. Commit many small ones together: a commit costs the same few
            milliseconds a table for one or for a thousand.
        force : bool
            Whether to replace trials that have not changed, too.

        Returns
        -------
        tuple of Committed
            What became of each, in the order given.

        Raises
        ------
        ParameterError
            A trial is given twice.
        DatabaseError
            The database cannot be written, or other writers leave no turn.
        """
        return commit_trials(self.path, self._tables, trials, force)

    def snapshot(self) -> Snapshot:
        """Pin one version of every table, consistently; see `take_snapshot`."""
        return take_snapshot(self.path)

    def sweep(self) -> dict[str, int]:
        """Delete the rows that no committed trial stands on, and return how many by table.

        Ingests may run at the same time. The files themselves stay, for snapshots that still read
        them, until the tables are vacuumed.

        Raises
        ------
        DatabaseError
            The database cannot be written, or other writers leave no turn.
        """
        return sweep(self.path, self._tables)
