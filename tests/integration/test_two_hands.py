"""Two hands in one recording: each is followed by its own markers, each has its own grasp."""

from dataclasses import replace

import numpy as np
import pytest
from two_hands import SIDES, simulate_two_hands

import graspdb
from graspdb.simulate import NoiseParameters
from graspdb_ingest.readers import read_recording
from graspdb_ingest.trial_markers import select_markers
from graspdb_schemas.manifest_reader import parse_manifest
from graspdb_schemas.vocabulary import Side

AWAY = 0.2
NOISE = NoiseParameters(marker_sd=0.0005, skin_sd=0.0, occlusion=0.02)


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    return simulate_two_hands(tmp_path_factory.mktemp("both") / "session", NOISE, rate=60.0, away=AWAY)


@pytest.fixture(scope="module")
def database(truth):
    report = graspdb.ingest(truth.folder, truth.folder.parent / "db")
    assert [(trial.status, trial.n_grasps) for trial in report.trials] == [("ok", 2)], report
    with graspdb.open(truth.folder.parent / "db") as opened:
        yield opened


def sites_of(database, side):
    query = "SELECT sites FROM frames WHERE side = $side ORDER BY frame"
    missing = [[np.nan] * 3] * 20
    return np.array([row[0] or missing for row in database.sql(query, side=side).rows()], dtype=float)


@pytest.mark.parametrize("side", SIDES)
def test_each_hand_is_where_it_was(truth, database, side):
    error = np.linalg.norm(sites_of(database, side) - truth.sites[side], axis=2)
    assert np.nanmean(error) < 0.0015
    assert np.nanmax(error) < 0.005


def test_a_hand_out_of_view_is_not_known_and_no_marker_of_the_other_stands_in_for_it(truth, database):
    away = round(AWAY * len(truth.times))
    known = {side: np.isfinite(sites_of(database, side)[:, 0, 0]) for side in SIDES}
    assert known[Side.RIGHT].all()
    assert not known[Side.LEFT][:away].any()
    assert known[Side.LEFT][away + 10 :].all()
    flags = database.sql("SELECT flags FROM frames WHERE side = 'left' AND frame < $n", n=away).rows()
    assert all(row[0] == ["not_tracked"] for row in flags)


def test_each_hand_has_its_own_grasp_with_the_sites_that_touch(truth, database):
    rows = database.sql("SELECT side, snapshot_time, contact_sites FROM grasps ORDER BY side DESC").rows()
    assert [row[0] for row in rows] == ["right", "left"]
    for side, time, sites in rows:
        assert time == pytest.approx(truth.events.lift, abs=0.05)
        assert set(truth.contacts[Side(side)]) <= set(sites)
    assert len(rows[0][2]) < len(rows[1][2])


def test_the_two_hands_are_calibrated_apart(database):
    rows = dict(database.sql("SELECT side, mjcf FROM hands").rows())
    assert set(rows) == {"right", "left"}
    assert rows["right"] != rows["left"]


def test_a_trial_that_says_one_hand_takes_that_hands_markers_alone(truth):
    session = parse_manifest(truth.folder)
    trial = replace(session.trials[0], sides=(Side.RIGHT,))
    recording = read_recording(trial.file, session.file_scale)
    both, one = (select_markers(recording, session, t) for t in (session.trials[0], trial))
    assert tuple(both.hands) == SIDES
    assert tuple(one.hands) == (Side.RIGHT,)
    assert np.array_equal(one.hands[Side.RIGHT], both.hands[Side.RIGHT], equal_nan=True)
    assert all(label.startswith("left_") for label in one.unused)
