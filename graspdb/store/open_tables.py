"""The tables of a database as writers keep them open, and what `trials` says of the sessions of a commit."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from deltalake import DeltaTable

from graspdb.store.bundle import Trial
from graspdb.store.content import KEY_LENGTH
from graspdb.store.fence import generation
from graspdb.store.layout import open_table, read_rows
from graspdb.store.location import Location
from graspdb_schemas.tables import TABLES

_CHECKPOINTS: Final = 100
"""Versions from one checkpoint of a table's log to the next, as Delta Lake has it."""


@dataclass(frozen=True)
class State:
    """What one version of `trials` says about some sessions.

    Attributes
    ----------
    version : int
        The version.
    sessions : tuple of str
        The sessions, sorted.
    generation : int
        Number of sweeps so far.
    input_keys : mapping of str to str
        Their trials that are there -> their input_key.
    stands_on : mapping of str to sequence of str
        The same trials -> ingest_ids of the session-level rows that they stand on.
    """

    version: int
    sessions: tuple[str, ...]
    generation: int
    input_keys: Mapping[str, str]
    stands_on: Mapping[str, Sequence[str]]

    def unchanged(self, trial: Trial) -> bool:
        """Whether the trial stands in the database with the same input_key."""
        return self.input_keys.get(trial.key) == trial.input_key

    @cached_property
    def contexts(self) -> Mapping[str, str]:
        """Content key -> ingest_id of session-level rows that committed trials of these sessions stand on."""
        used = {ingest_id for ingest_ids in self.stands_on.values() for ingest_id in ingest_ids}
        return {content_key_of(ingest_id): ingest_id for ingest_id in sorted(used)}


class OpenTables(Mapping[str, DeltaTable]):
    """The open tables of a database by name.

    Parameters
    ----------
    root : Path or ObjectStorage
        The database's folder.

    Raises
    ------
    DatabaseError
        The folder is no database, or one of a newer format, or damaged.
    """

    def __init__(self, root: Location) -> None:
        self._root = root
        open_table(root, "trials")
        self._tables = {name: open_table(root, name) for name in TABLES}
        self._opened = {name: table.version() for name, table in self._tables.items()}
        self._state: State | None = None

    def __getitem__(self, name: str) -> DeltaTable:
        """Return a table."""
        return self._tables[name]

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the tables."""
        return iter(self._tables)

    def __len__(self) -> int:
        """Return the number of tables."""
        return len(self._tables)

    def open_grown_anew(self) -> None:
        """Open the tables anew whose log has got a checkpoint since.

        An open table keeps a piece for every version that it has followed, and each makes the next commit
        dearer; from a checkpoint it has one for all.
        """
        for name, table in self._tables.items():
            if table.version() // _CHECKPOINTS > self._opened[name] // _CHECKPOINTS:
                self._tables[name] = open_table(self._root, name)
                self._opened[name] = self._tables[name].version()

    def state(self, trials: Sequence[Trial]) -> State:
        """Bring `trials` up to date and return what it says about the sessions of a batch.

        It is read only if it has been written to since the last time by somebody else.
        """
        table = self._tables["trials"]
        table.update_incremental()
        sessions = tuple(sorted({trial.session for trial in trials}))
        last = self._state
        if last is None or (last.version, last.sessions) != (table.version(), sessions):
            last = self._state = _read(table, sessions)
        return last

    def follow(
        self, state: State, input_keys: Mapping[str, str], stands_on: Mapping[str, Sequence[str]]
    ) -> None:
        """Take in the trials that a commit has written to `trials` right after a state."""
        version = self._tables["trials"].version()
        if version == state.version + 1:
            self._state = State(
                version,
                state.sessions,
                state.generation,
                {**state.input_keys, **input_keys},
                {**state.stands_on, **stands_on},
            )


def quoted(values: Sequence[str]) -> str:
    """Return values as a list of SQL text literals."""
    return ", ".join("'" + value.replace("'", "''") + "'" for value in values)


def content_key_of(ingest_id: str) -> str:
    """Return the content key at the end of a session-level ingest_id."""
    return ingest_id[-KEY_LENGTH:]


def _read(trials: DeltaTable, sessions: tuple[str, ...]) -> State:
    columns = ["trial", "input_key", "context"]
    rows = read_rows("trials", trials, columns, predicate=f"session IN ({quoted(sessions)})")
    keys = rows["trial"].to_pylist()
    return State(
        version=trials.version(),
        sessions=sessions,
        generation=generation(trials),
        input_keys=dict(zip(keys, rows["input_key"].to_pylist(), strict=True)),
        stands_on=dict(zip(keys, rows["context"].to_pylist(), strict=True)),
    )
