"""The hand model: its size, its mirror image, its signs, its derivatives, and what it refuses."""

import pickle
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand import HandDimensions, HandModel, build_hand
from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_schemas.errors import HandModelError, ParameterError
from graspdb_schemas.vocabulary import (
    CONFIGURATION,
    DIGITS,
    FINGERS,
    JOINT_ANGLES,
    N_DOF,
    N_Q,
    SEGMENTS,
    SITES,
    Side,
)

SIDES = (Side.RIGHT, Side.LEFT)
MIRROR = np.array([1.0, -1.0, 1.0])


def random_configuration(hand, rng):
    q = hand.neutral()
    q[:3] = rng.normal(0, 0.3, 3)
    q[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    q[7:] = rng.uniform(*hand.joint_range.T)
    return q


def tip_movement(hand, joint, digit, angle=0.2):
    """How the digit's tip moves, in the hand's frame, when one joint of the flat hand turns."""
    flat = hand.neutral()
    bent = flat.copy()
    bent[CONFIGURATION.index(joint)] = angle
    tip = SITES.index(f"{digit}_tip")
    return hand.forward(bent).sites[tip] - hand.forward(flat).sites[tip]


@pytest.mark.parametrize("side", SIDES)
def test_hand_has_the_degrees_of_freedom_and_the_sites_of_the_vocabulary(hands, side):
    hand = hands[side]
    assert (hand.n_dof, hand.n_q) == (N_DOF, N_Q) == (29, 30)
    assert hand.joints == JOINT_ANGLES
    assert hand.segments == SEGMENTS
    pose = hand.forward(hand.neutral())
    assert pose.sites.shape == (20, 3)
    assert pose.markers.shape == (24, 3)
    assert pose.positions.shape == (17, 3)


def test_left_hand_is_the_mirror_image_of_the_right_one_at_equal_angles(hands):
    rng = np.random.default_rng(1)
    right, left = hands[Side.RIGHT], hands[Side.LEFT]
    assert np.array_equal(right.joint_range, left.joint_range)
    for _ in range(20):
        q = right.neutral()
        q[7:] = rng.uniform(*right.joint_range.T)
        here, there = right.forward(q), left.forward(q)
        assert np.allclose(here.sites * MIRROR, there.sites, atol=1e-6)
        assert np.allclose(here.markers * MIRROR, there.markers, atol=1e-6)
        mirrored = here.rotations * np.outer(MIRROR, MIRROR)
        assert np.allclose(mirrored, there.rotations, atol=1e-5)


def test_mirrored_pose_of_the_forearm_mirrors_the_left_hand_in_the_lab(hands):
    q = random_configuration(hands[Side.RIGHT], np.random.default_rng(2))
    mirrored = q.copy()
    mirrored[:3] *= MIRROR
    mirrored[[4, 6]] *= -1  # a mirror at y = 0 keeps turns about y and reverses those about x and z
    right, left = hands[Side.RIGHT].forward(q), hands[Side.LEFT].forward(mirrored)
    assert np.allclose(right.sites * MIRROR, left.sites, atol=1e-6)


@pytest.mark.parametrize("length", [0.06, 0.16, 0.19, 0.21])
def test_flat_middle_finger_ends_one_hand_length_from_the_wrist(length):
    hand = build_hand(HandDimensions(length, 0.44 * length), Side.RIGHT, {})
    pose = hand.forward(hand.neutral())
    tip = SITES.index("middle_tip")
    end = pose.sites[tip, 0] + hand.radii[tip]
    assert end == pytest.approx(0.99 * length, rel=1e-4)  # sum of the shares in the study's table


def test_segment_lengths_grow_with_the_hand_alone():
    small = build_hand(HandDimensions(0.16, 0.08), Side.LEFT, {}).segment_lengths
    large = build_hand(HandDimensions(0.20, 0.08), Side.LEFT, {}).segment_lengths
    assert tuple(small) == SEGMENTS[2:]
    for segment in small:
        if not segment.endswith("distal"):
            assert large[segment] / small[segment] == pytest.approx(1.25, rel=1e-4)
    assert large["index_proximal"] == pytest.approx(0.245 * 0.20, rel=1e-4)


def test_distal_segment_and_its_tip_sphere_together_have_the_bone_length():
    hand = build_hand(HandDimensions(0.19, 0.084), Side.RIGHT, {})
    radius = hand.radii[SITES.index("ring_tip")]
    assert hand.segment_lengths["ring_distal"] + radius == pytest.approx(0.107 * 0.19, rel=1e-4)


def test_radii_are_half_the_caliper_thickness_and_elsewhere_scale_with_breadth():
    measured = {"index_pip": 0.019, "thumb_tip": 0.0141}
    narrow = build_hand(HandDimensions(0.19, 0.080, measured), Side.RIGHT, {}).radii
    broad = build_hand(HandDimensions(0.19, 0.092, measured), Side.RIGHT, {}).radii
    for site, a, b in zip(SITES, narrow, broad, strict=True):
        if site in measured:
            assert a == pytest.approx(measured[site] / 2, rel=1e-5)
            assert b == pytest.approx(measured[site] / 2, rel=1e-5)
        else:
            assert b / a == pytest.approx(0.092 / 0.080, rel=1e-4)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("joint", [j for j in JOINT_ANGLES if j.endswith("flexion")])
def test_flexion_brings_the_tip_towards_the_palm_side(hands, side, joint):
    digit = joint.partition("_")[0]
    movement = tip_movement(hands[side], joint, "middle" if digit == "wrist" else digit)
    assert movement[2] < -0.001


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("finger", FINGERS)
def test_finger_abduction_leads_away_from_the_middle_finger(hands, side, finger):
    radial = 1 if side is Side.RIGHT else -1
    away = -radial if finger in ("ring", "little") else radial
    movement = tip_movement(hands[side], f"{finger}_mcp_abduction", finger)
    assert away * movement[1] > 0.01
    assert abs(movement[2]) < 1e-6


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("joint", ["thumb_cmc_abduction", "thumb_mcp_abduction"])
def test_thumb_abduction_leads_to_the_palm_side(hands, side, joint):
    assert tip_movement(hands[side], joint, "thumb")[2] < -0.005


@pytest.mark.parametrize("side", SIDES)
def test_thumb_flexion_leads_across_the_palm_and_wrist_deviation_to_the_thumb(hands, side):
    radial = 1 if side is Side.RIGHT else -1
    for joint in ("thumb_cmc_flexion", "thumb_mcp_flexion", "thumb_ip_flexion"):
        assert radial * tip_movement(hands[side], joint, "thumb")[1] < -0.001
    assert radial * tip_movement(hands[side], "wrist_deviation", "middle")[1] > 0.02


def test_flat_hand_lies_with_its_fingers_in_order_and_its_thumb_radial(hands):
    sites = hands[Side.RIGHT].forward(hands[Side.RIGHT].neutral()).sites
    tips = [sites[SITES.index(f"{digit}_tip")] for digit in DIGITS]
    assert all(a[1] > b[1] + 0.01 for a, b in pairwise(tips))


def test_markers_lie_on_the_dorsal_side_one_radius_over_their_site(hands):
    hand = hands[Side.RIGHT]
    pose = hand.forward(random_configuration(hand, np.random.default_rng(3)))
    arms = pose.markers[4:] - pose.sites
    assert np.allclose(np.linalg.norm(arms, axis=1), hand.radii, atol=1e-6)
    carriers = [SEGMENTS.index(s) for s in ("hand", "index_proximal")]
    up = pose.rotations[carriers, :, 2]
    of = [SITES.index(s) for s in ("index_mcp", "index_pip")]
    assert np.allclose(arms[of] / hand.radii[of, None], up, atol=1e-4)


@pytest.mark.parametrize("side", SIDES)
def test_mjcf_is_its_own_round_trip_and_opens_from_a_file(hands, side, tmp_path):
    hand = hands[side]
    spec = mujoco.MjSpec.from_string(hand.mjcf)
    spec.compile()
    assert spec.to_xml() == hand.mjcf
    hand.write(tmp_path / "hand.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "hand.xml"))
    assert (model.nq, model.nv) == (N_Q, N_DOF)
    assert [model.joint(i).name for i in range(1, model.njnt)] == list(JOINT_ANGLES)


def test_pickled_hand_is_the_same_hand(hands):
    hand = hands[Side.LEFT]
    assert hand.radii.shape == (20,)  # the model is compiled, and must not travel along
    parcel = pickle.dumps(hand)
    assert len(parcel) < 1.1 * len(hand.mjcf) + 1000
    again = pickle.loads(parcel)
    assert again == hand
    q = random_configuration(hand, np.random.default_rng(4))
    assert np.array_equal(again.forward(q).sites, hand.forward(q).sites)


def test_many_configurations_at_once_are_the_same_as_one_by_one(hands):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(5)
    q = np.array([random_configuration(hand, rng) for _ in range(6)]).reshape(2, 3, N_Q)
    together = hand.forward(q)
    assert together.sites.shape == (2, 3, 20, 3)
    assert together.rotations.shape == (2, 3, 17, 3, 3)
    for i in np.ndindex(2, 3):
        assert np.array_equal(together.sites[i], hand.forward(q[i]).sites)
        assert np.array_equal(together.markers[i], hand.forward(q[i]).markers)


def test_unknown_configuration_gives_unknown_places(hands):
    pose = hands[Side.RIGHT].forward(np.full(N_Q, np.nan))
    assert np.isnan(pose.sites).all()
    assert np.isnan(pose.markers).all()


@given(seed=st.integers(0, 2**32 - 1), size=st.floats(1e-6, 1.5))
def test_integrate_undoes_difference(hands, seed, size):
    hand, rng = hands[Side.RIGHT], np.random.default_rng(seed)
    q, step = random_configuration(hand, rng), rng.normal(size=N_DOF)
    step *= size / np.linalg.norm(step)
    moved = hand.integrate(q, step)
    assert np.linalg.norm(moved[3:7]) == pytest.approx(1, abs=1e-12)
    assert np.allclose(hand.difference(q, moved), step, atol=1e-9)
    assert np.allclose(hand.integrate(q, hand.difference(q, moved)), moved, atol=1e-9)


def foreign_hand():
    """Return a gripper with joints and bodies of its own names, that carries the 20 sites."""
    rng = np.random.default_rng(6)
    rows = [
        f'<site name="{site}" pos="{p[0]} {p[1]} {p[2]}" size="0.008"/>'
        for site, p in zip(SITES, rng.normal(0, 0.03, (20, 3)), strict=True)
    ]
    return f"""<mujoco><worldbody><body name="base"><freejoint/><geom size="0.02"/>{"".join(rows[:8])}
      <site name="marker_m1" pos="0.01 0.02 0.03"/>
      <body name="jaw" pos="0.05 0 0.01"><joint name="jaw_turn" axis="0 1 0" range="-60 60"/>
        <geom size="0.01"/>{"".join(rows[8:14])}<site name="marker_m2" pos="0.02 0 0.01"/>
        <body name="claw" pos="0.04 0.01 0"><joint name="claw_turn" axis="0.6 0 0.8" pos="0.002 0 0.001"/>
          <geom size="0.01"/>{"".join(rows[14:])}<site name="marker_m3" pos="0 0 0"/>
    </body></body></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def gripper():
    return HandModel(Side.RIGHT, foreign_hand(), ("m3", "m1", "m2"))


def test_foreign_hand_keeps_the_names_of_its_joints(gripper):
    assert gripper.joints == ("jaw_turn", "claw_turn")
    assert (gripper.n_q, gripper.n_dof) == (9, 8)
    assert gripper.segments == ()
    assert np.allclose(gripper.joint_range, [[-np.pi / 3, np.pi / 3], [-np.pi, np.pi]])
    markers = gripper.forward(gripper.neutral()).markers
    assert np.allclose(markers, [[0.09, 0.01, 0.01], [0.01, 0.02, 0.03], [0.07, 0, 0.02]])


@pytest.mark.parametrize("which", ["right", "left", "foreign"])
def test_jacobians_are_the_central_differences(hands, gripper, which):
    hand = gripper if which == "foreign" else hands[Side(which)]
    rng, h = np.random.default_rng(7), 1e-6
    workspace = Kinematics(hand)
    for _ in range(3):
        q = random_configuration(hand, rng)
        poses = [
            [hand.forward(hand.integrate(q, sign * h * unit)) for sign in (1, -1)]
            for unit in np.eye(hand.n_dof)
        ]
        sites = np.stack([(p.sites - m.sites) / (2 * h) for p, m in poses], axis=-1)
        markers = np.stack([(p.markers - m.markers) / (2 * h) for p, m in poses], axis=-1)
        assert np.allclose(hand.site_jacobian(q), sites, atol=1e-8)
        assert np.allclose(hand.marker_jacobian(q), markers, atol=1e-8)
        workspace.move(q)
        assert np.allclose(workspace.marker_jacobian(), markers, atol=1e-8)
        assert np.array_equal(workspace.sites, hand.forward(q).sites)
        assert np.array_equal(workspace.markers, hand.forward(q).markers)


def test_workspace_follows_a_marker_moved_from_its_segments_origin(gripper):
    workspace = Kinematics(gripper)
    workspace.model.site("marker_m3").pos[:] = (0.01, 0.02, 0.03)
    workspace.move(gripper.neutral())
    assert np.allclose(workspace.markers[0], [0.10, 0.03, 0.04])


@pytest.mark.parametrize(
    ("length", "breadth", "thickness", "named"),
    [
        (190, 84, {}, "hand_length"),
        (0.02, 0.01, {}, "hand_length"),
        (np.nan, 0.08, {}, "hand_length"),
        (0.19, 84, {}, "hand_breadth"),
        (0.19, 0.01, {}, "hand_breadth"),
        (0.19, 0.084, {"index_pip": 19.0}, "joint_thickness.index_pip"),
        (0.19, 0.084, {"index_pip": 0.0}, "joint_thickness.index_pip"),
        (0.19, 0.084, {"index_pipp": 0.019}, "did you mean 'index_pip'"),
    ],
)
def test_implausible_dimensions_are_refused_by_name(length, breadth, thickness, named):
    with pytest.raises(ParameterError, match=named):
        HandDimensions(length, breadth, thickness)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('name="ring_pip"', 'name="ring_pipp"', "lacks the sites ring_pip"),
        ('name="marker_m2"', 'name="m2"', "lacks the sites marker_m2"),
        ('<joint name="jaw_turn"', '<joint type="slide" name="jaw_turn"', "free joint followed by hinges"),
        ("<freejoint/>", "", "free joint followed by hinges"),
        ("</mujoco>", "", "cannot compile"),
    ],
)
def test_foreign_hand_that_cannot_be_tracked_is_refused(old, new, complaint):
    mjcf = foreign_hand()
    assert old in mjcf
    with pytest.raises(HandModelError, match=complaint):
        HandModel(Side.RIGHT, mjcf.replace(old, new), ("m1", "m2"))


def test_configuration_of_another_hand_is_refused(hands, gripper):
    with pytest.raises(HandModelError, match="shape"):
        hands[Side.RIGHT].forward(gripper.neutral())
    with pytest.raises(HandModelError, match="shape"):
        gripper.marker_jacobian(hands[Side.RIGHT].neutral())
