"""The Python API: open, ask, take one grasp."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from handmade import rows, session_tables, trial_tables

import graspdb
from graspdb.store import Store
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import ParameterError, QueryError
from graspdb_schemas.tables import TABLES


@pytest.fixture
def database(tmp_path: Path) -> Iterator[graspdb.Database]:
    store = Store.create_or_open(tmp_path / "db")
    store.commit_session(session_tables())
    store.commit_trials([trial_tables(1), trial_tables(2, status="rejected", reasons=["too few markers"])])
    with graspdb.open(tmp_path / "db") as opened:
        yield opened


def test_sql_binds_parameters(database: graspdb.Database) -> None:
    result = database.sql("SELECT count(*) AS n FROM contacts WHERE site = $site", site="thumb_tip")
    assert result.df()["n"].tolist() == [2]


def test_info(database: graspdb.Database) -> None:
    info = database.info()
    assert info.rows["trials"] == 2
    assert info.rows["object_points"] == 5
    assert info.rejected == 1
    assert set(info.versions) == set(TABLES) == set(database.tables)
    assert info.several_versions == ()


def test_a_grasp_with_its_arrays(database: graspdb.Database) -> None:
    grasp = database.grasp("s/anna_mug_1/right/0")
    assert (grasp.trial, grasp.subject, grasp.object, grasp.side) == ("s/anna_mug_1", "anna", "mug", "right")
    assert grasp.contact_sites == ("thumb_tip", "index_tip", "index_pip")
    assert grasp.digits == ("thumb", "index")
    np.testing.assert_array_equal(grasp.contact_points, [[0, 0, 0], [1, 0, 0], [2, 0, 0]])
    np.testing.assert_array_equal(grasp.object_from_hand, np.eye(4))
    np.testing.assert_array_equal(grasp.feature_cloud, [[1, 0, 0], [3, 0, 0]])
    np.testing.assert_array_equal(grasp.sites[:, 0], 0.01 * np.arange(20))
    assert grasp.hull_vertices.shape == (4, 3)
    assert grasp.hull_faces.max() == 3
    assert grasp.descriptor.shape == (428,)
    assert grasp.quality == {"epsilon": 0.1}
    assert grasp.snapshot_time == 0.02


def test_what_a_grasp_lacks_is_nan_or_empty(tmp_path: Path) -> None:
    trial = trial_tables(1, sites=[])
    missing = dict.fromkeys(("q", "sites_object", "gap", "quality", "contact_sites"))
    grasps = rows("grasps", {**trial.tables["grasps"].to_pylist()[0], **missing})
    store = Store.create_or_open(tmp_path / "db")
    store.commit_trial(TrialTables({"trials": trial.tables["trials"], "grasps": grasps}))
    with graspdb.open(store.path) as database:
        grasp = database.grasp("s/anna_mug_1/right/0")
    assert grasp.q.shape == (30,)
    assert np.isnan(grasp.q).all()
    assert np.isnan(grasp.sites).all()
    assert grasp.sites.shape == (20, 3)
    assert grasp.contact_points.shape == grasp.hull_vertices.shape == grasp.feature_cloud.shape == (0, 3)
    assert grasp.quality == {}


def test_an_unknown_grasp_names_the_nearest(database: graspdb.Database) -> None:
    with pytest.raises(QueryError, match="did you mean 's/anna_mug_1/right/0'"):
        database.grasp("s/anna_mug_1/right/O")
    with pytest.raises(QueryError, match="no grasp 'x'"):
        database.grasp("x")


def test_an_unknown_table(database: graspdb.Database) -> None:
    with pytest.raises(ParameterError, match="did you mean 'grasps'"):
        database.table("grasp")


def test_a_closed_database_can_be_asked_again(database: graspdb.Database) -> None:
    database.close()
    assert database.sql("SELECT 1").rows() == [(1,)]


def test_names_of_the_package() -> None:
    assert {"open", "Database", "Grasp", "__version__"} <= set(dir(graspdb))
    assert graspdb.__version__[0].isdigit()
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        getattr(graspdb, "nonsense")  # noqa: B009


def test_importing_loads_nothing_heavy() -> None:
    heavy = {
        "duckdb",
        "pyarrow",
        "deltalake",
        "numpy",
        "pandas",
        "scipy",
        "open3d",
        "mujoco",
        "trimesh",
        "rich",
    }
    code = f"import sys, graspdb, graspdb.cli; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
