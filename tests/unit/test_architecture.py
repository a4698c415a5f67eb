"""The rooms of the tree: who imports whom, what starts light, what the repository holds."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = {
    "graspdb": ROOT / "graspdb",
    "graspdb_ingest": ROOT / "ingest" / "graspdb_ingest",
    "graspdb_queries": ROOT / "queries" / "graspdb_queries",
    "graspdb_schemas": ROOT / "schemas" / "graspdb_schemas",
}
BELOW = {
    "graspdb": {"graspdb_ingest", "graspdb_queries", "graspdb_schemas"},
    "graspdb_ingest": {"graspdb_schemas"},
    "graspdb_queries": {"graspdb_schemas"},
    "graspdb_schemas": set(),
}
RECORDING_LIBRARIES = {"ezc3d", "mujoco", "open3d", "trimesh"}
DATABASE_LIBRARIES = {"deltalake", "duckdb"}
STRANGERS = {
    "graspdb": set(),
    "graspdb_ingest": DATABASE_LIBRARIES,
    "graspdb_queries": RECORDING_LIBRARIES,
    "graspdb_schemas": RECORDING_LIBRARIES | DATABASE_LIBRARIES | {"scipy"},
}
HEAVY = {"open3d", "mujoco", "scipy", "duckdb"}
MACHINE_PATH = re.compile(r"(?<![\w.])/(?:work|root|home|Users)/\w|[A-Z]:\\Users")
REGISTRY_HOST = re.compile(r"pypi\.org|pythonhosted\.org|deb\.debian\.org|registry\.npmjs")
LARGEST_FILE = 1024 * 1024


def imported(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and top-level package of every absolute import, those inside functions included."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name.partition(".")[0]) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.lineno, node.module.partition(".")[0]


def violations(package: str, source: str) -> list[str]:
    """List the imports of a module of `package` that go sideways, upwards or to another room's library."""
    refused = (set(SOURCES) - BELOW[package] - {package}) | STRANGERS[package]
    return [f"line {line}: {name}" for line, name in imported(source) if name in refused]


def tracked_files() -> list[Path]:
    """Return the files that git keeps, or would keep once added."""
    listing = subprocess.run(
        ["git", "-c", "safe.directory=*", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return [ROOT / name for name in listing.stdout.split("\0") if name and (ROOT / name).is_file()]


def loaded_by(statements: str) -> set[str]:
    """Return the top-level modules that a fresh interpreter has loaded after running `statements`."""
    done = subprocess.run(
        [sys.executable, "-c", f"{statements}\nimport sys\nprint(*sys.modules, file=sys.stderr)"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return {name.partition(".")[0] for name in done.stderr.split()}


needs_git = pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a git checkout")


@pytest.mark.parametrize("package", SOURCES)
def test_imports_run_downwards(package: str) -> None:
    found = {
        str(path.relative_to(ROOT)): bad
        for path in SOURCES[package].rglob("*.py")
        if (bad := violations(package, path.read_text(encoding="utf-8")))
    }
    assert not found


def test_the_check_of_imports_sees_every_form() -> None:
    source = "import graspdb\nimport duckdb as d\ndef f():\n    from graspdb_queries.engine import x\n"
    assert violations("graspdb_ingest", source) == [
        "line 1: graspdb",
        "line 2: duckdb",
        "line 4: graspdb_queries",
    ]
    assert violations("graspdb", "import graspdb_ingest, duckdb\nfrom . import cli") == []


def test_importing_graspdb_loads_nothing_heavy() -> None:
    assert not HEAVY & loaded_by("import graspdb")


def test_whoever_asks_for_an_ingest_loads_nothing_that_computes() -> None:
    """Workers start the sooner, and an ingest that finds all trials unchanged ends the sooner."""
    assert not {"numba", "llvmlite", "open3d"} & loaded_by("import graspdb.ingestion")


def test_help_loads_nothing_heavy() -> None:
    loaded = loaded_by(
        "import sys; from graspdb.cli import main\n"
        "sys.argv = ['graspdb', '--help']\n"
        "try:\n    main()\nexcept SystemExit as done:\n    assert not done.code, done.code"
    )
    assert "graspdb" in loaded
    assert not HEAVY & loaded


@needs_git
def test_no_file_is_large() -> None:
    large = {path.name: size for path in tracked_files() if (size := path.stat().st_size) > LARGEST_FILE}
    assert not large


@needs_git
@pytest.mark.parametrize("pattern", [MACHINE_PATH, REGISTRY_HOST], ids=["machine paths", "registry hosts"])
def test_no_file_speaks_of_one_machine(pattern: re.Pattern[str]) -> None:
    files = tracked_files()
    assert Path(__file__) in files
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in files
        for number, line in enumerate(path.read_bytes().decode("utf-8", "replace").splitlines(), 1)
        if pattern.search(line)
    ]
    assert not found


def test_the_patterns_match_what_they_are_for() -> None:
    assert MACHINE_PATH.search("see /" + "home/someone/data")
    assert MACHINE_PATH.search("'/" + "work/x'")
    assert not MACHINE_PATH.search("../shared/data and docs/work/page and /homework")
    assert REGISTRY_HOST.search("https://" + "pypi" + ".org/simple")


@needs_git
def test_nothing_generated_is_kept() -> None:
    generated = re.compile(r"(^|/)(\.venv|build|dist|__pycache__|[^/]*\.egg-info|\.[a-z]+_cache)/")
    assert not [p for p in tracked_files() if generated.search(p.relative_to(ROOT).as_posix())]
