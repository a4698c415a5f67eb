"""What calibration changes in a hand: zero changes nothing, derivatives, and the hand that comes out."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand import HandDimensions, HandModel, build_hand
from graspdb_ingest.hand.kinematics import Kinematics
from graspdb_ingest.tracking.geometry import HandGeometry
from graspdb_schemas.manifest import MarkerPlacement
from graspdb_schemas.vocabulary import DIGITS, SITES, Side

SIDES = (Side.RIGHT, Side.LEFT)
N_CENTRES = 5 * (3 + 1 + 1 + 1)
FIRST_DIRECTION = 1 + N_CENTRES
FIRST_OFFSET = FIRST_DIRECTION + 15


@pytest.fixture(scope="module", params=SIDES)
def geometry(request, dorsal_markers):
    """Return a geometry in which some markers have to be found and one lies beyond its joint."""
    changed = {
        "forearm_1": MarkerPlacement("forearm"),
        "index_pip": MarkerPlacement("index_middle", at="index_pip"),
        "ring_dip": MarkerPlacement("ring_middle"),
    }
    placements = {**dorsal_markers, **changed}
    return HandGeometry(build_hand(HandDimensions(0.19, 0.084), request.param, placements), placements)


def random_configuration(hand, rng):
    q = hand.neutral()
    q[:3] = rng.normal(0, 0.3, 3)
    q[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    q[7:] = rng.uniform(*hand.joint_range.T)
    return q


def markers_of(geometry, parameters, q):
    workspace = Kinematics(geometry.hand)
    geometry.apply(workspace, parameters)
    workspace.move(q)
    return workspace.markers


def test_parameters_stand_in_the_documented_order(geometry):
    assert geometry.n_parameters == FIRST_OFFSET + 3 * 24
    assert np.all(geometry.prior_sd > 0)


def test_zero_parameters_leave_the_hand_as_it_is(geometry):
    q = random_configuration(geometry.hand, np.random.default_rng(1))
    zero = np.zeros(geometry.n_parameters)
    pose = geometry.hand.forward(q)
    assert np.allclose(markers_of(geometry, zero, q), pose.markers, atol=1e-12)
    again = geometry.hand.reshaped(geometry.shape(zero)).forward(q)
    assert np.allclose(again.sites, pose.sites, atol=1e-6)
    assert np.allclose(again.rotations, pose.rotations, atol=1e-5)


@pytest.mark.parametrize("spread", [0.0, 1.0, 3.0])
def test_jacobian_is_the_central_difference(geometry, spread):
    rng, h = np.random.default_rng(2), 1e-6
    parameters = spread * rng.normal(size=geometry.n_parameters) * geometry.prior_sd
    q = random_configuration(geometry.hand, rng)
    workspace = Kinematics(geometry.hand)
    differences = []
    for unit in np.eye(geometry.n_parameters):
        ends = []
        for sign in (1, -1):
            geometry.apply(workspace, parameters + sign * h * unit)
            workspace.move(q)
            ends.append(workspace.markers)
        differences.append((ends[0] - ends[1]) / (2 * h))
    geometry.apply(workspace, parameters)
    workspace.move(q)
    jacobian = geometry.jacobian(workspace, geometry.linearise(workspace, parameters))
    assert np.allclose(jacobian, np.stack(differences, axis=-1), atol=1e-8)


def test_reshaped_hand_is_the_hand_that_the_workspace_had(geometry):
    rng = np.random.default_rng(3)
    parameters = rng.normal(size=geometry.n_parameters) * geometry.prior_sd
    workspace = Kinematics(geometry.hand)
    geometry.apply(workspace, parameters)
    hand = geometry.hand.reshaped(geometry.shape(parameters))
    assert hand.side is geometry.hand.side
    assert np.array_equal(hand.radii, geometry.hand.radii)
    for _ in range(5):
        q = random_configuration(hand, rng)
        workspace.move(q)
        pose = hand.forward(q)
        assert np.allclose(pose.sites, workspace.sites, atol=2e-6)
        assert np.allclose(pose.markers, workspace.markers, atol=2e-6)


def test_joints_stay_joined_and_bones_keep_their_axes(geometry):
    rng = np.random.default_rng(4)
    parameters = rng.normal(size=geometry.n_parameters) * geometry.prior_sd
    shape, model = geometry.shape(parameters), geometry.hand.mujoco_model
    for digit in DIGITS:
        own = [site for site in SITES if site.startswith(digit)]
        for site in own[1:]:
            place = shape.site_positions[site]
            assert np.allclose(place[1:], 0, atol=1e-9)  # on the x axis of the segment
            assert place[0] > 0.5 * model.site(site).pos[0]
    hand = geometry.hand.reshaped(shape)
    pose = hand.forward(random_configuration(hand, rng))
    assert np.allclose(pose.positions[2:].reshape(5, 3, 3), pose.sites.reshape(5, 4, 3)[:, :3], atol=1e-6)


def test_size_scales_the_bones_and_nothing_else(geometry):
    parameters = np.zeros(geometry.n_parameters)
    parameters[0] = 0.07
    larger = geometry.hand.reshaped(geometry.shape(parameters))
    before, after = geometry.hand.segment_lengths, larger.segment_lengths
    assert all(after[s] == pytest.approx(1.07 * before[s], rel=1e-4) for s in before)
    assert np.array_equal(larger.radii, geometry.hand.radii)
    flat = geometry.hand.neutral()
    forearm = slice(0, 4)
    assert np.array_equal(larger.forward(flat).markers[forearm], geometry.hand.forward(flat).markers[forearm])


def test_direction_of_a_digit_turns_that_digit_alone(geometry):
    parameters = np.zeros(geometry.n_parameters)
    parameters[FIRST_DIRECTION + 3 : FIRST_DIRECTION + 6] = (0.02, -0.03, 0.05)
    flat = geometry.hand.neutral()
    before = geometry.hand.forward(flat).sites
    after = geometry.hand.reshaped(geometry.shape(parameters)).forward(flat).sites
    index = np.array([site.startswith("index") and site != "index_mcp" for site in SITES])
    assert np.linalg.norm(after - before, axis=1)[index].min() > 0.001
    assert np.allclose(after[~index], before[~index], atol=1e-6)
    base = SITES.index("index_mcp")
    turn = Rotation.from_rotvec(parameters[FIRST_DIRECTION + 3 : FIRST_DIRECTION + 6])
    body = geometry.hand.forward(flat).rotations[geometry.hand.segments.index("index_proximal")]
    expected = (before[index] - before[base]) @ body @ turn.as_matrix().T @ body.T
    assert np.allclose(after[index] - after[base], expected, atol=2e-6)


def test_hand_with_segments_of_its_own_has_marker_offsets_alone():
    sites = "".join(f'<site name="{s}" size="0.01"/>' for s in SITES)
    mjcf = (
        '<mujoco><worldbody><body name="base"><freejoint/><geom size="0.02"/><site name="marker_a"/>'
        '<body name="jaw" pos="0.05 0 0"><joint axis="0 1 0"/><geom size="0.01"/>'
        f'<site name="marker_b" pos="0 0 0.01"/>{sites}</body></body></worldbody></mujoco>'
    )
    placements = {"a": MarkerPlacement("base"), "b": MarkerPlacement("jaw", offset=(0, 0, 0.01))}
    geometry = HandGeometry(HandModel(Side.RIGHT, mjcf, ("a", "b")), placements)
    assert geometry.n_parameters == 6
    parameters = np.array([0.01, 0.02, 0.03, 0.001, 0.002, 0.003])
    q = geometry.hand.neutral()
    q[7] = 0.5
    moved = markers_of(geometry, parameters, q)
    turn = Rotation.from_rotvec([0, 0.5, 0])
    assert np.allclose(moved[0], [0.01, 0.02, 0.03])
    assert np.allclose(moved[1], np.array([0.05, 0, 0]) + turn.apply([0.001, 0.002, 0.013]))
    workspace = Kinematics(geometry.hand)
    geometry.apply(workspace, parameters)
    workspace.move(q)
    jacobian = geometry.jacobian(workspace, geometry.linearise(workspace, parameters))
    assert np.allclose(jacobian[0], np.hstack([np.eye(3), np.zeros((3, 3))]))
    assert np.allclose(jacobian[1], np.hstack([np.zeros((3, 3)), turn.as_matrix()]))


def test_drawn_capsules_reach_from_joint_to_joint_after_calibration(geometry):
    rng = np.random.default_rng(5)
    changed = geometry.hand.reshaped(
        geometry.shape(rng.normal(size=geometry.n_parameters) * geometry.prior_sd)
    )
    for hand in (geometry.hand, changed):
        model = hand.mujoco_model
        for site in SITES:
            capsule = model.geom(f"to_{site}")
            half = Rotation.from_quat(capsule.quat, scalar_first=True).apply([0, 0, capsule.size[1]])
            ends = sorted((capsule.pos + half, capsule.pos - half), key=np.linalg.norm)
            assert ends[0] == pytest.approx(np.zeros(3), abs=1e-5)
            assert ends[1] == pytest.approx(model.site(site).pos, abs=1e-5)
