"""Measured contact as NPZ, CSV and PLY says the same, and bad files are told apart."""

from pathlib import Path

import numpy as np
import pytest

from graspdb.validation.contact_map import agreement, auc, best_agreement
from graspdb.validation.contact_map_file import read_measured_map
from graspdb_schemas.errors import MeasuredMapError

POSITIONS = np.array([[0.0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [0.01, 0.01, 0], [0.02, 0, 0]])
CONTACT = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
NORMALS = np.tile([0.0, 0, 1], (5, 1))


def test_npz_csv_and_ply_say_the_same(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", positions=POSITIONS, contact=CONTACT, normals=NORMALS)
    rows = "".join(f"{x},{y},{z},{c},0,0,1\n" for (x, y, z), c in zip(POSITIONS, CONTACT, strict=True))
    (tmp_path / "a.csv").write_text("x,y,z,contact,nx,ny,nz\n" + rows)
    head = "ply\nformat ascii 1.0\nelement vertex 5\n" + "".join(
        f"property float {name}\n" for name in ("x", "y", "z", "contact")
    )
    faces = "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    points = "".join(f"{x} {y} {z} {c}\n" for (x, y, z), c in zip(POSITIONS, CONTACT, strict=True))
    (tmp_path / "a.ply").write_text(head + faces + points + "3 0 1 2\n3 1 3 2\n")
    for ending in ("npz", "csv", "ply"):
        found, hands = read_measured_map(tmp_path / f"a.{ending}")
        assert found.positions == pytest.approx(POSITIONS, abs=1e-8)
        assert found.contact == pytest.approx(CONTACT)
        assert found.normals[:4] == pytest.approx(NORMALS[:4])
        assert hands == ()


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"positions": POSITIONS}, "contact is missing"),
        ({"positions": POSITIONS[:3], "contact": CONTACT}, "shape"),
        ({"positions": POSITIONS, "contact": 2 * CONTACT}, "0 to 2"),
        ({"positions": 1000 * POSITIONS, "contact": CONTACT}, "in metres"),
        ({"positions": POSITIONS * np.nan, "contact": CONTACT}, "0 points"),
        ({"positions": POSITIONS, "contact": CONTACT, "faces": [[0, 1, 9]]}, "faces"),
        (
            {
                "positions": POSITIONS,
                "contact": CONTACT,
                "normals": NORMALS,
                "key_points": np.zeros((2, 21, 3)),
            },
            "sides",
        ),
    ],
)
def test_bad_files(tmp_path: Path, arrays: dict[str, np.ndarray], message: str) -> None:
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(MeasuredMapError, match=message):
        read_measured_map(tmp_path / "bad.npz")


def test_files_of_another_kind(tmp_path: Path) -> None:
    (tmp_path / "bad.npz").write_bytes(b"no archive")
    for name, message in (("bad.npz", "cannot be read"), ("none.npz", "no such file"), ("a.txt", "ends in")):
        with pytest.raises(MeasuredMapError, match=message):
            read_measured_map(tmp_path / name)


def test_figures_by_hand() -> None:
    gap, touched = np.array([0.0, 1, 2, 3]), np.array([True, False, True, False])
    assert auc(gap, touched) == pytest.approx(0.75)
    assert auc(np.zeros(4), touched) == pytest.approx(0.5)
    at = agreement(gap, touched, 1.0)
    assert (at.precision, at.recall, at.f1) == (0.5, 0.5, 0.5)
    best = best_agreement(gap, touched)
    assert (best.threshold, best.f1) == (2.0, pytest.approx(0.8))
