"""The store: a folder of Delta Lake tables that trials are committed to and snapshots taken of."""

from collections.abc import Sequence
from os import PathLike
from typing import Self

from deltalake import DeltaTable

from graspdb.store.bundle import as_trial
from graspdb.store.commit import Committed, commit_trials
from graspdb.store.committed import (
    CommittedTrial,
    calibrated_hands,
    committed_input_keys,
    committed_trials,
)
from graspdb.store.content import Unit, units
from graspdb.store.layout import create
from graspdb.store.location import Location, ObjectStorage, location
from graspdb.store.open_tables import OpenTables
from graspdb.store.optimize import SAFE_RETENTION, OptimizedTable, optimize
from graspdb.store.remove import Kind, Removed, remove
from graspdb.store.snapshot import Snapshot, take_snapshot
from graspdb.store.sweep import sweep
from graspdb_ingest.calibration_set import CalibratedHand
from graspdb_ingest.trial_tables import TrialTables


class Store:
    """A database, open for writing.

    Any number of processes may have the same database open and commit to it. One `Store` is for one
    thread at a time.

    Attributes
    ----------
    path : Path or ObjectStorage
        Where it is.
    """

    def __init__(self, path: Location) -> None:
        self.path = path
        self._tables = OpenTables(path)
        self._shared: dict[str, tuple[Unit, ...]] = {}

    @classmethod
    def open(cls, path: str | PathLike[str] | ObjectStorage) -> Self:
        """Open a database that is there.

        Raises
        ------
        DatabaseError
            The folder is no database, or one of a newer format, or damaged.
        """
        return cls(location(path))

    @classmethod
    def create_or_open(cls, path: str | PathLike[str] | ObjectStorage) -> Self:
        """Open a database; create it in a folder that is empty or not there.

        Raises
        ------
        DatabaseError
            The folder holds something else, or cannot be written.
        """
        create(location(path))
        return cls.open(path)

    def committed_input_keys(self, session: str) -> dict[str, str]:
        """Return what each committed trial of a session was made from: trial -> input_key.

        A trial whose input_key would be the same again need not be ingested again.
        """
        return committed_input_keys(self._up_to_date("trials"), session)

    def committed_trials(self, session: str) -> dict[str, CommittedTrial]:
        """Return what each committed trial of a session was made from, part by part: trial -> parts."""
        return committed_trials(self._up_to_date("trials"), self._up_to_date("hands"), session)

    def calibrated_hands(self, session: str) -> list[CalibratedHand]:
        """Return the hands that committed trials of a session stand on, the one committed last first."""
        return calibrated_hands(self._up_to_date("trials"), self._up_to_date("hands"), session)

    def commit_session(self, rows: TrialTables) -> None:
        """Take in the rows of a session that its trials stand on.

        They are written with the first trial that stands on them, unless the database has rows of the
        same content already. Trials committed before keep the rows that they stand on.

        Parameters
        ----------
        rows : TrialTables
            Rows of ``sessions``, ``subjects``, ``hands``, ``objects`` and ``object_points``.
        """
        found = list(units(rows.tables))
        for session in {unit.describes["session"] for unit in found}:
            self._shared[session] = tuple(unit for unit in found if unit.describes["session"] == session)

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
            The trials, each at most once, with one row in ``trials``; the session-level rows they stand
            on come with them or before, through `commit_session`. Commit many small ones together: a
            commit costs the same few milliseconds a table for one or for a thousand.
        force : bool
            Whether to replace trials that have not changed, too.

        Returns
        -------
        tuple of Committed
            What became of each, in the order given.

        Raises
        ------
        ParameterError
            A trial is given twice, or its rows are not those of one trial.
        DatabaseError
            The database cannot be written, or other writers leave no turn.
        """
        checked = [as_trial(trial, self._shared) for trial in trials]
        return commit_trials(self.path, self._tables, checked, force)

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

    def remove(self, kind: Kind, keys: Sequence[str]) -> Removed:
        """Take trials, sessions or subjects out; see `remove`."""
        return remove(self.path, self._tables, kind, keys)

    def optimize(self, retention_hours: int = SAFE_RETENTION) -> dict[str, OptimizedTable]:
        """Sweep, join small files and delete old ones; see `optimize`."""
        return optimize(self.path, self._tables, retention_hours)

    def _up_to_date(self, name: str) -> DeltaTable:
        self._tables[name].update_incremental()
        return self._tables[name]
