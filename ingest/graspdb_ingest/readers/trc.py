"""TRC: Motion Analysis' tab-separated track rows."""

from pathlib import Path

from graspdb_ingest.readers.registry import reader
from graspdb_ingest.readers.text import number_block, read_lines
from graspdb_ingest.readers.timing import check_frame_count, check_frame_numbers, start_of, stated_rate
from graspdb_ingest.readers.trajectories import scale_of, trajectories
from graspdb_ingest.recording import Recording
from graspdb_schemas.errors import RecordingError


@reader("TRC", ".trc")
def read_trc(path: Path, default_scale: float) -> Recording:
    """Read a TRC file: rate from DataRate, unit from Units, blank cells or zeros for missing markers."""
    text = read_lines(path)
    if not text.line(0).startswith("PathFileType"):
        raise RecordingError(
            path, "its first line does not start with PathFileType, as TRC does", "Export it as TRC again."
        )
    keys = [cell.strip() for cell in text.line(1).split("\t")]
    header = dict(zip(keys, (cell.strip() for cell in text.line(2).split("\t")), strict=False))
    names_row = [cell.strip() for cell in text.line(3).split("\t")]
    labels = [cell for cell in names_row[2:] if cell]
    if len(text.lines) < 5 or "DataRate" not in header:
        raise RecordingError(path, "it breaks off in its header", "Export or copy the recording again.")
    if header.get("NumMarkers", str(len(labels))) != str(len(labels)):
        raise RecordingError(
            path,
            f"its header counts {header['NumMarkers']} markers and names {len(labels)}",
            "Give every marker a label and export again.",
        )
    rate = stated_rate(path, header["DataRate"], "DataRate")
    columns = ["Frame#", "Time", *(f"{label} {axis}" for label in labels for axis in "XYZ")]
    rows = number_block(text, 5, "\t", columns, range(len(columns)))
    check_frame_count(path, header.get("NumFrames", ""), len(rows))
    check_frame_numbers(path, rows[:, 0])
    return trajectories(
        path,
        labels,
        rows[:, 2:].reshape(len(rows), len(labels), 3),
        scale_of(path, header.get("Units"), default_scale),
        rate,
        start_of(path, rows[:, 1], rate, "DataRate"),
    )
