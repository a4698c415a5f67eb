"""Real recordings from their files to their rows, against written figures."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import graspdb
from graspdb.ingestion import ingest

FIXTURES = Path(__file__).parents[1] / "fixtures"


@pytest.fixture(scope="module")
def pillow(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[graspdb.Database]:
    db = tmp_path_factory.mktemp("pillow") / "grasps"
    report = ingest(FIXTURES / "pillow", db, data_root=shared_data)
    assert [trial.status for trial in report.trials] == ["ok"]
    with graspdb.open(db) as database:
        yield database


def test_pillow_is_held_about_twenty_times_and_never_lifted(pillow: graspdb.Database) -> None:
    rows = pillow.sql("SELECT snapshot_kind, n_contacts, digits, feature_points FROM grasps").rows()
    print(f"\n{len(rows)} holds, {np.mean([row[1] for row in rows]):.1f} contacts a hold")
    assert 18 <= len(rows) <= 23
    assert {row[0] for row in rows} == {"steadiest"}
    assert all(row[1] >= 4 for row in rows)
    # SOURCE.txt: the four fingers reach the pillow in every grasp, the thumb never
    assert all("thumb" not in row[2] and len(row[2]) >= 3 for row in rows)
    assert all(row[3] >= 30 for row in rows)


def test_the_hand_fits_the_pillow_recordings_markers(pillow: graspdb.Database) -> None:
    row = pillow.sql("SELECT residual_rms, missing_fraction, rate, n_frames FROM trials").rows()[0]
    assert row[0] < 0.0015
    assert row[1] == pytest.approx((0.0822 + 0.0070 + 0.0130) / 13, abs=2e-4)
    assert tuple(row[2:]) == (100.0, 6000)


def test_bones_keep_their_length_through_the_pillow_recording(pillow: graspdb.Database) -> None:
    sites = np.array(
        [row[0] for row in pillow.sql("SELECT sites FROM frames WHERE sites IS NOT NULL").rows()]
    )
    assert len(sites) == 6000
    bones = np.linalg.norm(np.diff(sites.reshape(-1, 5, 4, 3), axis=2), axis=3)
    assert np.ptp(bones, axis=0).max() < 1e-9
    assert bones.min() > 0.008
    assert bones.max() < 0.08


def test_finger_tips_lie_on_the_pillow_while_it_is_held(pillow: graspdb.Database) -> None:
    # Over the whole hold: the pillow is soft, the tips press into its undeformed surface and come up
    # again, and at the steadiest moment the fingers may rest on their phalanges.
    found = pillow.sql(
        """
        SELECT g.grasp, median(f.gap[site]), min(f.gap[site])
        FROM grasps g
        JOIN frames f ON f.trial = g.trial AND f.side = g.side
            AND f.time BETWEEN g.onset_time AND coalesce(g.release_time, f.time)
        CROSS JOIN (VALUES (8), (12), (16), (20)) tips(site)
        GROUP BY g.grasp, site
        """
    ).rows()
    assert len({row[0] for row in found}) == 21
    assert abs(np.median([row[1] for row in found])) < 0.006
    assert max(row[2] for row in found) < 0.004  # each tip touches in every hold
    gaps = np.array([row[0] for row in pillow.sql("SELECT gap FROM grasps").rows()])
    assert gaps[:, 3].min() > 0.02  # the thumb stays away


def test_recordings_without_an_object_are_tracked(shared_data: Path, tmp_path: Path) -> None:
    report = ingest(FIXTURES / "sig18", tmp_path / "grasps", data_root=shared_data, workers=2)
    assert [trial.status for trial in report.trials] == ["ok"] * 4
    with graspdb.open(tmp_path / "grasps") as database:
        frames = database.sql(
            "SELECT count(*), count(q), count(gap), count(object_position) FROM frames"
        ).rows()
        total, tracked, gaps, poses = frames[0]
        assert (gaps, poses) == (0, 0)
        assert tracked > 0.99 * total
        residuals = database.sql("SELECT trial, residual_rms FROM trials ORDER BY trial").rows()
    print(*(f"{trial}: {1e3 * rms:.2f} mm" for trial, rms in residuals), sep="\n")
    assert all(rms < 0.006 for _, rms in residuals)
