"""Damaged files through ``graspdb check``: a short form of what ``make fuzz`` does with 10,000."""

import json
import subprocess
import sys
from pathlib import Path

N_INPUTS = 143
"""Eleven of each kind of file."""


def test_damaged_sessions_end_as_a_report_or_a_message() -> None:
    program = Path(__file__).parents[1] / "fuzz.py"
    done = subprocess.run(
        [sys.executable, str(program), str(N_INPUTS)],
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    report = json.loads(done.stdout)
    assert report["failed"] == []
    assert report["inputs"] == N_INPUTS
    read = sum(count for name, count in report.items() if name.endswith(": read"))
    refused = sum(count for name, count in report.items() if name.endswith(": refused"))
    assert read + refused == N_INPUTS
    assert min(read, refused) > N_INPUTS / 20, "some of the damage matters and some does not"
