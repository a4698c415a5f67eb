"""What was written in any format is what is read: positions, gaps, labels, rate."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import recording_files as write
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from graspdb_ingest.readers import read_recording
from graspdb_ingest.recording import Recording
from graspdb_schemas.tables import MARKERS

Positions = NDArray[np.float64]
Writer = Callable[[Path, list[str], Positions, float], Path]

WRITERS: dict[str, tuple[str, Writer]] = {
    "c3d": ("a.c3d", write.write_c3d),
    "trc": ("a.trc", write.write_trc),
    "qualisys": ("a.tsv", write.write_qualisys),
    "qualisys without time": ("a.tsv", lambda *a: write.write_qualisys(*a, leading=1, blank="")),
    "qualisys without titles": ("a.tsv", lambda *a: write.write_qualisys(*a, titles=False, blank="null")),
    "qualisys bare": ("a.tsv", lambda *a: write.write_qualisys(*a, leading=0, titles=False)),
    "optitrack": (
        "a.csv",
        lambda path, labels, positions, rate: write.write_optitrack(
            path,
            {label: positions[:, i] for i, label in enumerate(labels)},
            rate,
            units="Millimeters",
            parent=True,
        ),
    ),
    "plain": ("a.csv", write.write_plain),
    "plain dots": ("a.csv", lambda *a: write.write_plain(*a, style="{label}.{axis}")),
    "plain tabs": ("a.tsv", lambda *a: write.write_plain(*a, style="{label} {axis}", delimiter="\t")),
    "plain semicolons": ("a.csv", lambda *a: write.write_plain(*a, delimiter=";")),
    "parquet": ("a.parquet", write.write_parquet),
}


def sample(n_frames: int = 12, n_markers: int = 3, seed: int = 0) -> Positions:
    """Return positions in millimetres with a fifth of them missing."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-900, 900, (n_frames, n_markers, 3))
    positions[rng.random((n_frames, n_markers)) < 0.2] = np.nan
    positions[0] = rng.uniform(1, 2, (n_markers, 3))
    return positions


def labels_of(n_markers: int) -> list[str]:
    return [f"m {i}" if i == 1 else f"marker_{i}" for i in range(n_markers)]


@pytest.mark.parametrize("name", WRITERS)
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    n_frames=st.integers(2, 40),
    n_markers=st.integers(1, 5),
    rate=st.sampled_from([60.0, 100.0, 119.88, 200.0, 1000.0]),
    seed=st.integers(0, 1000),
)
def test_what_is_written_is_read(
    tmp_path: Path, name: str, n_frames: int, n_markers: int, rate: float, seed: int
) -> None:
    file, writer = WRITERS[name]
    positions, labels = sample(n_frames, n_markers, seed), labels_of(n_markers)
    recording = read_recording(writer(tmp_path / file, labels, positions, rate), 0.001)
    assert recording.labels == tuple(labels)
    assert recording.rate == pytest.approx(rate, rel=1e-6)
    assert recording.start_time == 0
    single = name == "c3d"
    np.testing.assert_allclose(recording.positions, positions * 0.001, atol=1e-7 if single else 1e-12, rtol=0)
    np.testing.assert_array_equal(recording.seen, np.isfinite(positions).all(axis=2))


def read(path: Path, scale: float = 0.001) -> Recording:
    return read_recording(path, scale)


@pytest.mark.parametrize(("units", "metres"), [("mm", 0.001), ("cm", 0.01), ("m", 1.0), ("Meters", 1.0)])
def test_units_come_from_the_file_where_it_says_them(tmp_path: Path, units: str, metres: float) -> None:
    positions, labels = np.full((3, 1, 3), 7.0), ["a"]
    files = [
        write.write_c3d(tmp_path / "a.c3d", labels, positions, 100.0, units=units),
        write.write_trc(tmp_path / "a.trc", labels, positions, 100.0, units=units),
        write.write_optitrack(tmp_path / "a.csv", {"a": positions[:, 0]}, 100.0, units=units),
        write.write_parquet(tmp_path / "a.parquet", labels, positions, 100.0, unit=units),
    ]
    for file in files:
        np.testing.assert_allclose(read(file, 0.1).positions, 7 * metres, rtol=1e-6)


def test_files_that_say_no_unit_take_the_default(tmp_path: Path) -> None:
    positions, labels = np.full((3, 1, 3), 7.0), ["a"]
    files = [
        write.write_c3d(tmp_path / "a.c3d", labels, positions, 100.0, units=""),
        write.write_qualisys(tmp_path / "a.tsv", labels, positions, 100.0),
        write.write_plain(tmp_path / "a.csv", labels, positions, 100.0),
        write.write_parquet(tmp_path / "a.parquet", labels, positions, 100.0),
    ]
    for file in files:
        np.testing.assert_allclose(read(file, 0.1).positions, 0.7, rtol=1e-6)


@pytest.mark.parametrize("name", WRITERS)
def test_a_point_at_the_origin_or_with_a_coordinate_missing_was_not_seen(tmp_path: Path, name: str) -> None:
    file, writer = WRITERS[name]
    positions = sample(5, 3)
    positions[1:] = 5.0
    positions[2, 0] = 0.0
    positions[3, 1] = [1.0, 0.0, 0.0]
    if name not in ("c3d", "qualisys", "qualisys bare"):  # these write zeros, or whole points, for missing
        positions[4, 2, 1] = np.nan
    recording = read(writer(tmp_path / file, labels_of(3), positions, 100.0))
    expected = np.ones((5, 3), dtype=bool)
    expected[2, 0] = False
    expected[4, 2] = np.isfinite(positions[4, 2]).all()
    np.testing.assert_array_equal(recording.seen, expected)
    assert np.isnan(recording.positions[~recording.seen]).all()


def test_a_negative_residual_means_not_seen(tmp_path: Path) -> None:
    positions = np.full((4, 2, 3), 50.0)
    residuals = np.array([[0.0, 0.3], [-1.0, 0.0], [0.5, -1.0], [0.0, 0.0]])
    recording = read(write.write_c3d(tmp_path / "a.c3d", ["a", "b"], positions, 100.0, residuals=residuals))
    np.testing.assert_array_equal(recording.seen, residuals >= 0)


def test_c3d_of_integers_and_its_first_frame(tmp_path: Path) -> None:
    positions = np.random.default_rng(1).uniform(-900, 900, (20, 2, 3))
    (tmp_path / "a.c3d").write_bytes(write.c3d_bytes(positions, ["a", "b"], 200.0, first=51, scale=0.05))
    recording = read(tmp_path / "a.c3d")
    np.testing.assert_allclose(recording.positions, positions * 0.001, atol=0.026e-3)
    assert recording.start_time == pytest.approx(0.25)
    assert recording.times[-1] == pytest.approx(69 / 200)


@pytest.mark.parametrize("extra", [b"", write.long_frames(65600)])
def test_c3d_of_more_frames_than_its_header_can_count(tmp_path: Path, extra: bytes) -> None:
    positions = np.arange(65600 * 3, dtype=float).reshape(-1, 1, 3) / 4 + 1
    (tmp_path / "a.c3d").write_bytes(write.c3d_bytes(positions, ["a"], 200.0, extra=extra))
    by_hand = read(tmp_path / "a.c3d")
    by_library = read(write.write_c3d(tmp_path / "b.c3d", ["a"], positions, 200.0))
    for recording in (by_hand, by_library):
        assert recording.n_frames == 65600
        np.testing.assert_allclose(recording.positions, positions * 0.001, rtol=1e-6)


def test_outputs_of_a_model_are_no_markers(tmp_path: Path) -> None:
    positions = np.full((3, 3, 3), 1e6)
    positions[:, :1] = 5.0
    groups = {"ANGLES": ["RElbow"], "MOMENTS": ["RKnee"]}
    file = write.write_c3d(tmp_path / "a.c3d", ["a", "RElbow", "RKnee"], positions, 100.0, groups=groups)
    assert read(file).labels == ("a",)


def test_a_marker_set_before_the_name_is_left_out_where_names_stay_unique(tmp_path: Path) -> None:
    positions = np.full((3, 3), 0.5)
    names = {f"{name}": positions for name in ("Hand:thumb", "Cup:m1", "Hand:m1", "free")}
    recording = read(write.write_optitrack(tmp_path / "a.csv", names, 100.0))
    assert recording.labels == ("thumb", "Cup:m1", "Hand:m1", "free")


def test_measured_markers_come_before_solved_ones(tmp_path: Path) -> None:
    seen, solved = np.full((4, 3), 0.5), np.full((4, 3), 0.7)
    seen[2] = np.nan
    file = write.write_optitrack(
        tmp_path / "a.csv", {"Cup:m1": seen}, 100.0, solved={"Cup:m1": solved, "Cup:m2": solved}
    )
    recording = read(file)
    assert recording.labels == ("m1", "m2")
    np.testing.assert_array_equal(recording.seen, [[True, True], [True, True], [False, True], [True, True]])
    np.testing.assert_allclose(recording.positions[0], [[0.5] * 3, [0.7] * 3])


def test_decimal_commas_come_with_semicolons(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time;a_x;a_y;a_z\n0,00;1,5;2;3\n0,01;;;\n")
    recording = read(tmp_path / "a.csv")
    np.testing.assert_allclose(recording.positions[0, 0], [0.0015, 0.002, 0.003])
    assert recording.rate == 100
    assert not recording.seen[1, 0]


def test_encodings_line_ends_comments_and_other_columns_do_not_matter(tmp_path: Path) -> None:
    text = "# by hand\n\nframe,time,a x,a y,a z,note\n7,1.0,1,2,3,ready\n8,1.5, 4 ,NaN,,\n\n"
    expected = np.array([[[0.001, 0.002, 0.003]], [[np.nan] * 3]])
    for name, data in {
        "utf8": text.encode("utf-8-sig"),
        "windows": text.replace("\n", "\r\n").replace("by hand", "f\xfcr").encode("cp1252"),
        "utf16": text.encode("utf-16"),
        "mac": text.replace("\n", "\r").encode(),
    }.items():
        file = tmp_path / f"{name}.csv"
        file.write_bytes(data)
        recording = read(file)
        np.testing.assert_allclose(recording.positions, expected)
        assert (recording.labels, recording.rate, recording.start_time) == (("a",), 2.0, 1.0)


def test_rows_may_lack_trailing_blanks(tmp_path: Path) -> None:
    file = write.write_trc(tmp_path / "a.trc", ["a", "b"], sample(6, 2), 100.0)
    file.write_text("\n".join(line.rstrip() for line in file.read_text().splitlines()) + "\n")
    np.testing.assert_allclose(read(file).positions, sample(6, 2) * 0.001, atol=1e-12)


def test_the_projects_own_table_of_markers_is_a_recording(tmp_path: Path) -> None:
    positions = (sample(8, 2) * 0.001).astype(np.float32)
    points = [[None if np.isnan(p).any() else p.tolist() for p in frame] for frame in positions]
    table = pa.table(
        {
            "trial": ["s/t"] * 8,
            "frame": list(range(8))[::-1],
            "time": [i / 50 for i in range(8)][::-1],
            "labels": [["a", "b"]] * 8,
            "positions": points[::-1],
            "ingest_id": ["x"] * 8,
        },
        schema=MARKERS,
    )
    pq.write_table(table, tmp_path / "a.parquet")
    recording = read(tmp_path / "a.parquet", 0.1)
    np.testing.assert_allclose(recording.positions, positions, rtol=1e-6)
    assert (recording.labels, recording.rate) == (("a", "b"), 50.0)


def test_content_decides_where_formats_share_an_ending(tmp_path: Path) -> None:
    positions = sample(5, 2)
    for name in ("a.tsv", "b.txt"):
        by_qualisys = read(write.write_qualisys(tmp_path / name, ["a", "b"], positions, 100.0))
        plain = write.write_plain(tmp_path / name, ["a", "b"], positions, 100.0, delimiter="\t")
        np.testing.assert_allclose(by_qualisys.positions, read(plain).positions)


def test_times_rounded_by_the_export_are_still_even(tmp_path: Path) -> None:
    rows = "".join(f"{i / 120:.3f},1,2,3\n" for i in range(600))
    (tmp_path / "a.csv").write_text("time,a_x,a_y,a_z\n" + rows)
    assert read(tmp_path / "a.csv").rate == pytest.approx(120, rel=1e-3)
