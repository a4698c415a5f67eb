"""Static grasps given as 21 key points of a hand in the frame of an object.

Public hand-object data sets give a grasp as the places of the wrist and the 20 joints and tips. Contacts,
enclosing space and feature need these and the spheres' radii, which follow from the hand's size.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from graspdb_ingest.events import Hold
from graspdb_ingest.grasp_rows import Grasp, enclose
from graspdb_ingest.hand import HandDimensions
from graspdb_ingest.hand.dimensions import (
    BASE_JOINT_PROPORTIONS,
    PLAUSIBLE_HAND_LENGTH,
    SEGMENT_LENGTH_PER_HAND_LENGTH,
)
from graspdb_ingest.hand.model import Floats
from graspdb_ingest.parameters import IngestParameters
from graspdb_ingest.prepared_object import PreparedObject
from graspdb_ingest.rigid import fit_rigid
from graspdb_ingest.surface import HandPoints
from graspdb_ingest.surface.touch import PosedHand, pose_hand
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.vocabulary import FINGERS, KEY_POINTS, Side

STATIC: Final = Hold(
    first=0,
    last=0,
    released=False,
    lift_onset=None,
    put_down=None,
    snapshot=0,
    snapshot_kind="static",
)
"""The hold of a grasp that is known at one instant."""

_KNUCKLES: Final = tuple(KEY_POINTS.index(f"{finger}_mcp") for finger in FINGERS)


@dataclass(frozen=True, eq=False)
class KeyPointGrasp:
    """One static grasp.

    Attributes
    ----------
    session, name, subject : str
        Session, name of the trial in it (one for each grasp), and whose hand it is.
    side : Side
        The hand.
    key_points : ndarray, shape (21, 3)
        Wrist, then the 20 sites, in the object frame [m].
    dimensions : HandDimensions
        Size of the hand, from which the radii follow; `dimensions_of` estimates it.
    task, source_file, source_sha256 : str or None
        What was to be done, and the file that the grasp comes from.
    attributes : mapping
        Whatever else is known of it.

    Raises
    ------
    ParameterError
        If the key points are not 21 finite positions, or their unit cannot be the metre.
    """

    session: str
    name: str
    subject: str
    side: Side
    key_points: Floats
    dimensions: HandDimensions
    task: str | None = None
    source_file: str | None = None
    source_sha256: str | None = None
    attributes: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_key_points(self.key_points[None], self.trial)

    @property
    def trial(self) -> str:
        """Key of the trial."""
        return f"{self.session}/{self.name}"

    @property
    def sites(self) -> Floats:
        """Sphere centres in the object frame [m], shape (20, 3)."""
        return self.key_points[1:]


def check_key_points(key_points: Floats, name: str) -> None:
    """Raise ParameterError unless key points, shape (n, 21, 3), are finite and those of hands in metres."""
    if key_points.shape[1:] != (len(KEY_POINTS), 3):
        raise ParameterError(name, f"shape {key_points.shape[1:]}", "21 key points of 3 coordinates")
    if not np.isfinite(key_points).all():
        broken = KEY_POINTS[int(np.argmin(np.isfinite(key_points).all(axis=(0, 2))))]
        raise ParameterError(f"{name}.{broken}", "not a finite position", "21 finite positions [m]")
    lengths = hand_lengths(key_points)
    low, high = PLAUSIBLE_HAND_LENGTH
    odd = lengths[(lengths < low) | (lengths > high)]
    if len(odd):
        allowed = f"{low} to {high} m; are the key points in metres?"
        raise ParameterError(f"{name}: length of the hand", float(odd[0]), allowed)


def dimensions_of(key_points: Floats) -> HandDimensions:
    """Estimate the size of a hand from the key points of its grasps.

    Length is measured from the wrist along the middle finger, breadth along the row of knuckles, each over
    what it is in a hand of length or breadth one (`HandDimensions`); the median over the grasps counts.

    Parameters
    ----------
    key_points : ndarray, shape (n, 21, 3)
        Key points of one hand in any number of grasps, at least one [m].

    Raises
    ------
    ParameterError
        If the key points are not finite, or those of no hand in metres.
    """
    check_key_points(key_points, "key points")
    length = float(np.median(hand_lengths(key_points)))
    row = np.linalg.norm(key_points[:, _KNUCKLES[0]] - key_points[:, _KNUCKLES[-1]], axis=1)
    index, little = (np.array(BASE_JOINT_PROPORTIONS[finger]) for finger in (FINGERS[0], FINGERS[-1]))
    along, across = np.abs(index - little)[0] * length, float(np.linalg.norm((index - little)[1:]))
    breadth = float(np.median(np.sqrt(np.maximum(row**2 - along**2, 0.0)))) / across
    return HandDimensions(length, float(np.clip(breadth, 0.2 * length, 0.8 * length)))


def object_from_hand(key_points: Floats, dimensions: HandDimensions, side: Side) -> Floats:
    """Return the pose of the hand segment in the frame of the key points, shape (4, 4).

    It is that in which wrist and knuckles of the hand model lie nearest to their key points.

    Parameters
    ----------
    key_points : ndarray, shape (21, 3)
        Key points [m].
    dimensions : HandDimensions
        Size of the hand.
    side : Side
        The hand.
    """
    knuckles = [dimensions.base_joint(finger, side) for finger in FINGERS]
    palm = np.array([np.zeros(3), *knuckles])
    seen = np.asarray(key_points[[0, *_KNUCKLES]], dtype=np.float64)
    fit = fit_rigid(palm, seen[None], np.ones((1, len(palm))))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = fit.rotations[0], fit.positions[0]
    return matrix


def static_grasp(
    described: KeyPointGrasp, prepared: PreparedObject, parameters: IngestParameters
) -> tuple[Grasp, PosedHand]:
    """Return contacts, enclosing space and feature of a static grasp, and the hand with its gaps."""
    points = HandPoints(described.key_points[None], described.dimensions.radii, described.side)
    posed = pose_hand(points, parameters.contact.surface, prepared.distance).frame(0)
    rotation = object_from_hand(described.key_points, described.dimensions, described.side)[:3, :3]
    key = f"{described.trial}/{described.side}/0"
    return enclose(key, STATIC, posed, rotation, prepared, parameters), posed


def hand_lengths(key_points: Floats) -> Floats:
    """Return the hand length that the middle finger of each grasp says [m], shape (n,)."""
    first = KEY_POINTS.index("middle_mcp")
    chain = key_points[:, [0, *range(first, first + 4)]]
    seen = np.linalg.norm(np.diff(chain, axis=1), axis=2).sum(axis=1)
    expected = BASE_JOINT_PROPORTIONS["middle"][0] + sum(SEGMENT_LENGTH_PER_HAND_LENGTH["middle"])
    return np.asarray(seen / expected)
