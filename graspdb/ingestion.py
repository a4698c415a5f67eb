"""From a session's folder to committed rows: what is new is prepared, followed and committed."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from graspdb.batches import commit_in_batches
from graspdb.engines import Engine, EngineName, make_engine
from graspdb.preparation import Parts, Processed, prepare_parts, process_prepared
from graspdb.store import Outcome, Store
from graspdb.store.location import Location
from graspdb_ingest.calibration_set import keep_calibrations
from graspdb_ingest.input_key import hand_inputs, input_key, session_inputs
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.manifest import Session, SessionTrial
from graspdb_schemas.manifest_reader import parse_manifest


@dataclass(frozen=True)
class TrialReport:
    """What became of one trial.

    Attributes
    ----------
    trial : str
        Its key.
    outcome : Outcome
        Added, replaced or left unchanged.
    status : str or None
        ok or rejected; None for an unchanged trial.
    reasons : tuple of str
        Why it was rejected, or what to know of it.
    n_grasps : int or None
        Number of grasps found; None for an unchanged trial.
    """

    trial: str
    outcome: Outcome
    status: str | None
    reasons: tuple[str, ...]
    n_grasps: int | None


@dataclass(frozen=True)
class IngestReport:
    """What became of a session.

    Attributes
    ----------
    session : str
        Its identifier.
    db : Path or ObjectStorage
        The database.
    trials : tuple of TrialReport
        Every trial of the manifest, in the order of their commit, unchanged ones first.
    """

    session: str
    db: Location
    trials: tuple[TrialReport, ...]

    @property
    def rejected(self) -> tuple[TrialReport, ...]:
        """The trials that were rejected."""
        return tuple(trial for trial in self.trials if trial.status == "rejected")


Progress = Callable[[TrialReport, int], None]
"""Called for each committed trial with its report and the number of trials to do in all."""


def ingest(
    session: str | os.PathLike[str],
    db: str | os.PathLike[str] = "grasps",
    *,
    workers: int | None = None,
    engine: str = EngineName.LOCAL,
    data_root: str | os.PathLike[str] | None = None,
    force: bool = False,
    parameters: IngestParameters | None = None,
    progress: Progress | None = None,
) -> IngestReport:
    """Ingest a session into a database; trials that are in it unchanged are skipped.

    Parameters
    ----------
    session : path
        The session's folder, or its manifest.
    db : path
        The database's folder, or its URL in object storage; made where there is none.
    workers : int, optional
        Trials that are worked on side by side; as many as there are cores unless given. The rows do not
        depend on it.
    engine : {'local', 'ray'}
        Where they are worked on: in processes of this machine, or on a Ray cluster, which needs the extra
        ``graspdb[ray]``. Rows are committed by this process alone.
    data_root : path, optional
        Folder that the manifest's files are in; the session's own folder unless given.
    force : bool
        Whether to ingest unchanged trials too, and replace their rows.
    parameters : IngestParameters, optional
        Thresholds and models; the defaults unless given.
    progress : callable, optional
        Told of every trial.

    Returns
    -------
    IngestReport
        What became of each trial.

    Raises
    ------
    ManifestError
        If the manifest does not describe a session.
    DatabaseError
        If the folder is no database, or cannot be written.
    ParameterError
        If `workers` is less than one, or there is no such engine.
    EngineError
        If a worker was lost, or the cluster cannot be used; what was committed before stays.
    """
    parameters = parameters or IngestParameters()
    described = parse_manifest(Path(session), None if data_root is None else Path(data_root))
    store = Store.create_or_open(db)
    if not force:
        described = with_kept_hands(described, store, parameters)
    inputs = session_inputs(described, parameters)
    todo, reports = _to_do(described, store, inputs, force)
    # Trials of one object after the other let workers keep it loaded.
    todo.sort(key=lambda trial: trial.object or "")
    with make_engine(engine, workers, at_most=len(todo)) as chosen:
        parts = prepare_parts(chosen, described, todo, parameters)
        committer = _Committer(store, described, parts, force)

        def commit(trials: Sequence[Processed]) -> None:
            for report in committer.commit(trials):
                reports.append(report)
                if progress is not None:
                    progress(report, len(todo))

        arrivals = _processed(chosen, described, todo, parts, inputs, parameters)
        commit_in_batches(arrivals, commit, Processed.size, chosen.finished)
    return IngestReport(described.id, store.path, tuple(reports))


def with_kept_hands(session: Session, store: Store, parameters: IngestParameters) -> Session:
    """Let subjects keep the recordings that their hands in the database were calibrated from."""
    if all(subject.calibration for subject in session.subjects.values()):
        return session
    hands = store.calibrated_hands(session.id)
    return keep_calibrations(session, hands, hand_inputs(session, parameters)) if hands else session


def _to_do(
    session: Session, store: Store, inputs: Mapping[str, Mapping[str, str]], force: bool
) -> tuple[list[SessionTrial], list[TrialReport]]:
    known = {} if force else store.committed_input_keys(session.id)
    todo, unchanged = [], []
    for trial in session.trials:
        key = f"{session.id}/{trial.name}"
        if known.get(key) == input_key(inputs[trial.name]):
            unchanged.append(TrialReport(key, Outcome.UNCHANGED, None, (), None))
        else:
            todo.append(trial)
    return todo, unchanged


def _processed(
    chosen: Engine,
    session: Session,
    todo: Sequence[SessionTrial],
    parts: Parts,
    inputs: Mapping[str, Mapping[str, str]],
    parameters: IngestParameters,
) -> Iterator[list[Processed]]:
    """Yield the trials done since the last time."""
    shared = chosen.share((session, parameters))
    calls = ((shared, trial, parts.of(session, trial), inputs[trial.name]) for trial in todo)
    yield from chosen.run(process_prepared, calls)


class _Committer:
    """Commits trials with what they stand on."""

    def __init__(self, store: Store, session: Session, parts: Parts, force: bool) -> None:
        self._store, self._session, self._parts, self._force = store, session, parts, force
        self._object: str | None = None

    def commit(self, trials: Sequence[Processed]) -> Iterator[TrialReport]:
        """Commit trials, those with the same object in one step, and yield what became of each."""
        by_object = sorted(trials, key=lambda trial: trial.object or "")
        for name, alike in groupby(by_object, key=lambda trial: trial.object or ""):
            if name != self._object:
                self._store.commit_session(_stands_on(self._session, self._parts, name))
                self._object = name
            rows = [trial.rows for trial in alike]
            outcomes = self._store.commit_trials(rows, force=self._force)
            yield from (trial_report(own, done.outcome) for own, done in zip(rows, outcomes, strict=True))


def _stands_on(session: Session, parts: Parts, name: str) -> TrialTables:
    """Return the rows that trials with an object stand on: of the session, its hands and that object."""
    # Here, since it loads what computes: workers are at work by now.
    from graspdb_ingest.session_rows import session_rows

    return session_rows(session, parts.good_hands(), parts.good_object(name))


def trial_report(rows: TrialTables, outcome: Outcome) -> TrialReport:
    """Return what became of a trial with these rows."""
    row = rows.tables["trials"].to_pylist()[0]
    return TrialReport(row["trial"], outcome, row["status"], tuple(row["reasons"]), row["n_grasps"])
