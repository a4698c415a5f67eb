"""A subject's hands, measured once on a few clips of the data set before all of them are imported."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Final

import numpy as np

from graspdb_ingest.hand import HandDimensions
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.importers.base import Clip, ClipSource, Importer, ImportOptions
from graspdb_ingest.importers.fit import hand_from_key_points
from graspdb_ingest.importers.plausible import check_clip
from graspdb_ingest.keypoints import dimensions_of
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepare import PreparedHand
from graspdb_schemas.errors import GraspDBError
from graspdb_schemas.vocabulary import Side

CLIPS: Final = 6
"""Clips of a subject that its hands are measured on, spread evenly over those that there are."""
FRAMES: Final = 200
"""Frames of each clip and hand that the size is measured on."""


@dataclass(frozen=True, eq=False)
class SurveyedSubject:
    """A subject of a data set.

    Attributes
    ----------
    name : str
        Name of the subject.
    dimensions : HandDimensions or None
        Size of the hands, the same for both; None if no clip that was looked at shows one.
    sides : tuple of Side
        The hands that were seen.
    models : mapping of Side to PreparedHand
        Hand models calibrated on the key points, where they are to be fitted.
    problems : tuple of str
        Why a model cannot be had; clips of that hand are rejected.
    """

    name: str
    dimensions: HandDimensions | None
    sides: tuple[Side, ...]
    models: Mapping[Side, PreparedHand] = field(default_factory=dict)
    problems: tuple[str, ...] = ()


def survey(
    name: str,
    sources: Sequence[ClipSource],
    importer: Importer,
    options: ImportOptions,
    parameters: IngestParameters,
    fit: bool,
) -> SurveyedSubject:
    """Measure a subject's hands on some of its clips, and calibrate hand models on them if asked to.

    A clip that cannot be used is passed over; it is rejected when its turn comes.

    Parameters
    ----------
    name : str
        Name of the subject.
    sources : sequence of ClipSource
        All its clips.
    importer, options
        How they are read.
    parameters : IngestParameters
        Thresholds.
    fit : bool
        Whether hand models are needed.
    """
    chosen = np.unique(np.linspace(0, len(sources) - 1, CLIPS).astype(int))
    clips = list(_readable([sources[i] for i in chosen], importer, options))
    sides = tuple(side for side in Side if any(hand.side is side for clip in clips for hand in clip.hands))
    dimensions = _dimensions(clips)
    if not fit or dimensions is None:
        return SurveyedSubject(name, dimensions, sides)
    models: dict[Side, PreparedHand] = {}
    problems = []
    for side in sides:
        recordings = [(h.key_points, c.rate) for c in clips for h in c.hands if h.side is side]
        try:
            models[side] = hand_from_key_points(name, side, recordings, dimensions, parameters)
        except GraspDBError as error:
            problems.append(f"subject {name}, {side} hand: {error}")
    return SurveyedSubject(name, dimensions, sides, models, tuple(problems))


def _readable(sources: Sequence[ClipSource], importer: Importer, options: ImportOptions) -> Iterator[Clip]:
    for source in sources:
        try:
            yield check_clip(importer.read(source, options), source.files[0], options.units).clip
        except GraspDBError:
            continue


def _dimensions(clips: Sequence[Clip]) -> HandDimensions | None:
    """Return the size of the hands of some clips: what the data set says, or what the key points show."""
    said = [hand.dimensions for clip in clips for hand in clip.hands if hand.dimensions is not None]
    if said:
        length, breadth = median(d.hand_length for d in said), median(d.hand_breadth for d in said)
        return HandDimensions(length, breadth, said[0].joint_thickness)
    samples = [sample for clip in clips for hand in clip.hands if len(sample := _sample(hand.key_points))]
    return dimensions_of(np.concatenate(samples)) if samples else None


def _sample(key_points: Floats) -> Floats:
    known = key_points[np.isfinite(key_points).all(axis=(1, 2))]
    return np.asarray(known[:: max(1, len(known) // FRAMES)])
