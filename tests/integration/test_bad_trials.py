"""Trials with something wrong, from files to rows: put right, or rejected with a reason; no hand is off."""

from pathlib import Path

import ezc3d
import numpy as np
import pytest
import yaml
from recording_files import write_trc

import graspdb
from graspdb.simulate import NoiseParameters, load_truth, simulate_session
from graspdb.simulate.writer import write_c3d
from graspdb_ingest.check import check_session
from graspdb_schemas.vocabulary import SITES

RATE = 60.0
HIDDEN = 60
"""Frames, one second, in which no marker of a finger is seen."""
KINDS = ("rim", "top", "handle", "side_power")
NOISE = NoiseParameters(marker_sd=0.0005, skin_sd=0.0, occlusion=0.0)


def read(path: Path):
    file = ezc3d.c3d(str(path))
    labels = tuple(file["parameters"]["POINT"]["LABELS"]["value"])
    return labels, file["data"]["points"][:3].transpose(2, 1, 0) / 1000


def moving(positions, marker, length):
    """Return the first frame of the stretch in which a marker moves furthest."""
    distance = np.linalg.norm(positions[length:, marker] - positions[:-length, marker], axis=1)
    return int(np.argmax(distance))


@pytest.fixture(scope="module")
def spoiled(tmp_path_factory):
    """Return a session whose trials are spoiled each in its own way, and which frames of which marker."""
    folder = tmp_path_factory.mktemp("bad") / "session"
    simulate_session(
        folder, subjects=1, objects=["mug"], kinds=KINDS, noise=NOISE, seed=9, rate=RATE, gloves=True
    )
    names = sorted(path.stem for path in (folder / "trials").glob("*.c3d"))
    wrong = dict(zip(("swap", "frozen", "origin", "hidden"), names, strict=True))
    stretches = {}
    for how, name in list(wrong.items())[:3]:
        path = folder / "trials" / f"{name}.c3d"
        labels, positions = read(path)
        index, middle = labels.index("index_pip"), labels.index("middle_pip")
        start = moving(positions, index, 30)
        rows = slice(start, start + 30)
        if how == "swap":
            positions[rows, [index, middle]] = positions[rows, [middle, index]]
        elif how == "frozen":
            positions[rows, index] = positions[start, index]
        else:
            positions[rows, index] = 0.0
            positions[:, labels.index("ring_tip")] = 0.0
        write_c3d(path, labels, positions, RATE)
        stretches[how] = rows
    path = folder / "trials" / f"{wrong['hidden']}.c3d"
    labels, positions = read(path)
    text = write_trc(folder / "trials/rate.trc", list(labels), 1000 * positions, RATE).read_text()
    (folder / "trials/rate.trc").write_text(text.replace(f"\n{RATE}\t", "\n0\t", 1))
    twice = [label if label != "ring_pip" else "index_pip" for label in labels]
    write_trc(folder / "trials/twice.trc", twice, 1000 * positions, RATE)
    side = load_truth(folder).trials[wrong["hidden"]].side
    write_trc(folder / "trials/sided.trc", [f"{side}_index_pip", *labels[1:]], 1000 * positions, RATE)
    start = moving(positions, labels.index("middle_tip"), HIDDEN)
    stretches["hidden"] = slice(start, start + HIDDEN)
    digit = [i for i, label in enumerate(labels) if label.startswith("middle_")]
    positions[start : start + HIDDEN, digit] = np.nan
    write_c3d(path, labels, positions, RATE)
    short = folder / "gloves" / f"{wrong['frozen']}.csv"
    short.write_text("\n".join(short.read_text().splitlines()[:50]) + "\n")
    manifest = yaml.safe_load((folder / "session.yaml").read_text())
    for name in ("rate", "twice", "sided"):
        manifest["trials"].append({"file": f"trials/{name}.trc", "subject": "s1", "object": "mug"})
        wrong[name] = name
    (folder / "session.yaml").write_text(yaml.safe_dump(manifest))
    return folder, wrong, stretches


@pytest.fixture(scope="module")
def ingested(spoiled, tmp_path_factory):
    db = tmp_path_factory.mktemp("db") / "grasps"
    report = graspdb.ingest(spoiled[0], db)
    with graspdb.open(db) as opened:
        yield opened, {trial.trial.rpartition("/")[2]: trial for trial in report.trials}


@pytest.mark.parametrize("how", ["swap", "frozen", "origin", "hidden"])
def test_no_hand_is_off_where_a_marker_is_wrong(spoiled, ingested, how):
    folder, wrong, stretches = spoiled
    database, reports = ingested
    assert reports[wrong[how]].status == "ok"
    trial = load_truth(folder).trials[wrong[how]]
    key = reports[wrong[how]].trial
    rows = database.sql("SELECT sites FROM frames WHERE trial = $key ORDER BY frame", key=key).rows()
    errors = np.linalg.norm(np.array([row[0] for row in rows], dtype=float) - trial.sites, axis=2)
    assert errors.mean() < 0.0015
    digits = [i for i, site in enumerate(SITES) if site.startswith(("index", "middle"))]
    assert errors[stretches[how]][:, digits].mean() < 0.0025


@pytest.mark.parametrize(("how", "marker"), [("swap", "index_pip"), ("frozen", "index_pip")])
def test_a_wrong_marker_is_named_with_its_frames(spoiled, ingested, how, marker):
    _, wrong, stretches = spoiled
    database, reports = ingested
    key = reports[wrong[how]].trial
    query = "SELECT frame FROM frames WHERE trial = $key AND list_contains(flags, $flag)"
    frames = [row[0] for row in database.sql(query, key=key, flag=f"rejected:{marker}").rows()]
    named = any(marker in reason for reason in reports[wrong[how]].reasons)
    inside = [f for f in frames if stretches[how].start <= f < stretches[how].stop]
    assert named or len(inside) > 10


def test_a_marker_at_the_origin_counts_as_unseen_and_one_that_always_is_there_is_noted(spoiled, ingested):
    _, wrong, stretches = spoiled
    database, reports = ingested
    report = reports[wrong["origin"]]
    assert "markers never seen: ring_tip" in report.reasons
    query = "SELECT labels FROM markers WHERE trial = $key LIMIT 1"
    ((labels,),) = database.sql(query, key=report.trial).rows()
    place = labels.index("index_pip") + 1
    query = "SELECT count(*) FROM markers WHERE trial = $key AND positions[$place] IS NULL"
    (count,) = database.sql(query, key=report.trial, place=place).rows()[0]
    assert count == stretches["origin"].stop - stretches["origin"].start


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("rate", "frame rate of 0"),
        ("twice", "2 markers are labelled 'index_pip'"),
        ("sided", "both stand for 'index_pip'"),
    ],
)
def test_a_file_that_cannot_be_meant_is_rejected_with_its_name(ingested, how, words):
    report = ingested[1][how]
    assert report.status == "rejected"
    assert any(words in reason and f"{how}.trc" in reason for reason in report.reasons)


def test_a_glove_holds_a_hidden_finger_and_its_offsets_are_stored(spoiled, ingested):
    folder, wrong, stretches = spoiled
    database, reports = ingested
    truth = load_truth(folder).trials[wrong["hidden"]]
    key = reports[wrong["hidden"]].trial
    rows = database.sql("SELECT sites FROM frames WHERE trial = $key ORDER BY frame", key=key).rows()
    tip = SITES.index("middle_tip")
    error = np.linalg.norm(np.array([row[0][tip] for row in rows]) - truth.sites[:, tip], axis=1)
    assert error[stretches["hidden"]].mean() < 0.004
    ((offsets,),) = database.sql("SELECT glove_offset FROM trials WHERE trial = $key", key=key).rows()
    found = dict(offsets)
    assert set(found) == set(truth.glove.offset)
    assert np.median([abs(found[joint] - true) for joint, true in truth.glove.offset.items()]) < 0.03


def test_a_glove_that_ends_early_is_not_used_and_says_so(spoiled, ingested):
    report = ingested[1][spoiled[1]["frozen"]]
    assert report.status == "ok"
    (reason,) = [reason for reason in report.reasons if "glove" in reason]
    assert reason.startswith("glove not used: ")
    assert "its times run from 0 to 0.48 s" in reason


def test_check_says_the_same_without_writing_anything(spoiled):
    folder, wrong, _ = spoiled
    reports = {report.name: report for report in check_session(folder).trials}
    assert any("run from 0 to 0.48 s" in warning for warning in reports[wrong["frozen"]].warnings)
    assert not any("glove" in warning for warning in reports[wrong["hidden"]].warnings)
    assert "frame rate of 0" in str(reports["rate"].problem)
