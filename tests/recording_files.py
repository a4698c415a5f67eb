"""Writers of recordings in every format, for tests; independent of the readers."""

import struct
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

Positions = NDArray[np.float64]


def times_of(n_frames: int, rate: float) -> Positions:
    return np.arange(n_frames) / rate


def cell(value: float, blank: str = "") -> str:
    return blank if np.isnan(value) else repr(float(value))


def rows_of(positions: Positions, rate: float, blank: str = "") -> list[list[str]]:
    """Return frame number, time and coordinates as cells."""
    return [
        [str(i + 1), repr(float(t)), *(cell(value, blank) for value in frame.ravel())]
        for i, (t, frame) in enumerate(zip(times_of(len(positions), rate), positions, strict=True))
    ]


def write_trc(path: Path, labels: list[str], positions: Positions, rate: float, units: str = "mm") -> Path:
    """Write positions, shape (n_frames, n_markers, 3), in the given unit; blank where NaN."""
    n = len(labels)
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{len(positions)}\t{n}\t{units}\t{rate}\t1\t{len(positions)}",
        "Frame#\tTime\t" + "".join(f"{label}\t\t\t" for label in labels),
        "\t\t" + "".join(f"X{i}\tY{i}\tZ{i}\t" for i in range(1, n + 1)),
        "",
    ]
    body = ["\t".join(row) for row in rows_of(positions, rate)]
    path.write_text("\n".join(head + body) + "\n")
    return path


def write_qualisys(
    path: Path,
    labels: list[str],
    positions: Positions,
    rate: float,
    *,
    leading: int = 2,
    titles: bool = True,
    blank: str = "0.000",
) -> Path:
    """Write a QTM export with none, one or both of Frame and Time before the coordinates."""
    head = [
        f"NO_OF_FRAMES\t{len(positions)}",
        "NO_OF_CAMERAS\t7",
        f"NO_OF_MARKERS\t{len(labels)}",
        f"FREQUENCY\t{rate}",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2021-08-26, 15:19:24.317\t1483034.68525310",
        "DATA_INCLUDED\t3D",
        "EVENT\tStart\t1\t0.0",
        "MARKER_NAMES\t" + "\t".join(labels),
        "TRAJECTORY_TYPES\t" + "\t".join(["Measured"] * len(labels)),
    ]
    if titles:
        names = ["Frame", "Time"][:leading]
        head.append("\t".join([*names, *(f"{label} {axis}" for label in labels for axis in "XYZ")]))
    body = ["\t".join(row[:leading] + row[2:]) for row in rows_of(positions, rate, blank)]
    path.write_bytes(("\r\n".join(head + body) + "\r\n").encode())
    return path


def write_optitrack(
    path: Path,
    markers: dict[str, Positions],
    rate: float,
    *,
    units: str = "Meters",
    solved: dict[str, Positions] | None = None,
    parent: bool = False,
    space: str = "Global",
) -> Path:
    """Write a Motive export: a rigid body with its pose, then solved markers, then measured ones."""
    n = len(next(iter((markers or solved or {}).values())))
    body = np.full((n, 7), 0.25)
    kinds, names, quantities = ["Rigid Body"] * 7, ["Cup"] * 7, ["Rotation"] * 4 + ["Position"] * 3
    axes, columns = list("XYZWXYZ"), [body]
    for kind, group in (("Rigid Body Marker", solved or {}), ("Marker", markers)):
        for name, positions in group.items():
            kinds += [kind] * 3
            names += [name] * 3
            quantities += ["Position"] * 3
            axes += list("XYZ")
            columns.append(positions)
    values = np.hstack(columns)
    head = [
        f"Format Version,1.23,Take Name,Take,Capture Frame Rate,{rate:.6f},Export Frame Rate,{rate:.6f},"
        f"Total Exported Frames,{n},Rotation Type,Quaternion,Length Units,{units},Coordinate Space,{space}",
        "",
        ",Type," + ",".join(kinds),
        ",Name," + ",".join(f'"{name}"' for name in names),
        ",ID," + ",".join(['"7C0"'] * len(kinds)),
        *([",Parent," + ",".join([""] * len(kinds))] if parent else []),
        ",," + ",".join(quantities),
        "Frame,Time (Seconds)," + ",".join(axes),
    ]
    rows = [
        ",".join([str(i), repr(float(t)), *(cell(value) for value in row)])
        for i, (t, row) in enumerate(zip(times_of(n, rate), values, strict=True))
    ]
    path.write_text("\n".join(head + rows) + "\n")
    return path


def write_plain(
    path: Path,
    labels: list[str],
    positions: Positions,
    rate: float,
    *,
    style: str = "{label}_{axis}",
    delimiter: str = ",",
    start: float = 0.0,
) -> Path:
    """Write a plain table with a column of times."""
    titles = ["time", *(style.format(label=label, axis=axis) for label in labels for axis in "xyz")]
    rows = [
        [repr(float(start + t)), *(cell(value) for value in frame.ravel())]
        for t, frame in zip(times_of(len(positions), rate), positions, strict=True)
    ]
    path.write_text("\n".join(delimiter.join(row) for row in [titles, *rows]) + "\n")
    return path


def write_parquet(
    path: Path, labels: list[str], positions: Positions, rate: float, unit: str | None = None
) -> Path:
    """Write a plain table as Parquet, null where NaN, its unit in the fields' metadata."""
    metadata = {"unit": unit} if unit else None
    fields = [pa.field("time", pa.float64())]
    columns = [pa.array(times_of(len(positions), rate))]
    for i, label in enumerate(labels):
        for j, axis in enumerate("xyz"):
            fields.append(pa.field(f"{label}_{axis}", pa.float64(), metadata=metadata))
            columns.append(pa.array(positions[:, i, j], from_pandas=True))
    pq.write_table(pa.table(columns, schema=pa.schema(fields)), path)
    return path


def write_c3d(
    path: Path,
    labels: list[str],
    positions: Positions,
    rate: float,
    *,
    units: str = "mm",
    residuals: Positions | None = None,
    groups: dict[str, Any] | None = None,
) -> Path:
    """Write positions with ezc3d; `groups` are further parameters of POINT."""
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"] = [rate]
    point["LABELS"]["value"] = tuple(labels)
    point["UNITS"]["value"] = [units] if units else []
    for name, value in (groups or {}).items():
        file.add_parameter("POINT", name, value)
    data = np.ones((4, len(labels), len(positions)))
    data[:3] = positions.transpose(2, 1, 0)
    file["data"]["points"] = data
    if residuals is not None:
        shape = (7, len(labels), len(positions))
        file["data"]["meta_points"] = {
            "residuals": residuals.T[None].astype(float),
            "camera_masks": np.zeros(shape, dtype=bool),
        }
    file.write(str(path))
    return path


def c3d_bytes(
    positions: Positions,
    labels: list[str],
    rate: float,
    *,
    first: int = 1,
    scale: float = -1.0,
    extra: bytes = b"",
) -> bytes:
    """Return a C3D file made byte by byte: floats for a negative scale, else scaled 16-bit integers.

    `extra` are further parameter records of group 1 (POINT).
    """
    n_frames, n_markers, _ = positions.shape
    last = first + n_frames - 1
    width = max(len(label) for label in labels)
    text = b"".join(label.ljust(width).encode() for label in labels)
    records = [
        _record(-1, "POINT", b""),
        _record(1, "USED", _ints([n_markers])),
        _record(1, "FRAMES", _ints([min(n_frames, 65535)])),
        _record(1, "SCALE", b"\x04\x00" + struct.pack("<f", scale)),
        _record(1, "RATE", b"\x04\x00" + struct.pack("<f", rate)),
        _record(1, "LABELS", struct.pack("<bBBB", -1, 2, width, n_markers) + text),
        _record(1, "UNITS", struct.pack("<bBBB", -1, 2, 2, 1) + b"mm"),
        extra,
        _record(-3, "ANALOG", b""),
        _record(3, "USED", _ints([0])),
    ]
    chain = b"".join(records)
    blocks = -(-(len(chain) + 64) // 512)
    chain += _record(1, "DATA_START", _ints([2 + blocks])) + b"\0\0"
    section = (struct.pack("BBBB", 1, 0x50, blocks, 84) + chain).ljust(512 * blocks, b"\0")
    header = struct.pack(
        "<BB5HfHHf",
        2,
        0x50,
        n_markers,
        0,
        min(first, 65535),
        min(last, 65535),
        10,
        scale,
        2 + blocks,
        0,
        rate,
    ).ljust(512, b"\0")
    points = np.zeros((n_frames, n_markers, 4))
    points[..., :3] = positions if scale < 0 else np.round(positions / scale)
    return header + section + points.astype("<f4" if scale < 0 else "<i2").tobytes()


def long_frames(n_frames: int) -> bytes:
    """Return the record POINT:LONG_FRAMES."""
    return _record(1, "LONG_FRAMES", b"\x04\x00" + struct.pack("<f", n_frames))


def _ints(values: list[int]) -> bytes:
    dimensions = bytes([1, len(values)]) if len(values) > 1 else b"\x00"
    return b"\x02" + dimensions + struct.pack(f"<{len(values)}H", *values)


def _record(group: int, name: str, values: bytes) -> bytes:
    body = values + b"\x00"
    return struct.pack("<Bb", len(name), group) + name.encode() + struct.pack("<H", len(body) + 2) + body
