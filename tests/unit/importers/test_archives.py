"""NPY and NPZ files of data sets: arrays and dicts come through, traps and halves are named."""

import os
import stat
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from graspdb_ingest.importers import archives
from graspdb_ingest.importers.archives import read_bytes, read_npy, read_npz
from graspdb_schemas.errors import ImportSourceError, UnsafeFileError


class Harm:
    """Pickles as a command."""

    def __reduce__(self) -> tuple[Callable[[str], int], tuple[str]]:
        return os.system, ("touch harm",)


def objects(content: object) -> np.ndarray:
    array = np.empty((), dtype=object)
    array[()] = content
    return array


def test_arrays_and_dicts_come_through(tmp_path: Path) -> None:
    points = np.asfortranarray(np.arange(12.0).reshape(4, 3))
    body = {"params": {"transl": np.ones((2, 3))}, "vtemp": "tools/s1.ply"}
    np.savez_compressed(tmp_path / "a.npz", points=points, body=objects(body), name="mug", n=np.int32(4))
    read = read_npz(tmp_path / "a.npz")
    assert np.array_equal(np.asarray(read["points"]), points)
    assert isinstance(read["body"], dict)
    assert read["body"]["vtemp"] == "tools/s1.ply"
    assert read["body"]["params"]["transl"].tolist() == [[1, 1, 1], [1, 1, 1]]
    assert (np.asarray(read["name"]).item(), np.asarray(read["n"]).item()) == ("mug", 4)
    assert set(read_npz(tmp_path / "a.npz", ["n", "other"])) == {"n"}


def test_an_npy_file_of_a_dict_or_of_numbers_comes_through(tmp_path: Path) -> None:
    np.save(tmp_path / "hands.npy", objects({"right": {"rot": np.zeros((5, 3))}}))
    np.save(tmp_path / "object.npy", np.ones((5, 7)))
    hands = read_npy(tmp_path / "hands.npy")
    assert isinstance(hands, dict)
    assert hands["right"]["rot"].shape == (5, 3)
    assert np.array_equal(np.asarray(read_npy(tmp_path / "object.npy")), np.ones((5, 7)))


def test_commands_in_arrays_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    np.savez("a.npz", points=np.zeros(3), body=objects({"x": Harm()}))
    np.save("a.npy", objects(Harm()))
    with pytest.raises(UnsafeFileError, match=r"a.npz.*system"):
        read_npz(Path("a.npz"))
    with pytest.raises(UnsafeFileError, match=r"a.npy.*system"):
        read_npy(Path("a.npy"))
    assert not Path("harm").exists()


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_half_a_file_is_named(tmp_path: Path, share: float) -> None:
    np.savez(tmp_path / "a.npz", points=np.random.default_rng(0).normal(size=(500, 3)))
    np.save(tmp_path / "a.npy", np.zeros((500, 3)))
    for name, read in (("a.npz", read_npz), ("a.npy", read_npy)):
        path = tmp_path / name
        path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
        with pytest.raises(ImportSourceError, match=rf"{name}.*[Dd]ownload it again"):
            read(path)


def test_a_shape_beyond_the_data_reserves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.zeros((500, 3)))
    path.write_bytes(path.read_bytes().replace(b"(500, 3), }     ", b"(1000000000,3),}"))
    with pytest.raises(ImportSourceError, match=r"12000 bytes for an array of shape \(1000000000, 3\)"):
        read_npy(path)


@pytest.mark.parametrize("name", ["../a.npy", "/a.npy", "x/../../a.npy", "..\\a.npy", "C:\\a.npy", "run.sh"])
def test_members_of_other_places_are_refused(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr(name, b"data")
    with pytest.raises(UnsafeFileError, match=r"a.npz: its member"):
        read_npz(tmp_path / "a.npz")


def test_links_are_refused(tmp_path: Path) -> None:
    link = zipfile.ZipInfo("a.npy")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr(link, b"/etc/passwd")
    with pytest.raises(UnsafeFileError, match="a link"):
        read_npz(tmp_path / "a.npz")


def test_sizes_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.savez_compressed(tmp_path / "a.npz", a=np.zeros(100_000), b=np.zeros(100_000))
    monkeypatch.setattr(archives, "MAX_BYTES", 1 << 20)
    assert set(read_npz(tmp_path / "a.npz", ["a"])) == {"a"}
    with pytest.raises(UnsafeFileError, match="unpacks to more than 1 MiB"):
        read_npz(tmp_path / "a.npz")
    np.save(tmp_path / "a.npy", np.zeros(200_000))
    with pytest.raises(UnsafeFileError, match="more than 1 MiB"):
        read_npy(tmp_path / "a.npy")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    for read in (read_npz, read_npy, read_bytes):
        with pytest.raises(ImportSourceError, match=r"none.*No such file"):
            read(tmp_path / "none")
