"""What calibration may change in a hand: joint centres, digit directions, marker offsets, size.

All changes are linear parameters with a normal prior about the hand that anthropometry gives, so
that a parameter which the recording says nothing about stays where it was.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import MARKER_PREFIX, Floats, HandModel, HandShape
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import (
    DIGITS,
    JOINTS_OF_DIGIT,
    SEGMENT_OF_SITE,
    SEGMENTS,
    SEGMENTS_OF_DIGIT,
    SITES,
)

Indices = NDArray[np.intp]

SIZE_SD: Final = 0.05
"""Spread of the whole hand's size about the measured one [1]."""
LENGTH_SD: Final = 0.06
"""Spread of a single segment's length about its share of the hand [1]."""
BASE_JOINT_SD: Final = 0.004
"""Spread of a digit's first joint in the palm, each axis [m]."""
DIRECTION_SD: Final = {"thumb": np.deg2rad(12), **dict.fromkeys(DIGITS[1:], np.deg2rad(5))}
"""Spread of the direction of a digit's axes [rad]."""
PLACED_SD: Final = (0.002, 0.002, 0.001)
"""Spread of a marker about the place that the manifest gives [m]: a joint is felt through the skin to some
millimetres along and across the segment, but its depth under the marker is half a measured thickness."""
UNKNOWN_SD: Final = {"forearm": 0.06, "hand": 0.04}
UNKNOWN_DIGIT_SD: Final = 0.012
"""Spread of a marker that calibration has to find about the middle of its segment [m]."""


@dataclass(frozen=True)
class HandGeometry:
    """The parameters of a hand's shape and how markers move with them.

    They stand in this order: size (1), joint centres and tips (3 for each digit's first joint and 1,
    along the segment, for each further site), directions of the digits (3 each), offsets of the
    markers (3 each). A hand with segments of its own (a robot's) has only the marker offsets.

    Attributes
    ----------
    hand : HandModel
        The hand as it was, all parameters zero.
    placements : mapping of str to MarkerPlacement
        Where each marker sits.
    """

    hand: HandModel
    placements: Mapping[str, MarkerPlacement]

    @cached_property
    def anatomical(self) -> bool:
        """Whether the hand has the segments of a human hand, so that its bones may be scaled."""
        return self.hand.segments == SEGMENTS and not self.hand.foreign

    @cached_property
    def marker_sd(self) -> Floats:
        """Prior spread of each marker's place on its segment, each axis [m], shape (n_markers, 3)."""
        placed = (self.placements[label] for label in self.hand.markers)
        return np.array(
            [
                np.full(3, UNKNOWN_SD.get(p.segment, UNKNOWN_DIGIT_SD)) if p.calibrated else PLACED_SD
                for p in placed
            ]
        )

    @cached_property
    def prior_sd(self) -> Floats:
        """Prior spread of every parameter, shape (n_parameters,)."""
        offsets = self.marker_sd.ravel()
        if not self.anatomical:
            return offsets
        centres = [
            BASE_JOINT_SD if first else LENGTH_SD * length
            for first, length in zip(self._centre_is_first, self._centre_lengths, strict=True)
        ]
        directions = np.repeat([DIRECTION_SD[digit] for digit in DIGITS], 3)
        return np.concatenate([[SIZE_SD], centres, directions, offsets])

    @property
    def n_parameters(self) -> int:
        """Number of parameters."""
        return len(self.prior_sd)

    def apply(self, kinematics: Kinematics, parameters: Floats) -> None:
        """Give the workspace's hand the shape that the parameters say."""
        model, shape = kinematics.model, self.shape(parameters)
        for name, position in shape.body_positions.items():
            model.body(name).pos[:] = position
        for name, quaternion in shape.body_quaternions.items():
            model.body(name).quat[:] = quaternion
        for name, position in shape.site_positions.items():
            model.site(name).pos[:] = position

    def shape(self, parameters: Floats) -> HandShape:
        """Return the places of joints, sites and markers for given parameters."""
        model, offsets = self.hand.mujoco_model, parameters[-3 * len(self.hand.markers) :].reshape(-1, 3)
        sites, bodies, quaternions = {}, {}, {}
        if self.anatomical:
            sites = self._site_positions(parameters)
            for digit in DIGITS:
                for segment, joint in zip(SEGMENTS_OF_DIGIT[digit], JOINTS_OF_DIGIT[digit], strict=False):
                    bodies[segment] = sites[f"{digit}_{joint}"]
                first = SEGMENTS_OF_DIGIT[digit][0]
                turn = Rotation.from_rotvec(self._direction(parameters, digit))
                nominal = Rotation.from_quat(model.body(first).quat, scalar_first=True)
                quaternions[first] = (nominal * turn).as_quat(scalar_first=True)
        places = dict(sites)
        for label, offset in zip(self.hand.markers, offsets, strict=True):
            name = MARKER_PREFIX + label
            moved = np.array(model.site(name).pos) + offset
            at = self._follows(label)
            if at is not None and self.anatomical:
                moved += sites[at] - model.site(at).pos
            places[name] = moved
        return HandShape(body_positions=bodies, body_quaternions=quaternions, site_positions=places)

    def linearise(self, kinematics: Kinematics, parameters: Floats) -> "Linearisation | None":
        """Return what the derivatives of the markers need of a shape that the workspace's hand has.

        It is the same for all postures; None for a hand whose bones are not scaled.
        """
        if not self.anatomical:
            return None
        model = kinematics.model
        axes = np.empty((len(DIGITS), 3, 3))
        for d, (digit, body) in enumerate(zip(DIGITS, self._first_bodies, strict=True)):
            turned = Rotation.from_quat(model.body_quat[body], scalar_first=True)
            axes[d] = turned.as_matrix() @ _right_jacobian(self._direction(parameters, digit))
        places = np.array(list(self._site_positions(parameters).values())) / (1 + parameters[0])
        return Linearisation(
            scaled_centre_axes=self._centre_axes * (1 + parameters[0]), places=places, axes=axes
        )

    def jacobian(self, kinematics: Kinematics, shape: "Linearisation | None") -> Floats:
        """Return d(marker) / d(parameter) for the workspace's posture, shape (n_markers, 3, n_parameters).

        Parameters
        ----------
        kinematics : Kinematics
            The workspace, with the shape applied and the posture taken.
        shape : Linearisation or None
            What `linearise` made of the shape.
        """
        rotations, n_markers = kinematics.body_rotations, len(self.hand.markers)
        jacobian = np.zeros((n_markers, 3, self.n_parameters))
        offsets = jacobian[:, :, -3 * n_markers :].reshape(n_markers, 3, n_markers, 3)
        each = np.arange(n_markers)
        offsets[each, :, each] = rotations[self._marker_bodies]
        if shape is None:
            return jacobian
        n_centres = len(self._centre_axes)
        carriers = rotations[self._centre_carriers]
        columns = np.einsum("kij,kj->ki", carriers, shape.scaled_centre_axes)
        jacobian[:, :, 1 : 1 + n_centres] = self._moved_by_centre[:, None] * columns.T
        along = np.einsum("sij,sj->si", rotations[self._site_carriers], shape.places)
        jacobian[:, :, 0] = self._moved_by_site @ along
        on, digit = self._digit_markers
        arms = kinematics.markers[on] - kinematics.body_positions[self._first_bodies][digit]
        axes = rotations[self._first_parents] @ shape.axes
        turns = jacobian[:, :, 1 + n_centres : -3 * n_markers].reshape(n_markers, 3, len(DIGITS), 3)
        turns[on, :, digit] = _cross_matrix(-arms) @ axes[digit]
        return jacobian

    def length_sd(self, parameters: Floats, covariance: Floats) -> dict[str, float]:
        """Return the standard deviation of each digit segment's length [m], by segment.

        A segment ends at a site that lies on its axis, at (length + shift) (1 + size).

        Parameters
        ----------
        parameters : ndarray, shape (n_parameters,)
            The shape.
        covariance : ndarray, shape (n_parameters, n_parameters)
            Covariance of its error.
        """
        if not self.anatomical:
            return {}
        segments = iter(segment for digit in DIGITS for segment in SEGMENTS_OF_DIGIT[digit])
        deviations = {}
        for k, first in enumerate(self._centre_is_first):
            if first:
                continue
            slope = np.zeros(self.n_parameters)
            slope[0] = self._centre_lengths[k] + parameters[1 + k]
            slope[1 + k] = 1 + parameters[0]
            deviations[next(segments)] = float(np.sqrt(slope @ covariance @ slope))
        return deviations

    def _direction(self, parameters: Floats, digit: str) -> Floats:
        start = 1 + len(self._centre_axes) + 3 * DIGITS.index(digit)
        return parameters[start : start + 3]

    def _site_positions(self, parameters: Floats) -> dict[str, Floats]:
        shifts = parameters[1 : 1 + len(self._centre_axes), None] * self._centre_axes
        moved = np.array([self.hand.mujoco_model.site(site).pos for site in SITES])
        np.add.at(moved, self._centre_sites, shifts)
        return dict(zip(SITES, moved * (1 + parameters[0]), strict=True))

    def _follows(self, label: str) -> str | None:
        """Return the site that a marker keeps to when joint centres move."""
        placement = self.placements[label]
        at = placement.at
        return at if at is not None and placement.segment == SEGMENT_OF_SITE[at] else None

    @cached_property
    def _centre_sites(self) -> list[int]:
        return [i for i in range(len(SITES)) for _ in range(3 if i % 4 == 0 else 1)]

    @cached_property
    def _centre_is_first(self) -> list[bool]:
        return [site % 4 == 0 for site in self._centre_sites]

    @cached_property
    def _centre_axes(self) -> Floats:
        """Direction in the carrying segment of each centre parameter, shape (n_centres, 3)."""
        model = self.hand.mujoco_model
        axes: list[Floats] = []
        for i, site in enumerate(SITES):
            place = np.array(model.site(site).pos)
            axes.extend(np.eye(3) if i % 4 == 0 else [place / np.linalg.norm(place)])
        return np.array(axes)

    @cached_property
    def _centre_lengths(self) -> list[float]:
        model = self.hand.mujoco_model
        return [float(np.linalg.norm(model.site(SITES[i]).pos)) for i in self._centre_sites]

    @cached_property
    def _site_carriers(self) -> list[int]:
        return [int(self.hand.mujoco_model.body(SEGMENT_OF_SITE[site]).id) for site in SITES]

    @cached_property
    def _centre_carriers(self) -> list[int]:
        return [self._site_carriers[i] for i in self._centre_sites]

    @cached_property
    def _marker_bodies(self) -> list[int]:
        model = self.hand.mujoco_model
        return [int(model.site_bodyid[i]) for i in self.hand.marker_ids]

    @cached_property
    def _first_bodies(self) -> list[int]:
        return [int(self.hand.mujoco_model.body(SEGMENTS_OF_DIGIT[d][0]).id) for d in DIGITS]

    @cached_property
    def _first_parents(self) -> list[int]:
        return [int(self.hand.mujoco_model.body_parentid[body]) for body in self._first_bodies]

    @cached_property
    def _digit_markers(self) -> tuple[Indices, Indices]:
        """Markers that sit on a digit, and which digit that is."""
        segments = (self.placements[label].segment for label in self.hand.markers)
        on_digit = np.array([[s in SEGMENTS_OF_DIGIT[d] for d in DIGITS] for s in segments])
        markers, digits = np.nonzero(on_digit)
        return markers, digits

    @cached_property
    def _moved_by_site(self) -> Floats:
        """1 where a marker moves when a site does, shape (n_markers, 20)."""
        moves = np.zeros((len(self.hand.markers), len(SITES)))
        for row, label in zip(moves, self.hand.markers, strict=True):
            segment = self.placements[label].segment
            for d, digit in enumerate(DIGITS):
                if segment in SEGMENTS_OF_DIGIT[digit]:
                    row[4 * d : 4 * d + SEGMENTS_OF_DIGIT[digit].index(segment) + 1] = 1
            at = self._follows(label)
            if at is not None:
                row[SITES.index(at)] = 1
        return moves

    @cached_property
    def _moved_by_centre(self) -> Floats:
        return self._moved_by_site[:, self._centre_sites]


@dataclass(frozen=True)
class Linearisation:
    """A shape as the derivatives of the markers need it, the same for all postures.

    Attributes
    ----------
    scaled_centre_axes : ndarray, shape (n_centres, 3)
        Way of a site for each unit of its parameter, in the carrying segment.
    places : ndarray, shape (20, 3)
        Sites in their carrying segments, for a hand of size 1 [m].
    axes : ndarray, shape (5, 3, 3)
        Columns: the axes that the parameters of a digit's direction turn it about, in its parent's frame.
    """

    scaled_centre_axes: Floats
    places: Floats
    axes: Floats


def _cross_matrix(vectors: Floats) -> Floats:
    """Return the matrices of v x, shape (n, 3, 3), of vectors (n, 3)."""
    matrices = np.zeros((len(vectors), 3, 3))
    matrices[:, [2, 0, 1], [1, 2, 0]] = vectors
    matrices[:, [1, 2, 0], [2, 0, 1]] = -vectors
    return matrices


def _right_jacobian(vector: Floats) -> Floats:
    """Return the right Jacobian of the rotation vector, which turns its change into one about own axes."""
    angle = float(np.linalg.norm(vector))
    skew: Floats = _cross_matrix(vector[None])[0]
    squared: Floats = skew @ skew
    if angle < 1e-6:
        return np.eye(3) - skew / 2
    first, second = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    jacobian: Floats = np.eye(3) - first * skew + second * squared
    return jacobian
