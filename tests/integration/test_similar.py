"""Grasps like this one, from a database and from files: what is found, why, and what is refused."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import similar_database
from scipy.spatial.transform import Rotation

import graspdb
from graspdb.database import Database
from graspdb.similar import part_question
from graspdb_queries.similar.question import Respect
from graspdb_queries.similar.search import Search
from graspdb_schemas.errors import ObjectError, ParameterError, QueryError

QUERY = "made/4/right/0"
REFUSED = [
    "1",
    "subject",
    "subject = 'anna'; DROP TABLE grasps",
    "true) UNION SELECT (grasp",
    "true, false",
    "*",
    "",
    "(SELECT 1",
    "true /*",
    "sum(n_contacts) > 1",
    "no_such_column = 1",
    "EXISTS (SELECT * FROM read_text('/etc/hostname'))",
    "EXISTS (SELECT * FROM read_csv('data.csv'))",
    "getenv('HOME') IS NULL",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return similar_database.build(tmp_path_factory.mktemp("similar") / "grasps")


@pytest.fixture(scope="module")
def db(folder: Path):
    with graspdb.open(folder) as database:
        yield database


def answer(found):
    return [(hit.grasp, hit.cost, hit.parts, hit.shared_sites) for hit in found.hits]


@pytest.mark.parametrize("by", ["feature", "posture", "contact", "all"])
@pytest.mark.parametrize("mode", ["shape", "held"])
def test_hits_are_ranked_and_explained(db: Database, by: str, mode: str) -> None:
    found = db.similar(QUERY, 8, by=by, mode=mode)
    assert [hit.rank for hit in found.hits] == list(range(1, len(found.hits) + 1))
    assert len(found.hits) == 8
    costs = [hit.cost for hit in found.hits]
    assert costs == sorted(costs)
    assert QUERY not in {hit.grasp for hit in found.hits}
    for hit in found.hits:
        assert hit.cost == pytest.approx(sum(part.cost for part in hit.parts))
        assert sum(part.weight for part in hit.parts) == pytest.approx(1)
        assert (hit.hit_from_query is None) == (by == "posture")
        assert all(part.name in hit.explain() for part in hit.parts)
    assert len(found.table()) == 8
    json.dumps(found.as_json(), allow_nan=False)


@pytest.mark.parametrize("by", ["feature", "posture", "contact", "all"])
def test_answers_repeat_and_do_not_depend_on_memory(db: Database, folder: Path, by: str) -> None:
    expected = answer(db.similar(QUERY, 12, by=by, where="object = 'round' OR subject = 'ben'"))
    with graspdb.open(folder) as again:
        assert (
            answer(again.similar(QUERY, 12, by=by, where="object = 'round' OR subject = 'ben'")) == expected
        )
        batched = Search(again._engine, memory=0)
        question = batched.question(QUERY)
        found = batched.similar(question, Respect(by), 12, "object = 'round' OR subject = 'ben'")
    assert not batched.holdings.in_memory
    assert answer(found) == expected


def test_a_filter_leaves_only_what_it_says(db: Database) -> None:
    everything = [hit.grasp for hit in db.similar(QUERY, 100).hits]
    round_ones = [hit.grasp for hit in db.similar(QUERY, 100, where="object = 'round' -- only these").hits]
    objects = dict(db.sql("SELECT grasp, object FROM grasps").rows())
    assert round_ones == [key for key in everything if objects[key] == "round"]
    assert db.similar(QUERY, 5, where="false").hits == ()
    other = db.similar(QUERY, 100, where="grasp IN (SELECT grasp FROM contacts WHERE site = 'thumb_tip')")
    assert 0 < len(other.hits) < len(everything)


def test_what_cannot_be_compared_is_counted(db: Database) -> None:
    found = db.similar(QUERY)
    assert (found.searched, found.left_out) == (similar_database.N_GRASPS - 1, 1)


def test_held_compares_one_side(db: Database) -> None:
    assert {hit.side for hit in db.similar(QUERY, 100, mode="held").hits} == {"right"}
    assert {hit.side for hit in db.similar(QUERY, 100).hits} == {"right", "left"}


def test_posture_is_that_of_the_hand_whatever_its_size_and_side(db: Database) -> None:
    found = db.similar("made/0/left/0", 100, by="posture")
    alike = [hit for hit in found.hits if int(hit.grasp.split("/")[1]) % 5 == 0]
    assert all(hit.cost < 1e-6 for hit in alike)
    assert {hit.side for hit in alike} == {"right", "left"}
    metric = db.similar("made/0/left/0", 100, by="posture", posture="metric")
    assert metric.hits[0].cost > 0.01


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("normals", [True, False])
def test_a_moved_part_from_a_file_finds_its_object(
    db: Database, tmp_path: Path, seed: int, normals: bool
) -> None:
    cloud = similar_database.sheets()["round"]
    inside = np.linalg.norm(cloud.points - cloud.points[900], axis=1) < 0.025
    still = _write(tmp_path / "still.ply", cloud.points[inside], cloud.normals[inside] if normals else None)
    turn, shift = Rotation.random(rng=np.random.default_rng(seed)), np.array([0.3, -0.2, 0.1])
    points, directions = turn.apply(cloud.points[inside]) + shift, turn.apply(cloud.normals[inside])
    moved = _write(tmp_path / "moved.ply", points, directions if normals else None)
    here, there = db.similar(k=5, cloud=still), db.similar(k=5, cloud=moved)
    assert [hit.grasp for hit in here.hits] == [hit.grasp for hit in there.hits]
    assert [hit.cost for hit in here.hits] == pytest.approx([hit.cost for hit in there.hits], abs=0.02)
    assert here.hits[0].object == "round"
    assert here.hits[0].parts[0].distance < 0.5  # also of this hollow part the side that is out is kept


@pytest.mark.parametrize("where", REFUSED)
def test_a_filter_that_is_no_boolean_or_leaves_the_database_is_refused(db: Database, where: str) -> None:
    with pytest.raises(QueryError):
        db.similar(QUERY, where=where)


def test_an_unknown_grasp_is_answered_with_the_nearest_name(db: Database) -> None:
    with pytest.raises(QueryError, match=r"did you mean 'made/4/right/0'"):
        db.similar("made/4/rigt/0")


def test_what_the_query_lacks_is_said(db: Database, tmp_path: Path) -> None:
    with pytest.raises(QueryError, match="encloses no point"):
        db.similar(similar_database.EMPTY)
    with pytest.raises(QueryError, match="no angles posture"):
        db.similar(QUERY, by="posture", posture="angles")
    cloud = similar_database.sheets()["flat"]
    part = _write(tmp_path / "part.ply", cloud.points[:200], cloud.normals[:200])
    with pytest.raises(QueryError, match="part without a hand"):
        db.similar(cloud=part, by="posture")
    with pytest.raises(QueryError, match="pose of a hand"):
        db.similar(cloud=part, mode="held")


@pytest.mark.parametrize(
    ("name", "value"), [("by", "colour"), ("mode", "upside"), ("posture", "x"), ("k", 0)]
)
def test_wrong_arguments_are_named(db: Database, name: str, value: object) -> None:
    with pytest.raises(ParameterError, match=name):
        db.similar(QUERY, **{name: value})
    with pytest.raises(ParameterError, match="one of them"):
        db.similar()


def test_clouds_that_are_no_part_are_refused(db: Database, tmp_path: Path) -> None:
    cloud = similar_database.sheets()["flat"]
    some, up = cloud.points[:400], cloud.normals[:400]
    with pytest.raises(ObjectError, match="3 finite points"):
        db.similar(cloud=_write(tmp_path / "three.ply", some[:3], up[:3]))
    with pytest.raises(ObjectError, match=r"mesh_units mm|Check --units"):
        db.similar(cloud=_write(tmp_path / "large.ply", 1000 * some, up))
    with pytest.raises(ObjectError, match="largest extent"):
        db.similar(cloud=_write(tmp_path / "small.ply", some / 1000, up))
    with pytest.raises(ObjectError, match="encloses at most"):
        db.similar(cloud=_write(tmp_path / "long.ply", 10 * some, up))
    broken = np.vstack([some, np.full((5, 3), np.nan)])
    assert db.similar(cloud=_write(tmp_path / "nan.ply", broken, np.vstack([up, up[:5]]))).hits
    with pytest.raises(ObjectError):
        db.similar(cloud=tmp_path / "missing.ply")


def test_a_cloud_of_a_million_points_is_thinned(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(0, 0.05, (1_000_000, 2)), np.zeros(1_000_000)])
    path = _write(tmp_path / "million.ply", points, np.tile([0.0, 0.0, 1.0], (1_000_000, 1)))
    question = part_question(path, 1.0)
    assert question.part is not None
    assert 300 < len(question.part.points) < 2000


def test_the_command_line_answers(folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch) -> None:
    from graspdb.cli import main

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["graspdb", "similar", "--db", str(folder), *arguments])
        with pytest.raises(SystemExit) as done:
            main()
        captured = capsys.readouterr()
        return int(done.value.code or 0), captured.out, captured.err

    status, out, _ = run(QUERY, "-k", "3", "--by", "all", "--where", "object = 'round'")
    assert status == 0
    assert "grasps searched" in out
    status, out, _ = run(QUERY, "-k", "3", "--json")
    assert [hit["rank"] for hit in json.loads(out)["hits"]] == [1, 2, 3]
    assert run("nothing")[0] == 1
    assert run()[0] == 2
    status, _, err = run(QUERY, "--where", "1")
    assert status == 1
    assert "BOOLEAN" in err
    assert "Traceback" not in err


def _write(path: Path, points: np.ndarray, normals: np.ndarray | None) -> Path:
    columns = points if normals is None else np.hstack([points, normals])
    names = ["x", "y", "z"] if normals is None else ["x", "y", "z", "nx", "ny", "nz"]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    head += [f"property double {name}" for name in names] + ["end_header"]
    path.write_bytes(("\n".join(head) + "\n").encode() + np.ascontiguousarray(columns, "<f8").tobytes())
    return path
