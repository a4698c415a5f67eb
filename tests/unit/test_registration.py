"""A model registered to partial, noisy clouds of itself in motion, against the motion that made them."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.objects.registration import RegistrationParameters, first_pose, register


def model_of(mesh):
    surface = Surface(
        np.array(mesh.vertices), np.array(mesh.faces), None, float(mesh.area), None, np.ones(3), True, "", ()
    )
    return sample_cloud(surface)


@pytest.fixture(scope="module")
def mug():
    """Return a mug: a cup and a handle, which tells how it is turned."""
    cup = trimesh.creation.cylinder(0.04, 0.09, sections=64)
    handle = trimesh.creation.torus(0.025, 0.006)
    handle.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    handle.apply_translation([0.05, 0, 0])
    return model_of(trimesh.util.concatenate([cup, handle]))


def seen(model: ObjectCloud, turn, shift, noise, rng, camera=(0.0, -0.8, 0.4)):
    """Return what a camera sees of a model at a pose: the points that face it, with noise [m]."""
    points, normals = model.points @ turn.T + shift, model.normals @ turn.T
    facing = np.einsum("ni,ni->n", normals, np.array(camera) - points) > 0.1 * np.linalg.norm(
        np.array(camera) - points, axis=1
    )
    return points[facing] + noise * rng.normal(size=(int(facing.sum()), 3))


def error(found, turn, shift, middle):
    """Return the error of a pose: of the object's middle [m] and of its rotation [rad]."""
    there = turn @ middle + shift
    return (
        float(np.linalg.norm(found.rotation @ middle + found.position - there)),
        float(Rotation.from_matrix(found.rotation @ turn.T).magnitude()),
    )


@pytest.mark.parametrize(
    ("noise", "reach", "degrees"), [(0.0, 1e-6, 1e-3), (0.001, 0.0002, 0.3), (0.003, 0.001, 1.5)]
)
def test_a_mug_followed_from_cloud_to_cloud(mug, noise, reach, degrees):
    # The handle, 12 mm thick, moves by up to 10 mm from one cloud to the next.
    rng = np.random.default_rng(0)
    turn, shift = Rotation.from_euler("z", -1.2).as_matrix(), np.array([0.0, 0.0, 0.1])
    rotation, position = turn, shift
    errors = []
    for step in range(25):
        turn = Rotation.from_rotvec([0.02, 0.01, 0.04]).as_matrix() @ turn
        shift = shift + np.array([0.004, 0.003, 0.005])
        found = register(mug, seen(mug, turn, shift, noise, rng), rotation, position)
        assert found.reason is None, step
        rotation, position = found.rotation, found.position
        errors.append(error(found, turn, shift, mug.points.mean(axis=0)))
        assert found.residual == pytest.approx(noise, rel=0.3, abs=3e-4)
    middle, angle = np.mean(errors, axis=0)
    assert middle < reach
    assert np.degrees(angle) < degrees


def test_points_that_are_not_the_object_do_not_move_it(mug):
    rng = np.random.default_rng(1)
    turn, shift = np.eye(3), np.zeros(3)
    own = seen(mug, turn, shift, 0.001, rng)
    table = np.column_stack([rng.uniform(-0.3, 0.3, (3000, 2)), np.full(3000, -0.055)])
    hand = rng.normal(size=(300, 3)) * 0.01 + [-0.05, -0.03, 0.02]
    broken = np.full((50, 3), np.nan)
    start = Rotation.from_rotvec([0.03, -0.02, 0.03]).as_matrix()
    found = register(mug, np.concatenate([own, table, hand, broken]), start, shift + 0.004)
    middle, angle = error(found, turn, shift, mug.points.mean(axis=0))
    print(f"\nothers {1e3 * middle:.3f} mm {np.degrees(angle):.3f}")
    assert middle < 0.002
    assert np.degrees(angle) < 1.5


def test_the_same_clouds_give_the_same_pose_to_the_last_bit(mug):
    points = seen(mug, np.eye(3), np.zeros(3), 0.001, np.random.default_rng(2))
    first, second = (register(mug, points, np.eye(3), np.array([0.003, 0, 0])) for _ in range(2))
    assert np.array_equal(first.rotation, second.rotation)
    assert np.array_equal(first.position, second.position)


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        (np.empty((0, 3)), "no finite point"),
        (np.full((100, 3), np.nan), "no finite point"),
        (np.full((100, 3), 1.0), "no point of the cloud within"),
        (np.array([[0.04, 0, 0]] * 5), "5 points of the cloud within"),
    ],
)
def test_a_cloud_that_does_not_show_the_object_says_why(mug, points, reason):
    found = register(mug, points, np.eye(3), np.zeros(3))
    assert reason in str(found.reason)
    assert np.isnan(found.rotation).all()


def test_a_cloud_of_something_else_is_no_pose(mug):
    rng = np.random.default_rng(3)
    fog = rng.uniform(-0.06, 0.06, size=(4000, 3))
    found = register(mug, fog, np.eye(3), np.zeros(3), RegistrationParameters(maximum_residual=0.003))
    assert found.reason is not None


def test_a_first_pose_is_found_without_a_beginning(mug):
    rng = np.random.default_rng(4)
    turn, shift = Rotation.from_rotvec([0.5, -0.4, 2.0]).as_matrix(), np.array([0.2, -0.1, 0.3])
    points = seen(mug, turn, shift, 0.001, rng, camera=(0.9, -0.8, 0.9))
    found = first_pose(mug, points, RegistrationParameters())
    assert found.reason is None
    middle, angle = error(found, turn, shift, mug.points.mean(axis=0))
    print(f"\nfirst {1e3 * middle:.3f} mm {np.degrees(angle):.3f}")
    assert middle < 0.004
