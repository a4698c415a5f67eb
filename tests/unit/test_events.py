"""Holds, lifts and snapshots, on synthesised movements whose events are known."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from graspdb_ingest.events import Hold, find_holds
from graspdb_ingest.parameters import EventParameters

Floats = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])
H = 0.004
P = EventParameters()
FAR = 0.08
TOUCHING = 6
POSE_NOISE = 0.0005
"""Noise of the mean of four markers with 1 mm each."""


@dataclass(frozen=True)
class Movement:
    """What `find_holds` takes of a trial."""

    times: Floats
    gap: Floats
    positions: Floats
    sites: Floats

    def holds(self, up: Floats = UP, parameters: EventParameters = P) -> tuple[Hold, ...]:
        """Find this trial's holds."""
        return find_holds(self.times, self.gap, self.positions, self.sites, up, H, parameters)


def ease(times: Floats, start: float, duration: float) -> Floats:
    """Minimum-jerk movement from 0 to 1."""
    x = np.clip((times - start) / duration, 0, 1)
    return 10 * x**3 - 15 * x**4 + 6 * x**5


def movement(
    path: list[tuple[float, float, tuple[float, float, float]]],
    contact: list[tuple[float, float]],
    *,
    rate: float = 100.0,
    end: float = 5.0,
    noise: float = 0.0,
    seed: int = 0,
) -> Movement:
    """Six spheres of a hand touch the object in the given times; moves are start, duration, vector."""
    rng = np.random.default_rng(seed)
    times = np.arange(round(end * rate)) / rate
    positions = np.array([0.3, -0.2, 0.75]) + sum(
        (ease(times, start, duration)[:, None] * np.array(vector) for start, duration, vector in path),
        np.zeros((len(times), 3)),
    )
    distance = np.full(len(times), FAR)
    for start, stop in contact:
        away = np.maximum(np.maximum(start - times, times - stop), 0)
        distance = np.minimum(distance, np.minimum(0.3 * away, FAR))
    gap = np.repeat(distance[:, None], 20, axis=1)
    gap[:, TOUCHING:] += 0.02
    places = rng.normal(0, 0.04, (20, 3))
    sites = positions[:, None] + places * (1 + distance[:, None, None] / 0.04)
    return Movement(
        times,
        gap + rng.normal(0, noise, gap.shape),
        positions + rng.normal(0, noise, positions.shape),
        sites + rng.normal(0, noise, sites.shape),
    )


LIFT, LOWER = (1.5, 0.8, (0.0, 0.0, 0.1)), (3.2, 0.8, (0.0, 0.0, -0.1))


def lift(*, rate: float = 100.0, noise: float = 0.0, seed: int = 0) -> Movement:
    return movement([LIFT, LOWER], [(1.0, 4.3)], rate=rate, noise=noise, seed=seed)


def only(holds: tuple[Hold, ...]) -> Hold:
    assert len(holds) == 1
    return holds[0]


@pytest.mark.parametrize("rate", [60.0, 100.0, 240.0, 480.0])
@pytest.mark.parametrize(("height", "duration"), [(0.05, 0.6), (0.1, 0.8), (0.2, 1.0)])
def test_lift_onset_is_found_within_40_ms(rate, height, duration):
    up, down = (0.0, 0.0, height), (0.0, 0.0, -height)
    for seed in range(8):
        trial = movement(
            [(1.5, duration, up), (3.0, duration, down)],
            [(1.0, 4.3)],
            rate=rate,
            noise=POSE_NOISE,
            seed=seed,
        )
        hold = only(trial.holds())
        assert hold.snapshot_kind == "lift_onset"
        assert hold.snapshot == hold.lift_onset
        assert abs(trial.times[hold.lift_onset] - 1.5) < 0.04
        assert -0.1 < trial.times[hold.put_down] - (3.0 + duration) < 0.02


@pytest.mark.parametrize("rate", [60.0, 500.0])
def test_hold_lasts_from_first_to_last_contact(rate):
    trial = lift(rate=rate)
    hold = only(trial.holds())
    touching = np.flatnonzero((trial.gap < H).any(axis=1))
    assert (hold.first, hold.last) == (touching[0], touching[-1])
    assert hold.released


def test_first_contact_is_that_of_a_single_sphere():
    trial = lift()
    trial.gap[80:, 0] = 0.0
    trial.gap[450:, 0] = FAR
    hold = only(trial.holds())
    assert (hold.first, hold.last) == (80, 449)


def test_one_sphere_alone_is_no_hold():
    trial = lift()
    trial.gap[:, 1:] = FAR
    assert trial.holds() == ()


def test_sphere_that_stays_between_two_holds_belongs_to_neither():
    trial = movement([], [(1.0, 2.0), (3.0, 4.0)])
    trial.gap[100:400, 0] = 0.0
    first, second = trial.holds()
    assert first.last < 210
    assert second.first > 290


def test_pushed_object_is_not_lifted_and_gets_the_steadiest_frame():
    trial = movement([(1.5, 0.6, (0.3, 0.1, 0.0))], [(1.0, 4.0)], noise=POSE_NOISE)
    hold = only(trial.holds())
    assert hold.lift_onset is None
    assert hold.put_down is None
    assert hold.snapshot_kind == "steadiest"
    assert hold.first <= hold.snapshot <= hold.last


def test_object_that_lies_still_is_not_lifted():
    for seed in range(5):
        trial = movement([], [(1.0, 4.0)], rate=60.0, noise=0.001, seed=seed)
        assert only(trial.holds()).lift_onset is None


def test_single_frame_that_jumps_is_no_lift():
    trial = movement([], [(1.0, 4.0)])
    trial.positions[250] += 0.06 * UP
    assert only(trial.holds()).lift_onset is None


def test_object_pushed_and_then_lifted_is_lifted_when_it_rises():
    trial = movement([(1.2, 1.5, (0.4, 0.0, 0.0)), (2.5, 0.8, (0.0, 0.0, 0.1))], [(1.0, 4.5)])
    assert trial.times[only(trial.holds()).lift_onset] == pytest.approx(2.5, abs=0.04)


def test_steadiest_frame_is_the_slowest_of_those_with_most_contacts():
    trial = movement([], [(1.0, 4.0)])
    wave = 0.01 * np.sin(2 * np.pi * (trial.times - 2.7525))
    wave[np.abs(trial.times - 1.5) < 0.35] = 0.0
    sites = trial.sites + wave[:, None, None] * UP
    trial.gap[np.abs(trial.times - 1.5) < 0.4, 3:] = FAR
    hold = only(replace(trial, sites=sites).holds())
    turning_points = np.array([2.0, 2.5, 3.0, 3.5])
    assert np.abs(trial.times[hold.snapshot] - turning_points).min() < 0.011
    assert (trial.gap[hold.snapshot] < H).sum() == TOUCHING


def test_several_holds_each_with_its_lift():
    path = []
    for start in (1.0, 4.0, 7.0):
        path += [(start, 0.6, (0.0, 0.0, 0.12)), (start + 1.0, 0.6, (0.1, 0.0, -0.1))]
    contact = [(start - 0.4, start + 2.0) for start in (1.0, 4.0, 7.0)]
    trial = movement(path, contact, end=10.0, noise=POSE_NOISE, seed=3)
    holds = trial.holds()
    onsets = [trial.times[hold.lift_onset] for hold in holds]
    assert np.allclose(onsets, [1.0, 4.0, 7.0], atol=0.04)
    assert all(hold.first < hold.lift_onset < hold.put_down <= hold.last for hold in holds)


def test_two_lifts_in_one_hold_give_the_first_onset_and_the_last_put_down():
    again = [(5.0, 0.8, (0.0, 0.0, 0.1)), (6.5, 0.8, (0.0, 0.0, -0.1))]
    trial = movement([LIFT, LOWER, *again], [(1.0, 8.0)], end=9.0)
    hold = only(trial.holds())
    assert trial.times[hold.lift_onset] == pytest.approx(1.5, abs=0.04)
    assert trial.times[hold.put_down] == pytest.approx(7.3, abs=0.1)


@pytest.mark.parametrize("change", [-0.2, 0.06])
def test_object_may_be_put_down_at_another_height(change):
    path = [LIFT, (3.2, 0.8, (0.2, 0.0, change - 0.1))]
    trial = movement(path, [(1.0, 4.3)], noise=POSE_NOISE)
    hold = only(trial.holds())
    assert trial.times[hold.lift_onset] == pytest.approx(1.5, abs=0.04)
    assert trial.times[hold.put_down] == pytest.approx(4.0, abs=0.1)


def test_dropped_object_is_not_put_down_in_the_air():
    trial = movement([LIFT], [(1.0, 3.5)])
    fall = np.minimum(0.5 * 9.81 * np.maximum(trial.times - 3.5, 0) ** 2, 0.1)
    hold = only(replace(trial, positions=trial.positions - fall[:, None] * UP).holds())
    assert hold.lift_onset is not None
    assert hold.put_down is None or trial.times[hold.put_down] > 3.6


def test_flicker_of_contact_is_one_hold():
    trial = lift()
    rng = np.random.default_rng(5)
    plain = only(trial.holds())
    trial.gap[plain.first + 1 : plain.last] += rng.uniform(0, 0.012, (plain.last - plain.first - 1, 1))
    assert only(trial.holds()) == plain


def test_hysteresis_keeps_a_hold_through_the_margin():
    trial = movement([], [(1.0, 4.0)])
    trial.gap[200:300, :TOUCHING] = H + 0.5 * P.release_margin
    assert len(trial.holds()) == 1
    trial.gap[200:300, :TOUCHING] = H + 1.5 * P.release_margin
    assert len(trial.holds()) == 2


def test_brief_touch_is_no_hold():
    assert movement([], [(1.0, 1.05)]).holds() == ()


def test_short_loss_of_data_changes_nothing_but_a_long_one_parts_the_hold():
    plain = only(lift().holds())
    short = lift()
    for array in (short.gap, short.positions, short.sites):
        array[190:200] = array[260:340] = np.nan
    hold = only(short.holds())
    assert (hold.first, hold.last, hold.lift_onset) == (plain.first, plain.last, plain.lift_onset)
    long = lift()
    for array in (long.gap, long.positions, long.sites):
        array[260:380] = np.nan
    before, after = long.holds()
    assert before.lift_onset == plain.lift_onset
    assert (before.last, before.released) == (259, False)
    assert (after.first, after.lift_onset) == (380, None)


def test_snapshot_is_a_frame_in_which_hand_and_object_are_known():
    plain = only(lift().holds())
    trial = lift()
    hidden = slice(plain.lift_onset - 4, plain.lift_onset + 5)
    for array in (trial.gap, trial.positions, trial.sites):
        array[hidden] = np.nan
    hold = only(trial.holds())
    assert np.isfinite(trial.gap[hold.snapshot]).all()
    assert abs(hold.snapshot - plain.snapshot) <= 8


def test_object_never_known():
    trial = lift()
    trial.gap[:] = trial.positions[:] = np.nan
    assert trial.holds() == ()


def test_hand_never_near():
    assert movement([LIFT], []).holds() == ()


def test_contact_at_the_end_is_not_released():
    trial = movement([LIFT], [(1.0, 9.0)])
    hold = only(trial.holds())
    assert (hold.last, hold.released) == (len(trial.times) - 1, False)
    assert hold.lift_onset is not None
    assert hold.put_down is None


def test_object_put_back_but_still_held_at_the_end_is_put_down():
    hold = only(movement([LIFT, LOWER], [(1.0, 9.0)]).holds())
    assert not hold.released
    assert hold.put_down is not None


def test_recording_that_starts_in_contact_on_the_table_has_a_lift():
    trial = movement([LIFT, LOWER], [(-1.0, 4.3)])
    hold = only(trial.holds())
    assert hold.first == 0
    assert trial.times[hold.lift_onset] == pytest.approx(1.5, abs=0.04)


def test_object_in_the_air_from_the_start_has_no_lift_until_it_was_put_down():
    carried = [(1.0, 0.6, (0.0, 0.0, 0.08)), (2.5, 0.8, (0.0, 0.0, -0.3))]
    assert only(movement(carried, [(-1.0, 4.0)]).holds()).lift_onset is None
    lifted = [*carried, (4.0, 0.8, (0.0, 0.0, 0.1))]
    trial = movement(lifted, [(-1.0, 9.0)])
    assert trial.times[only(trial.holds()).lift_onset] == pytest.approx(4.0, abs=0.04)


def test_turning_points_of_an_object_in_the_air_are_no_rest():
    trial = movement([], [(-1.0, 9.0)])
    swing = 0.03 * np.sin(2 * np.pi * 0.8 * trial.times)
    swung = replace(trial, positions=trial.positions + swing[:, None] * UP)
    assert only(swung.holds()).lift_onset is None


def test_object_that_rose_before_the_hand_came_was_not_lifted_by_it():
    assert only(movement([(0.5, 1.5, (0.0, 0.0, 0.3))], [(1.2, 4.0)]).holds()).lift_onset is None


def test_onset_just_before_the_first_contact_lies_in_the_hold():
    hold = only(movement([LIFT, LOWER], [(1.58, 4.3)]).holds())
    assert hold.lift_onset == hold.snapshot == hold.first


@pytest.mark.parametrize("n_frames", [0, 1, 2, 5, 20, 40])
def test_short_recordings(n_frames):
    trial = movement([], [(-1.0, 9.0)])
    cut = Movement(*(array[:n_frames] for array in (trial.times, trial.gap, trial.positions, trial.sites)))
    assert len(cut.holds()) == (n_frames >= P.minimum_hold * 100)


def test_rate_below_the_filter_still_finds_the_hold():
    assert len(lift(rate=10.0).holds()) == 1


def test_isolated_frames_of_the_object_are_no_fault():
    trial = lift()
    trial.positions[:] = np.where(np.arange(500)[:, None] % 50 == 0, trial.positions, np.nan)
    hold = only(trial.holds())
    assert hold.lift_onset is None
    assert hold.first <= hold.snapshot <= hold.last


def test_events_do_not_depend_on_the_lab_frame_or_the_start_of_time():
    trial = lift(noise=POSE_NOISE, seed=1)
    plain = trial.holds()
    for turn in Rotation.random(5, rng=np.random.default_rng(2)):
        shift = np.array([1.0, -2.0, 0.5])
        moved = Movement(
            trial.times + 1234.5,
            trial.gap,
            turn.apply(trial.positions) + shift,
            turn.apply(trial.sites.reshape(-1, 3)).reshape(trial.sites.shape) + shift,
        )
        assert moved.holds(up=turn.apply(UP)) == plain


def test_order_of_the_spheres_does_not_matter():
    trial = lift(noise=POSE_NOISE, seed=4)
    order = np.random.default_rng(0).permutation(20)
    assert replace(trial, gap=trial.gap[:, order], sites=trial.sites[:, order]).holds() == trial.holds()


def test_holds_are_ordered_and_snapshots_known_whatever_the_data():
    rng = np.random.default_rng(11)
    found = 0
    for _ in range(60):
        n = int(rng.integers(2, 400))
        steps = rng.normal(0, rng.choice([0.001, 0.01]), (n, 3))
        positions = np.cumsum(steps * (rng.random((n, 1)) < 0.5), axis=0)
        gap = 0.01 * np.abs(np.cumsum(rng.normal(0, 0.1, (n, 20)), axis=0))
        sites = positions[:, None] + rng.normal(0, 0.05, (n, 20, 3))
        hidden = np.repeat(rng.random(n // 7 + 1) < 0.3, 7)[:n]
        positions[hidden] = gap[hidden] = np.nan
        trial = Movement(np.arange(n) / 100, gap, positions, sites)
        holds = trial.holds()
        found += len(holds)
        assert all(one.last < other.first for one, other in pairwise(holds))
        for hold in holds:
            assert hold.first <= hold.snapshot <= hold.last
            assert np.isfinite(gap[[hold.first, hold.last, hold.snapshot]]).all()
            assert (hold.lift_onset is None) == (hold.snapshot_kind == "steadiest")
            if hold.put_down is not None:
                assert hold.lift_onset is not None
                assert hold.lift_onset < hold.put_down
    assert found > 20
