"""The scene of a grasp: what the database holds, and nothing made up."""

from itertools import pairwise
from pathlib import Path

import held_can
import numpy as np
import pytest
from handmade import session_tables, trial_tables

import graspdb
from graspdb.store import Store
from graspdb.view.motion import MOST_FRAMES, Times, read_motion
from graspdb.view.reading import SceneReader
from graspdb.view.scene import ELBOW, FOREARM_DRAWN, SEGMENTS_DRAWN, WRIST, Scene
from graspdb.view.surface import triangles_between
from graspdb_schemas.errors import QueryError
from graspdb_schemas.vocabulary import SITES


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return held_can.build(tmp_path_factory.mktemp("held") / "grasps")


@pytest.fixture(scope="module")
def scene(database: Path) -> Scene:
    with graspdb.open(database) as db:
        return SceneReader(db).scene(held_can.LIFTED)


def test_the_hand_is_where_the_model_has_it(scene: Scene) -> None:
    grip = held_can.held()
    pose = grip.model.forward(grip.q)
    np.testing.assert_allclose(scene.nodes[: len(SITES)], pose.sites, atol=1e-12)
    np.testing.assert_allclose(scene.radii[: len(SITES)], grip.model.radii, atol=1e-12)
    wrist, forearm = pose.positions[1], pose.rotations[0]
    np.testing.assert_allclose(scene.nodes[WRIST], wrist, atol=1e-9)
    np.testing.assert_allclose(scene.nodes[ELBOW], wrist - FOREARM_DRAWN * forearm[:, 0], atol=1e-9)


def test_capsules_join_what_the_skeleton_joins(scene: Scene) -> None:
    capsules = scene.capsules()
    assert len(capsules) == len(SEGMENTS_DRAWN)
    ends = {(s.start, s.end) for s in SEGMENTS_DRAWN}
    for digit in range(5):
        chain = [WRIST, *range(4 * digit, 4 * digit + 4)]
        assert all(pair in ends for pair in pairwise(chain))
    assert all(r0 > 0 and r1 > 0 for *_, r0, r1 in capsules)


def test_motion_follows_hand_and_object(scene: Scene) -> None:
    motion = scene.motion
    assert motion is not None
    assert len(motion.times) == held_can.N_FRAMES
    assert motion.snapshot == held_can.LIFT
    grip = held_can.held()
    wrist = grip.model.forward(grip.q).positions[1]
    for frame in range(held_can.N_FRAMES):
        turn, place = held_can.can_pose(frame)
        away = held_can.hand_away(frame)
        np.testing.assert_allclose(motion.nodes[frame, :20], turn.apply(grip.sites) + place + away, atol=1e-9)
        np.testing.assert_allclose(motion.nodes[frame, WRIST], turn.apply(wrist) + place + away, atol=1e-9)
        assert np.linalg.norm(motion.nodes[frame, ELBOW] - motion.nodes[frame, WRIST]) == pytest.approx(
            FOREARM_DRAWN
        )
        np.testing.assert_allclose(motion.object_position[frame], place, atol=1e-12)


def test_phases_follow_each_other_without_a_hole(scene: Scene) -> None:
    motion = scene.motion
    assert motion is not None
    assert [phase.name for phase in motion.phases] == ["reach", "contact", "lift", "hold", "release"]
    for before, after in pairwise(motion.phases):
        assert before.end == after.start
    assert motion.phases[0].start == motion.times[0]
    assert motion.phases[-1].end == motion.times[-1]
    # The lift ends where 95 % of the height are reached: of ten equal steps, at the tenth.
    assert motion.phases[2].end == pytest.approx(held_can.TOP / held_can.RATE)


def test_up_is_the_labs_vertical(scene: Scene) -> None:
    np.testing.assert_allclose(scene.up, [0, 0, 1], atol=1e-12)


def test_the_surface_closes_the_can_and_faces_outwards(scene: Scene) -> None:
    surface = scene.surface
    corners = surface.points[surface.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1).sum() / 2
    assert area == pytest.approx(surface.areas.sum(), rel=0.08)
    assert len(np.unique(surface.faces)) > 0.99 * len(surface.points)
    outward = np.einsum("ni,ni->n", cross, surface.normals[surface.faces].sum(axis=1))
    assert (outward > 0).mean() > 0.99


def test_a_scene_of_one_instant_has_no_motion(database: Path) -> None:
    with graspdb.open(database) as db:
        still = SceneReader(db).scene(held_can.NAMED)
    assert still.motion is None
    assert len(still.capsules()) == len(SEGMENTS_DRAWN)


def test_a_grasp_that_is_not_there_is_named(database: Path) -> None:
    with graspdb.open(database) as db, pytest.raises(QueryError, match="no grasp 'made/lift/right/7'"):
        SceneReader(db).scene("made/lift/right/7")


def test_bare_rows_make_a_bare_scene(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "grasps")
    store.commit_session(session_tables())
    store.commit_trials([trial_tables()])
    with graspdb.open(tmp_path / "grasps") as db:
        scene = SceneReader(db).scene("s/anna_mug_0/right/0")
    # Its points lie on a line, its frames have no sites, no pose and no gap, and there is no contact map.
    assert scene.contact_map is None
    assert not np.isfinite(scene.nodes[ELBOW]).any()
    assert scene.motion is None


def test_a_hand_without_radii_says_so(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "grasps")
    tables = session_tables().tables
    store.commit_session(type(session_tables())({n: t for n, t in tables.items() if n != "hands"}))
    store.commit_trials([trial_tables()])
    with graspdb.open(tmp_path / "grasps") as db, pytest.raises(QueryError, match="radii of the hand"):
        SceneReader(db).scene("s/anna_mug_0/right/0")


@pytest.mark.parametrize("n_frames", [MOST_FRAMES, MOST_FRAMES + 1, 5 * MOST_FRAMES + 7])
def test_long_trials_are_thinned_evenly_and_keep_the_snapshot(n_frames: int) -> None:
    snapshot = n_frames // 3
    rows = {
        "frame": list(range(n_frames)),
        "time": [frame / 100 for frame in range(n_frames)],
        **dict.fromkeys(
            ("q", "sites", "object_position", "object_quaternion", "gap", "touching"), [None] * n_frames
        ),
    }
    motion = read_motion(rows, snapshot, np.full((22, 3), np.nan), None, Times(None, None, None))
    assert motion is not None
    assert len(motion.times) <= MOST_FRAMES
    assert motion.times[motion.snapshot] == snapshot / 100
    steps = np.diff(motion.times)
    assert steps.max() - steps.min() < 1e-9
    assert np.isnan(motion.nodes).all()


def test_few_points_make_no_triangles() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    normals = np.tile([0.0, 0, 1], (3, 1))
    assert triangles_between(points, normals, np.ones(3)).shape == (0, 3)
    points = np.vstack([points, [[np.nan] * 3] * 5])
    assert triangles_between(points, np.tile([0.0, 0, 1], (8, 1)), np.ones(8)).shape == (0, 3)
