"""A single frame fitted from nowhere: exact where the markers are."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.tracking.fit import fit_frame
from graspdb_schemas.vocabulary import Side

SIDES = (Side.RIGHT, Side.LEFT)
SEEDS = range(40)
SD = np.full(24, 0.0001)
"""Markers without noise; a larger spread lets the prior pull the posture, by 0.3 mm at 1.5 mm."""


def drawn(hand, prior, rng):
    """Draw a posture from the prior, within the limits, in any rigid pose."""
    q = hand.neutral()
    q[:3] = rng.normal(0, 0.5, 3)
    q[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    q[7:] = np.clip(rng.multivariate_normal(prior.mean, prior.covariance), *hand.joint_range.T)
    return q


def within_limits(hand, q):
    return np.all(q[7:] >= hand.joint_range[:, 0]) and np.all(q[7:] <= hand.joint_range[:, 1])


@pytest.mark.parametrize("n_missing", [0, 4])
@pytest.mark.parametrize("side", SIDES)
def test_noiseless_markers_give_the_posture_back_from_nowhere(hands, side, n_missing):
    hand = hands[side]
    prior, workspace = default_prior(hand), Kinematics(hand)
    found, worst_site = 0, 0.0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        q = drawn(hand, prior, rng)
        pose = hand.forward(q)
        observed = pose.markers.copy()
        observed[rng.choice(24, n_missing, replace=False)] = np.nan
        fit = fit_frame(workspace, observed, prior, SD)
        assert within_limits(hand, fit.q)
        assert np.array_equal(np.isnan(fit.residuals), np.isnan(observed))
        if fit.rms < 1e-4:
            found += 1
            if n_missing == 0:
                worst_site = max(worst_site, np.abs(hand.forward(fit.q).sites - pose.sites).max())
    share = found / len(SEEDS)
    print(f"{side}, {n_missing} missing: found {share:.1%}")
    assert share >= 0.95
    if n_missing == 0:  # with markers missing, what none of them shows is the prior's
        print(f"worst site {1e3 * worst_site:.3f} mm")
        assert 0 < worst_site < 1e-4


def test_fit_moves_with_the_markers(hands):
    hand = hands[Side.RIGHT]
    prior, workspace, rng = default_prior(hand), Kinematics(hand), np.random.default_rng(7)
    observed = hand.forward(drawn(hand, prior, rng)).markers + rng.normal(0, 0.001, (24, 3))
    turn, shift = Rotation.random(rng=rng), rng.normal(0, 1, 3)
    here = fit_frame(workspace, observed, prior, np.full(24, 0.0015))
    there = fit_frame(workspace, turn.apply(observed) + shift, prior, np.full(24, 0.0015))
    assert here.cost == pytest.approx(there.cost, rel=1e-3)
    moved = turn.apply(hand.forward(here.q).sites) + shift
    assert np.abs(moved - hand.forward(there.q).sites).max() < 1e-4


def test_given_start_is_used(hands):
    hand = hands[Side.LEFT]
    prior, workspace, rng = default_prior(hand), Kinematics(hand), np.random.default_rng(8)
    q = drawn(hand, prior, rng)
    observed = hand.forward(q).markers
    without = fit_frame(workspace, observed, prior, SD)
    with_start = fit_frame(workspace, observed, prior, SD, starts=(q,))
    assert with_start.cost <= without.cost * (1 + 1e-6)
    assert with_start.rms < 1e-4


def test_joint_that_no_marker_shows_goes_to_the_mean_posture(hands):
    hand = hands[Side.RIGHT]
    prior, workspace = default_prior(hand), Kinematics(hand)
    q = hand.neutral()
    q[7:] = prior.mean
    observed = hand.forward(q).markers
    thumb = [i for i, label in enumerate(hand.markers) if label.startswith("thumb")]
    observed[thumb] = np.nan
    fit = fit_frame(workspace, observed, prior, SD)
    assert np.allclose(fit.q[7:], prior.mean, atol=1e-3)


def test_cost_is_half_the_sum_of_normalised_squares(hands):
    hand = hands[Side.RIGHT]
    prior, workspace, rng = default_prior(hand), Kinematics(hand), np.random.default_rng(9)
    observed = hand.forward(drawn(hand, prior, rng)).markers + rng.normal(0, 0.001, (24, 3))
    observed[3] = np.nan
    fit = fit_frame(workspace, observed, prior, SD)
    arms = observed - hand.forward(fit.q).markers
    angles = fit.q[7:] - prior.mean
    squares = np.nansum((arms / SD[:, None]) ** 2) + angles @ np.linalg.solve(prior.covariance, angles)
    assert fit.cost == pytest.approx(squares / 2, rel=1e-9)
    assert fit.rms == pytest.approx(np.sqrt(np.nanmean(np.sum(arms**2, axis=1))), rel=1e-9)
