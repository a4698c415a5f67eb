"""A subject's hand before calibration: from its measures, or from the model that the subject brings."""

from pathlib import Path

from graspdb_ingest.hand.dimensions import HandDimensions
from graspdb_ingest.hand.foreign import HandFile, hand_files, load_hand
from graspdb_ingest.hand.mjcf import build_hand
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.manifest import Session, Subject
from graspdb_schemas.vocabulary import Side


def model_files(subject: Subject) -> tuple[Path, ...]:
    """Return the files that a subject's own hand models are made of, includes among them."""
    return tuple(file for model in subject.models.values() for file in hand_files(model))


def subject_hand(session: Session, subject: Subject, side: Side) -> HandFile:
    """Return a subject's hand before calibration: from its model, or from its measures.

    Raises
    ------
    HandFileError
        If the model's file cannot be used.
    ParameterError
        If the measures are no hand's.
    """
    if subject.models:
        mirrored = side not in subject.models
        file = next(iter(subject.models.values())) if mirrored else subject.models[side]
        return load_hand(file, side, session.markers, mirrored)
    if subject.hand_length is None or subject.hand_breadth is None:
        raise ParameterError("hand_length", subject.hand_length, "a length, or a model")
    dimensions = HandDimensions(subject.hand_length, subject.hand_breadth, subject.joint_thickness)
    return HandFile(build_hand(dimensions, side, session.markers), session.markers)
