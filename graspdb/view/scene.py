"""What there is to see of a grasp, as data: nothing here draws."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb.grasp import Grasp
from graspdb_ingest.rigid import rotations_from_quaternions
from graspdb_schemas.vocabulary import DIGITS, N_SITES, SEGMENTS_OF_DIGIT, SITES

Floats = NDArray[np.float64]
Integers = NDArray[np.int32]
Bools = NDArray[np.bool_]

NODES: Final = (*SITES, "wrist", "elbow")
"""The places between which segments are drawn; the elbow stands for the forearm's direction alone."""

WRIST: Final = N_SITES
ELBOW: Final = N_SITES + 1

CAPSULE_SHARE: Final = 0.85
"""Radius of a drawn segment over those of its ends, so that the spheres of the sites stand out."""

FOREARM_DRAWN: Final = 0.12
"""Length of forearm that is drawn [m]."""


@dataclass(frozen=True)
class Segment:
    """A piece of the hand, drawn as a capsule.

    Attributes
    ----------
    name : str
        The segment, such as ``index_proximal``; the palm is several pieces of the segment ``hand``.
    start, end : int
        Its ends, as indices of `NODES`.
    """

    name: str
    start: int
    end: int


def _segments() -> tuple[Segment, ...]:
    palm = [Segment("hand", WRIST, 4 * i) for i in range(len(DIGITS))]
    # Across the knuckles, so that the palm is one piece.
    palm += [Segment("hand", 4 * i, 4 * (i + 1)) for i in range(1, len(DIGITS) - 1)]
    digits = [
        Segment(name, 4 * i + k, 4 * i + k + 1)
        for i, digit in enumerate(DIGITS)
        for k, name in enumerate(SEGMENTS_OF_DIGIT[digit])
    ]
    return (Segment("forearm", ELBOW, WRIST), *palm, *digits)


SEGMENTS_DRAWN: Final = _segments()
"""The capsules of a hand, in the order in which they are drawn."""


@dataclass(frozen=True, eq=False)
class ObjectSurface:
    """The surface of an object: the points of its cloud, and triangles between them to draw.

    Attributes
    ----------
    points, normals : ndarray, shape (n, 3)
        Points [m] and outward unit normals, object frame; the index is the point's in the cloud.
    areas : ndarray, shape (n,)
        Surface that each point stands for [m2].
    faces : ndarray of int, shape (m, 3)
        Triangles as indices of points, outward. They close what the cloud shows, and may leave seams.
    """

    points: Floats
    normals: Floats
    areas: Floats
    faces: Integers


@dataclass(frozen=True, eq=False)
class ContactMap:
    """How near the hand is to the points of the object.

    Attributes
    ----------
    points : ndarray of int, shape (n,)
        Points near the hand.
    gaps : ndarray, shape (n,)
        Signed distance of each to the hand's surface [m].
    surface : str
        Surface of the hand: spheres, capsules or skin.
    """

    points: Integers
    gaps: Floats
    surface: str


@dataclass(frozen=True)
class Phase:
    """A part of a trial.

    Attributes
    ----------
    name : str
        reach, contact, lift, hold or release.
    start, end : float
        Times [s].
    """

    name: str
    start: float
    end: float


@dataclass(frozen=True, eq=False)
class Motion:
    """Hand and object over a trial, or its part between two other grasps; lab frame, NaN where not known.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Times of the frames [s].
    nodes : ndarray, shape (n, 22, 3)
        `NODES` [m].
    object_position, object_quaternion : ndarray, shapes (n, 3) and (n, 4)
        world_from_object [m]; quaternions w x y z of continuous sign.
    gap : ndarray, shape (n, 20)
        Signed distance of each site to the object [m].
    touching : ndarray of bool, shape (n, 20)
        Whether each site touches; False where that is not known.
    snapshot : int
        Index of the frame of the grasp's snapshot.
    phases : tuple of Phase
        Parts of that time, in order.
    """

    times: Floats
    nodes: Floats
    object_position: Floats
    object_quaternion: Floats
    gap: Floats
    touching: Bools
    snapshot: int
    phases: tuple[Phase, ...]


@dataclass(frozen=True, eq=False)
class Scene:
    """A grasp and all that is seen with it; object frame at the snapshot, SI units.

    Attributes
    ----------
    grasp : Grasp
        The grasp: sites, contacts with normals, enclosing space, feature.
    task : str or None
        Task of the trial.
    repetition : int or None
        Its repetition.
    grasp_type : str or None
        Type of the GRASP taxonomy.
    threshold : float or None
        h of equation 3 [m].
    surface : ObjectSurface
        The object.
    nodes : ndarray, shape (22, 3)
        The hand at the snapshot: `NODES` [m]; NaN where a place is not known.
    radii : ndarray, shape (22,)
        Radii of the spheres, of the wrist and of the forearm [m].
    contact_map : ContactMap or None
        Gaps of the object's points; None where none are stored.
    up : ndarray, shape (3,)
        Vertical of the lab at the snapshot, object frame; the object's z axis where it is not known.
    motion : Motion or None
        The trial's frames; None where the grasp is one instant alone.
    """

    grasp: Grasp
    task: str | None
    repetition: int | None
    grasp_type: str | None
    threshold: float | None
    surface: ObjectSurface
    nodes: Floats
    radii: Floats
    contact_map: ContactMap | None
    up: Floats
    motion: Motion | None

    @property
    def touching(self) -> Bools:
        """Whether each site touches at the snapshot, shape (20,)."""
        return np.isin(np.array(SITES), self.grasp.contact_sites)

    @property
    def world_from_object(self) -> Floats:
        """Pose of the object at the snapshot, shape (4, 4); the identity where it is not known."""
        pose = np.eye(4)
        if self.motion is not None:
            at = self.motion.snapshot
            rotation = rotations_from_quaternions(self.motion.object_quaternion[at : at + 1])[0]
            position = self.motion.object_position[at]
            if np.isfinite(rotation).all() and np.isfinite(position).all():
                pose[:3, :3], pose[:3, 3] = rotation, position
        return pose

    @property
    def feature(self) -> Integers:
        """Indices of the surface's points that are in the graspable feature, shape (k,)."""
        points = self.grasp.feature_points
        return points[points < len(self.surface.points)]

    def capsules(self) -> tuple[tuple[Segment, Floats, Floats, float, float], ...]:
        """Return each segment that is known at the snapshot: its ends [m] and the radii there [m]."""
        return tuple(
            (s, self.nodes[s.start], self.nodes[s.end], *(CAPSULE_SHARE * self.radii[[s.start, s.end]]))
            for s in SEGMENTS_DRAWN
            if np.isfinite(self.nodes[[s.start, s.end]]).all()
        )
