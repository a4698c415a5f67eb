"""Contact maps against contact measured by a thermal camera, one grasp of ContactPose."""

import os
from pathlib import Path

from harness import Result, benchmark

from graspdb.validation.contact_map import validate_map
from graspdb.validation.contact_map_file import read_measured_map
from graspdb_ingest.surface import SURFACES

FILE = "contactpose-camera/full1_use_camera_contact_derived.npz"


@benchmark("contact map")
def contact_map() -> list[Result]:
    """Compare each surface of the hand with what was measured; contact above 0.4 counts."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    path = Path(os.environ.get("GRASPDB_TEST_DATA", beside)) / FILE
    found = validate_map(*read_measured_map(path), SURFACES, 0.4, [])
    results = []
    for one in found:
        note = "peer: a first trial with tapered capsules; bar for the best: {}"
        name = f"{one.surface}, {one.gap} gap"
        results.append(Result(f"AUC, {name}", one.auc, 0.904, "", "more", note.format("0.92")))
        results.append(Result(f"best F1, {name}", one.best.f1, 0.49, "", "more", note.format("0.52")))
    return results
