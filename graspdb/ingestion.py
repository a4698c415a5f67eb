"""From a session's folder to committed rows: what is new is prepared, followed and committed."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from joblib import Parallel, delayed

from graspdb.store import Outcome, Store
from graspdb_ingest.calibration_set import keep_calibrations
from graspdb_ingest.input_key import hand_inputs, input_key, session_inputs
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.pipeline import Context, process_trial
from graspdb_ingest.prepare import PreparedHand, prepare_hand
from graspdb_ingest.prepared_object import PreparedObject, prepare_object
from graspdb_ingest.session_rows import session_rows
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import GraspDBError, ParameterError
from graspdb_schemas.manifest import Session, SessionTrial
from graspdb_schemas.manifest_reader import parse_manifest
from graspdb_schemas.vocabulary import Side

T = TypeVar("T")


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
    db : Path
        The database.
    trials : tuple of TrialReport
        Every trial of the manifest, in the order of their commit, unchanged ones first.
    """

    session: str
    db: Path
    trials: tuple[TrialReport, ...]

    @property
    def rejected(self) -> tuple[TrialReport, ...]:
        """The trials that were rejected."""
        return tuple(trial for trial in self.trials if trial.status == "rejected")


Progress = Callable[[TrialReport, int], None]
"""Called after each committed trial with its report and the number of trials to do in all."""


def ingest(
    session: str | os.PathLike[str],
    db: str | os.PathLike[str] = "grasps",
    *,
    workers: int = 1,
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
        The database's folder; made where there is none.
    workers : int
        Processes that follow trials side by side. The rows do not depend on it.
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
        If `workers` is less than one.
    """
    if workers < 1:
        raise ParameterError("workers", workers, "1 or more")
    parameters = parameters or IngestParameters()
    described = parse_manifest(Path(session), None if data_root is None else Path(data_root))
    store = Store.create_or_open(db)
    if not force:
        described = with_kept_hands(described, store, parameters)
    inputs = session_inputs(described, parameters)
    todo, reports = _to_do(described, store, inputs, force)
    prepared = _prepare(described, todo, parameters, workers)
    if todo:
        store.commit_session(session_rows(described, prepared.good_hands, prepared.good_objects))
    contexts = {trial.name: prepared.context(described, trial, inputs[trial.name]) for trial in todo}
    for rows in _processed(described, todo, contexts, parameters, workers):
        committed = store.commit_trial(rows, force=force)
        report = trial_report(rows, committed.outcome)
        reports.append(report)
        if progress is not None:
            progress(report, len(todo))
    return IngestReport(described.id, Path(db), tuple(reports))


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


@dataclass(frozen=True)
class _Problem:
    """Why something that trials stand on cannot be had."""

    text: str


@dataclass(frozen=True)
class _Prepared:
    """The hands and objects of a session's trials, or why they cannot be had."""

    hands: Mapping[tuple[str, Side], PreparedHand | _Problem]
    objects: Mapping[str, PreparedObject | _Problem]

    @property
    def good_hands(self) -> list[PreparedHand]:
        return [hand for hand in self.hands.values() if isinstance(hand, PreparedHand)]

    @property
    def good_objects(self) -> list[PreparedObject]:
        return [thing for thing in self.objects.values() if isinstance(thing, PreparedObject)]

    def context(self, session: Session, trial: SessionTrial, inputs: Mapping[str, str]) -> Context:
        """Return what a trial stands on."""
        hands = {side: self.hands[trial.subject, side] for side in session.sides_of(trial)}
        thing = None if trial.object is None else self.objects.get(trial.object)
        return Context(
            hands={side: hand for side, hand in hands.items() if isinstance(hand, PreparedHand)},
            object=thing if isinstance(thing, PreparedObject) else None,
            problems=tuple(part.text for part in (*hands.values(), thing) if isinstance(part, _Problem)),
            inputs=inputs,
        )


def _prepare(
    session: Session, todo: Sequence[SessionTrial], parameters: IngestParameters, workers: int
) -> _Prepared:
    """Prepare each hand and object that the trials need, once; a failure rejects just those trials."""
    hands = _unique((t.subject, side) for t in todo for side in session.sides_of(t))
    names = _unique(trial.object for trial in todo)
    objects = [name for name in names if name is not None and session.objects[name].mesh is not None]
    with Parallel(n_jobs=min(workers, max(1, len(hands) + len(objects)))) as parallel:
        prepared_hands = parallel(delayed(_hand)(session, n, s, parameters) for n, s in hands)
        prepared_objects = parallel(delayed(_object)(session, n, parameters) for n in objects)
    return _Prepared(
        hands=dict(zip(hands, prepared_hands, strict=True)),
        objects=dict(zip(objects, prepared_objects, strict=True)),
    )


def _hand(
    session: Session, subject: str, side: Side, parameters: IngestParameters
) -> PreparedHand | _Problem:
    try:
        return prepare_hand(session, session.subjects[subject], side, parameters.tracking)
    except GraspDBError as error:
        return _Problem(f"subject {subject}, {side} hand: {error}")


def _object(session: Session, name: str, parameters: IngestParameters) -> PreparedObject | _Problem:
    try:
        return prepare_object(session.objects[name], parameters)
    except GraspDBError as error:
        return _Problem(f"object {name}: {error}")


def _processed(
    session: Session,
    todo: Sequence[SessionTrial],
    contexts: Mapping[str, Context],
    parameters: IngestParameters,
    workers: int,
) -> Iterator[TrialTables]:
    """Yield the rows of each trial as it is done, in the order of the manifest."""
    tasks = (delayed(process_trial)(session, t, contexts[t.name], parameters) for t in todo)
    yield from Parallel(n_jobs=workers, return_as="generator", pre_dispatch=workers)(tasks)


def trial_report(rows: TrialTables, outcome: Outcome) -> TrialReport:
    """Return what became of a trial with these rows."""
    row = rows.tables["trials"].to_pylist()[0]
    return TrialReport(row["trial"], outcome, row["status"], tuple(row["reasons"]), row["n_grasps"])


def _unique(values: Iterable[T]) -> list[T]:
    return list(dict.fromkeys(values))
