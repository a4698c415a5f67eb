"""The named queries' answers on the worked example, each worked out by hand."""

from collections.abc import Iterator
from math import pi, sqrt
from pathlib import Path
from typing import Any

import pytest
from worked_example import build

import graspdb
from graspdb_schemas.errors import ParameterError, QueryError


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[graspdb.Database]:
    path: Path = tmp_path_factory.mktemp("worked") / "db"
    build(path)
    with graspdb.open(path) as opened:
        yield opened


def near(value: float) -> Any:
    return pytest.approx(value, rel=1e-9, abs=1e-12)


def test_contact_frequency(database: graspdb.Database) -> None:
    rows = {row[:2]: row[2:] for row in database.query("contact_frequency").rows()}
    assert rows["mug", "thumb_tip"] == ("thumb", 4, 4, 1.0)
    assert rows["mug", "index_pip"] == ("index", 4, 1, 0.25)
    assert rows["jug", "ring_tip"] == ("ring", 2, 2, 1.0)
    assert ("jug", "index_tip") not in rows


def test_digits_used(database: graspdb.Database) -> None:
    assert database.query("digits_used").rows() == [
        ("jug", "anna", "thumb+ring", 2, 1, 1.0),
        ("jug", "ben", "thumb+ring", 2, 1, 1.0),
        ("mug", "anna", "thumb+index", 2, 2, 1.0),
        ("mug", "ben", "thumb+index", 2, 1, 0.5),
        ("mug", "ben", "thumb+index+middle+ring+little", 5, 1, 0.5),
    ]


def test_session_overview(database: graspdb.Database) -> None:
    anna, ben = database.query("session_overview").rows()
    # Five trials of four frames, an eighth of the markers missing, and half of them in the rejected one.
    assert anna[:6] == ("s", "anna", 5, 1, 3, near(0.15))
    assert anna[6:] == (near((4 * 0.125 + 0.5) / 5), near(0.002), "s/anna_None_9", 0.002)
    assert ben[:6] == ("s", "ben", 4, 0, 3, near(0.12))
    assert ben[6:] == (0.125, near(sqrt((3 * 0.002**2 + 0.006**2) / 4)), "s/ben_mug_2", 0.006)


def test_feature_consistency(database: graspdb.Database) -> None:
    # Points of the mug: anna {0, 1, 2} and {1, 2, 3}, ben {2, 3}; of the jug: both {0, 1}.
    jug, within, between = database.query("feature_consistency").rows()
    assert jug == ("jug", "between", 1, 1.0, None, 0.0, 1.0, 1.0)
    assert within == ("mug", "within", 1, 0.5, None, 0.0, 1.0, 0.5)
    mean = (1 / 4 + 2 / 3) / 2
    best = (1 / 4 + 2 / 3 + 2 / 3) / 3
    spread = (2 / 3 - 1 / 4) / sqrt(2)
    assert between == ("mug", "between", 2, near(mean), near(spread), 0.0, 0.5, near(best))
    assert len(database.query("feature_consistency", object="jug")) == 1


def test_where_grasped(database: graspdb.Database) -> None:
    rows = database.query("where_grasped", object="mug", radius=0.015).rows()
    assert [row[2] for row in rows] == [0, 1, 2, 3, 4]
    assert [row[3:6] for row in rows] == [(pytest.approx(0.01 * i, rel=1e-6), 0.0, 0.0) for i in range(5)]
    assert {row[6] for row in rows} == {4}
    assert [row[7] for row in rows] == [1.0, 1.0, 0.5, 1.0, 1.0]
    # Contacts on points 0 to 4: 3, 1, 1, 1 and 6; each counts for its neighbours too.
    assert [row[8] * 4 * pi * 0.015**2 for row in rows] == [near(n) for n in (4, 5, 3, 8, 7)]
    assert [row[9] for row in rows] == [0.75, 0.25, 0.25, 0.25, 0.75]
    assert [row[10] for row in rows] == [0.25, 0.5, 0.75, 0.5, 0.0]
    alone = database.query("where_grasped", object="mug", radius=0.005, subject="ben").rows()
    assert [row[7] for row in alone] == [0.5, 0.5, 0.0, 0.5, 0.5]


def test_onset_order(database: graspdb.Database) -> None:
    rows = {row[:2]: row[2:] for row in database.query("onset_order").rows()}
    assert rows["mug", "thumb"] == (4, 1.0, 1.0, 0.0, 0.0)
    # 0.1, 0.2, 0 and 0.1 s after the thumb; once together with it.
    assert rows["mug", "index"] == (4, 0.25, 1.75, near(0.1), near(sqrt(0.02 / 3)))
    assert rows["mug", "little"] == (1, 0.0, 5.0, near(0.2), None)
    assert rows["jug", "ring"] == (2, 0.5, 1.5, near(0.05), near(sqrt(0.005)))
    assert {row[0] for row in database.query("onset_order", object="jug").rows()} == {"jug"}


def test_grip_aperture(database: graspdb.Database) -> None:
    rows = {row[0]: row[1:] for row in database.query("grip_aperture").rows()}
    assert rows["s/anna_mug_1/right/0"] == ("anna", "mug", near(0.04), 0.05, near(0.10), near(0.1))
    # First contact is at 0.2 s; the index touches at 4 and 2 cm, the thumb at 0.
    assert rows["s/anna_mug_2/right/0"] == ("anna", "mug", near(0.03), 0.05, near(0.09), near(0.1))
    assert rows["s/ben_mug_1/right/0"][2] == near(0.02)
    short = database.query("grip_aperture", window=0.05, object="mug", subject="ben").rows()
    assert [row[5:] for row in short] == [(None, None), (None, None)]


def test_hull_volume(database: graspdb.Database) -> None:
    rows = database.query("hull_volume").rows()
    ratios = (near(2.0), near(3.0), near(4.0))
    assert rows[0] == ("palmar pinch", "thumb+index", 3, near(2e-5), near(1e-5), *ratios, near(4e-6 * 8 / 3))
    assert [row[:2] for row in rows[1:]] == [(None, "thumb+ring"), (None, "thumb+index+middle+ring+little")]


def test_quality_by_object(database: graspdb.Database) -> None:
    epsilon, closed, open_, volume = database.query("quality_by_object").rows()
    assert closed == ("mug", "force_closure", 4, 0.5, near(sqrt(1 / 3)), 0.0, 0.5, 1.0)
    assert open_ == ("jug", "force_closure", 2, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert epsilon == ("mug", "epsilon", 3, near(0.2), near(0.1), 0.1, near(0.2), 0.3)
    assert volume == ("mug", "volume", 1, 0.01, None, 0.01, 0.01, 0.01)


def test_posture_change(database: graspdb.Database) -> None:
    rows = {row[0]: row[1:] for row in database.query("posture_change", object="mug").rows()}
    # First contact at 0.3 s, once at 0.2 s; lift at 0.5 s; the angle is the time.
    assert rows["index_mcp_flexion"] == (4, near(0.275), near(0.5), near(0.225), near(0.05))
    assert rows["thumb_ip_flexion"] == (4, 0.0, 0.0, 0.0, 0.0)
    assert len(rows) == 23


def test_rerecord(database: graspdb.Database) -> None:
    rows = {row[1]: row[6] for row in database.query("rerecord").rows()}
    assert rows == {
        "s/anna_mug_3": ["hand not tracked", "50 % of the hand markers missing"],
        "s/ben_jug_2": ["no grasp found"],
        "s/ben_mug_2": ["residual of 6.0 mm"],
    }
    loose = database.query("rerecord", max_missing=0.6, max_residual="0.01").rows()
    assert [row[1] for row in loose] == ["s/anna_mug_3", "s/ben_jug_2"]
    assert database.query("rerecord", session="other").rows() == []


def test_subject_similarity(database: graspdb.Database) -> None:
    rows = {row[:2]: row[2:] for row in database.query("subject_similarity").rows()}
    features = ((1 / 4 + 2 / 3) / 2 + 1) / 2
    sites = ((1 + 2 / 5 + 2 / 3 + 1 / 3) / 4 + 1) / 2
    posture = sqrt(((0.04 + 0.64 + 0.01 + 0.65) / 4 + 0.01) / 2 / 21)
    assert rows["anna", "ben"] == rows["ben", "anna"]
    assert rows["anna", "ben"] == (2, 5, near(features), near(sites), near(posture))
    assert rows["anna", "anna"] == (1, 1, 0.5, near(2 / 3), near(sqrt(0.01 / 21)))
    # Ben's whole-hand grasp has no feature, so his two cannot be compared by it.
    assert rows["ben", "ben"] == (1, 1, None, near(2 / 5), near(sqrt((0.64 + 0.04) / 21)))


def test_contact_to_lift(database: graspdb.Database) -> None:
    rows = {row[:2]: row[2:] for row in database.query("contact_to_lift").rows()}
    assert rows["mug", "anna"] == (
        2, near(0.25), near(0.1 / sqrt(2)), near(0.2), near(0.25), near(0.3),
    )  # fmt: skip
    assert rows["jug", "ben"][:2] == (1, near(0.2))


def test_grasps_with_digits(database: graspdb.Database) -> None:
    def found(**parameters: str) -> list[str]:
        return [row[0] for row in database.query("grasps_with_digits", **parameters).rows()]

    pinches = ["s/anna_mug_1/right/0", "s/anna_mug_2/right/0", "s/ben_mug_1/right/0"]
    assert found(digits="thumb+index") == found(digits="index + thumb") == pinches
    assert found(digits="index+thumb", match="at_least") == [*pinches, "s/ben_mug_2/right/0"]
    assert found(digits="thumb+ring+middle", match="at_most") == [
        "s/anna_jug_1/right/0",
        "s/ben_jug_1/left/0",
    ]
    assert found(digits="thumb+index", subject="ben") == ["s/ben_mug_1/right/0"]
    with pytest.raises(QueryError, match="no digit is called indx; there are thumb, index"):
        found(digits="thumb+indx")
    with pytest.raises(ParameterError, match=r"digits.*no value"):
        found()
    with pytest.raises(ParameterError, match="did you mean 'at_least'"):
        found(digits="thumb", match="at_leest")


def test_synergies(database: graspdb.Database) -> None:
    first, second = database.query("synergies").rows()
    # The index varies by 0.4 six times, the thumb by 0.1 four times, independently.
    assert first[:5] == (1, near(0.192), near(0.96), near(0.96), 6)
    assert second[:5] == (2, near(0.008), near(0.04), near(1.0), 6)
    loadings = dict(first[5])
    assert len(loadings) == 21
    assert loadings.pop("index_mcp_flexion") == near(1.0)
    assert list(loadings.values()) == [near(0.0)] * 20
    standardised = database.query("synergies", normalisation="correlation").rows()
    assert [row[1:4] for row in standardised] == [
        (near(1.0), near(0.5), near(0.5)),
        (near(1.0), near(0.5), near(1.0)),
    ]
    # In the trials with a mug the angle is the time, in those with a jug nothing moves; all frames are rows.
    moving = database.query("synergies", postures="movements", object="mug", subject="ben").rows()
    assert [row[1:5] for row in moving] == [(near(2 * 0.175 / 11), near(1.0), near(1.0), 12)]
    assert database.query("synergies", postures="movements", object="jug", subject="anna").rows() == []
    assert database.query("synergies", object="jug", subject="anna").rows() == []


def test_synergy_space(database: graspdb.Database) -> None:
    rows = database.query("synergy_space", components=1).rows()
    assert [row[3] for row in rows] == [near(0.4), near(-0.4), near(-0.4), near(0.4), near(-0.4), near(0.4)]
    assert [row[4] for row in rows] == [None] * 6
    assert rows[1][6] == near(0.1 / sqrt(21))
    whole = database.query("synergy_space", components=5).rows()
    assert whole[1][5] == [near(-0.4), near(-0.1)]
    assert all(row[6] == near(0.0) for row in whole)
    with pytest.raises(ParameterError, match="at least 1"):
        database.query("synergy_space", components=0)


@pytest.mark.parametrize("linkage", ["ward", "average", "complete"])
def test_grasp_clusters(database: graspdb.Database, linkage: str) -> None:
    rows = database.query("grasp_clusters", clusters=2, linkage=linkage).rows()
    assert [row[0] for row in rows] == [
        "s/anna_jug_1/right/0",
        "s/ben_jug_1/left/0",
        "s/ben_mug_2/right/0",
        "s/anna_mug_1/right/0",
        "s/anna_mug_2/right/0",
        "s/ben_mug_1/right/0",
    ]
    assert [row[3:5] for row in rows] == [(1, 3)] * 3 + [(2, 3)] * 3
    off = near(0.1 / sqrt(21))
    assert [row[5] for row in rows] == [near(0.0), off, off, off, near(0.0), off]
    assert [row[6] for row in rows] == [True, False, False, False, True, False]
    assert len({row[3] for row in database.query("grasp_clusters", clusters=100).rows()}) == 6
