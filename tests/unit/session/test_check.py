"""`graspdb check` says what recordings hold, and one that cannot be read stops no other."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recording_files as write
import trimesh
import typer
import yaml
from numpy.typing import NDArray
from typer.testing import CliRunner

from graspdb.commands.check import check
from graspdb_ingest.check import SessionReport, check_session, longest_gap
from graspdb_ingest.rigidity import measure_distances, rigidity_warnings

MODEL = {"m1": (0.0, 0.0, 0.0), "m2": (0.1, 0.0, 0.0), "m3": (0.02, 0.07, 0.0), "m4": (0.03, 0.02, 0.06)}
PLACES = np.array(list(MODEL.values()))
RATE = 100.0


def moved(places: NDArray[np.float64], n_frames: int = 200, seed: int = 0) -> NDArray[np.float64]:
    """Return places carried along a smooth rigid motion, shape (n_frames, n, 3) [m]."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    cross = np.cross(np.eye(3), axis)
    path = np.cumsum(rng.normal(scale=0.001, size=(n_frames, 3)), axis=0) + np.array([0.3, 0.2, 0.9])
    turned = []
    for angle in np.linspace(0, 2.5, n_frames):
        rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        turned.append(places @ rotation.T)
    return np.array(turned) + path[:, None]


def warnings_of(positions: NDArray[np.float64]) -> tuple[str, ...]:
    return rigidity_warnings(MODEL, positions, measure_distances(MODEL, positions))


def test_distances_do_not_change_with_the_object_moving() -> None:
    positions = moved(PLACES)
    for entry in measure_distances(MODEL, positions):
        assert entry.mean == pytest.approx(entry.model, abs=1e-12)
        assert entry.sd < 1e-12
        assert entry.n_frames == 200
    assert warnings_of(positions) == ()


def test_distances_are_those_of_the_frames_where_both_markers_were_seen() -> None:
    positions = moved(PLACES)
    positions[:150, 0] = np.nan
    positions[100:, 1] = np.nan
    counts = {(e.first, e.second): e.n_frames for e in measure_distances(MODEL, positions)}
    assert counts["m1", "m2"] == 0
    assert counts["m1", "m3"] == 50
    assert counts["m2", "m3"] == 100
    assert warnings_of(positions) == ()


def test_noise_shows_as_the_standard_deviation_it_must_have() -> None:
    rng = np.random.default_rng(3)
    positions = moved(PLACES, 4000) + rng.normal(scale=0.0005, size=(4000, 4, 3))
    for entry in measure_distances(MODEL, positions):
        assert entry.sd == pytest.approx(0.0005 * np.sqrt(2), rel=0.1)  # along the line, from both ends


@pytest.mark.parametrize("factor", [1000.0, 0.001, 0.1, 10.0, 1.2])
def test_one_factor_on_all_distances_suggests_units(factor: float) -> None:
    (warning,) = warnings_of(moved(PLACES) * factor)
    assert f"{factor:.3g} times" in warning
    assert "units" in warning


def test_a_loose_marker_is_named() -> None:
    positions = moved(PLACES)
    positions[100:, 2] += [0.012, 0.0, 0.0]
    warnings = warnings_of(positions)
    steady = [w for w in warnings if "not steady" in w]
    assert steady
    assert all("m3" in warning for warning in steady)


def test_exchanged_labels_are_found_out() -> None:
    warnings = warnings_of(moved(PLACES)[:, [1, 0, 2, 3]])
    assert "would fit if m1 were m2, m2 were m1" in warnings[-1]


def test_a_mirror_image_is_told_from_a_turn() -> None:
    assert warnings_of(moved(PLACES)) == ()
    (warning,) = warnings_of(moved(PLACES * [1, 1, -1]))
    assert "mirror image" in warning


@pytest.mark.parametrize(
    ("seen", "gap"), [("1111", 0), ("0000", 4), ("0110", 1), ("1000110", 3), ("1100", 2), ("", 0)]
)
def test_the_longest_gap(seen: str, gap: int) -> None:
    assert longest_gap(np.array([c == "1" for c in seen], dtype=bool)) == gap


LABELS = ["top", "nail", *MODEL]


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """Return a session of one good trial, in which the nail is hidden in frames 50 to 79."""
    positions = moved(np.vstack([[[0.05, 0.0, 0.1], [0.12, 0.0, 0.1]], PLACES]))
    positions[50:80, 1] = np.nan
    write.write_c3d(tmp_path / "good.c3d", LABELS, positions, RATE, units="m")
    trimesh.creation.box((0.1, 0.06, 0.04)).export(tmp_path / "box.stl")
    manifest: dict[str, Any] = {
        "graspdb_session": 1,
        "id": "s",
        "units": "m",
        "up": [0, 0, 1],
        "marker_set": {
            "top": {"segment": "hand", "offset": "calibrate"},
            "nail": {"segment": "index_distal", "at": "index_tip"},
            "palm": {"segment": "hand", "offset": "calibrate"},
        },
        "subjects": {"p": {"hand": "right", "hand_length": 0.19, "hand_breadth": 0.085}},
        "objects": {"box": {"mesh": "box.stl", "markers": {k: list(v) for k, v in MODEL.items()}}},
        "trials": [{"file": "good.c3d", "subject": "p", "object": "box"}],
    }
    (tmp_path / "session.yaml").write_text(yaml.safe_dump(manifest, sort_keys=False))
    return tmp_path


def add_trials(session: Path, **files: bytes) -> None:
    file = session / "session.yaml"
    manifest = yaml.safe_load(file.read_text())
    for name, data in files.items():
        (session / f"{name}.c3d").write_bytes(data)
        manifest["trials"].append({"file": f"{name}.c3d", "subject": "p", "object": "box"})
    file.write_text(yaml.safe_dump(manifest, sort_keys=False))


def test_a_session_is_reported_marker_by_marker(session: Path) -> None:
    report: SessionReport = check_session(session)
    (trial,) = report.trials
    assert report.readable
    assert (trial.n_frames, trial.rate, trial.duration) == (200, RATE, pytest.approx(1.99))
    by_label = {marker.label: marker for marker in trial.markers}
    assert tuple(by_label) == ("top", "nail", *MODEL)
    assert by_label["nail"].missing == pytest.approx(0.15)
    assert by_label["nail"].longest_gap == pytest.approx(0.30)
    assert by_label["top"].missing == by_label["m1"].missing == 0
    assert trial.not_found == ("palm",)
    assert len(trial.distances) == 6
    assert trial.warnings == ()


def test_trials_that_cannot_be_read_say_why_and_the_others_are_reported(session: Path) -> None:
    other = write.c3d_bytes(np.full((5, 2, 3), 0.5), ["P1", "P2"], RATE)
    add_trials(session, cut=b"\x02P", other=other)
    report = check_session(session)
    good, cut, stranger = report.trials
    assert not report.readable
    assert good.problem is None
    assert "breaks off" in str(cut.problem)
    assert "P1, P2" in str(stranger.problem)


def test_calibration_recordings_are_read_too(session: Path) -> None:
    file = session / "session.yaml"
    manifest = yaml.safe_load(file.read_text())
    (session / "rom.trc").write_text("nothing")
    manifest["subjects"]["p"]["calibration"] = ["good.c3d", "rom.trc"]
    file.write_text(yaml.safe_dump(manifest, sort_keys=False))
    good, bad = check_session(session).calibrations
    assert good.problem is None
    assert bad.problem is not None


def test_a_hand_of_a_size_that_no_hand_has_is_warned_of(session: Path) -> None:
    positions = moved(np.vstack([[[0.0, 0.0, 0.0], [0.9, 0.0, 0.1], [0.1, 0.8, 0]], PLACES]))
    write.write_c3d(session / "good.c3d", ["top", "nail", "palm", *MODEL], positions, RATE, units="m")
    (warning,) = check_session(session).trials[0].warnings
    assert "right hand" in warning
    assert "units" in warning


def run(*arguments: str) -> Any:
    app = typer.Typer()
    app.command()(check)
    return CliRunner().invoke(app, list(arguments))


def test_the_command_prints_tables_and_succeeds(session: Path) -> None:
    result = run(str(session))
    assert result.exit_code == 0, result.output
    for word in ("good", "200 frames at 100 Hz", "15.0 %", "0.30 s", "m1 - m2", "100.00 mm", "palm"):
        assert word in result.output, word


def test_the_command_fails_where_a_trial_cannot_be_read(session: Path) -> None:
    add_trials(session, cut=b"\x02P")
    result = run(str(session))
    assert result.exit_code == 1
    assert "cannot be read" in result.output
    assert "200 frames" in result.output


def test_json_is_the_report(session: Path) -> None:
    add_trials(session, cut=b"\x02P")
    result = run(str(session), "--json")
    report = json.loads(result.stdout)
    assert result.exit_code == 1
    assert report["readable"] is False
    nail = report["trials"][0]["markers"][1]
    assert nail == {"label": "nail", "missing": pytest.approx(0.15), "longest_gap": pytest.approx(0.3)}
    assert report["trials"][1]["rate"] is None


def test_a_bad_manifest_is_a_failure_and_a_path_that_is_not_there_is_wrong_usage(session: Path) -> None:
    (session / "session.yaml").write_text("id: [")
    result = run(str(session))
    assert (result.exit_code, result.stdout) == (1, "")
    assert "session.yaml" in result.stderr
    assert run(str(session / "nowhere")).exit_code == 2
    assert run(str(session), "--data-root", str(session / "nowhere")).exit_code == 2


def test_an_object_is_reported_with_its_size(session: Path) -> None:
    (thing,) = check_session(session).objects
    assert (thing.name, thing.file, thing.problem) == ("box", "box.stl", None)
    assert (thing.n_vertices, thing.n_faces, thing.watertight) == (8, 12, True)
    assert thing.extents == pytest.approx((0.1, 0.06, 0.04))


def test_an_object_that_is_none_is_named_and_the_recordings_are_read(session: Path) -> None:
    (session / "box.stl").write_bytes(b"solid nothing")
    report = check_session(session)
    (thing,) = report.objects
    assert thing.problem is not None
    assert "box.stl" in thing.problem
    assert not report.readable
    assert [trial.problem for trial in report.trials] == [None]
