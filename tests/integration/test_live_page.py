"""The worked example of docs/live.md runs as it stands there."""

import re
from pathlib import Path

import numpy as np
import pytest

import graspdb
from graspdb.simulate import NoiseParameters, simulate_session
from graspdb_ingest.readers import read_recording
from graspdb_ingest.trial_markers import select_markers
from graspdb_schemas.manifest_reader import parse_manifest

PAGE = Path(__file__).parents[2] / "docs" / "live.md"


def test_the_worked_example_finds_the_thumb_on_the_mug(tmp_path, monkeypatch, capsys):
    noise = NoiseParameters(marker_sd=0.0005, skin_sd=0.0, occlusion=0.02)
    simulate_session(
        tmp_path / "session", subjects=1, objects=["mug"], kinds=["rim"], noise=noise, seed=1, rate=60.0
    )
    session = parse_manifest(tmp_path / "session")
    (trial,) = session.trials

    def camera_frames(tracker):
        found = select_markers(read_recording(trial.file, session.file_scale), session, trial)
        (hand,) = found.hands.values()
        order = [found.hand_labels.index(label) for label in tracker.marker_labels]
        assert tracker.thing.marker_labels == found.object_labels
        yield from zip(hand[:, order], found.object_markers, strict=True)

    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert "rate=120.0" in code
    code = code.replace("rate=120.0", "rate=60.0")
    monkeypatch.chdir(tmp_path)
    exec(compile(code, str(PAGE), "exec"), {"camera_frames": camera_frames})  # noqa: S102
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("('forearm_1', 'forearm_2'") for line in lines)
    touched = [line for line in lines if line.startswith("thumb on the mug")]
    assert len(touched) > 30
    sure = [float(line.split()[-2]) for line in touched]
    assert 0.05 < np.median(sure) < 2


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"subject": "s2"}, "subject: found 's2'; allowed: one of s1"),
        ({"subject": "s1", "side": "up"}, "side"),
        ({"subject": "s1", "thing": "mag"}, "did you mean 'mug'"),
    ],
)
def test_a_name_that_the_session_has_not_is_said(tmp_path, arguments, named):
    simulate_session(
        tmp_path / "session",
        subjects=1,
        objects=["mug"],
        kinds=["rim"],
        noise=NoiseParameters.none(),
        seed=1,
        rate=30.0,
    )
    with pytest.raises(graspdb.GraspDBError, match=named):
        graspdb.HandTracker.from_session(tmp_path / "session", rate=120.0, **arguments)
