"""All chosen frames together: one shape of the hand, a posture for each frame (bundle adjustment).

The model is a hierarchy of normal distributions. Markers lie about their places on the hand with
a t distribution, so that a wrong label or a jump loses its weight (Lange, Little and Taylor 1989);
postures and shape have normal priors. Each marker's own standard deviation is estimated from the fit.
The postures are eliminated frame by frame with the Schur complement, so the cost grows linearly
with the frames. A joint that rests against a limit is held there for a step (Bertsekas 1982, projected Newton
methods): else the others would move as if it gave way.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.model import Bools, Floats
from graspdb_ingest.hand.posture import PosturePrior
from graspdb_ingest.tracking.fit import FREE, SEVEN, visible
from graspdb_ingest.tracking.geometry import HandGeometry

FREEDOM: Final = 4.0
"""Degrees of freedom of the markers' t distribution."""
ALIKE: Final = 10.0
"""Frames that one standard deviation for all markers is worth in the estimate of each one's own."""
STEPS: Final = 80
"""Least-squares steps at the most."""


@dataclass(frozen=True)
class BundleFit:
    """A shape, and a posture for each frame.

    Attributes
    ----------
    parameters : ndarray, shape (n_parameters,)
        Shape of the hand, as `HandGeometry` orders it.
    covariance : ndarray, shape (n_parameters, n_parameters)
        Covariance of their error.
    postures : tuple of ndarray, each of shape (n_q,)
        Configurations.
    residuals : ndarray, shape (n_frames, n_markers, 3)
        Observed minus model [m], NaN where not seen.
    marker_sd : ndarray, shape (n_markers,)
        Standard deviation of each marker about its place, each axis [m].
    """

    parameters: Floats
    covariance: Floats
    postures: tuple[Floats, ...]
    residuals: Floats
    marker_sd: Floats


@dataclass(frozen=True)
class Bundle:
    """The least-squares problem.

    Attributes
    ----------
    geometry : HandGeometry
        What may change in the hand.
    frames : ndarray, shape (n_frames, n_markers, 3)
        Marker positions [m], NaN where not seen.
    prior : PosturePrior
        Where joints usually are.
    marker_sd : float
        Usual standard deviation of a marker [m].
    """

    geometry: HandGeometry
    frames: Floats
    prior: PosturePrior
    marker_sd: float
    kinematics: Kinematics = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "kinematics", Kinematics(self.geometry.hand))

    @cached_property
    def _seen(self) -> Bools:
        return visible(self.frames)

    def solve(self, parameters: Floats, postures: Sequence[Floats]) -> BundleFit:
        """Return the fit, from a first guess of the shape and of the postures."""
        marker_sd = np.full(self.frames.shape[1], self.marker_sd)
        state = _State(parameters, tuple(postures), marker_sd)
        # Spreads are told last: weights that follow them while the shape is fitted let each frame's own
        # posture take up what the shape should explain, and the shape goes wrong.
        state = self._spreads(self._descend(state))
        normal = self._eliminate(state, damping=0.0).normal
        residuals = self._residuals(state.parameters, state.postures)
        return BundleFit(state.parameters, np.linalg.inv(normal), state.postures, residuals, state.marker_sd)

    def _residuals(self, parameters: Floats, postures: Sequence[Floats]) -> Floats:
        """Observed minus model [m], shape (n_frames, n_markers, 3)."""
        self.geometry.apply(self.kinematics, parameters)
        model = np.empty_like(self.frames)
        for i, q in enumerate(postures):
            self.kinematics.move(q)
            model[i] = self.kinematics.markers
        return np.asarray(self.frames - model)

    def _cost(self, state: "_State") -> float:
        """Return minus the logarithm of the posterior, but for constants."""
        residuals = self._residuals(state.parameters, state.postures)
        squared = np.sum(residuals**2, axis=2) / state.marker_sd**2
        robust = (FREEDOM + 3) * np.log1p(np.where(self._seen, squared, 0) / FREEDOM)
        angles = np.array([q[SEVEN:] for q in state.postures]) - self.prior.mean
        posture = np.sum(angles * np.linalg.solve(self.prior.covariance, angles.T).T)
        shape = np.sum((state.parameters / self.geometry.prior_sd) ** 2)
        return float(robust.sum() + posture + shape) / 2

    def _descend(self, state: "_State") -> "_State":
        """Levenberg-Marquardt over shape and postures, spreads fixed."""
        damping, cost, refused = 1e-4, self._cost(state), False
        for _ in range(STEPS):
            eliminated = self._eliminate(state, damping)
            trial = self._moved(state, *eliminated.steps())
            new_cost = self._cost(trial)
            if new_cost < cost:
                gained, state, cost = cost - new_cost, trial, new_cost
                if gained < 1e-6 * cost:
                    break
                # What has just been too little is not tried again at once.
                damping, refused = damping if refused else damping / 10, False
            else:
                damping, refused = max(10 * damping, 1e-6), True
        return state

    def _moved(self, state: "_State", change: Floats, steps: Sequence[Floats]) -> "_State":
        hand = self.kinematics.hand
        postures = []
        for q, step in zip(state.postures, steps, strict=True):
            moved = hand.integrate(q, step)
            moved[SEVEN:] = np.clip(moved[SEVEN:], *hand.joint_range.T)
            postures.append(moved)
        return _State(state.parameters + change, tuple(postures), state.marker_sd)

    def _weights(self, residual: Floats, marker_sd: Floats) -> Floats:
        """Return the t distribution's weight of each marker, shape (n_markers,)."""
        squared = np.sum(residual**2, axis=1) / marker_sd**2
        return np.asarray((FREEDOM + 3) / (FREEDOM + squared))

    def _eliminate(self, state: "_State", damping: float) -> "_Eliminated":
        """Return the damped normal equations of the shape, postures eliminated frame by frame."""
        precision = np.linalg.inv(self.prior.covariance)
        prior = 1 / self.geometry.prior_sd**2
        normal, gradient = np.diag(prior), -state.parameters * prior
        self.geometry.apply(self.kinematics, state.parameters)
        geometry, solved_of_frame = self.geometry, []
        shape = geometry.linearise(self.kinematics, state.parameters)
        for frame, seen, q in zip(self.frames, self._seen, state.postures, strict=True):
            self.kinematics.move(q)
            residual = (frame - self.kinematics.markers)[seen]
            sd = state.marker_sd[seen]
            scale = (np.sqrt(self._weights(residual, sd)) / sd)[:, None]
            rows = (scale * residual).ravel()
            by_q = (scale[..., None] * self.kinematics.marker_jacobian()[seen]).reshape(len(rows), -1)
            by_shape = geometry.jacobian(self.kinematics, shape)[seen]
            by_shape = (scale[..., None] * by_shape).reshape(len(rows), -1)
            own = by_q.T @ by_q
            own[FREE:, FREE:] += precision
            pull = by_q.T @ rows
            pull[FREE:] -= precision @ (q[SEVEN:] - self.prior.mean)
            own[np.diag_indices_from(own)] *= 1 + damping
            cross = by_q.T @ by_shape
            held = self._held(q, pull)
            own[held], own[:, held], cross[held], pull[held] = 0, 0, 0, 0
            own[held, held] = 1
            solved = np.linalg.solve(own, np.column_stack([cross, pull]))
            normal += by_shape.T @ by_shape - cross.T @ solved[:, :-1]
            gradient += by_shape.T @ rows - cross.T @ solved[:, -1]
            solved_of_frame.append(solved)
        normal += damping * np.diag(prior)
        return _Eliminated(normal, gradient, tuple(solved_of_frame))

    def _held(self, q: Floats, pull: Floats) -> NDArray[np.int64]:
        """Return the degrees of freedom whose joint is at a limit and pulled beyond it."""
        lowest, highest = self.kinematics.hand.joint_range.T
        angles, hinges = q[SEVEN:], pull[FREE:]
        return FREE + np.flatnonzero(
            ((angles >= highest) & (hinges > 0)) | ((angles <= lowest) & (hinges < 0))
        )

    def _spreads(self, state: "_State") -> "_State":
        """Estimate the markers' standard deviations, each drawn to that of all of them."""
        precision = np.linalg.inv(self.prior.covariance)
        n_dof = self.kinematics.hand.n_dof
        squared, counts = np.zeros(len(state.marker_sd)), np.zeros(len(state.marker_sd))
        self.geometry.apply(self.kinematics, state.parameters)
        for frame, seen, q in zip(self.frames, self._seen, state.postures, strict=True):
            self.kinematics.move(q)
            residual = (frame - self.kinematics.markers)[seen]
            jacobian = self.kinematics.marker_jacobian()[seen]
            sd = state.marker_sd[seen]
            rows = (jacobian * (np.sqrt(self._weights(residual, sd)) / sd)[:, None, None]).reshape(-1, n_dof)
            normal = rows.T @ rows
            normal[FREE:, FREE:] += precision
            covariance = np.linalg.inv(normal)
            expected = np.sum(residual**2, axis=1) + np.einsum(
                "mij,jk,mik->m", jacobian, covariance, jacobian, optimize=True
            )
            weights = (FREEDOM + 3) / (FREEDOM + expected / sd**2)
            squared[seen] += weights * expected / 3
            counts[seen] += 1
        common = (ALIKE * self.marker_sd**2 + squared.sum()) / (ALIKE + counts.sum())
        variance = (ALIKE * common + squared) / (ALIKE + counts)
        return _State(state.parameters, state.postures, np.sqrt(variance))


@dataclass(frozen=True)
class _State:
    """Everything that is estimated."""

    parameters: Floats
    postures: tuple[Floats, ...]
    marker_sd: Floats


@dataclass(frozen=True)
class _Eliminated:
    """Normal equations of the shape, and what gives each frame's step once the shape's is known."""

    normal: Floats
    gradient: Floats
    solved: tuple[Floats, ...]

    def steps(self) -> tuple[Floats, list[Floats]]:
        """Return the steps of the shape and of each posture."""
        change = np.linalg.solve(self.normal, self.gradient)
        return change, [part[:, -1] - part[:, :-1] @ change for part in self.solved]
