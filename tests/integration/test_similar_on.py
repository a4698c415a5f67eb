"""Where people would grasp a new object: the same mug, another, one of twice the size, and no object."""

import json
import sys
from pathlib import Path

import mug_database
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import graspdb
from graspdb.database import Database
from graspdb.store import Store
from graspdb_queries.similar.placed import GraspsOn
from graspdb_schemas.errors import ObjectError, ParameterError, QueryError

POSE = np.eye(4)
POSE[:3, :3] = Rotation.random(rng=np.random.default_rng(4)).as_matrix()
POSE[:3, 3] = 0.3, -0.2, 0.1


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return mug_database.build(tmp_path_factory.mktemp("similar_on") / "grasps")


@pytest.fixture(scope="module")
def db(folder: Path):
    with graspdb.open(folder) as database:
        yield database


@pytest.fixture(scope="module")
def same(db: Database, folder: Path) -> GraspsOn:
    """Return the answer for the database's own mug, moved."""
    return db.similar_on(mug_database.write(folder.parent / "same.stl", mug_database.mug().mesh, POSE))


def moved(points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    return points @ pose[:3, :3].T + pose[:3, 3]


def kind(grasp: str) -> str:
    return grasp.split("/")[1][:-1]


def test_a_moved_object_gets_its_own_grasps_back(db: Database, same: GraspsOn) -> None:
    true = {key: np.array(sites) for key, sites in db.sql("SELECT grasp, sites_object FROM grasps").rows()}
    assert {hit.grasp for hit in same.hits} == set(true)
    apart = {
        hit.grasp: np.linalg.norm(hit.sites - moved(true[hit.grasp], POSE), axis=1).max() for hit in same.hits
    }
    handles = [key for key in apart if kind(key) == "handle"]
    print({key: f"{1e3 * value:.2f} mm" for key, value in apart.items()})
    assert max(apart[key] for key in handles) < 0.003
    # Side and rim are alike all around, so only how well they fit is known.
    assert all(hit.trimmed < 0.0015 and hit.contacts_on == 1 for hit in same.hits)
    assert all(hit.penetration < 0.005 for hit in same.hits)


def test_hits_are_ranked_and_explained(db: Database, same: GraspsOn) -> None:
    costs = [hit.cost for hit in same.hits]
    assert costs == sorted(costs)
    for hit in same.hits:
        assert hit.cost == pytest.approx(sum(part.cost for part in hit.parts))
        assert all(part.name in hit.explain() for part in hit.parts)
        true = np.array(db.sql("SELECT sites_object FROM grasps WHERE grasp = $g", g=hit.grasp).rows()[0][0])
        assert hit.sites == pytest.approx(moved(true, hit.new_from_object), abs=1e-9)
        assert hit.q == pytest.approx(np.linspace(0, 1, 30))
    assert len(same.table()) == len(same.hits)
    json.dumps(same.as_json(), allow_nan=False)
    assert {hit.place for hit in same.hits if kind(hit.grasp) == "handle"} & {1, 2, 3}


def test_answers_repeat(db: Database, folder: Path, same: GraspsOn) -> None:
    again = db.similar_on(folder.parent / "same.stl")
    assert again.as_json() == same.as_json()


def test_another_mug_is_grasped_at_its_handle(db: Database, folder: Path) -> None:
    body = mug_database.mug(seed=8)
    new = mug_database.write(folder.parent / "other.stl", body.mesh, POSE, 1000)
    found = db.similar_on(new, where="grasp LIKE '%handle%'", scale=0.001)
    assert found.searched == 3
    for hit in found.hits:
        assert np.linalg.norm(hit.centre - moved(mug_database.handle(body), POSE)) < 0.015
        assert hit.contacts_on >= 0.5


def test_an_object_of_half_the_size_does_not_fit(db: Database, folder: Path, same: GraspsOn) -> None:
    small = mug_database.write(folder.parent / "half.stl", mug_database.mug().mesh, scale=0.5)
    best = min((hit.cost for hit in db.similar_on(small).hits), default=np.inf)
    assert best > 2 * max(hit.cost for hit in same.hits if kind(hit.grasp) == "handle")


def test_files_that_are_no_object_are_refused(db: Database, folder: Path, tmp_path: Path) -> None:
    mesh = mug_database.mug().mesh
    with pytest.raises(ObjectError, match=r"largest extent .* mm \(0\.1"):
        db.similar_on(mug_database.write(tmp_path / "mm.stl", mesh, scale=1000))
    with pytest.raises(ObjectError, match="largest extent"):
        db.similar_on(mug_database.write(tmp_path / "small.stl", mesh, scale=0.001))
    empty = tmp_path / "empty.off"
    empty.write_text("OFF\n3 0 0\n0 0 0\n0.1 0 0\n0 0.1 0\n")
    with pytest.raises(ObjectError):
        db.similar_on(empty)
    with pytest.raises(ObjectError, match=r"missing\.stl"):
        db.similar_on(tmp_path / "missing.stl")
    with pytest.raises(ParameterError, match="k"):
        db.similar_on(folder.parent / "same.stl", 0)
    with pytest.raises(QueryError, match="BOOLEAN"):
        db.similar_on(folder.parent / "same.stl", where="1")
    small = mug_database.write(tmp_path / "small.stl", mesh, scale=0.4)
    assert db.similar_on(small, where="false").hits == ()


def test_a_database_without_features_is_said(tmp_path: Path, same: GraspsOn) -> None:
    Store.create_or_open(tmp_path / "none")
    with graspdb.open(tmp_path / "none") as nothing, pytest.raises(QueryError, match="has no features"):
        nothing.similar_on(same.object)


def test_the_command_line_answers(folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch) -> None:
    from graspdb.cli import main

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["graspdb", "similar", "--db", str(folder), *arguments])
        with pytest.raises(SystemExit) as done:
            main()
        captured = capsys.readouterr()
        return int(done.value.code or 0), captured.out, captured.err

    new = str(folder.parent / "same.stl")
    mug_database.write(Path(new), mug_database.mug().mesh, POSE)
    status, out, _ = run("--object", new, "-k", "2", "--json")
    assert status == 0
    assert [hit["rank"] for hit in json.loads(out)["hits"]] == [1, 2]
    assert np.array(json.loads(out)["hits"][0]["sites"]).shape == (20, 3)
    small = mug_database.write(folder.parent / "small.stl", mug_database.mug().mesh, scale=0.4)
    status, out, _ = run("--object", str(small), "-k", "2")
    assert "grasps searched" in out
    assert run("--object", new, "--by", "posture")[0] == 2
    assert run("--object", new, "some/grasp")[0] == 2
    status, _, err = run("--object", new, "--units", "mm")
    assert (status, "Traceback" in err) == (1, False)
