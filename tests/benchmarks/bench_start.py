"""How long the command line takes to answer."""

import subprocess
import sys
from time import perf_counter

from harness import Result, benchmark


def seconds(*arguments: str) -> float:
    """Return the least time of ten runs of the interpreter [s]."""
    times = []
    for _ in range(10):
        start = perf_counter()
        subprocess.run([sys.executable, *arguments], capture_output=True, check=True)
        times.append(perf_counter() - start)
    return min(times)


@benchmark("start")
def start() -> Result:
    """Time ``graspdb --help`` against an interpreter that imports nothing of ours."""
    return Result(
        "graspdb --help",
        ours=seconds("-m", "graspdb", "--help"),
        peer=seconds("-c", "import typer"),
        unit="s",
        note="peer: import of typer alone; at most 0.25 s is allowed",
    )
