"""The posture prior between what is known of any hand and what a hand has shown."""

import numpy as np
import pytest

from graspdb_ingest.hand.posture import PosturePrior, default_prior, learned_prior
from graspdb_ingest.tracking.posture_learning import learn_prior
from graspdb_schemas.vocabulary import Side

P = 23


@pytest.fixture(scope="module")
def default(hands):
    return default_prior(hands[Side.RIGHT])


def draws(default: PosturePrior, n: int) -> np.ndarray:
    """Return postures of a hand that moves half as far as others, about another mean."""
    rng = np.random.default_rng(0)
    return rng.multivariate_normal(default.mean + 0.1, default.covariance / 4, size=n)


def test_many_postures_outweigh_the_default(default):
    angles = draws(default, 20_000)
    learned = learned_prior(default, angles, np.zeros((len(angles), P, P)), float(len(angles)))
    assert learned.mean == pytest.approx(default.mean + 0.1, abs=0.01)
    scale = np.sqrt(np.diagonal(default.covariance))
    assert (learned.covariance - default.covariance / 4) / np.outer(scale, scale) == pytest.approx(
        0, abs=0.02
    )


def test_next_to_no_postures_leave_the_default(default):
    angles = draws(default, 100)
    learned = learned_prior(default, angles, np.zeros((100, P, P)), 1e-6)
    assert learned.mean == pytest.approx(default.mean, abs=1e-6)
    assert learned.covariance == pytest.approx(default.covariance, abs=1e-6)


def test_a_joint_that_was_never_seen_keeps_its_spread(default):
    angles = draws(default, 500)
    angles[:, 4] = default.mean[4]
    spreads = np.zeros((500, P, P))
    spreads[:, 4, 4] = default.covariance[4, 4]
    learned = learned_prior(default, angles, spreads, 500.0)
    assert learned.mean[4] == pytest.approx(default.mean[4])
    assert learned.covariance[4, 4] == pytest.approx(default.covariance[4, 4], rel=1e-9)


def test_learned_covariances_can_be_inverted(default):
    same = np.repeat(default.mean[None], 50, axis=0)  # a hand that never moved
    learned = learned_prior(default, same, np.zeros((50, P, P)), 50.0)
    np.linalg.cholesky(learned.covariance)


def test_prior_of_a_recording_comes_near_the_one_its_postures_were_drawn_from(hands, default):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(1)
    q = np.tile(hand.neutral(), (60, 1))
    q[:, 7:] = np.clip(draws(default, 60), *hand.joint_range.T)
    markers = hand.forward(q).markers + rng.normal(0, 0.0005, (60, 24, 3))
    learned = learn_prior(hand, markers, 1000.0, default, np.full(24, 0.0005), 0.25)
    assert learned.n_frames >= 55
    assert learned.n_independent == learned.n_frames
    spread = np.sqrt(np.diagonal(learned.prior.covariance) / np.diagonal(default.covariance))
    # the draws have half of the default's spread
    assert np.median(spread) == pytest.approx(0.5, abs=0.08)


@pytest.mark.parametrize("n", [15, 40, 150])
def test_the_default_counts_for_more_where_postures_are_as_it_says(default, n):
    rng = np.random.default_rng(7)
    usual = rng.multivariate_normal(default.mean, default.covariance, size=n)
    synergies = rng.normal(size=(n, 2)) @ rng.normal(0, 0.3, (2, P)) + rng.normal(0, 0.02, (n, P))
    off = []
    for angles in (usual, default.mean + synergies):
        learned = learned_prior(default, angles, np.zeros((n, P, P)), float(n))
        sample = np.cov(angles.T, bias=True)
        nearer = np.linalg.norm(learned.covariance - sample)
        off.append(nearer / np.linalg.norm(default.covariance - sample))
    assert off[0] > 0.6  # a sample of the default's own postures is taken for just that
    assert off[1] < 4 / n


def test_too_few_frames_leave_the_default(hands, default):
    hand = hands[Side.RIGHT]
    frames = hand.forward(np.tile(hand.neutral(), (4, 1))).markers
    learned = learn_prior(hand, frames, 1.0, default, np.full(24, 0.001), 0.25)
    assert (learned.prior, learned.n_frames) == (default, 0)
