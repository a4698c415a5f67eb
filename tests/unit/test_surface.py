"""Three surfaces of a hand: closed forms, nesting, mirror images, gaps that no cloud's density changes."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from graspdb_ingest.hand import HandModel
from graspdb_ingest.objects.cloud import ObjectCloud, sample_cloud
from graspdb_ingest.objects.distance import ObjectDistance
from graspdb_ingest.objects.mesh import Surface
from graspdb_ingest.parameters import CloudParameters
from graspdb_ingest.surface import SURFACES, HandPoints, hand_surface, key_points
from graspdb_ingest.surface.mesh import closed_mesh
from graspdb_ingest.surface.rounded import rounded_distances
from graspdb_ingest.surface.touch import PosedHand, pad_of, pose_hand, segment_axes, touching
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.vocabulary import SEGMENTS, SITES, Side

MIRROR = np.array([1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def hand(hands: dict[Side, HandModel]) -> HandPoints:
    """Return a right hand that is half closed, without the forearm's pose."""
    return posed(hands[Side.RIGHT], 0.6)


def posed(model: HandModel, flexion: float) -> HandPoints:
    q = model.neutral()
    for i, joint in enumerate(model.joints):
        if joint.endswith("flexion") and not joint.startswith(("wrist", "thumb")):
            q[7 + i] = flexion
    sites = model.forward(q).sites
    return HandPoints(key_points(model.palm(q)[0], sites), model.radii, model.side)


def target(mesh: trimesh.Trimesh, spacing: float = 0.002) -> ObjectDistance:
    surface = Surface(
        vertices=np.array(mesh.vertices),
        faces=np.array(mesh.faces, dtype=np.int64),
        normals=None,
        area=float(mesh.area),
        volume=None,
        extents=np.ptp(mesh.vertices, axis=0),
        watertight=bool(mesh.is_watertight),
        sha256="",
        warnings=(),
    )
    return ObjectDistance(surface, sample_cloud(surface, CloudParameters(spacing=spacing)))


def moved(hand: HandPoints, offset: np.ndarray) -> HandPoints:
    return HandPoints(hand.key_points + offset, hand.radii, hand.side)


def at(hand: HandPoints, name: str, place: ObjectDistance) -> PosedHand:
    return pose_hand(HandPoints(hand.key_points[None], hand.radii, hand.side), name, place).frame(0)


# Rounded shapes.


def sampled_distance(points: np.ndarray, centres: np.ndarray, radii: np.ndarray, n: int = 60) -> np.ndarray:
    """Return the least distance to many spheres that a wedge is the union of."""
    u, v = (g.ravel() for g in np.meshgrid(np.arange(n + 1) / n, np.arange(n + 1) / n))
    w = np.column_stack([1 - u - v, u, v])[u + v <= 1 + 1e-9]
    distances = np.linalg.norm(points[:, None] - w @ centres, axis=2) - w @ radii
    return np.asarray(distances.min(axis=1))


@given(st.integers(0, 2**32 - 1))
def test_the_closed_form_is_the_least_over_all_spheres_in_between(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centres, radii = rng.uniform(-0.05, 0.05, (3, 3)), rng.uniform(0.002, 0.02, 3)
    points = rng.uniform(-0.1, 0.1, (30, 3))
    for corners in ((0, 0, 0), (0, 1, 1), (0, 1, 2)):
        shape = np.array([corners])
        exact = rounded_distances(points, centres, radii, shape).distance
        dense = sampled_distance(points, centres[list(corners)], radii[list(corners)])
        assert (exact <= dense + 1e-12).all()
        assert exact == pytest.approx(dense, abs=4e-4)


def test_a_capsule_of_one_radius_is_a_cylinder_with_round_ends() -> None:
    centres, radii = np.array([[0.0, 0, 0], [0.04, 0, 0]]), np.array([0.01, 0.01])
    points = np.array([[0.02, 0.03, 0], [0.07, 0, 0], [-0.03, 0, 0.04], [0.01, 0, 0]])
    found = rounded_distances(points, centres, radii, np.array([[0, 1, 1]]))
    assert found.distance == pytest.approx([0.02, 0.02, 0.04, -0.01])
    assert found.weights[:, 0] == pytest.approx([0.5, 0, 1, 0.75])


@given(st.integers(0, 2**32 - 1))
def test_what_is_nearest_of_many_shapes_is_so_of_all_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centres, radii = rng.uniform(-0.1, 0.1, (40, 3)), rng.uniform(0.002, 0.03, 40)
    shapes = rng.integers(0, 40, (50, 3))
    shapes[:10, 1:], shapes[10:30, 2] = shapes[:10, :1], shapes[10:30, 1]
    points = rng.uniform(-0.2, 0.2, (100, 3))
    found = rounded_distances(points, centres, radii, shapes)
    alone = [rounded_distances(points, centres, radii, shape[None]).distance for shape in shapes]
    assert np.array_equal(found.distance, np.min(alone, axis=0))
    corners = shapes[found.shape]
    nearest = np.einsum("nk,nki->ni", found.weights, centres[corners])
    radius = np.sum(found.weights * radii[corners], axis=1)
    assert np.linalg.norm(points - nearest, axis=1) - radius == pytest.approx(found.distance, abs=1e-12)


# The surfaces of a hand.


def test_each_surface_holds_the_one_before(hand: HandPoints) -> None:
    points = hand.sites.mean(axis=0) + np.random.default_rng(0).uniform(-0.12, 0.12, (3000, 3))
    spheres, capsules, skin = (hand_surface(hand, name).distances(points).distance for name in SURFACES)
    assert (capsules <= spheres + 1e-12).all()
    assert (skin <= capsules + 1e-12).all()
    assert (skin < capsules - 1e-4).mean() > 0.2


@pytest.mark.parametrize("name", SURFACES)
def test_a_surface_moves_with_its_hand(hand: HandPoints, name: str) -> None:
    rng = np.random.default_rng(1)
    turn, offset = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    points = hand.sites.mean(axis=0) + rng.uniform(-0.1, 0.1, (300, 3))
    there = HandPoints(hand.key_points @ turn.T + offset, hand.radii, hand.side)
    expected = hand_surface(hand, name).distances(points)
    found = hand_surface(there, name).distances(points @ turn.T + offset)
    assert found.distance == pytest.approx(expected.distance, abs=1e-12)


@pytest.mark.parametrize("name", SURFACES)
def test_a_left_hand_is_the_mirror_image(hand: HandPoints, name: str) -> None:
    points = hand.sites.mean(axis=0) + np.random.default_rng(2).uniform(-0.1, 0.1, (300, 3))
    left = HandPoints(hand.key_points * MIRROR, hand.radii, Side.LEFT)
    expected = hand_surface(hand, name).distances(points)
    found = hand_surface(left, name).distances(points * MIRROR)
    assert found.distance == pytest.approx(expected.distance, abs=1e-12)


def test_many_frames_are_built_as_each_alone(hands: dict[Side, HandModel]) -> None:
    alone = [posed(hands[Side.LEFT], flexion) for flexion in (0.0, 0.5, 1.0)]
    together = HandPoints(np.stack([h.key_points for h in alone]), alone[0].radii, Side.LEFT)
    for name in SURFACES:
        built = hand_surface(together, name)
        for i, one in enumerate(alone):
            assert built.frame(i).centres == pytest.approx(hand_surface(one, name).centres, abs=1e-12)


def test_key_points_show_the_directions_that_the_hand_model_has(hands: dict[Side, HandModel]) -> None:
    for model in hands.values():
        q = model.neutral()
        for i, joint in enumerate(model.joints):
            q[7 + i] = 0.5 if "flexion" in joint and not joint.startswith("wrist") else 0.0
        pose, (wrist, _) = model.forward(q), model.palm(q)
        points = HandPoints(key_points(wrist, pose.sites), model.radii, model.side)
        mirror = np.array([1, 1 if model.side is Side.RIGHT else -1, 1])
        for segment in SEGMENTS[2:]:
            true = (pose.rotations[model.segments.index(segment)] * mirror).T
            cosines = np.sum(true * segment_axes(points, segment), axis=1)
            assert np.rad2deg(np.arccos(cosines.clip(-1, 1))).max() < 15, segment


@pytest.mark.parametrize("name", SURFACES)
def test_the_mesh_around_a_hand_is_closed_and_lies_on_its_surface(hand: HandPoints, name: str) -> None:
    surface = hand_surface(hand, name)
    mesh = closed_mesh(surface, spacing=0.003)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert np.abs(surface.distances(mesh.vertices).distance).max() < 1e-4
    assert name != "skin" or (mesh.body_count == 1 and 2e-4 < mesh.volume < 5e-4)


def test_hands_that_are_none_are_refused(hand: HandPoints) -> None:
    with pytest.raises(ParameterError, match="radius of index_pip"):
        HandPoints(hand.key_points, hand.radii * (np.array(SITES) != "index_pip"), hand.side)
    with pytest.raises(ParameterError, match="radius of thumb_cmc"):
        HandPoints(hand.key_points, np.full(20, np.nan), hand.side)
    with pytest.raises(ParameterError, match="key points"):
        HandPoints(hand.key_points[1:], hand.radii, hand.side)
    with pytest.raises(ParameterError, match="did you mean 'spheres'"):
        hand_surface(hand, "sphere")
    with pytest.raises(ParameterError, match="finite"):
        closed_mesh(hand_surface(moved(hand, np.array([np.nan, 0, 0])), "spheres"))


# Gaps and contacts.


def test_gaps_of_spheres_to_a_ball_and_a_box_are_exact(hand: HandPoints) -> None:
    centre = hand.sites.mean(axis=0) + np.array([0, 0, 0.3])
    ball = trimesh.creation.icosphere(5, 0.03)
    found = at(moved(hand, -centre), "spheres", target(ball)).gaps
    expected = np.linalg.norm(hand.sites - centre, axis=1) - 0.03 - hand.radii
    assert found.gap == pytest.approx(expected, abs=3e-5)
    box = target(trimesh.creation.box((0.04, 0.06, 0.08)))
    near = moved(hand, -centre)
    beyond = np.abs(near.sites) - [0.02, 0.03, 0.04]
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
    assert at(near, "spheres", box).gaps.gap == pytest.approx(outside - hand.radii, abs=1e-6)


def test_a_sphere_inside_an_object_has_a_signed_gap() -> None:
    points = np.zeros((1, 21, 3)) + np.arange(21)[:, None] * [1e-3, 0, 0]
    deep = HandPoints(points, np.full(20, 0.002), Side.RIGHT)
    gaps = pose_hand(deep, "spheres", target(trimesh.creation.box((0.1, 0.1, 0.1)))).frame(0).gaps
    assert gaps.gap == pytest.approx(np.abs(points[0, 1:, 0]) - 0.05 - 0.002, abs=1e-6)


@pytest.mark.parametrize("name", ["capsules", "skin"])
def test_gaps_are_the_least_over_each_sites_part(hand: HandPoints, name: str) -> None:
    ball = target(trimesh.creation.icosphere(5, 0.03))
    near = moved(hand, -hand.sites.mean(axis=0) + [0, 0, -0.05])
    posed_hand = at(near, name, ball)
    surface = posed_hand.surface
    for site in range(20):
        own = np.flatnonzero(surface.sites == site)
        # Seen from a ball's centre, the least distance to the shapes is that of the ball, and its radius.
        least = rounded_distances(np.zeros((1, 3)), surface.centres, surface.radii, surface.shapes[own])
        assert posed_hand.gaps.gap[site] == pytest.approx(least.distance[0] - 0.03, abs=5e-5), SITES[site]


def test_contact_does_not_depend_on_the_density_of_the_cloud(hand: HandPoints) -> None:
    mesh = trimesh.creation.cylinder(0.02, 0.12, sections=64)
    near = moved(hand, -hand.site("middle_pip") + [0, 0, 0.03])
    for name in SURFACES:
        found = [at(near, name, target(mesh, spacing)) for spacing in (0.001, 0.002, 0.004)]
        touched = [touching(one, 0.02, target(mesh, 0.004)) for one in found]
        assert len(touched[0].sites) > 0
        for other in touched[1:]:
            assert np.array_equal(other.gap, touched[0].gap)
            assert np.array_equal(other.positions, touched[0].positions)


def test_the_gap_to_a_bare_cloud_is_that_to_its_nearest_point(hand: HandPoints) -> None:
    rng = np.random.default_rng(3)
    points = hand.sites.mean(axis=0) + [0, 0, -0.06] + rng.uniform(-0.05, 0.05, (400, 3)) * [1, 1, 0.1]
    cloud = ObjectCloud(points, np.tile([0.0, 0, 1], (400, 1)), np.ones(400), 0.002)
    bare = Surface(points, None, None, None, None, np.ptp(points, axis=0), False, "", ())
    for name in SURFACES:
        posed_hand = at(hand, name, ObjectDistance(bare, cloud))
        surface = posed_hand.surface
        for site in range(20):
            own = surface.shapes[surface.sites == site]
            least = rounded_distances(points, surface.centres, surface.radii, own).distance.min()
            assert posed_hand.gaps.gap[site] == pytest.approx(least, abs=3e-4), (name, SITES[site])


def test_unknown_frames_have_no_gaps(hand: HandPoints) -> None:
    frames = np.stack([hand.key_points, np.full((21, 3), np.nan)])
    place = target(trimesh.creation.icosphere(3, 0.03))
    for name in SURFACES:
        gaps = pose_hand(HandPoints(frames, hand.radii, hand.side), name, place).gaps
        assert np.isfinite(gaps.gap[0]).all()
        assert np.isnan(gaps.gap[1]).all()
        assert (gaps.shapes[1] == -1).all()


def test_pads_are_told_apart_by_the_angle_around_the_segment(hand: HandPoints) -> None:
    distal, radial, dorsal = segment_axes(hand, "index_distal")
    for direction, pad in ((-dorsal, "palmar"), (dorsal, "dorsal"), (radial, "radial"), (-radial, "ulnar")):
        assert pad_of(hand, "index_distal", direction + 0.3 * distal) == pad
    assert pad_of(hand, "index_distal", distal - 0.5 * dorsal) == "tip"
    assert pad_of(hand, "index_middle", distal - 0.5 * dorsal) == "palmar"


def test_a_plate_under_the_finger_pads_touches_their_palmar_side(hands: dict[Side, HandModel]) -> None:
    for side, model in hands.items():
        flat = posed(model, 0.0)
        palmar = -flat.palm_axes[2]
        tips = [(flat.site(tip), flat.radius(tip)) for tip in ("index_tip", "middle_tip")]
        lowest = max(float(palmar @ centre) + radius for centre, radius in tips)
        plate = trimesh.creation.box((0.5, 0.5, 0.01))
        turn = trimesh.geometry.align_vectors([0, 0, 1], -palmar)
        turn[:3, 3] = palmar * (lowest + 0.005)
        plate.apply_transform(turn)
        place = target(plate, 0.01)
        found = touching(at(flat, "capsules", place), 0.003, place)
        pads = dict(zip(found.segments, found.pads, strict=True))
        assert pads["middle_distal"] == "palmar", side
