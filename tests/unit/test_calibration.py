"""Calibration: a hand of other proportions and markers of unknown place, found from the recording."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand import HandDimensions, HandModel, build_hand
from graspdb_ingest.hand.posture import PosturePrior, default_prior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.bundle import Bundle
from graspdb_ingest.tracking.calibration import Calibration, calibrate_hand, choose_frames
from graspdb_ingest.tracking.fit import fit_frame
from graspdb_ingest.tracking.frame_choice import sample_frames
from graspdb_ingest.tracking.geometry import HandGeometry
from graspdb_ingest.tracking.tracker import track_hand
from graspdb_schemas.errors import TrackingError
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import DIGITS, FOREARM_MARKERS, TIPS, Side

RATE, N_FRAMES, NOISE = 120.0, 360, 0.0005
SD = 0.001


@dataclass(frozen=True)
class Case:
    """A hand as assumed and as it is, its movement, and what calibration made of it."""

    assumed: HandModel
    placements: dict[str, MarkerPlacement]
    true: HandModel
    sites: np.ndarray
    markers: np.ndarray
    calibration: Calibration


def movement(hand: HandModel, rng: np.random.Generator) -> np.ndarray:
    time, prior = np.arange(N_FRAMES) / RATE, default_prior(hand)

    def waves(n):
        phases, rates = rng.uniform(0, 2 * np.pi, (2, n)), rng.uniform(0.2, 0.9, (2, n))
        return np.sin(2 * np.pi * rates[:, None] * time[:, None] + phases[:, None]).sum(axis=0) / 2

    q = np.empty((N_FRAMES, hand.n_q))
    q[:, :3] = 0.2 * waves(3)
    turns = Rotation.random(rng=rng) * Rotation.from_rotvec(0.8 * waves(3))
    q[:, 3:7] = turns.as_quat(scalar_first=True)
    spread = 2 * np.sqrt(np.diagonal(prior.covariance))
    q[:, 7:] = np.clip(prior.mean + spread * waves(hand.n_dof - 6), *hand.joint_range.T)
    return q


@pytest.fixture(scope="module", params=(Side.RIGHT, Side.LEFT))
def case(request, dorsal_markers):
    """Return a hand three per cent larger than assumed, its bones off by some per cent more."""
    rng = np.random.default_rng(1)
    size = HandDimensions(0.19, 0.084)
    placements = {**dorsal_markers, **{label: MarkerPlacement("forearm") for label in FOREARM_MARKERS}}
    assumed = build_hand(size, request.param, placements)
    truly_placed = build_hand(size, request.param, dorsal_markers)
    geometry = HandGeometry(truly_placed, dorsal_markers)
    parameters = np.zeros(geometry.n_parameters)
    parameters[0] = 0.03
    n_centres = 30
    parameters[1 : 1 + n_centres] = 0.6 * rng.normal(size=n_centres) * geometry.prior_sd[1 : 1 + n_centres]
    true = truly_placed.reshaped(geometry.shape(parameters))
    pose = true.forward(movement(true, rng))
    markers = pose.markers + rng.normal(0, NOISE, pose.markers.shape)
    markers[rng.random(markers.shape[:2]) < 0.05] = np.nan
    calibration = calibrate_hand(assumed, placements, [markers], default_prior(assumed), SD)
    return Case(assumed, placements, true, pose.sites, markers, calibration)


def tip_error(hand: HandModel, case: Case) -> float:
    track = track_hand(hand, case.markers, RATE, default_prior(hand), TrackingParameters(marker_sd=SD))
    return float(np.mean(np.linalg.norm(track.sites - case.sites, axis=2)[:, TIPS]))


def test_residuals_come_down_to_the_noise(case):
    before, after = case.calibration.before, case.calibration.after
    print(
        f"{case.assumed.side}: rms {1e3 * np.sqrt(np.mean(before**2)):.2f} mm before, "
        f"{1e3 * np.sqrt(np.mean(after**2)):.2f} mm after, noise {1e3 * NOISE * np.sqrt(3):.2f} mm"
    )
    assert before.shape == after.shape == (24,)
    assert 0.4 * NOISE * np.sqrt(3) < np.sqrt(np.mean(after**2)) < 1.2 * NOISE * np.sqrt(3)
    assert np.sqrt(np.mean(after**2)) < 0.2 * np.sqrt(np.mean(before**2))


def test_tips_are_nearer_than_without_calibration(case, dorsal_markers):
    size = HandDimensions(0.19, 0.084)
    uncalibrated = tip_error(build_hand(size, case.assumed.side, dorsal_markers), case)
    calibrated = tip_error(case.calibration.hand, case)
    print(f"{case.assumed.side}: tip error {1e3 * uncalibrated:.2f} mm, calibrated {1e3 * calibrated:.2f} mm")
    assert calibrated < 0.7 * uncalibrated
    assert calibrated < 0.004


def test_segment_lengths_are_nearer_than_anthropometry(case):
    def errors(hand):
        found, true = hand.segment_lengths, case.true.segment_lengths
        return np.array([found[s] / true[s] - 1 for s in true])

    before, after = (
        np.sqrt(np.mean(errors(case.assumed) ** 2)),
        np.sqrt(np.mean(errors(case.calibration.hand) ** 2)),
    )
    print(f"{case.assumed.side}: rms error of segment lengths {before:.1%}, calibrated {after:.1%}")
    assert after < 0.7 * before


def test_forearm_markers_keep_the_distances_that_they_had(case):
    found = case.calibration.hand.forward(case.calibration.hand.neutral()).markers[:4]
    true = case.true.forward(case.true.neutral()).markers[:4]
    distances = [np.linalg.norm(m[:, None] - m[None], axis=2) for m in (found, true)]
    assert np.abs(distances[0] - distances[1]).max() < 0.0015


def test_calibrated_hand_keeps_its_joints_limits_and_radii(case):
    hand = case.calibration.hand
    assert hand.joints == case.assumed.joints
    assert hand.markers == case.assumed.markers
    assert np.allclose(hand.joint_range, case.assumed.joint_range)
    assert np.array_equal(hand.radii, case.assumed.radii)
    assert case.calibration.n_frames == 60


def test_calibration_moves_nothing_that_the_markers_do_not_show(hands, dorsal_markers):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(2)
    markers = hand.forward(movement(hand, rng)[::4]).markers
    little = [i for i, label in enumerate(hand.markers) if label.startswith("little")]
    markers[:, little] = np.nan
    calibration = calibrate_hand(hand, dorsal_markers, [markers], default_prior(hand), SD)
    assert np.isnan(calibration.before[little]).all()
    assert np.isnan(calibration.after[little]).all()
    before, after = hand.segment_lengths, calibration.hand.segment_lengths
    for segment in ("little_proximal", "little_middle"):
        size = np.mean([after[f"{d}_middle"] / before[f"{d}_middle"] for d in DIGITS[1:4]])
        assert after[segment] / before[segment] == pytest.approx(size, abs=0.03)


def test_chosen_frames_are_well_seen_and_distinct(hands):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(3)
    markers = hand.forward(movement(hand, rng)).markers
    markers[::3, :20] = np.nan  # a third of the frames show four markers
    chosen = choose_frames(markers, 30)
    assert chosen.shape == (30, 24, 3)
    assert np.isfinite(chosen).all(axis=2).sum(axis=1).min() >= 6
    assert len(np.unique(np.nan_to_num(chosen).reshape(30, -1), axis=0)) == 30


def test_chosen_frames_include_the_one_odd_posture_wherever_the_hand_is(hands):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(4)
    q = np.tile(hand.neutral(), (400, 1))
    q[:, :3] = rng.normal(0, 1, (400, 3))
    q[:, 3:7] = Rotation.random(400, rng=rng).as_quat(scalar_first=True)
    q[:, 7:] += rng.normal(0, 0.01, (400, 23))
    q[237, 7:] = 0.8 * hand.joint_range[:, 1]
    markers = hand.forward(q).markers
    chosen = choose_frames(markers, 8)
    assert any(np.array_equal(frame, markers[237]) for frame in chosen)


def test_fewer_frames_than_wanted_are_all_used(hands):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(5)
    markers = hand.forward(movement(hand, rng)[:12]).markers
    assert np.array_equal(choose_frames(markers), markers)


def test_too_few_frames_are_refused_with_their_number(hands, dorsal_markers):
    hand = hands[Side.RIGHT]
    markers = hand.forward(movement(hand, np.random.default_rng(6))).markers
    markers[7:, 3:] = np.nan
    with pytest.raises(TrackingError, match=r"only 7 frames show 6 or more of the hand's 24 markers"):
        calibrate_hand(hand, dorsal_markers, [markers], default_prior(hand), SD)


def test_true_lengths_lie_within_the_stated_deviations(case):
    found, true = case.calibration.hand.segment_lengths, case.true.segment_lengths
    z = np.array([(found[s] - true[s]) / sd for s, sd in case.calibration.length_sd.items()])
    print(f"{case.assumed.side}: lengths' errors over their deviations, rms {np.sqrt(np.mean(z**2)):.2f}")
    assert set(case.calibration.length_sd) == set(true)
    assert np.mean(np.abs(z) < 2) >= 0.8
    assert np.sqrt(np.mean(z**2)) > 0.1  # nor is everything said to be unsure


def test_lengths_that_nothing_tells_are_anthropometrys_and_said_to_be(hands, dorsal_markers):
    hand = hands[Side.RIGHT]
    markers = hand.forward(movement(hand, np.random.default_rng(2))[::6]).markers
    markers[:, [i for i, label in enumerate(hand.markers) if label.startswith("little")]] = np.nan
    notes = calibrate_hand(hand, dorsal_markers, [markers], default_prior(hand), SD).notes
    assert any("never seen" in note and "little_tip" in note for note in notes)
    assert any("little_proximal" in note and "index_proximal" not in note for note in notes)


def test_still_hand_is_refused_where_markers_have_to_be_found(hands, dorsal_markers):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(7)
    q = movement(hand, rng)
    q[:, 7:] = q[0, 7:]
    markers = hand.forward(q).markers + rng.normal(0, NOISE, (len(q), 24, 3))
    placements = dorsal_markers | {"index_tip": MarkerPlacement("index_distal")}
    with pytest.raises(TrackingError, match=r"posture hardly changes.*index_tip"):
        calibrate_hand(hand, placements, [markers], default_prior(hand), SD)


def test_sampling_keeps_all_of_few_frames_and_few_of_all():
    recordings = [np.random.default_rng(i).normal(size=(n, 5, 3)) for i, n in enumerate((40, 70))]
    assert np.array_equal(sample_frames(recordings, 200), np.concatenate(recordings))
    some = sample_frames((np.full((1000, 5, 3), float(i)) for i in range(20)), 300)
    assert 100 <= len(some) <= 300
    assert set(some[:, 0, 0]) == set(range(20))


def test_joints_pulled_beyond_their_limits_do_not_end_the_descent_early(hands, dorsal_markers):
    """Of a hand that hyperextends, shape and postures together leave less than postures alone do."""
    hand, rng = hands[Side.RIGHT], np.random.default_rng(5)
    prior, geometry = default_prior(hand), HandGeometry(hand, dorsal_markers)
    q = movement(hand, rng)[:: N_FRAMES // 30]
    q[:, 7:] = prior.mean + 1.8 * (q[:, 7:] - prior.mean)
    frames = np.array([hand.forward(configuration).markers for configuration in q])
    frames += rng.normal(0, NOISE, frames.shape)
    bundle = Bundle(geometry, frames, PosturePrior(prior.mean, len(frames) * prior.covariance), SD)
    alone = [fit_frame(bundle.kinematics, frame, prior, np.full(24, SD)) for frame in frames]
    together = bundle.solve(np.zeros(geometry.n_parameters), [fit.q for fit in alone])
    assert np.std(together.residuals) < np.std([fit.residuals for fit in alone])
