"""``graspdb export rerun``: recordings that Rerun's own reader gives back as they were."""

from pathlib import Path

import held_can
import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

import graspdb
from graspdb_schemas.errors import MissingLibraryError
from graspdb_schemas.vocabulary import SITES


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rerun")
    held_can.build(folder / "grasps")
    with graspdb.open(folder / "grasps") as database:
        database.export("rerun", folder / "out")
    return folder / "out"


@pytest.fixture(scope="module")
def lifted(exported: Path) -> dict[str, pa.Table]:
    """Return what the recording of the lifted can holds, by entity."""
    (path,) = exported.glob("*_made_lift_right.rrd")
    chunks: dict[str, list[pa.Table]] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        chunks.setdefault(chunk.entity_path, []).append(pa.Table.from_batches([chunk.to_record_batch()]))
    return {entity: pa.concat_tables(tables, promote_options="default") for entity, tables in chunks.items()}


def seconds(table: pa.Table) -> np.ndarray:
    return table["time"].cast(pa.int64()).to_numpy() / 1e9


def test_every_hand_and_trial_is_a_file(exported: Path) -> None:
    assert len(list(exported.glob("*.rrd"))) == 2
    assert "hand enclosing space" in (exported / "README.md").read_text()


def test_the_object_moves_as_it_did(lifted: dict[str, pa.Table]) -> None:
    table = lifted["/world/object"].sort_by("time")
    np.testing.assert_allclose(seconds(table), np.arange(held_can.N_FRAMES) / held_can.RATE, atol=1e-8)
    positions = [row[0] for row in table["Transform3D:translation"].to_pylist()]
    quaternions = [row[0] for row in table["Transform3D:quaternion"].to_pylist()]
    for frame in range(held_can.N_FRAMES):
        turn, place = held_can.can_pose(frame)
        np.testing.assert_allclose(positions[frame], place, atol=1e-6)
        assert abs(np.dot(quaternions[frame], turn.as_quat())) == pytest.approx(1, abs=1e-6)


def test_spheres_are_where_they_were_and_red_where_they_touch(lifted: dict[str, pa.Table]) -> None:
    table = lifted["/world/hand/sites"].sort_by("time")
    grip = held_can.held()
    touching = grip.gap < held_can.THRESHOLD
    for frame in (0, held_can.LIFT, held_can.TOP):
        row = table.slice(frame, 1).to_pylist()[0]
        turn, place = held_can.can_pose(frame)
        expected = turn.apply(grip.sites) + place + held_can.hand_away(frame)
        np.testing.assert_allclose(row["Points3D:positions"], expected, atol=1e-6)
        np.testing.assert_allclose(row["Points3D:radii"], grip.model.radii, atol=1e-6)
        colours = np.array(row["Points3D:colors"])
        expected_colours = touching if frame >= held_can.CONTACT else np.zeros(len(SITES), dtype=bool)
        assert len(np.unique(colours)) == len(np.unique(expected_colours))
        if expected_colours.any():
            assert (colours[expected_colours] != colours[~expected_colours][0]).all()
        assert row["Points3D:labels"] == list(SITES)


def test_numbers_are_those_of_the_frames(lifted: dict[str, pa.Table]) -> None:
    grip = held_can.held()
    for site, gap in zip(SITES, grip.gap, strict=True):
        table = lifted[f"/gap/{site}"].sort_by("time")
        values = np.array([row[0] for row in table["Scalars:scalars"].to_pylist()])
        away = [np.linalg.norm(held_can.hand_away(frame)) for frame in range(held_can.N_FRAMES)]
        np.testing.assert_allclose(values, gap + np.array(away), atol=1e-9)


def test_the_surface_hull_and_contacts_stand_for_all_times(lifted: dict[str, pa.Table]) -> None:
    for entity in ("/world/object/surface", "/world/object/grasp_0/hull", "/world/object/grasp_0/contacts"):
        assert "time" not in lifted[entity].column_names
    surface = lifted["/world/object/surface"].to_pylist()[0]
    np.testing.assert_allclose(surface["Mesh3D:vertex_positions"], held_can.held().points, atol=1e-6)


def test_without_rerun_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    held_can.build(tmp_path / "grasps")
    monkeypatch.setattr("graspdb.export.run.find_spec", lambda _: None)
    with (
        graspdb.open(tmp_path / "grasps") as database,
        pytest.raises(MissingLibraryError, match=r"pip install 'graspdb\[rerun\]'"),
    ):
        database.export("rerun", tmp_path / "out")
    assert not (tmp_path / "out").exists()
