"""A macaque's two hands from files to rows: joints and axes of its own, the left the mirror image."""

from pathlib import Path

import numpy as np
import pytest
import recording_files
import trimesh
import yaml
from foreign_hands import write_macaque

import graspdb
from graspdb_ingest.hand.foreign import load_hand
from graspdb_ingest.input_key import input_key, session_inputs
from graspdb_ingest.parameters import IngestParameters
from graspdb_schemas.manifest_reader import BUILT_IN_MARKERS, parse_manifest
from graspdb_schemas.vocabulary import Side

RATE, N = 120.0, 240
BALL = {"ball_1": (0.02, 0, 0), "ball_2": (0, 0.02, 0), "ball_3": (0, 0, 0.02), "ball_4": (-0.02, 0, 0)}


def macaque_grasp(hand, rng):
    """Return configurations of a hand that closes and opens about the origin, shape (N, n_q)."""
    t = np.arange(N) / RATE
    low, high = hand.joint_range.T
    share = 0.5 + 0.3 * np.sin(2 * np.pi * 0.5 * t[:, None] + rng.uniform(-0.5, 0.5, len(low)))
    q = np.repeat(hand.neutral()[None], N, axis=0)
    q[:, 7:] = low + share * (high - low)
    q[:, :3] = np.stack([-0.05 + 0.01 * np.sin(t), 0.01 * np.cos(2 * t), 0.02 + 0 * t], axis=1)
    return q


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("macaque")
    model = write_macaque(folder / "hands")
    rng = np.random.default_rng(0)
    truth, labels, columns = {}, [], []
    for side, shift in ((Side.RIGHT, 0.0), (Side.LEFT, 0.15)):
        hand = load_hand(model, side, BUILT_IN_MARKERS, mirrored=side is Side.LEFT).hand
        q = macaque_grasp(hand, rng)
        q[:, 1] += shift
        pose = hand.forward(q)
        truth[side] = pose.sites
        labels += [f"{side}_{label}" for label in hand.markers]
        columns.append(pose.markers)
    columns.append(np.broadcast_to(np.array(list(BALL.values())), (N, 4, 3)))
    positions = np.concatenate(columns, axis=1) + rng.normal(0, 0.0003, (N, len(labels) + 4, 3))
    (folder / "trials").mkdir()
    recording_files.write_trc(folder / "trials/m_ball.trc", [*labels, *BALL], 1000 * positions, RATE)
    (folder / "objects").mkdir()
    trimesh.creation.icosphere(subdivisions=4, radius=20).export(folder / "objects/ball.stl")
    manifest = {
        "graspdb_session": 1,
        "id": "macaque",
        "units": "mm",
        "up": [0, 0, 1],
        "subjects": {"m": {"hand": "both", "model": {"right": "hands/macaque.xml"}}},
        "objects": {
            "ball": {
                "mesh": "objects/ball.stl",
                "markers": {k: [1000 * x for x in v] for k, v in BALL.items()},
            }
        },
        "trials": [{"file": "trials/m_ball.trc", "subject": "m", "object": "ball"}],
    }
    (folder / "session.yaml").write_text(yaml.safe_dump(manifest))
    return folder, truth


@pytest.fixture(scope="module")
def database(session, tmp_path_factory):
    db = tmp_path_factory.mktemp("db") / "grasps"
    report = graspdb.ingest(session[0], db)
    assert [trial.status for trial in report.trials] == ["ok"], report.trials
    with graspdb.open(db) as opened:
        yield opened


@pytest.mark.parametrize("side", list(Side))
def test_each_hand_is_followed_with_its_own_number_of_joints(session, database, side):
    rows = database.sql(
        "SELECT q, q_sd, sites FROM frames WHERE side = $side ORDER BY frame", side=side
    ).rows()
    assert {(len(q), len(sd)) for q, sd, _ in rows} == {(31, 30)}
    error = np.linalg.norm(np.array([sites for *_, sites in rows]) - session[1][side], axis=2)
    assert error.mean() < 0.0006
    assert error.max() < 0.004


def test_models_and_grasps_of_both_hands_are_stored(database):
    hands = database.sql("SELECT side, mjcf, radii FROM hands ORDER BY side").rows()
    assert [side for side, *_ in hands] == ["left", "right"]
    assert all("wrist_roll" in mjcf and len(radii) == 20 for _, mjcf, radii in hands)
    keys = [row[0] for row in database.sql("SELECT grasp FROM grasps WHERE side = 'right'").rows()]
    assert keys
    grasp = database.grasp(keys[0])
    assert grasp.q.shape == (31,)
    assert np.isfinite(grasp.object_from_hand).all()


def test_subject_has_no_measures_and_a_changed_model_is_another_trial(session, database):
    assert database.sql("SELECT hand_length, hand_breadth FROM subjects").rows() == [(None, None)]

    def key():
        manifest = parse_manifest(session[0])
        return input_key(session_inputs(manifest, IngestParameters())[manifest.trials[0].name])

    before, included = key(), Path(session[0] / "hands/digits.xml")
    text = included.read_text()
    included.write_text(text.replace('size="0.0035"', 'size="0.0036"', 1))
    try:
        assert key() != before
    finally:
        included.write_text(text)
    assert key() == before


def test_a_model_without_a_site_rejects_the_trial_with_its_name(session, tmp_path):
    folder, _ = session
    included = folder / "hands/digits.xml"
    text = included.read_text()
    included.write_text(text.replace('site name="ring_pip"', 'site name="pip_ring"'))
    try:
        (trial,) = graspdb.ingest(folder, tmp_path / "db").trials
    finally:
        included.write_text(text)
    assert trial.status == "rejected"
    assert "lacks the sites ring_pip" in trial.reasons[0]
    assert "macaque.xml" in trial.reasons[0]
