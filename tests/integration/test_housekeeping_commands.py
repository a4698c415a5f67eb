"""The commands that keep a database in order, as a user types them."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from handmade import session_tables, trial_tables
from typer.testing import CliRunner, Result

from graspdb.cli import app
from graspdb.store import Store

Run = Callable[..., Result]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Return a way to run a command on a small database."""
    store = Store.create_or_open(tmp_path / "db")
    store.commit_session(session_tables())
    for number in range(3):
        store.commit_trial(trial_tables(number))

    def run(*arguments: str) -> Result:
        return CliRunner().invoke(app, [*arguments, "--db", str(tmp_path / "db")])

    return run


def test_remove_then_ask_the_past_then_forget_it(run: Run) -> None:
    question = "SELECT count(*) AS n FROM trials"
    assert "removed s/anna_mug_1" in run("remove", "trial", "s/anna_mug_1").stdout
    assert json.loads(run("sql", question, "--format", "json").stdout) == [{"n": 2}]
    assert json.loads(run("sql", question, "--format", "json", "--as-of", "3").stdout) == [{"n": 3}]
    done = json.loads(run("optimize", "--retention", "0", "--json").stdout)
    assert done["frames"]["swept"] == 4
    assert "no longer kept" in str(run("sql", question, "--as-of", "3").exception)
    assert json.loads(run("verify", "--json").stdout)["whole"]


def test_history_names_versions_that_can_be_asked(run: Run) -> None:
    changes = json.loads(run("info", "--history", "--json").stdout)
    assert [change["action"] for change in changes] == ["ingest", "ingest", "ingest", "create"]
    for change in changes:
        for state in (str(change["version"]), change["time"]):
            asked = run("sql", "SELECT count(*) AS n FROM trials", "--format", "json", "--as-of", state)
            assert json.loads(asked.stdout) == [{"n": change["version"]}]
    assert "1 trials added" in run("info", "--history").stdout


def test_verify_fails_where_a_file_is_lost(run: Run, tmp_path: Path) -> None:
    assert run("verify").exit_code == 0
    next((tmp_path / "db" / "contacts").glob("*.parquet")).unlink()
    failed = run("verify")
    assert failed.exit_code == 1
    assert "is missing" in failed.stdout
    assert "not whole" in failed.stdout


def test_wrong_usage_is_told(run: Run) -> None:
    assert run("sql", "SELECT 1", "--as-of", "yesterday").exit_code == 2
    assert run("optimize", "--retention", "-1").exit_code == 2
    assert run("remove", "trails", "x").exit_code == 2
