"""Read TRC and MOT exports with OpenSim, and compare every number with what stands in the files.

Usage: python check_opensim.py TRC_FOLDER MOT_FOLDER; needs the package opensim. Prints what it read.
"""

import sys
from pathlib import Path

import numpy as np
import opensim as osim

osim.Logger.setLevelString("Off")


def check_trc(path: Path) -> int:
    """Compare a TRC file with OpenSim's table of it; return its number of rows."""
    lines = path.read_text(encoding="utf-8").splitlines()
    labels = [cell for cell in lines[3].split("\t")[2:] if cell]
    rows = [line.split("\t") for line in lines[6:] if line]
    width = 2 + 3 * len(labels)
    wanted = np.array([[float(cell) if cell else np.nan for cell in row[2:width]] for row in rows])
    table = osim.TimeSeriesTableVec3(str(path))
    assert list(table.getColumnLabels()) == labels, path
    assert table.getTableMetaDataString("Units") == "mm", path
    np.testing.assert_allclose(table.getIndependentColumn(), [float(row[1]) for row in rows])
    flat = table.flatten()  # its numbers are its own: without a name for it they would be gone
    np.testing.assert_allclose(flat.getMatrix().to_numpy(), wanted, rtol=1e-12)
    return len(rows)


def check_mot(path: Path) -> int:
    """Compare a MOT file with OpenSim's table and storage of it; return its number of rows."""
    lines = path.read_text(encoding="utf-8").splitlines()
    end = lines.index("endheader")
    columns = lines[end + 1].split("\t")
    wanted = np.array([[float(cell) for cell in line.split("\t")] for line in lines[end + 2 :]])
    table = osim.TimeSeriesTable(str(path))
    assert ["time", *table.getColumnLabels()] == columns, path
    np.testing.assert_allclose(table.getMatrix().to_numpy(), wanted[:, 1:], rtol=1e-12)
    storage = osim.Storage(str(path))
    assert storage.getSize() == len(wanted), path
    assert not storage.isInDegrees(), path
    return len(wanted)


def main() -> None:
    """Check all files of both folders."""
    for folder, check, ending in zip(sys.argv[1:3], (check_trc, check_mot), ("trc", "mot"), strict=True):
        rows = [check(path) for path in sorted(Path(folder).rglob(f"*.{ending}"))]
        assert rows, f"{folder} has no .{ending} file"
        print(f"OpenSim {osim.GetVersion()}: {len(rows)} {ending} files, {sum(rows):,} rows, all equal")


if __name__ == "__main__":
    main()
