"""Files that are no recordings are refused with the file, what was found and what to do."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import recording_files as write

from graspdb_ingest.readers import read_recording, readers
from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import RecordingError

LABELS = ["a", "b"]
POSITIONS = np.random.default_rng(5).uniform(10, 500, (20, 2, 3))

MAKERS: dict[str, Callable[[Path], Path]] = {
    ".c3d": lambda folder: write.write_c3d(folder / "x.c3d", LABELS, POSITIONS, 100.0),
    ".trc": lambda folder: write.write_trc(folder / "x.trc", LABELS, POSITIONS, 100.0),
    ".tsv": lambda folder: write.write_qualisys(folder / "x.tsv", LABELS, POSITIONS, 100.0),
    "motive.csv": lambda folder: write.write_optitrack(
        folder / "motive.csv", {"a": POSITIONS[:, 0], "b": POSITIONS[:, 1]}, 100.0, units="Millimeters"
    ),
    ".csv": lambda folder: write.write_plain(folder / "x.csv", LABELS, POSITIONS, 100.0),
    ".parquet": lambda folder: write.write_parquet(folder / "x.parquet", LABELS, POSITIONS, 100.0),
}
TEXT = [".trc", ".tsv", "motive.csv", ".csv"]


def refused(file: Path, said: str) -> RecordingError:
    with pytest.raises(RecordingError) as caught:
        read_recording(file, 0.001)
    error = caught.value
    assert error.path == file
    assert str(error).startswith(f"{file}: ")
    assert said in str(error), str(error)
    assert error.remedy.endswith(".")
    return error


def edited(file: Path, *changes: tuple[str, str]) -> Path:
    text = file.read_text()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    file.write_text(text)
    return file


@pytest.mark.parametrize("ending", MAKERS)
def test_every_maker_makes_a_good_file(tmp_path: Path, ending: str) -> None:
    recording: Recording = read_recording(MAKERS[ending](tmp_path), 0.001)
    assert recording.labels == ("a", "b")


@pytest.mark.parametrize("ending", MAKERS)
def test_an_empty_file(tmp_path: Path, ending: str) -> None:
    file = MAKERS[ending](tmp_path)
    file.write_bytes(b"")
    refused(file, "the file is empty")


@pytest.mark.parametrize("ending", MAKERS)
@pytest.mark.parametrize("seed", range(5))
def test_binary_garbage(tmp_path: Path, ending: str, seed: int) -> None:
    file = MAKERS[ending](tmp_path)
    file.write_bytes(np.random.default_rng(seed).bytes(3000))
    refused(file, "")


@pytest.mark.parametrize("ending", [".c3d", ".trc", ".tsv", "motive.csv", ".parquet"])
def test_a_file_cut_anywhere(tmp_path: Path, ending: str) -> None:
    file = MAKERS[ending](tmp_path)
    data = file.read_bytes()
    last_cell = 25 if ending in TEXT else 1
    if ending == ".c3d":  # what follows the last frame is padding
        last_cell = len(data) - 512 * (data[16] - 1) - POSITIONS.shape[0] * 2 * 16 + 1
    for end in np.linspace(1, len(data) - last_cell, 40).astype(int):
        file.write_bytes(data[:end])
        refused(file, "")


def test_a_plain_table_cut_within_a_row(tmp_path: Path) -> None:
    file = MAKERS[".csv"](tmp_path)
    file.write_bytes(file.read_bytes()[:-60])
    refused(file, "it breaks off in line 21")


@pytest.mark.parametrize("ending", TEXT)
def test_a_cell_that_is_no_number_is_named_with_line_and_column(tmp_path: Path, ending: str) -> None:
    file = MAKERS[ending](tmp_path)
    value = repr(float(POSITIONS[7, 1, 2]))
    line = next(i for i, row in enumerate(file.read_text().splitlines(), 1) if value in row)
    error = refused(edited(file, (value, "12,3.4" if ending == ".trc" else "12.3.4")), f"line {line}, column")
    assert "'b" in error.found
    assert "is not a number" in error.found


@pytest.mark.parametrize("ending", TEXT)
def test_a_row_with_too_many_cells(tmp_path: Path, ending: str) -> None:
    file = MAKERS[ending](tmp_path)
    value = repr(float(POSITIONS[7, 1, 2]))
    separator = "," if ending.endswith("csv") else "\t"
    refused(edited(file, (value, f"{value}{separator}5")), "cells where the header has")


@pytest.mark.parametrize("ending", [".c3d", ".trc", ".tsv", "motive.csv", ".csv"])
def test_a_label_that_stands_twice(tmp_path: Path, ending: str) -> None:
    twice = ["a", "a"]
    if ending == ".c3d":
        (tmp_path / "x.c3d").write_bytes(write.c3d_bytes(POSITIONS, twice, 100.0))
        file = tmp_path / "x.c3d"
    elif ending == "motive.csv":
        file = edited(MAKERS[ending](tmp_path), ('"b"', '"a"'))
    else:
        maker = {".trc": write.write_trc, ".tsv": write.write_qualisys, ".csv": write.write_plain}[ending]
        file = maker(tmp_path / f"x{ending}", twice, POSITIONS, 100.0)
    refused(file, "'a")


@pytest.mark.parametrize("rate", ["0", "-100", "nan", "fast", "1e9"])
def test_a_rate_that_no_camera_has(tmp_path: Path, rate: str) -> None:
    refused(edited(MAKERS[".trc"](tmp_path), ("\n100.0\t", f"\n{rate}\t")), "frame rate")
    refused(edited(MAKERS[".tsv"](tmp_path), ("FREQUENCY\t100.0", f"FREQUENCY\t{rate}")), "frame rate")
    refused(
        edited(MAKERS["motive.csv"](tmp_path), ("Export Frame Rate,100.000000", f"Export Frame Rate,{rate}")),
        "frame rate",
    )


@pytest.mark.parametrize("rate", [0.0, -50.0, float("nan")])
def test_a_rate_in_c3d_that_no_camera_has(tmp_path: Path, rate: float) -> None:
    (tmp_path / "x.c3d").write_bytes(write.c3d_bytes(POSITIONS, LABELS, rate))
    refused(tmp_path / "x.c3d", "frame rate")


def test_units_that_nobody_knows(tmp_path: Path) -> None:
    files = [
        write.write_c3d(tmp_path / "x.c3d", LABELS, POSITIONS, 100.0, units="furlong"),
        write.write_trc(tmp_path / "x.trc", LABELS, POSITIONS, 100.0, units="furlong"),
        write.write_optitrack(tmp_path / "x.csv", {"a": POSITIONS[:, 0]}, 100.0, units="furlong"),
        write.write_parquet(tmp_path / "x.parquet", LABELS, POSITIONS, 100.0, unit="furlong"),
    ]
    for file in files:
        assert "mm, cm, dm, m" in str(refused(file, "'furlong'"))


@pytest.mark.parametrize("ending", MAKERS)
def test_coordinates_that_no_laboratory_has(
    tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(globals(), "POSITIONS", POSITIONS * 1000)
    assert "length unit" in str(refused(MAKERS[ending](tmp_path), "m from the origin"))


@pytest.mark.parametrize("ending", TEXT)
def test_infinite_coordinates(tmp_path: Path, ending: str) -> None:
    file = edited(MAKERS[ending](tmp_path), (repr(float(POSITIONS[7, 1, 2])), "inf"))
    refused(file, "'b' in frame 8 has an infinite coordinate")


@pytest.mark.parametrize("ending", TEXT)
def test_a_header_without_frames(tmp_path: Path, ending: str) -> None:
    file = MAKERS[ending](tmp_path)
    lines = file.read_text().splitlines()
    head = [line for line in lines if not line[:1].isdigit() or line.startswith("100.0\t")]
    file.write_text("\n".join(head).replace("\t20\t", "\t0\t").replace("Frames,20", "Frames,0") + "\n")
    edited(file, ("NO_OF_FRAMES\t20", "NO_OF_FRAMES\t0")) if ending == ".tsv" else None
    refused(file, "frames")


def test_frames_that_are_missing_from_the_middle(tmp_path: Path) -> None:
    for ending in (".trc", ".tsv", "motive.csv"):
        file = MAKERS[ending](tmp_path)
        lines = file.read_text().splitlines(keepends=True)
        del lines[-8]
        text = "".join(lines).replace("\t20\t", "\t19\t").replace("FRAMES\t20", "FRAMES\t19")
        file.write_text(text.replace("Exported Frames,20", "Exported Frames,19"))
        refused(file, "not numbered evenly")
    file = MAKERS[".csv"](tmp_path)
    lines = file.read_text().splitlines(keepends=True)
    del lines[-8]
    file.write_text("".join(lines))
    refused(file, "not evenly spaced")


def test_a_rate_that_its_times_do_not_have(tmp_path: Path) -> None:
    positions = np.tile(POSITIONS, (10, 1, 1))
    file = write.write_trc(tmp_path / "x.trc", LABELS, positions, 100.0)
    refused(edited(file, ("\n100.0\t", "\n200.0\t")), "DataRate states 200 Hz")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,a_x,a_y\n0,1,2\n", "'a' has no column of z"),
        ("a_x,a_y,a_z\n1,2,3\n", "no column of times"),
        ("time,one,two\n0,1,2\n", "name no markers"),
        ("time,a_x,a_y,a_z\n0,1,2,3\n", "1 frames, so its rate is unknown"),
        ("time,a_x,a_y,a_z\n0,1,2,3\n,1,2,3\n", "blank cells"),
        ("time,a_x,a_y,a_z\n0,1,2,3\n0,1,2,3\n", "not evenly spaced"),
        ("time,a_x,a_y,a_z\n0,1,2,3\n-1,1,2,3\n", "not evenly spaced"),
        ("time,a_x,a_y,a_z\n0,1,2,3\n10,1,2,3\n20,1,2,3\n", "0.1 Hz"),
        ("# nothing\n\n", "no row of titles"),
        ("hello world\n", "name no markers"),
    ],
)
def test_plain_tables_that_lack_something(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "x.csv").write_text(text)
    refused(tmp_path / "x.csv", said)


def test_exports_that_are_of_something_else(tmp_path: Path) -> None:
    refused(edited(MAKERS[".tsv"](tmp_path), ("INCLUDED\t3D", "INCLUDED\t6D")), "6D data")
    file = write.write_optitrack(tmp_path / "l.csv", {"a": POSITIONS[:, 0]}, 100.0, space="Local")
    refused(file, "not those of the lab")
    file = write.write_optitrack(tmp_path / "r.csv", {}, 100.0, solved={"a": POSITIONS[:, 0]})
    refused(edited(file, ("Rigid Body Marker", "Bone")), "it holds Bone, Rigid Body and no markers")
    refused(edited(MAKERS[".trc"](tmp_path), ("PathFileType", "Something")), "PathFileType")


def test_parquet_that_is_of_something_else(tmp_path: Path) -> None:
    file = tmp_path / "x.parquet"
    pq.write_table(pa.table({"time": [0.0, 1.0], "a_x": ["1", "2"], "a_y": [1, 2], "a_z": [1, 2]}), file)
    refused(file, "column 'a_x' is of type string")
    own = {"frame": [0, 0], "time": [0.0, 0.0], "labels": [["a"]] * 2, "positions": [[[1.0, 2.0, 3.0]]] * 2}
    pq.write_table(pa.table({"trial": ["s/1", "s/2"], **own}), file)
    refused(file, "2 trials")
    pq.write_table(pa.table(own | {"frame": [0, 1], "time": [0.0, 0.1], "labels": [["a"], ["b"]]}), file)
    refused(file, "different labels")


def test_an_ending_that_belongs_to_no_format(tmp_path: Path) -> None:
    for name, said in (("x.c3", "did you mean '.c3d'"), ("x.mat", ".c3d, .csv"), ("x", "no ending")):
        (tmp_path / name).write_bytes(b"something")
        refused(tmp_path / name, said)


def test_a_wrong_ending(tmp_path: Path) -> None:
    trc = MAKERS[".trc"](tmp_path)
    refused(trc.rename(tmp_path / "y.c3d"), "does not start as a C3D file does")
    c3d = MAKERS[".c3d"](tmp_path)
    refused(c3d.rename(tmp_path / "y.trc"), "binary")


def test_what_cannot_be_opened(tmp_path: Path) -> None:
    refused(tmp_path / "nothing.c3d", "cannot be opened")
    (tmp_path / "folder.c3d").mkdir()
    refused(tmp_path / "folder.c3d", "cannot be opened")


@pytest.mark.parametrize(
    ("offset", "value", "said"),
    [
        (-2, 120, "damaged"),  # length of the name
        (7, 200, "damaged"),  # high byte of the record's length
        (8, 9, "of type 9"),  # kind of values
        (9, 99, "99 dimensions"),
        (10, 200, "larger than its record"),  # length of a text
    ],
)
def test_damaged_c3d_parameters_are_refused_before_a_library_reads_them(
    tmp_path: Path, offset: int, value: int, said: str
) -> None:
    data = bytearray(write.c3d_bytes(POSITIONS, LABELS, 100.0))
    data[data.index(b"LABELS") + offset] = value
    (tmp_path / "x.c3d").write_bytes(data)
    refused(tmp_path / "x.c3d", said)


def test_formats_that_share_an_ending_can_be_told_apart() -> None:
    endings = {ending for entry in readers() for ending in entry.endings}
    for ending in endings:
        takers = [entry for entry in readers() if ending in entry.endings]
        assert sum(entry.sniff(b"no format starts like this") for entry in takers) == 1
