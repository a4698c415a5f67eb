"""The benchmark runner: finding modules, ratios, table and JSON."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"

MODULE = '''
from harness import Result, benchmark


@benchmark("{name}")
def measure():
    """Return made-up figures."""
    return [Result("{name}: time", 2.0, 6.0, "s"), Result("{name}: rate", 2.0, 6.0, "1/s", "more")]


@benchmark("{name} alone")
def alone():
    """Return a figure without a peer."""
    return Result("{name}: alone", 5.0, None, "s", note="no peer")
'''


@pytest.fixture
def runner(tmp_path: Path) -> Path:
    """Copy the runner into a folder that has two modules of benchmarks and one that is none."""
    for name in ("harness.py", "run.py"):
        (tmp_path / name).write_text((BENCHMARKS / name).read_text())
    for name in ("second", "first"):
        (tmp_path / f"bench_{name}.py").write_text(MODULE.format(name=name))
    (tmp_path / "helper.py").write_text("raise RuntimeError('not a benchmark')")
    return tmp_path / "run.py"


def run(runner: Path, *names: str) -> subprocess.CompletedProcess[str]:
    """Run the runner in its own folder."""
    return subprocess.run(
        [sys.executable, str(runner), *names],
        cwd=runner.parent,
        capture_output=True,
        text=True,
        check=False,
        env={"COLUMNS": "200"},
    )


def test_finds_every_benchmark_and_writes_what_it_prints(runner: Path) -> None:
    done = run(runner)
    assert done.returncode == 0, done.stderr
    report = json.loads((runner.parent / "bench.json").read_text())
    assert [result["name"] for result in report["results"]] == [
        f"{module}: {figure}" for module in ("first", "second") for figure in ("time", "rate", "alone")
    ]
    for result in report["results"]:
        assert result["name"] in done.stdout
    time, rate, alone = report["results"][:3]
    assert time["ratio"] == pytest.approx(3)
    assert rate["ratio"] == pytest.approx(1 / 3)
    assert alone["ratio"] is None


def test_runs_only_the_named_one(runner: Path) -> None:
    assert run(runner, "first alone").returncode == 0
    report = json.loads((runner.parent / "bench.json").read_text())
    assert [result["name"] for result in report["results"]] == ["first: alone"]


def test_unknown_name_lists_what_there_is(runner: Path) -> None:
    done = run(runner, "third")
    assert done.returncode == 2
    assert "no benchmark third; there are: first, first alone, second, second alone" in done.stderr
    assert not (runner.parent / "bench.json").exists()


def test_ratio_of_zero_and_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)
    from harness import Result

    assert math.isnan(Result("x", 1.0, None, "s").ratio)
    assert Result("x", 0.0, 1.0, "s").ratio == math.inf
    assert Result("x", 4.0, 2.0, "m", "more").ratio == 2
