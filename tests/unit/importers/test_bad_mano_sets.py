"""What can be wrong with a downloaded data set is named: file, what was found, what to do."""

import contextlib
import os
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mano_sets import WRITERS, Truth, write_hot3d_mano

from graspdb.importing import import_data_set
from graspdb_ingest.importers.base import Clip, ImportOptions
from graspdb_ingest.importers.plausible import check_clip
from graspdb_ingest.importers.registry import IMPORTERS
from graspdb_schemas.errors import GraspDBError, ImportSourceError, UnsafeFileError
from graspdb_schemas.vocabulary import Side


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Truth]]:
    """Return a folder with each of the data sets, and what is in them."""
    folder = tmp_path_factory.mktemp("sets")
    return folder, {form: writer(folder / form) for form, writer in WRITERS.items()}


@pytest.fixture
def sets(written: tuple[Path, dict[str, Truth]], tmp_path: Path) -> Path:
    """Return a folder with a copy of each data set to be damaged."""
    shutil.copytree(written[0], tmp_path / "sets")
    return tmp_path / "sets"


def mano(form: str, folder: Path) -> dict[str, Any]:
    """Return the options that a format needs."""
    return {"mano": folder / "mano"} if form in ("grab", "arctic") else {}


def read(form: str, root: Path, trial: str, **options: Any) -> Clip:
    """Find a clip by its name and read it."""
    said = ImportOptions(
        **{"mano": root.parent / "mano"} | options if form in ("grab", "arctic") else options
    )
    return next(
        IMPORTERS[form].read(source, said)
        for source in IMPORTERS[form].find(root, said)
        if source.name == trial
    )


@pytest.mark.parametrize("form", WRITERS)
def test_the_folder_of_another_set_is_told_by_its_name(
    written: tuple[Path, dict[str, Truth]], form: str, tmp_path: Path
) -> None:
    folder, truths = written
    for other in truths.keys() - {form}:
        options = ImportOptions(mano=folder / "mano")
        with pytest.raises(ImportSourceError) as caught:
            import_data_set(form, folder / other, tmp_path / "grasps", options=options)
        message = str(caught.value)
        assert str(folder / other) in message
        assert IMPORTERS[form].format.needs[0] in message
        assert f"graspdb import {other}" in message
    assert not (tmp_path / "grasps").exists()


@pytest.mark.parametrize(
    ("form", "mesh"),
    [
        ("dexycb", "models/025_mug/textured_simple.obj"),
        ("ho3d", "models/021_bleach_cleanser/textured_simple.obj"),
        ("grab", "tools/object_meshes/contact_meshes/mug.ply"),
        ("grab", "tools/subject_meshes/male/s1_lhand.ply"),
        ("arctic", "meta/object_vtemplates/box/top.obj"),
        ("oakink", "image/obj/A01001.obj"),
        ("hot3d", "assets/265826671143948.glb"),
    ],
)
def test_a_missing_mesh_is_named(sets: Path, form: str, mesh: str) -> None:
    (sets / form / mesh).unlink()
    with pytest.raises(ImportSourceError) as caught:
        list(
            IMPORTERS[form].find(
                sets / form, ImportOptions(mano=sets / "mano" if form in ("grab", "arctic") else None)
            )
        )
    name = Path(mesh).parent.name if "textured" in mesh else Path(mesh).stem
    assert name in str(caught.value)


@pytest.mark.parametrize("form", WRITERS)
def test_half_of_any_file_is_named(written: tuple[Path, dict[str, Truth]], sets: Path, form: str) -> None:
    trial = written[1][form].trial
    options = ImportOptions(**mano(form, sets))
    source = next(s for s in IMPORTERS[form].find(sets / form, options) if s.name == trial)
    for file in {path.suffix + path.name[:5]: path for path in reversed(source.files)}.values():
        whole = file.read_bytes()
        file.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(GraspDBError) as caught:
            read(form, sets / form, trial)
        assert file.name in str(caught.value)
        file.write_bytes(whole)
    read(form, sets / form, trial)


@pytest.mark.parametrize("form", WRITERS)
def test_damage_is_read_over_or_named_but_never_a_traceback(
    written: tuple[Path, dict[str, Truth]], sets: Path, form: str
) -> None:
    trial, rng = written[1][form].trial, np.random.default_rng(len(form))
    options = ImportOptions(**mano(form, sets))
    source = next(s for s in IMPORTERS[form].find(sets / form, options) if s.name == trial)
    for file in {path.suffix + path.name[:5]: path for path in reversed(source.files)}.values():
        whole = file.read_bytes()
        for _ in range(5):
            damaged = bytearray(whole)
            place = int(rng.integers(min(len(whole), 3000)))
            other = (b"", b"[]", b"-1", b"nan", b"1e400", rng.bytes(3))[int(rng.integers(6))]
            damaged[place : place + int(rng.integers(20))] = other
            file.write_bytes(bytes(damaged))
            with contextlib.suppress(GraspDBError):
                check_clip(read(form, sets / form, trial), file, None)
        file.write_bytes(whole)


@pytest.mark.parametrize("form", ["grab", "arctic"])
def test_a_missing_hand_model_says_where_to_get_it(sets: Path, form: str) -> None:
    (sets / "mano" / "MANO_LEFT.pkl").unlink()
    for given, missing in ((None, "MANO_RIGHT.pkl"), (sets / "mano", "MANO_LEFT.pkl")):
        with pytest.raises(ImportSourceError, match=rf"{missing}.*mano.is.tue.mpg.de.*--mano"):
            list(IMPORTERS[form].find(sets / form, ImportOptions(mano=given)))


def test_hot3d_with_mano_needs_manos_trajectory(sets: Path) -> None:
    with pytest.raises(ImportSourceError, match="mano_hand_pose_trajectory"):
        list(IMPORTERS["hot3d"].find(sets / "hot3d", ImportOptions(mano=sets / "mano")))


def test_a_hand_of_the_other_side_is_told_by_its_key_points(sets: Path) -> None:
    meta = next((sets / "dexycb").glob("*/*/meta.yml"))
    meta.write_text(meta.read_text().replace("- left", "- right"))
    clip = read("dexycb", sets / "dexycb", "20200709-subject-01_20200709_141754")
    with pytest.raises(ImportSourceError, match="declared to be of the right hand are those of a left one"):
        check_clip(clip, meta, None)


def change_ho3d(root: Path, change: Callable[[int, dict[str, Any]], None]) -> None:
    """Write the frames of HO-3D anew after a change."""
    from graspdb_ingest.importers.archives import read_pickle

    for number, file in enumerate(sorted((root / "train/ABF10/meta").glob("*.pkl"))):
        content = read_pickle(file)
        assert isinstance(content, dict)
        change(number, content)
        file.write_bytes(pickle.dumps(content))


def test_other_units_are_told_and_can_be_said(written: tuple[Path, dict[str, Truth]], sets: Path) -> None:
    def to_millimetres(_number: int, content: dict[str, Any]) -> None:
        for key in ("handJoints3D", "objTrans"):
            content[key] = None if content[key] is None else 1000 * content[key]

    change_ho3d(sets / "ho3d", to_millimetres)
    with pytest.raises(ImportSourceError, match="--units mm"):
        check_clip(read("ho3d", sets / "ho3d", "ABF10"), sets, None)
    clip = read("ho3d", sets / "ho3d", "ABF10", units="mm")
    truth = written[1]["ho3d"]
    np.testing.assert_allclose(clip.hands[0].key_points, truth.key_points[Side.RIGHT], atol=1e-6)
    np.testing.assert_allclose(np.asarray(clip.poses), truth.poses, atol=1e-6)


def test_mixed_units_are_told(sets: Path) -> None:
    def to_millimetres(number: int, content: dict[str, Any]) -> None:
        if number >= 5:
            content["handJoints3D"] = 1000 * content["handJoints3D"]

    change_ho3d(sets / "ho3d", to_millimetres)
    with pytest.raises(ImportSourceError, match="mixed units"):
        check_clip(read("ho3d", sets / "ho3d", "ABF10"), sets, None)


class Harm:
    """Pickles as a command."""

    def __reduce__(self) -> tuple[Callable[[str], int], tuple[str]]:
        return os.system, ("touch harm",)


def test_commands_in_annotations_are_refused(sets: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(sets)

    def harm(number: int, content: dict[str, Any]) -> None:
        content["handPose"] = Harm() if number == 2 else content["handPose"]

    change_ho3d(sets / "ho3d", harm)
    with pytest.raises(UnsafeFileError, match=r"0042.pkl.*system"):
        read("ho3d", sets / "ho3d", "ABF10")
    joints = next((sets / "oakink/image/anno/hand_j").glob("*__1__12__1.pkl"))
    joints.write_bytes(pickle.dumps(Harm()))
    with pytest.raises(UnsafeFileError, match=rf"{joints.name}.*system"):
        read("oakink", sets / "oakink", "A01001_0004_0003_0007_2021-09-26-19-59-58_1")
    assert not (sets / "harm").exists()


def test_the_evaluation_split_of_ho3d_is_of_no_use(sets: Path) -> None:
    def wrist_alone(_number: int, content: dict[str, Any]) -> None:
        joints = content["handJoints3D"]
        content["handJoints3D"] = None if joints is None else joints[0]

    change_ho3d(sets / "ho3d", wrist_alone)
    with pytest.raises(ImportSourceError, match="wrist alone"):
        read("ho3d", sets / "ho3d", "ABF10")


def test_missing_labels_and_cameras_are_counted(sets: Path) -> None:
    root, trial = sets / "dexycb", "20200709-subject-01_20200709_141754"
    next(root.glob("*/*/839512060362/labels_000004.npz")).unlink()
    with pytest.raises(ImportSourceError, match="839512060362 has 7 of 8 label files"):
        read("dexycb", root, trial)
    shutil.rmtree(next(root.glob("*/*/839512060362")))
    clip = read("dexycb", root, trial)
    assert np.isnan(clip.hands[0].key_points[[2, 3, 5]]).all()
    shutil.rmtree(next(root.glob("*/*/836212060125")))
    with pytest.raises(ImportSourceError, match="no camera has labels"):
        read("dexycb", root, trial)


def test_an_unknown_object_and_a_missing_calibration_are_named(sets: Path) -> None:
    root = sets / "dexycb"
    meta = next(root.glob("*/*/meta.yml"))
    content = yaml.safe_load(meta.read_text())
    meta.write_text(yaml.safe_dump(content | {"ycb_ids": [1, 77]}))
    with pytest.raises(ImportSourceError, match=r"ycb_ids \[1, 77\] with ycb_grasp_ind 1 name no object"):
        list(IMPORTERS["dexycb"].find(root, ImportOptions()))
    meta.write_text(yaml.safe_dump(content | {"extrinsics": "20990101_000000"}))
    with pytest.raises(ImportSourceError, match="extrinsics_20990101_000000"):
        list(IMPORTERS["dexycb"].find(root, ImportOptions()))
    del content["num_frames"]
    meta.write_text(yaml.safe_dump(content))
    with pytest.raises(ImportSourceError, match=r"no num_frames; there is .*ycb_ids"):
        read("dexycb", root, "20200709-subject-01_20200709_141754")


def test_grab_names_no_file_outside_of_itself(sets: Path) -> None:
    file = next((sets / "grab").glob("grab/*/*.npz"))
    with np.load(file, allow_pickle=True) as arrays:
        content = {name: arrays[name] for name in arrays.files}
    content["object"].item()["object_mesh"] = "../../mano/MANO_LEFT.pkl"
    np.savez(file, **content)
    with pytest.raises(UnsafeFileError, match=r"\.\./\.\./mano/MANO_LEFT.pkl.*outside"):
        list(IMPORTERS["grab"].find(sets / "grab", ImportOptions(mano=sets / "mano")))


def test_a_file_numbered_far_off_reserves_nothing(sets: Path) -> None:
    first = sets / "ho3d/train/ABF10/meta/0040.pkl"
    first.rename(first.with_name("9999999999.pkl"))
    with pytest.raises(ImportSourceError, match="frames are numbered 41 to 9999999999"):
        read("ho3d", sets / "ho3d", "ABF10")
    meta = next((sets / "dexycb").glob("*/*/meta.yml"))
    meta.write_text(meta.read_text().replace("num_frames: 8", "num_frames: 1000000000000"))
    with pytest.raises(ImportSourceError, match="8 of 1000000000000 label files"):
        read("dexycb", sets / "dexycb", "20200709-subject-01_20200709_141754")


def test_oakinks_earlier_file_names_are_known(written: tuple[Path, dict[str, Truth]], sets: Path) -> None:
    for file in (sets / "oakink/image/anno").glob("*/*.pkl"):
        file.rename(file.with_name(file.name.replace("A01001_0004_0003_0007", "A01001__0004__0003__0007")))
    truth = written[1]["oakink"]
    clip = read("oakink", sets / "oakink", truth.trial)
    np.testing.assert_allclose(clip.hands[0].key_points, truth.key_points[Side.RIGHT], atol=1e-6)
    assert clip.identifier == truth.identifier


def test_frames_that_do_not_go_together_are_counted(sets: Path) -> None:
    file = sets / "arctic/raw_seqs/s01/box_grab_01.object.npy"
    np.save(file, np.load(file)[:5])
    with pytest.raises(ImportSourceError, match=r"5 frames, the hands \[8, 8\]"):
        read("arctic", sets / "arctic", "s01_box_grab_01_top")


def test_a_table_without_a_column_and_a_time_far_off_are_named(sets: Path) -> None:
    table = sets / "hot3d/P0003_c701bd11/dynamic_objects.csv"
    whole = table.read_text()
    table.write_text(whole.replace("t_wo_x[m]", "t_wo_x[mm]"))
    with pytest.raises(ImportSourceError, match=r"no column 't_wo_x\[m\]'"):
        read("hot3d", sets / "hot3d", "P0003_c701bd11_mug")
    table.write_text(whole + "265826671143948,5,0,0,0,1,0,0,0\n")
    with pytest.raises(ImportSourceError, match=r"8 time stamps span 17025\d\d frames"):
        read("hot3d", sets / "hot3d", "P0003_c701bd11_mug")


@pytest.mark.parametrize("form", WRITERS)
def test_a_path_that_is_no_folder_is_named(form: str, tmp_path: Path) -> None:
    (tmp_path / "data.zip").write_bytes(b"PK")
    for path in (tmp_path / "data.zip", tmp_path / "nowhere", tmp_path):
        assert not IMPORTERS[form].recognises(path)
        with pytest.raises(ImportSourceError, match=str(path)):
            list(IMPORTERS[form].find(path, ImportOptions()))


def test_manos_hot3d_is_complete_without_umetracks(tmp_path: Path) -> None:
    truth = write_hot3d_mano(tmp_path / "hot3d")
    with pytest.raises(ImportSourceError, match="umetrack_hand_pose_trajectory"):
        list(IMPORTERS["hot3d"].find(tmp_path / "hot3d", ImportOptions()))
    clip = read("hot3d", tmp_path / "hot3d", truth.trial, mano=truth.mano)
    assert clip.attributes["hand_model"] == "MANO"
