"""BVH: positions and rotations worked out by hand, and files that are none."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from graspdb_ingest.bvh import read_bvh
from graspdb_schemas.errors import RecordingError

TEXT = """HIERARCHY
ROOT hand
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation
  JOINT finger
  {
    OFFSET 10 0 0
    CHANNELS 3 Yrotation Xrotation Zrotation
    End Site
    {
      OFFSET 5 0 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.01
1 2 3 0 0 0 0 0 0
0 0 0 0 0 90 90 0 0
"""


@pytest.mark.parametrize("packed", [False, True])
def test_a_finger_by_hand(tmp_path: Path, packed: bool) -> None:
    path = tmp_path / ("hand.bvh.gz" if packed else "hand.bvh")
    path.write_bytes(gzip.compress(TEXT.encode()) if packed else TEXT.encode())
    motion = read_bvh(path, 0.1)
    assert [joint.name for joint in motion.joints] == ["hand", "finger", "finger end"]
    assert motion.rate == pytest.approx(100)
    assert motion.positions[0] == pytest.approx(np.array([[0.1, 0.2, 0.3], [1.1, 0.2, 0.3], [1.6, 0.2, 0.3]]))
    # The root turns x to y; the finger then turns its own x to minus z.
    assert motion.positions[1] == pytest.approx(np.array([[0, 0, 0], [0, 1, 0], [0, 1, -0.5]]), abs=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "not a motion",
        "HIERARCHY ROOT",
        TEXT[: TEXT.index("MOTION")],
        TEXT.replace("Frames: 2", "Frames: 3"),
        TEXT.replace("1 2 3", "1 2"),
        TEXT.replace("1 2 3", "1 nan 3"),
    ],
)
def test_files_that_are_no_bvh(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.bvh"
    path.write_text(text)
    with pytest.raises(RecordingError, match=r"bad\.bvh"):
        read_bvh(path, 0.1)
    with pytest.raises(RecordingError, match="cannot be read"):
        read_bvh(tmp_path / "none.bvh", 0.1)
