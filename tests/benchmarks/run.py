"""Run the benchmarks, all or those named: ``python tests/benchmarks/run.py [NAME ...]``."""

import argparse
from pathlib import Path

from harness import Result, as_table, discover, write_json
from rich.console import Console


def main() -> int:
    """Run, print a table, write ``bench.json`` into the current folder; return the exit status."""
    parser = argparse.ArgumentParser(description="Run graspdb's benchmarks.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="benchmarks to run; all without any")
    names = parser.parse_args().names
    found = {entry.name: entry for entry in discover(Path(__file__).parent)}
    unknown = sorted(set(names) - set(found))
    if unknown:
        parser.error(f"no benchmark {', '.join(unknown)}; there are: {', '.join(found) or 'none'}")
    console = Console(stderr=True)
    results: list[Result] = []
    for name in names or found:
        console.print(f"measuring {name} ...")
        results.extend(found[name].run())
    Console().print(as_table(results))
    write_json(results, Path("bench.json"))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
