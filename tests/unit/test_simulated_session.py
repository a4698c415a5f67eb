"""A simulated session: the same for a seed, readable, and true to its truth."""

import csv
import hashlib
from pathlib import Path

import ezc3d
import numpy as np
import pytest
import trimesh
import yaml
from scipy.spatial.transform import Rotation

from graspdb.simulate import NoiseParameters, load_truth, simulate_session
from graspdb.simulate.force_panels import PAD_COMPRESSION, centres_of_pressure
from graspdb.simulate.grasps import TOUCH
from graspdb.simulate.surface import Surface
from graspdb_schemas.errors import ParameterError, RecordingError
from graspdb_schemas.manifest_reader import parse_manifest
from graspdb_schemas.vocabulary import DIGIT_OF_SITE, FOREARM_MARKERS, SITES, Side

FEW = {"subjects": 2, "objects": ["mug"], "kinds": ["rim", "top"], "trials": 2, "rate": 60.0, "seed": 3}
NOISE = NoiseParameters(marker_sd=0.001, skin_sd=0.002, occlusion=0.1, swaps=1.0)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return simulate_session(tmp_path_factory.mktemp("sim") / "noisy", noise=NOISE, **FEW)


@pytest.fixture(scope="module")
def perfect(tmp_path_factory):
    return simulate_session(tmp_path_factory.mktemp("sim") / "perfect", noise=NoiseParameters.none(), **FEW)


@pytest.fixture(scope="module")
def panels(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sim") / "panels"
    return simulate_session(
        folder, subjects=1, experiment="force_panels", rate=60.0, noise=NoiseParameters.none()
    )


def digests(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def read_c3d(path: Path) -> tuple[ezc3d.c3d, np.ndarray]:
    file = ezc3d.c3d(str(path))
    return file, file["data"]["points"][:3].transpose(2, 1, 0) / 1000


def test_the_same_seed_gives_the_same_files_byte_for_byte(session, tmp_path):
    again = simulate_session(tmp_path / "again", noise=NOISE, **FEW)
    assert digests(again.path) == digests(session.path)


def test_another_seed_gives_other_recordings(session, tmp_path):
    other = simulate_session(tmp_path / "other", noise=NOISE, **{**FEW, "seed": 4})
    ours, theirs = digests(session.path), digests(other.path)
    shared = set(ours) & set(theirs)
    assert not [name for name in shared if name.endswith(".c3d") and ours[name] == theirs[name]]


def test_the_manifest_is_valid_and_says_what_the_truth_says(session):
    manifest = parse_manifest(session.path)
    assert {trial.name for trial in manifest.trials} == set(session.trials)
    assert len(session.trials) == 2 * 2 * 2
    for name, subject in manifest.subjects.items():
        true = session.truth.subjects[name]
        assert subject.sides == (true.side,)
        assert subject.hand_length == pytest.approx(true.dimensions.hand_length, abs=1e-12)
        assert subject.hand_breadth == pytest.approx(true.dimensions.hand_breadth, abs=1e-12)
        assert subject.joint_thickness == pytest.approx(dict(true.dimensions.joint_thickness), abs=1e-12)
    for trial in manifest.trials:
        assert session.truth.trials[trial.name].subject == trial.subject
        assert trial.task == "lift"


def test_nothing_that_ingest_reads_names_a_kind_of_grasp_or_a_forearm_offset(session):
    text = (session.path / "session.yaml").read_text()
    names = [path.name for path in (session.path / "trials").iterdir()]
    for kind in {trial.kind for trial in session.truth.trials.values()}:
        assert kind not in text
        assert not [name for name in names if kind in name]
    assert "forearm_1" not in yaml.safe_load(text)


def test_repetitions_count_by_object_in_the_manifest_and_by_kind_in_the_truth(session):
    for subject in ("s1", "s2"):
        counted = [t.repetition for t in parse_manifest(session.path).trials if t.subject == subject]
        assert sorted(counted) == [1, 2, 3, 4]
        true = [t for t in session.truth.trials.values() if t.subject == subject]
        assert sorted((t.kind, t.repetition) for t in true) == [
            ("rim", 1),
            ("rim", 2),
            ("top", 1),
            ("top", 2),
        ]


def test_the_truth_reads_back_as_it_was(session):
    truth = load_truth(session.path)
    assert truth.noise == NOISE
    assert truth.subjects == dict(session.truth.subjects)
    for name, trial in session.truth.trials.items():
        read = truth.trials[name]
        for key in ("times", "q", "object_position", "object_rotation", "contact", "occluded"):
            assert np.array_equal(getattr(read, key), getattr(trial, key)), key
        for key in ("sites", "markers", "gap"):
            assert getattr(read, key) == pytest.approx(getattr(trial, key), abs=1e-7), key
        for key in ("kind", "repetition", "side", "contacts", "events", "swaps", "marker_labels"):
            assert getattr(read, key) == getattr(trial, key), key


def test_sites_and_markers_are_the_kinematics_of_q(perfect):
    truth = load_truth(perfect.path)
    for trial in truth.trials.values():
        subject = truth.subjects[trial.subject]
        pose = subject.hand.forward(trial.q)
        assert trial.sites == pytest.approx(pose.sites, abs=1e-6)
        assert trial.marker_labels[:24] == (*FOREARM_MARKERS, *SITES)
        assert trial.markers[:, :24] == pytest.approx(pose.markers[:, subject.marker_columns()], abs=1e-6)
        over = trial.markers[:, 4:24] - trial.sites
        radii = np.broadcast_to(subject.hand.radii, over.shape[:2])
        assert np.linalg.norm(over, axis=2) == pytest.approx(radii, abs=1e-6)


def test_gaps_are_distances_to_the_mesh_that_was_written(session):
    mesh = trimesh.load_mesh(session.path / "objects" / "mug.stl")
    mesh.apply_scale(0.001)
    surface = Surface(tuple(mesh.split()))
    for trial in session.truth.trials.values():
        rotation = Rotation.from_quat(trial.object_rotation, scalar_first=True).as_matrix()
        points = np.einsum("fji,fkj->fki", rotation, trial.sites - trial.object_position[:, None])
        radii = session.truth.subjects[trial.subject].hand.radii
        assert surface.distance(points) - radii == pytest.approx(trial.gap, abs=1e-6)
        assert np.array_equal(trial.contact, trial.gap < TOUCH)


def test_a_held_object_is_touched_by_the_same_sites_all_the_time_and_never_pierced(session):
    for trial in session.truth.trials.values():
        held = (trial.times >= trial.events.closed) & (trial.times <= trial.events.release)
        expected = np.isin(SITES, trial.contacts)
        assert "thumb_tip" in trial.contacts
        assert (trial.contact[held] == expected).all()
        assert trial.gap[held].min() > -TOUCH
        away = trial.times < trial.events.reach
        assert not trial.contact[away].any()


def test_objects_stand_still_outside_the_lift_and_their_markers_follow_them(perfect):
    manifest = parse_manifest(perfect.path)
    places = np.array(list(manifest.objects["mug"].markers.values()))
    for trial in perfect.truth.trials.values():
        before, after = trial.times <= trial.events.lift, trial.times >= trial.events.landed
        for rest in (before, after):
            assert np.ptp(trial.object_position[rest], axis=0).max() < 1e-12
        assert trial.object_position[before, 2] == pytest.approx(0)
        rotation = Rotation.from_quat(trial.object_rotation, scalar_first=True).as_matrix()
        expected = np.einsum("fij,mj->fmi", rotation, places) + trial.object_position[:, None]
        assert trial.markers[:, 24:] == pytest.approx(expected, abs=1e-6)


def test_a_perfect_c3d_holds_the_true_markers(perfect):
    for name, trial in perfect.truth.trials.items():
        file, positions = read_c3d(perfect.path / "trials" / f"{name}.c3d")
        point = file["parameters"]["POINT"]
        assert point["UNITS"]["value"] == ["mm"]
        assert point["RATE"]["value"][0] == 60.0
        assert tuple(point["LABELS"]["value"]) == trial.marker_labels
        assert positions == pytest.approx(trial.markers, abs=1e-6)
        assert (file["data"]["meta_points"]["residuals"] >= 0).all()


def test_a_noisy_c3d_misses_what_was_occluded_and_errs_as_asked(session):
    errors = []
    for name, trial in session.truth.trials.items():
        file, positions = read_c3d(session.path / "trials" / f"{name}.c3d")
        for swap in trial.swaps:
            pair = [trial.marker_labels.index(swap.first), trial.marker_labels.index(swap.second)]
            stretch = positions[swap.start : swap.stop]
            stretch[:, pair] = stretch[:, pair[::-1]]
        missing = np.isnan(positions).any(axis=2)
        assert np.array_equal(missing, trial.occluded)
        negative = file["data"]["meta_points"]["residuals"][0].T < 0
        assert negative.sum() == missing.sum()
        errors.append((positions - trial.markers)[~missing])
    assert np.concatenate(errors).std() == pytest.approx(0.001, rel=0.03)


def test_skin_moves_hand_markers_and_not_the_object(session):
    for trial in session.truth.trials.values():
        subject = session.truth.subjects[trial.subject]
        moved = trial.markers[:, :24] - subject.hand.forward(trial.q).markers[:, subject.marker_columns()]
        assert 0.0005 < np.sqrt(np.mean(np.sum(moved**2, axis=2))) < 0.006


def test_trials_of_a_kind_differ(session):
    first, second = (t for t in session.truth.trials.values() if t.subject == "s1" and t.kind == "top")
    onset = [int(np.searchsorted(t.times, t.events.lift)) for t in (first, second)]
    in_object = [
        Rotation.from_quat(t.object_rotation[i], scalar_first=True)
        .inv()
        .apply(t.sites[i] - t.object_position[i])
        for t, i in zip((first, second), onset, strict=True)
    ]
    assert 0.001 < np.linalg.norm(in_object[0] - in_object[1], axis=1).mean() < 0.03


def test_the_centre_of_pressure_is_on_the_panel_between_what_touches(panels):
    manifest = parse_manifest(panels.path)
    assert sorted(t.kind for t in panels.truth.trials.values()) == sorted(
        f"thumb_{finger}" for finger in ("index", "middle", "ring", "little")
    )
    for entry in manifest.trials:
        trial = panels.truth.trials[entry.name]
        rows = list(csv.DictReader(entry.reference_contacts.read_text().splitlines()))
        assert {row["digit"] for row in rows} == set(trial.kind.split("_"))
        radii = panels.truth.subjects[trial.subject].hand.radii
        for row in rows:
            frame = round(float(row["time"]) * 60)
            own = [i for i, digit in enumerate(DIGIT_OF_SITE) if digit == row["digit"]]
            assert trial.contact[frame, own].any()
            rotation = Rotation.from_quat(trial.object_rotation[frame], scalar_first=True)
            centres = rotation.inv().apply(trial.sites[frame, own] - trial.object_position[frame])
            pressed = np.array([float(row[axis]) for axis in "xyz"]) / 1000
            gap, reach = trial.gap[frame, own], radii[own] + trial.gap[frame, own]
            near = gap < PAD_COMPRESSION
            off = np.linalg.norm(pressed - centres[near], axis=1)
            if near.sum() == 1:
                assert off == pytest.approx(reach[near], abs=1e-6)
            else:  # between the points that the spheres press on
                assert (off >= reach[near] - 1e-4).all()
                apart = np.linalg.norm(np.ptp(centres[near], axis=0))
                assert (off <= reach[near] + apart).all()


def test_pads_press_by_their_radius_and_the_square_of_their_depth():
    points, deep = np.array([[[0, 0, 0], [0.02, 0, 0]]]), PAD_COMPRESSION
    radii = np.array([0.01, 0.01])
    for gaps, middle in (([0, 0], 0.01), ([0, deep], 0.0), ([0, 0.01], 0.0), ([0, deep / 2], 0.02 / 5)):
        found = centres_of_pressure(points, np.array([gaps], dtype=float), radii)
        assert np.allclose(found, [[middle, 0, 0]])
    found = centres_of_pressure(points, np.zeros((1, 2)), np.array([0.01, 0.03]))
    assert np.allclose(found, [[0.015, 0, 0]])


def test_left_hands_can_be_drawn_and_grasp(tmp_path):
    session = simulate_session(tmp_path / "s", subjects=3, objects=["bottle"], kinds=["cap_side"], rate=30.0)
    sides = {subject.side for subject in session.truth.subjects.values()}
    assert sides == {Side.LEFT, Side.RIGHT}


@pytest.mark.parametrize(
    ("key", "value", "hint"),
    [
        ("subjects", 0, "1 or more"),
        ("trials", 0, "1 or more"),
        ("seed", -1, "0 or more"),
        ("rate", 5.0, "20 to 2000"),
        ("experiment", "juggling", "objects, force_panels"),
        ("objects", ["mugg"], "did you mean 'mug'"),
        ("kinds", ["handel"], "did you mean 'handle'"),
        ("kinds", [], "some of"),
    ],
)
def test_impossible_requests_are_refused_by_name(tmp_path, key, value, hint):
    with pytest.raises(ParameterError, match=key) as caught:
        simulate_session(tmp_path / "s", **{key: value})
    assert hint in str(caught.value)
    assert not (tmp_path / "s").exists()


def test_a_folder_that_holds_something_is_left_alone(tmp_path):
    (tmp_path / "precious.txt").write_text("mine")
    with pytest.raises(ParameterError, match="empty"):
        simulate_session(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


def test_a_folder_without_truth_says_so(tmp_path):
    with pytest.raises(RecordingError, match="no truth"):
        load_truth(tmp_path)
