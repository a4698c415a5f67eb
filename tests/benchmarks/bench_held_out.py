"""Hidden markers of a real recording: predicted from the others, against what stands in its SOURCE.txt."""

import os
from pathlib import Path

from harness import Result, benchmark

from graspdb.validation.markers import held_out_errors

TESTS = Path(__file__).parents[1]
DATA = Path(os.environ.get("GRASPDB_TEST_DATA", TESTS.parents[1] / "shared" / "data"))
RIDGE_AND_BAR = {0.25: (1.15, 0.9), 0.5: (1.25, 1.0), 1.0: (1.2, 1.2)}
"""By length of the gap [s]: error of ridge regression on the other markers, and the bar [mm]."""


@benchmark("held-out markers")
def held_out() -> list[Result]:
    """Hide each of the pillow recording's ten digit markers in 30 random gaps of three lengths."""
    results = []
    for seconds, (ridge, bar) in RIDGE_AND_BAR.items():
        errors = held_out_errors(TESTS / "fixtures" / "pillow", seconds=seconds, data_root=DATA, workers=2)
        digits = [error.mean for error in errors if not error.marker.startswith("hand")]
        note = f"peer: ridge regression on the other markers; bar {bar} mm; hidden from calibration too"
        results.append(
            Result(
                f"held-out markers, {seconds:g} s", 1e3 * sum(digits) / len(digits), ridge, "mm", note=note
            )
        )
    return results
