"""Simulated grasps touch the real surface, from two sides, with hands as hands are."""

import numpy as np
import pytest

from graspdb.simulate.closing import close
from graspdb.simulate.grasps import TOUCH, begin, find_grasp
from graspdb.simulate.kinds import PLANS
from graspdb.simulate.motion import perform, progress, rest_pose
from graspdb.simulate.objects import OBJECTS, make_inverted_t
from graspdb.simulate.planning import FLESH_LIMIT, PlanningHand
from graspdb_ingest.hand import HandDimensions
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, N_SITES, SITES, Side

BODIES = {name: make(np.random.default_rng(11)) for name, make in OBJECTS.items()}
PLANNED = [(name, plan) for name, body in BODIES.items() for plan in PLANS[name](body.measures)]
SOME = [
    p
    for p in PLANNED
    if (p[0], p[1].kind) in {("bottle", "cap_top"), ("mug", "handle"), ("jug", "side_power")}
]


@pytest.fixture(scope="module")
def hand():
    return PlanningHand(HandDimensions(0.186, 0.083), Side.RIGHT)


@pytest.fixture(scope="module")
def grasps(hand):
    return {
        (name, plan.kind): find_grasp(hand, BODIES[name], plan, np.random.default_rng(2))
        for name, plan in PLANNED
    }


def gaps(hand, body, q):
    return body.surface.distance(hand.points_of(q[None])[0, : hand.n_solid]) - hand.radii[: hand.n_solid]


def test_there_are_five_kinds_for_each_object():
    for name, body in BODIES.items():
        assert len({plan.kind for plan in PLANS[name](body.measures)}) == 5


def test_thumb_and_another_digit_touch_and_no_sphere_is_inside(hand, grasps):
    for (name, kind), grasp in grasps.items():
        gap = gaps(hand, BODIES[name], grasp.q)
        assert np.array_equal(gap[:N_SITES], grasp.gaps), kind
        assert gap[:N_SITES].min() > -TOUCH, (name, kind)
        assert gap.min() > -FLESH_LIMIT - 1e-4, (name, kind)
        digits = {DIGIT_OF_SITE[SITES.index(site)] for site in grasp.contacts}
        assert "thumb" in digits, (name, kind)
        assert len(digits) >= 2, (name, kind)


def test_no_grasp_touches_a_marker(hand, grasps):
    for (name, kind), grasp in grasps.items():
        centres = hand.points_of(grasp.q[None])[0, :N_SITES]
        away = np.linalg.norm(BODIES[name].markers[:, None] - centres, axis=2) - hand.radii[:N_SITES]
        assert away.min() > 0.001, (name, kind)


def test_most_of_what_was_to_touch_does(grasps):
    wanted = {(name, plan.kind): plan.contacts for name, plan in PLANNED}
    shares = [np.isin(wanted[key], grasp.contacts).mean() for key, grasp in grasps.items()]
    assert np.mean(shares) > 0.8


def test_joints_stay_inside_their_limits(hand, grasps):
    low, high = hand.hand.joint_range.T
    for grasp in grasps.values():
        for q in (grasp.q, grasp.opened):
            assert ((q[7:] >= low) & (q[7:] <= high)).all()
            assert np.linalg.norm(q[3:7]) == pytest.approx(1)


def test_the_opened_hand_has_let_go(hand, grasps):
    for (name, kind), grasp in grasps.items():
        digits = {site.split("_")[0] for site in grasp.contacts if site.endswith("_tip")} - {"little"}
        tips = [SITES.index(f"{digit}_tip") for digit in digits]
        opened, closed = (gaps(hand, BODIES[name], q)[tips].max() for q in (grasp.opened, grasp.q))
        assert opened > closed + 0.004, (name, kind)


def test_closing_again_from_open_comes_back_to_the_same_touch(hand, grasps):
    grasp, body = grasps["bottle", "side_precision"], BODIES["bottle"]
    digits = ("thumb", "index", "middle", "ring", "little")
    again = close(hand, body.surface, grasp.opened, grasp.q, digits)
    assert np.abs(gaps(hand, body, again)[:N_SITES] - grasp.gaps).max() < 1e-4


def test_a_digit_that_meets_nothing_goes_its_whole_way(hand):
    q = hand.hand.neutral()
    q[2] += 1.0
    planned = q.copy()
    planned[7 + 7] += 0.5
    closed = close(hand, BODIES["mug"].surface, q, planned, ("index",))
    assert closed[7 + 7] > planned[7 + 7]


def test_a_left_hand_begins_as_the_mirror_image_of_a_right_one(hand):
    left = PlanningHand(hand.dimensions, Side.LEFT)
    for _, plan in PLANNED:
        right_points, left_points = (h.points_of(begin(h, plan)[None])[0, :N_SITES] for h in (hand, left))
        assert left_points == pytest.approx(right_points * [1, -1, 1], abs=1e-9)


def test_panels_are_touched_by_the_two_digits_from_opposite_sides(hand):
    body = make_inverted_t(np.random.default_rng(1))
    for plan in PLANS["inverted_t"](body.measures):
        grasp = find_grasp(hand, body, plan, np.random.default_rng(3))
        tips = [SITES.index(site) for site in plan.contacts]
        points = body.surface.nearest(hand.points_of(grasp.q[None])[0, tips]).point
        half = body.measures["half_grip"]
        assert np.abs(points[:, 1]) == pytest.approx(half, abs=1e-6)
        assert points[0, 1] * points[1, 1] < 0
        assert (points[:, 2] > body.measures["panel_low"]).all()


def test_progress_is_minimum_jerk():
    times = np.linspace(0, 2, 2001)
    share = progress(times, 0.5, 1.0)
    assert share[0] == 0
    assert share[-1] == 1
    assert progress(np.array([1.0]), 0.5, 1.0) == pytest.approx(0.5)
    speed = np.gradient(share, times)
    assert speed.max() == pytest.approx(1.875, rel=1e-3)
    assert np.diff(share).min() > -1e-12


def test_a_hand_at_rest_lies_on_the_table(hand):
    q = rest_pose(hand, np.random.default_rng(0))
    low = hand.points_of(q[None])[0, : hand.n_solid, 2] - hand.radii[: hand.n_solid]
    assert low.min() == pytest.approx(0.001)


@pytest.mark.parametrize(("name", "plan"), SOME, ids=lambda x: getattr(x, "kind", x))
def test_motion_is_smooth_and_the_object_moves_only_between_lift_and_landing(hand, grasps, name, plan):
    grasp, body = grasps[name, plan.kind], BODIES[name]
    rng = np.random.default_rng(8)
    motion = next(m for m in (perform(hand, body.surface, grasp, rng, 120.0) for _ in range(9)) if m)
    resting = (motion.times <= motion.events.lift) | (motion.times >= motion.events.landed)
    for track in (motion.object_position, motion.object_rotation):
        steps = np.abs(np.diff(track, axis=0)).max(axis=1)
        assert steps[resting[1:] & resting[:-1]].max() < 1e-12
    assert motion.object_position[:, 2].max() > 0.06
    points = hand.points_of(motion.q)
    speed = np.linalg.norm(np.diff(points, axis=0), axis=2) * 120.0
    assert speed.max() < 3.0
    assert np.abs(np.diff(speed, axis=0)).max() < 0.25


def test_people_with_more_variety_are_further_from_the_plan_and_from_each_other(hand):
    plan = next(plan for plan in PLANS["bottle"](BODIES["bottle"].measures) if plan.kind == "cap_top")
    spread = {}
    for variety in (0.0, 1.0):
        found = [
            find_grasp(hand, BODIES["bottle"], plan, np.random.default_rng(seed), variety=variety).q[7:]
            for seed in range(3)
        ]
        spread[variety] = np.std(found, axis=0).mean()
    assert spread[0.0] < 1e-9  # the plan, and the same hand
    assert spread[1.0] > np.deg2rad(2)
