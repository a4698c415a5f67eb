"""What trials stand on, prepared once and shared with the workers: the session's hands and objects.

What computes is imported by whoever computes. So workers start while the process that asks them has loaded
little, and an ingest that finds all trials unchanged ends without.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from graspdb.engines import Engine, EngineError, Shared
from graspdb_ingest.one_thread import one_thread
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import GraspDBError
from graspdb_schemas.manifest import Session, SessionTrial
from graspdb_schemas.vocabulary import Side

if TYPE_CHECKING:
    from graspdb_ingest.pipeline import Context
    from graspdb_ingest.prepare import PreparedHand
    from graspdb_ingest.prepared_object import PreparedObject

T = TypeVar("T")
Hand = tuple[str, Side]


@dataclass(frozen=True)
class Part(Generic[T]):
    """A hand or an object: shared with the workers, or why it cannot be had.

    Attributes
    ----------
    shared : Shared or None
        The prepared hand or object.
    problem : str or None
        Why there is none; its trials are rejected for it.
    """

    shared: Shared[T] | None
    problem: str | None = None


@dataclass(frozen=True)
class TrialParts:
    """The parts that one trial stands on."""

    hands: Mapping[Side, Part["PreparedHand"]]
    object: "Part[PreparedObject] | None"

    def load(self, inputs: Mapping[str, str]) -> "Context":
        """Return them as the pipeline takes them."""
        from graspdb_ingest.pipeline import Context

        problems = [hand.problem for hand in self.hands.values()]
        if self.object is not None:
            problems.append(self.object.problem)
        loaded = None if self.object is None or self.object.shared is None else self.object.shared.load()
        return Context(
            hands={s: hand.shared.load() for s, hand in self.hands.items() if hand.shared is not None},
            object=loaded,
            problems=tuple(problem for problem in problems if problem is not None),
            inputs=inputs,
        )


@dataclass(frozen=True)
class Parts:
    """All hands and objects of the trials to do.

    Attributes
    ----------
    hands : mapping of (subject, Side) to Part
        The calibrated hands.
    objects : mapping of str to Part
        The objects that have a mesh or cloud.
    """

    hands: Mapping[Hand, Part["PreparedHand"]]
    objects: Mapping[str, Part["PreparedObject"]]

    def of(self, session: Session, trial: SessionTrial) -> TrialParts:
        """Return those of one trial."""
        hands = {side: self.hands[trial.subject, side] for side in session.sides_of(trial)}
        return TrialParts(hands, None if trial.object is None else self.objects.get(trial.object))

    def good_hands(self) -> "list[PreparedHand]":
        """Return the hands that could be prepared."""
        return [part.shared.load() for part in self.hands.values() if part.shared is not None]

    def good_object(self, name: str) -> "list[PreparedObject]":
        """Return an object, or nothing where there is no such or it could not be prepared."""
        part = self.objects.get(name)
        return [] if part is None or part.shared is None else [part.shared.load()]


def prepare_parts(
    engine: Engine, session: Session, todo: Sequence[SessionTrial], parameters: IngestParameters
) -> Parts:
    """Prepare each hand and object that trials need, once; a failure rejects just those trials."""
    hands = _unique((t.subject, side) for t in todo for side in session.sides_of(t))
    names = _unique(trial.object for trial in todo)
    objects = [name for name in names if name is not None and session.objects[name].mesh is not None]
    shared = engine.share((session, parameters))
    prepared = {
        key: Part[object](None, value) if isinstance(value, str) else Part[object](engine.share(value))
        for done in engine.run(_prepare, ((shared, key) for key in [*hands, *objects]))
        for key, value in done
    }
    return Parts(
        hands={hand: prepared[hand] for hand in hands},  # type: ignore[misc]
        objects={name: prepared[name] for name in objects},  # type: ignore[misc]
    )


def _prepare(
    shared: Shared[tuple[Session, IngestParameters]], key: Hand | str
) -> "tuple[Hand | str, PreparedHand | PreparedObject | str]":
    """Prepare a hand or an object, in whatever process this is; or say why it cannot be had."""
    from graspdb_ingest.prepare import prepare_hand
    from graspdb_ingest.prepared_object import prepare_object

    session, parameters = shared.load()
    _check_files(session)
    with one_thread():
        if isinstance(key, str):
            try:
                return key, prepare_object(session.objects[key], parameters)
            except GraspDBError as error:
                return key, f"object {key}: {error}"
        subject, side = key
        try:
            return key, prepare_hand(session, session.subjects[subject], side, parameters.tracking)
        except GraspDBError as error:
            return key, f"subject {subject}, {side} hand: {error}"


@dataclass(frozen=True)
class Processed:
    """Rows of a trial, and its object."""

    object: str | None
    rows: TrialTables

    def size(self) -> int:
        """Return the bytes of its rows."""
        return sum(table.nbytes for table in self.rows.tables.values())


def process_prepared(
    shared: Shared[tuple[Session, IngestParameters]],
    trial: SessionTrial,
    parts: TrialParts,
    inputs: Mapping[str, str],
) -> Processed:
    """Turn one trial into rows, in whatever process this is."""
    from graspdb_ingest.pipeline import process_trial

    session, parameters = shared.load()
    _check_files(session)
    with one_thread():
        rows = process_trial(session, trial, parts.load(inputs), parameters)
    return Processed(trial.object, rows)


def _check_files(session: Session) -> None:
    """Raise where this machine does not see the session, before every trial is rejected for it."""
    if not session.path.is_file():
        raise EngineError(
            f"a worker does not find the session at {session.path}",
            "Put it where every machine of the cluster finds it at the same path.",
        )


def _unique(values: Iterable[T]) -> list[T]:
    return list(dict.fromkeys(values))
