"""Key points of hands in known postures and places, made with the hand model."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand import HandDimensions, HandModel, build_hand
from graspdb_ingest.hand.posture import default_prior
from graspdb_schemas.vocabulary import Side

SIZE = HandDimensions(0.19, 0.084)


@cache
def model(side: Side) -> HandModel:
    """Return a hand without markers."""
    return build_hand(SIZE, side, {})


def posture(side: Side, seed: int) -> np.ndarray:
    """Return a usual configuration somewhere in a room."""
    rng, hand = np.random.default_rng(seed), model(side)
    prior = default_prior(hand)
    q = hand.neutral()
    q[:3] = rng.uniform(-0.5, 0.5, 3)
    q[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    q[7:] = rng.multivariate_normal(prior.mean, 0.5 * prior.covariance)
    low, high = hand.mujoco_model.jnt_range[1:].T
    q[7:] = np.clip(q[7:], low, high)
    return q


def key_points(side: Side, q: np.ndarray) -> np.ndarray:
    """Return wrist and sites of a configuration, shape (21, 3)."""
    hand = model(side)
    return np.vstack([hand.palm(q)[0], hand.forward(q).sites])


def postures(side: Side, n: int, seed: int = 0) -> np.ndarray:
    """Return key points of n postures that have nothing to do with each other, shape (n, 21, 3)."""
    return np.array([key_points(side, posture(side, 1000 * seed + i)) for i in range(n)])


def movement(side: Side, n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return configurations (n, 30) that go smoothly from one posture to another and back, and key points."""
    first, second = posture(side, seed), posture(side, seed + 1)
    second[:7] = first[:7] + np.array([0.05, 0.02, 0.03, 0, 0, 0, 0])
    share = 0.5 - 0.5 * np.cos(np.linspace(0, 4 * np.pi, n))[:, None]
    configurations = first + share * (second - first)
    return configurations, np.array([key_points(side, q) for q in configurations])
