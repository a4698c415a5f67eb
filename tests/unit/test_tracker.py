"""A simulated hand followed through gaps, a swapped marker and a loss of the whole hand."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand import HandDimensions, HandModel, HandPose, build_hand
from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking import smoother
from graspdb_ingest.tracking.tracker import HandTrack, track_hand
from graspdb_schemas.errors import TrackingError
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import DIGITS, FINGERS, SEGMENT_OF_SITE, SITES, TIPS, Side

SIDES = (Side.RIGHT, Side.LEFT)
RATE = 120.0
N_FRAMES = 360
NOISE = 0.001
PARAMETERS = TrackingParameters(marker_sd=NOISE)
PROXIMAL_JOINT = {"thumb": "thumb_mcp", **{finger: f"{finger}_pip" for finger in FINGERS}}


@dataclass(frozen=True)
class Simulated:
    """A hand, how it truly moved, and its markers as seen."""

    hand: HandModel
    q: np.ndarray
    pose: HandPose
    markers: np.ndarray


def simulate(hand: HandModel, seed: int, coupled: bool = False) -> Simulated:
    """Move a hand smoothly, all joints within their limits, and see its markers with noise.

    Joints move each for itself and more than usual, or, coupled, as the prior says that they do.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(N_FRAMES) / RATE

    def waves(n):
        phases, rates = rng.uniform(0, 2 * np.pi, (2, n)), rng.uniform(0.2, 0.9, (2, n))
        return np.sin(2 * np.pi * rates[:, None] * time[:, None] + phases[:, None]).sum(axis=0) / 2

    prior = default_prior(hand)
    spread = 1.5 * np.sqrt(np.diagonal(prior.covariance))
    q = np.empty((N_FRAMES, hand.n_q))
    q[:, :3] = 0.2 * waves(3) + (0.3, 0.1, 0.9)
    start = Rotation.random(rng=rng)
    q[:, 3:7] = (start * Rotation.from_rotvec(0.6 * waves(3))).as_quat(scalar_first=True)
    margin = np.deg2rad(2) * np.array([1, -1])
    moved = waves(hand.n_dof - 6)
    moved = moved @ np.linalg.cholesky(prior.covariance).T if coupled else spread * moved
    q[:, 7:] = np.clip(prior.mean + moved, *(hand.joint_range + margin).T)
    pose = hand.forward(q)
    return Simulated(hand, q, pose, pose.markers + rng.normal(0, NOISE, pose.markers.shape))


def follow(hand: HandModel, markers: np.ndarray, parameters: TrackingParameters = PARAMETERS) -> HandTrack:
    return track_hand(hand, markers, RATE, default_prior(hand), parameters)


def site_errors(track: HandTrack, simulated: Simulated) -> np.ndarray:
    return np.linalg.norm(track.sites - simulated.pose.sites, axis=2)


def tip_error(track: HandTrack, simulated: Simulated) -> float:
    return float(np.mean(site_errors(track, simulated)[:, TIPS]))


@pytest.fixture(scope="module", params=SIDES)
def simulated(request, hands):
    return simulate(hands[request.param], seed=1)


@pytest.fixture(scope="module")
def track(simulated):
    return follow(simulated.hand, simulated.markers)


def within_limits(track, hand):
    angles, limits = track.q[track.tracked, 7:], hand.joint_range
    return bool(np.all((angles >= limits[:, 0]) & (angles <= limits[:, 1])))


def test_tips_are_found_to_two_millimetres(simulated, track):
    error = tip_error(track, simulated)
    print(f"{simulated.hand.side}: mean tip error {1e3 * error:.2f} mm")
    assert track.tracked.all()
    assert error < 0.002
    assert site_errors(track, simulated).max() < 0.01
    assert within_limits(track, simulated.hand)


def test_quaternions_keep_length_one(track):
    assert np.allclose(np.linalg.norm(track.q[:, 3:7], axis=1), 1, atol=1e-9)


def test_residuals_are_the_noise(track):
    assert track.used.mean() > 0.999
    assert 0.6 * NOISE * np.sqrt(3) < np.median(track.residual_rms) < 1.1 * NOISE * np.sqrt(3)


def test_joint_angles_are_as_uncertain_as_the_filter_says(simulated, track):
    squared = ((track.q[:, 7:] - simulated.q[:, 7:]) / track.q_sd[:, 6:]) ** 2
    normalised = float(np.mean(squared[12:]))
    print(f"{simulated.hand.side}: normalised squared error of a joint angle {normalised:.2f}, ideally 1")
    assert 0.3 < normalised < 3


def test_sites_move_rigidly_with_the_markers(simulated, track):
    rng = np.random.default_rng(2)
    turn, shift = Rotation.random(rng=rng), np.array([1.0, -2.0, 0.5])
    moved = turn.apply(simulated.markers.reshape(-1, 3)).reshape(simulated.markers.shape) + shift
    again = follow(simulated.hand, moved)
    expected = turn.apply(track.sites.reshape(-1, 3)).reshape(track.sites.shape) + shift
    assert np.abs(again.sites - expected).max() < 5e-5


def test_bursts_of_missing_markers_are_bridged(simulated):
    rng, markers = np.random.default_rng(3), simulated.markers.copy()
    for marker in range(24):
        for start in rng.integers(5, N_FRAMES - 30, 3):
            markers[start : start + rng.integers(5, 25), marker] = np.nan
    missing = np.isnan(markers[..., 0])
    track = follow(simulated.hand, markers)
    error = tip_error(track, simulated)
    print(f"{simulated.hand.side}: {missing.mean():.0%} missing, mean tip error {1e3 * error:.2f} mm")
    assert missing.mean() > 0.08
    assert track.tracked.all()
    assert error < 0.003
    assert within_limits(track, simulated.hand)
    assert not track.used[missing].any()
    assert np.isnan(track.residuals[missing]).all()
    assert np.isfinite(track.residuals[~missing]).all()


def test_angles_that_no_marker_shows_grow_uncertain(simulated, track):
    markers = simulated.markers.copy()
    gap = slice(150, 210)
    thumb = [i for i, label in enumerate(simulated.hand.markers) if label.startswith("thumb")]
    markers[gap, thumb] = np.nan
    blind = follow(simulated.hand, markers)
    ip = 6 + simulated.hand.joints.index("thumb_ip_flexion")
    prior = default_prior(simulated.hand)
    tip = 3  # thumb_tip
    assert blind.q_sd[180, ip] > 5 * track.q_sd[180, ip]
    assert blind.q_sd[180, ip] < 1.05 * np.sqrt(prior.covariance[ip - 6, ip - 6])
    # What comes after the gap tells of it as well as what came before.
    assert blind.q_sd[155, ip] == pytest.approx(blind.q_sd[204, ip], rel=0.25)
    assert np.allclose(blind.q_sd[250, ip], track.q_sd[250, ip], rtol=0.1)
    assert blind.sites_sd[180, tip] > 5 * track.sites_sd[180, tip]


def test_recording_may_start_before_the_hand_is_seen(simulated):
    markers = simulated.markers.copy()
    markers[:60] = np.nan
    markers[60:80, 5:] = np.nan  # five markers are one too few to start from
    track = follow(simulated.hand, markers)
    assert not track.tracked[:80].any()
    assert track.tracked[80:].all()
    assert np.isnan(track.sites[:80]).all()
    assert not track.used[:80].any()
    assert np.isnan(track.residual_rms[:60]).all()
    assert np.mean(site_errors(track, simulated)[80:, TIPS]) < 0.002


def jumping(simulated, label, start=180):
    """Return the markers with one of them off by 50 mm for 0.2 s, its number, and when."""
    markers, frames = simulated.markers.copy(), slice(start, start + round(0.2 * RATE))
    marker = simulated.hand.markers.index(label)
    markers[frames, marker] += 0.05 * np.array([0.6, 0.0, 0.8])
    return markers, marker, frames


@pytest.mark.parametrize("label", ["index_tip", "middle_mcp", "forearm_2"])
def test_jumping_marker_is_rejected_and_reported(simulated, label):
    markers, marker, frames = jumping(simulated, label)
    track = follow(simulated.hand, markers)
    assert not track.used[frames, marker].any()
    assert np.linalg.norm(track.residuals[frames, marker], axis=1).min() > 0.04
    assert track.used[:, np.arange(24) != marker].mean() > 0.99
    assert track.used[frames.stop + 3 :, marker].mean() > 0.99
    markers[frames, marker] = np.nan
    assert np.array_equal(track.sites, follow(simulated.hand, markers).sites)  # as if it had not been seen


@pytest.mark.parametrize(
    ("label", "most"), [("middle_mcp", 0.002), ("forearm_2", 0.002), ("index_tip", 0.005)]
)
def test_jumping_marker_hardly_moves_the_tips(simulated, track, label, most):
    # The tip's marker alone shows the last joint, so that joint coasts while its marker is rejected.
    markers, _, _ = jumping(simulated, label)
    moved = np.linalg.norm(follow(simulated.hand, markers).sites - track.sites, axis=2)[:, TIPS].max()
    print(f"{simulated.hand.side}: {label} off by 50 mm moves a tip by {1e3 * moved:.2f} mm at most")
    assert moved < most


@pytest.mark.parametrize("gap", [0.25, 1.5])
def test_lost_hand_is_found_again(simulated, gap):
    markers = simulated.markers.copy()
    lost = slice(60, 60 + round(gap * RATE))
    markers[lost] = np.nan
    track = follow(simulated.hand, markers)
    forgotten = 60 + round(1.0 * RATE)
    assert track.tracked[: min(lost.stop, forgotten)].all()
    assert not track.tracked[forgotten + 1 : lost.stop].any()
    assert track.tracked[lost.stop :].all()
    assert np.mean(site_errors(track, simulated)[lost.stop + 2 :, TIPS]) < 0.002
    assert within_limits(track, simulated.hand)


def test_hand_that_comes_back_elsewhere_is_found_again(simulated):
    markers, back = simulated.markers.copy(), 150
    shift = np.array([0.4, -0.3, 0.2])
    markers[back - 12 : back] = np.nan
    markers[back:] += shift
    track = follow(simulated.hand, markers)
    errors = np.linalg.norm(track.sites - shift - simulated.pose.sites, axis=2)
    assert errors[back + 15 :, TIPS].mean() < 0.002


def test_fist_at_its_limits_stays_within_them(hands):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(4)
    q = np.tile(hand.neutral(), (120, 1))
    flexions = [
        7 + i for i, joint in enumerate(hand.joints) if joint.endswith(("pip_flexion", "dip_flexion"))
    ]
    limits = hand.joint_range[np.array(flexions) - 7, 1]
    q[:, flexions] = limits * (0.5 - 0.5 * np.cos(np.linspace(0, 2 * np.pi, 120)))[:, None]
    markers = hand.forward(q).markers
    track = follow(hand, markers + rng.normal(0, NOISE, markers.shape))
    assert within_limits(track, hand)
    assert track.at_limit[50:70].any()
    assert np.mean(np.linalg.norm(track.sites - hand.forward(q).sites, axis=2)[:, TIPS]) < 0.003


def test_long_recordings_are_kept_in_single_precision_and_lose_nothing_by_it(simulated, monkeypatch):
    hidden = simulated.markers.copy()
    hidden[100:220, [i for i, m in enumerate(simulated.hand.markers) if m.startswith("index")]] = np.nan
    arguments = simulated.hand, hidden, RATE, default_prior(simulated.hand), PARAMETERS
    double = track_hand(*arguments)
    monkeypatch.setattr(smoother, "DOUBLE_FRAMES", 0)
    single = track_hand(*arguments)
    steps = [simulated.hand.difference(a, b) for a, b in zip(double.q, single.q, strict=True)]
    assert (np.abs(steps) < 0.05 * double.q_sd).all()
    assert np.allclose(single.q_sd, double.q_sd, rtol=0.01)
    assert not np.array_equal(single.q_sd, double.q_sd)


def test_too_few_markers_are_refused_with_their_number(simulated):
    markers = simulated.markers.copy()
    markers[:, 5:] = np.nan
    with pytest.raises(TrackingError, match=r"no frame shows 6 of the hand's 24 markers"):
        follow(simulated.hand, markers)


def test_marker_with_one_coordinate_missing_was_not_seen(simulated):
    markers = simulated.markers.copy()
    markers[:10, 7, 1] = np.nan  # the first frame is used without a gate
    track = follow(simulated.hand, markers)
    assert not track.used[:10, 7].any()
    assert np.isfinite(track.sites).all()


def test_more_noise_gives_larger_standard_deviations(simulated, track):
    noisy = follow(simulated.hand, simulated.markers, TrackingParameters(marker_sd=3 * NOISE))
    assert np.all(noisy.q_sd[60:, 6:].mean(axis=0) > track.q_sd[60:, 6:].mean(axis=0))


@pytest.mark.parametrize("side", SIDES)
def test_three_markers_on_the_hand_and_two_a_digit_are_enough(side):
    at = {site: MarkerPlacement(SEGMENT_OF_SITE[site], at=site) for site in SITES}
    few = {site: at[site] for digit in DIGITS for site in (f"{digit}_tip", PROXIMAL_JOINT[digit])}
    sign = 1 if side == Side.RIGHT else -1
    plate = ((-0.01, 0.03), (0.03, 0.0), (-0.01, -0.03))
    back = {
        f"hand_{i}": MarkerPlacement("hand", offset=(0.05 + x, sign * y, 0.02))
        for i, (x, y) in enumerate(plate)
    }
    hand = build_hand(HandDimensions(0.19, 0.084), side, {**back, **few})
    moved = simulate(hand, seed=4, coupled=True)
    found = follow(hand, moved.markers)
    assert found.tracked.all()
    error = site_errors(found, moved)
    assert error[:, TIPS].mean() < 0.003
    assert error.mean() < 0.003
    assert (error < 2 * found.sites_sd).mean() > 0.93


def test_a_hand_tracked_backwards_in_time_is_the_same_hand(simulated, track):
    backwards = follow(simulated.hand, simulated.markers[::-1])
    apart = np.linalg.norm(backwards.sites[::-1] - track.sites, axis=2)
    # linearised at other predictions, and started at the other end
    assert np.median(apart) < 5e-5
    assert apart.mean() < 2e-4


def test_a_hand_without_any_marker_for_a_while_is_found_again_and_says_how_unsure_it_was(simulated, track):
    markers = simulated.markers.copy()
    markers[150:190] = np.nan
    found = follow(simulated.hand, markers)
    assert not found.used[150:190].any()
    assert found.tracked.all()
    assert found.sites_sd[170].mean() > 5 * track.sites_sd[170].mean()
    error = site_errors(found, simulated)
    assert (error[150:190] < 2 * found.sites_sd[150:190]).mean() > 0.9
    assert error[200:].mean() < 1.1 * site_errors(track, simulated)[200:].mean()
