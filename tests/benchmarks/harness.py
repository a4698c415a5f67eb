"""What a benchmark is, how benchmarks are found, and how their results are shown and written.

A benchmark is a function in a module ``bench_*.py`` of this folder::

    from harness import Result, benchmark

    @benchmark("contact search")
    def contact_search() -> Result:
        '''Time 24,000 queries against a brute-force search.'''
        ...
        return Result("24,000 queries", ours=0.1, peer=2.3, unit="s", note="peer: brute force")
"""

import importlib.util
import json
import math
import os
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from rich.table import Table


@dataclass(frozen=True)
class Result:
    """One measured figure beside that of a peer.

    Attributes
    ----------
    name : str
        What was measured.
    ours : float
        Figure of graspdb, in `unit`.
    peer : float or None
        Figure of the library, program or paper compared with, in `unit`; None where there is none.
    unit : str
        Unit of both figures.
    better : {"less", "more"}
        Whether a lower or a higher figure is the better one.
    note : str
        Who the peer is, and what else a reader has to know.
    """

    name: str
    ours: float
    peer: float | None
    unit: str
    better: Literal["less", "more"] = "less"
    note: str = ""

    @property
    def ratio(self) -> float:
        """Say how many times better ours is than the peer's; below 1 it is worse, NaN without a peer."""
        if self.peer is None:
            return math.nan
        above, below = (self.peer, self.ours) if self.better == "less" else (self.ours, self.peer)
        return above / below if below else math.inf


@dataclass(frozen=True)
class Benchmark:
    """A registered benchmark.

    Attributes
    ----------
    name : str
        What it is called on the command line.
    measure : callable
        Runs it and returns its result, or one result for each of several figures.
    """

    name: str
    measure: Callable[[], Result | Sequence[Result]]

    def run(self) -> tuple[Result, ...]:
        """Measure and return all results."""
        results = self.measure()
        return (results,) if isinstance(results, Result) else tuple(results)


def benchmark(name: str) -> Callable[[Callable[[], Result | Sequence[Result]]], Benchmark]:
    """Register the decorated function as the benchmark `name`."""

    def register(measure: Callable[[], Result | Sequence[Result]]) -> Benchmark:
        return Benchmark(name, measure)

    return register


def discover(folder: Path) -> Iterator[Benchmark]:
    """Yield the benchmarks in the modules ``bench_*.py`` of a folder, by module, then as they stand there."""
    for path in sorted(folder.glob("bench_*.py")):
        spec = importlib.util.spec_from_file_location(path.stem, path)
        if spec is None or spec.loader is None:
            raise ImportError(f"{path} is not a Python module")
        module = importlib.util.module_from_spec(spec)
        sys.modules[path.stem] = module
        spec.loader.exec_module(module)
        yield from (entry for entry in vars(module).values() if isinstance(entry, Benchmark))


def as_table(results: Sequence[Result]) -> Table:
    """Lay results out for the terminal, a row each."""
    table = Table(caption="ratio: how many times better ours is than the peer's")
    table.add_column("name")
    for heading in ("ours", "peer", "unit", "ratio"):
        table.add_column(heading, justify="left" if heading == "unit" else "right")
    table.add_column("note")
    for result in results:
        peer, ratio = ("", "") if result.peer is None else (f"{result.peer:.4g}", f"{result.ratio:.3g}")
        table.add_row(result.name, f"{result.ours:.4g}", peer, result.unit, ratio, result.note)
    return table


def write_json(results: Sequence[Result], path: Path) -> None:
    """Write results, the day and the machine to a JSON file; a ratio without a peer is null."""
    report = {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        "results": [
            asdict(result) | {"ratio": result.ratio if math.isfinite(result.ratio) else None}
            for result in results
        ],
    }
    path.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
