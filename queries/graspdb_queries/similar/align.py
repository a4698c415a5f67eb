"""Aligning parts of objects: many starts for many candidates at once, then iterated closest points.

Starts are the four proper turns of the principal axes onto each other, up to three agreements of point
histograms, and the hand's frame. Agreements come from a graph of correspondences, two of which are joined
where they keep the distance of their points, and weighed by how many neighbours they share (second-order
compatibility; Chen et al. 2022, CVPR, 13221). Nothing is drawn at random.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspdb_queries.similar.part import Part

Floats = NDArray[np.float64]

ITERATIONS: Final = (4, 10)
"""Steps of all starts, then of the best ones."""

KEPT_STARTS: Final = 2
AGREEMENTS: Final = 3

AGREEMENT: Final = 0.004
"""Largest difference of two distances between points that corresponding points keep [m]."""

TRIMMED: Final = 0.7
"""Share of the points, those nearest to the other part, that an alignment is fitted and judged by."""

CHUNK: Final = 20
"""Candidates aligned together; fixed, so that an answer does not depend on who computes beside it."""

_TURNS: Final = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Poses:
    """Rigid transforms candidate_from_query.

    Attributes
    ----------
    rotations : ndarray, shape (..., 3, 3)
        Rotations.
    positions : ndarray, shape (..., 3)
        Places of the query's origin in the frame of the candidate [m].
    """

    rotations: Floats
    positions: Floats

    def matrices(self) -> Floats:
        """Return homogeneous matrices, shape (..., 4, 4)."""
        matrices = np.zeros((*self.positions.shape[:-1], 4, 4))
        matrices[..., :3, :3], matrices[..., :3, 3] = self.rotations, self.positions
        matrices[..., 3, 3] = 1.0
        return matrices


def align(query: Part, candidates: Sequence[Part]) -> Poses:
    """Return how each candidate is best laid over by the query, any pose allowed, shapes (n, 3, 3), (n, 3).

    Parameters
    ----------
    query : Part
        What is moved.
    candidates : sequence of Part
        What it is moved onto, at most `CHUNK` at a time.
    """
    refined, cost = aligned(query, candidates)
    rows, chosen = np.arange(len(candidates)), np.argmin(cost, axis=1)
    return Poses(refined.rotations[rows, chosen], refined.positions[rows, chosen])


def aligned(query: Part, candidates: Sequence[Part]) -> tuple[Poses, Floats]:
    """Return the `KEPT_STARTS` best poses of `align`, shapes (n, s, 3, 3), (n, s, 3), and their costs."""
    source = query.sparse.points
    targets = np.stack([candidate.dense.points for candidate in candidates])
    starts = _starts(query, candidates)
    moved, cost = _closest_points(source, targets, starts, ITERATIONS[0])
    best = np.argsort(cost, axis=1, kind="stable")[:, :KEPT_STARTS]
    rows = np.arange(len(candidates))[:, None]
    kept = Poses(moved.rotations[rows, best], moved.positions[rows, best])
    return _closest_points(query.dense.points, targets, kept, ITERATIONS[1])


def held_poses(query: Part, candidates: Sequence[Part]) -> Poses:
    """Return the transforms that lay the query's hand onto each candidate's, shapes (n, 3, 3), (n, 3)."""
    turned = query.object_from_hand[:3, :3].T
    hands = np.stack([candidate.object_from_hand for candidate in candidates])
    rotations = hands[:, :3, :3] @ turned
    positions = hands[:, :3, 3] - rotations @ query.object_from_hand[:3, 3]
    return Poses(rotations, positions)


def _starts(query: Part, candidates: Sequence[Part]) -> Poses:
    """Return all starts, shapes (n, s, 3, 3) and (n, s, 3)."""
    parts = [_principal(query, candidates), _agreeing(query, candidates)]
    if query.has_hand and all(candidate.has_hand for candidate in candidates):
        held = held_poses(query, candidates)
        parts.append(Poses(held.rotations[:, None], held.positions[:, None]))
    return Poses(
        np.concatenate([part.rotations for part in parts], axis=1),
        np.concatenate([part.positions for part in parts], axis=1),
    )


def _principal(query: Part, candidates: Sequence[Part]) -> Poses:
    """Return the four turns of the query's principal axes onto each candidate's."""
    axes = np.stack([candidate.axes for candidate in candidates])
    centres = np.stack([candidate.centre for candidate in candidates])
    rotations = np.einsum("nij,sj,kj->nsik", axes, _TURNS, query.axes)
    return Poses(rotations, centres[:, None] - rotations @ query.centre)


def _agreeing(query: Part, candidates: Sequence[Part]) -> Poses:
    """Return the transforms of the correspondences of histograms that agree best."""
    source, sketch = query.sparse.points, query.sparse.histograms
    targets = np.stack([candidate.dense.points for candidate in candidates])
    sketches = np.stack([candidate.dense.histograms for candidate in candidates])
    likeness = 2 * sketch @ sketches.transpose(0, 2, 1) - np.sum(sketches**2, axis=2)[:, None]
    found = np.take_along_axis(targets, likeness.argmax(axis=2)[..., None], axis=1)
    apart = _distances(source, source)
    found_apart = np.sqrt(_squared(found, found))
    compatible = np.maximum(1 - ((apart - found_apart) / AGREEMENT) ** 2, 0.0)
    # A pair of points that lie close to each other keeps its distance in any case, and says nothing.
    compatible[:, apart < 2 * AGREEMENT] *= 0.25
    support = compatible * (compatible @ compatible)
    seeds = np.argsort(-support.sum(axis=2), axis=1, kind="stable")[:, ::3][:, :AGREEMENTS]
    weights = np.take_along_axis(support, seeds[..., None], axis=1)
    weights += 1e-9 * weights.max(axis=2, keepdims=True) + 1e-12
    return _rigid(source, found[:, None], weights)


def _closest_points(source: Floats, targets: Floats, poses: Poses, steps: int) -> tuple[Poses, Floats]:
    """Iterate closest points both ways, the furthest left out; return the poses and their costs.

    Parameters
    ----------
    source : ndarray, shape (m, 3)
        Points of the query [m].
    targets : ndarray, shape (n, k, 3)
        Points of the candidates [m].
    poses : Poses
        Starts, shapes (n, s, 3, 3) and (n, s, 3).
    steps : int
        Number of iterations.

    Returns
    -------
    tuple of Poses and ndarray of shape (n, s)
        The poses, and the mean squared distance of the points kept [m2].
    """
    n, k = targets.shape[:2]
    m, n_starts = len(source), poses.positions.shape[1]
    centres = targets.mean(axis=1)
    right = _right_factor(targets - centres[:, None])
    rows = np.arange(n)[:, None, None]
    for step in range(steps + 1):
        moved = source @ poses.rotations.swapaxes(-1, -2) + poses.positions[..., None, :]
        left = _left_factor((moved - centres[:, None, None]).reshape(n, -1, 3))
        squared = (left @ right).reshape(n, n_starts, m, k)
        to_target, to_source = squared.argmin(axis=3), squared.argmin(axis=2)
        near, far = squared.min(axis=3), squared.min(axis=2)
        forth, back = _nearest_share(near), _nearest_share(far)
        if step == steps:
            break
        sources = np.concatenate([np.broadcast_to(source, moved.shape), source[to_source]], axis=2)
        onto = np.broadcast_to(targets[:, None], (n, n_starts, k, 3))
        found = np.concatenate([targets[rows, to_target], onto], axis=2)
        poses = _rigid(sources, found, np.concatenate([forth / m, back / k], axis=2))
    cost = (near * forth).sum(axis=2) / forth.sum(axis=2) + (far * back).sum(axis=2) / back.sum(axis=2)
    return poses, np.asarray(cost, dtype=np.float64)


def _left_factor(points: Floats) -> NDArray[np.float32]:
    """Return what makes, multiplied by `_right_factor`, squared distances, shape (..., m, 5)."""
    squares = (points**2).sum(axis=-1, keepdims=True)
    return np.concatenate([-2 * points, squares, np.ones_like(squares)], axis=-1).astype(np.float32)


def _right_factor(points: Floats) -> NDArray[np.float32]:
    """Return the other factor, shape (..., 5, k)."""
    squares = (points**2).sum(axis=-1, keepdims=True)
    factor = np.concatenate([points, np.ones_like(squares), squares], axis=-1).astype(np.float32)
    return np.ascontiguousarray(factor.swapaxes(-1, -2))


def _nearest_share(squared: NDArray[np.float32]) -> Floats:
    """Return weights, one for the nearest share of the points and zero for the others."""
    last = int(np.ceil(TRIMMED * squared.shape[-1])) - 1
    limit = np.partition(squared, last, axis=-1)[..., last : last + 1]
    return (squared <= limit).astype(np.float64)


def _rigid(source: Floats, target: Floats, weights: Floats) -> Poses:
    """Return the rigid transforms of least weighted squares (Kabsch 1976), over any leading axes."""
    share = weights / weights.sum(axis=-1, keepdims=True)
    source_centre = (share[..., None] * source).sum(axis=-2)
    target_centre = (share[..., None] * target).sum(axis=-2)
    across = (share[..., None] * (target - target_centre[..., None, :])).swapaxes(-1, -2)
    left, _, right = np.linalg.svd(across @ (source - source_centre[..., None, :]))
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[..., None]
    rotations = left @ right
    positions = target_centre - (rotations @ source_centre[..., None])[..., 0]
    return Poses(rotations, positions)


def _squared(first: NDArray[np.floating], second: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return squared distances of all pairs, shape (..., m, k), never below zero."""
    dots = first @ second.swapaxes(-1, -2)
    norms = (first**2).sum(axis=-1)[..., None] + (second**2).sum(axis=-1)[..., None, :]
    return np.asarray(np.maximum(norms - 2 * dots, 0.0))


def _distances(first: Floats, second: Floats) -> Floats:
    return np.asarray(np.sqrt(_squared(first, second)))
