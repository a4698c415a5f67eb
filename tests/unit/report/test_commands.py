"""`graspdb report` and `graspdb explore` as a user meets them."""

import json
import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
import worked_example
from typer.testing import CliRunner

from graspdb.cli import app
from graspdb_schemas.errors import DatabaseError, QueryError


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("commands") / "db"
    worked_example.build(folder)
    return folder


def test_report_says_what_it_wrote(path: Path, tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    done = CliRunner().invoke(app, ["report", "s", "-o", str(file), "--db", str(path), "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told == {
        "file": str(file),
        "bytes": file.stat().st_size,
        "session": "s",
        "trials": 9,
        "rejected": 1,
        "grasps": 6,
    }


def test_report_of_no_session_writes_nothing(path: Path, tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    done = CliRunner().invoke(app, ["report", "nobody", "-o", str(file), "--db", str(path)])
    assert isinstance(done.exception, QueryError)
    assert list(tmp_path.iterdir()) == []


def test_report_needs_to_be_told_where_to(path: Path) -> None:
    assert CliRunner().invoke(app, ["report", "s", "--db", str(path)]).exit_code == 2


def test_explore_of_no_database_says_so(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["explore", str(tmp_path / "none")])
    assert isinstance(done.exception, DatabaseError)


def test_explore_prints_its_address_answers_and_ends_by_ctrl_c(path: Path) -> None:
    command = [sys.executable, "-m", "graspdb", "explore", str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        address = process.stdout.readline().strip()
        with urllib.request.urlopen(address) as answer:
            assert "6</b> grasps" in answer.read().decode()
        os.kill(process.pid, signal.SIGINT)
        assert process.wait(timeout=60) == 0
        said = process.stderr.read()
    assert "Traceback" not in said
    assert address.rsplit("/", 2)[1] not in said
