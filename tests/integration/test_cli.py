"""The command line as a user meets it: answers on standard output, one message and a status for errors."""

import csv
import io
import json
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from handmade import session_tables, trial_tables

import graspdb
from graspdb.store import Store

QUERY = "SELECT grasp, n_contacts, digits, quality, 'nan'::DOUBLE AS nothing FROM grasps ORDER BY grasp"
Done = subprocess.CompletedProcess[str]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("cli") / "db"
    store = Store.create_or_open(folder)
    store.commit_session(session_tables())
    store.commit_trials(
        [trial_tables(1), trial_tables(2, sites=["thumb_tip"]), trial_tables(3, status="rejected")]
    )
    return folder


def run(*arguments: str, cwd: Path | None = None, **environment: str) -> Done:
    clean = {key: value for key, value in os.environ.items() if key != "GRASPDB"}
    return subprocess.run(
        [sys.executable, "-m", "graspdb", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=cwd,
        env={**clean, **environment},
        check=False,
    )


def started(*arguments: str) -> "subprocess.Popen[bytes]":
    command = [sys.executable, "-m", "graspdb", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def answer(*arguments: str, **environment: str) -> str:
    done = run(*arguments, **environment)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_csv_reads_back_equal(path: Path) -> None:
    rows = list(csv.reader(io.StringIO(answer("sql", QUERY, "--db", str(path), "--format", "csv"))))
    assert rows[0] == ["grasp", "n_contacts", "digits", "quality", "nothing"]
    assert rows[1] == ["s/anna_mug_1/right/0", "3", '["thumb", "index"]', '{"epsilon": 0.1}', "nan"]
    assert len(rows) == 4


def test_json_reads_back_equal(path: Path) -> None:
    rows = json.loads(answer("sql", QUERY, "--db", str(path), "--format", "json"))
    assert rows[1] == {
        "grasp": "s/anna_mug_2/right/0",
        "n_contacts": 1,
        "digits": ["thumb"],
        "quality": {"epsilon": 0.1},
        "nothing": None,
    }
    assert len(rows) == 3
    assert json.loads(answer("sql", "SELECT 1 WHERE false", "--db", str(path), "--format", "json")) == []


def test_parquet_reads_back_equal(path: Path, tmp_path: Path) -> None:
    statement = "SELECT * FROM frames ORDER BY ALL"
    file = tmp_path / "x.parquet"
    assert answer("sql", statement, "--db", str(path), "--format", "parquet", "-o", str(file)) == ""
    with graspdb.open(path) as database:
        assert pq.read_table(file).equals(database.sql(statement).arrow())


def test_parquet_to_standard_output(path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "graspdb", "sql", "SELECT 1 AS one", "--db", str(path), "--format", "parquet"],
        capture_output=True,
        check=True,
    )
    assert pq.read_table(io.BytesIO(done.stdout)).to_pylist() == [{"one": 1}]


def test_table_shows_every_cell(path: Path) -> None:
    lines = answer("sql", QUERY, "--db", str(path)).splitlines()
    assert lines[0].split() == ["grasp", "n_contacts", "digits", "quality", "nothing"]
    assert lines[2].startswith("s/anna_mug_1/right/0")
    assert lines[-1] == "3 rows"


def test_an_answer_goes_to_a_file(path: Path, tmp_path: Path) -> None:
    file = tmp_path / "out.csv"
    assert answer("sql", "SELECT 1 AS one", "--db", str(path), "--format", "csv", "-o", str(file)) == ""
    assert file.read_text() == "one\n1\n"
    failed = run("sql", "SELECT 'x'::INT", "--db", str(path), "-o", str(file))
    assert failed.returncode == 1


def test_named_query(path: Path) -> None:
    rows = json.loads(
        answer("query", "digits_used", "--param", "subject=anna", "--db", str(path), "--format", "json")
    )
    assert [row["digits"] for row in rows] == ["thumb+index", "thumb"]
    listed = answer("query", "--list")
    assert "contact_frequency: " in listed
    assert "--param object=<text>" in listed


def test_info_and_schema(path: Path) -> None:
    assert "1 of 3 trials rejected" in answer("info", "--db", str(path))
    assert json.loads(answer("info", "--json", GRASPDB=str(path)))["rows"]["grasps"] == 3
    tables = json.loads(answer("schema", "--json"))
    assert [column["unit"] for column in tables[0]["columns"]].count("m") == 0
    assert "signed distance" in answer("schema", "contacts")


def test_an_empty_database_answers(tmp_path: Path) -> None:
    Store.create_or_open(tmp_path / "db")
    assert json.loads(answer("info", "--json", "--db", str(tmp_path / "db")))["rows"]["trials"] == 0
    assert answer("sql", "SELECT grasp FROM grasps", "--db", str(tmp_path / "db")).endswith("0 rows\n")


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["info", "--db", "nowhere"], 1, "nowhere: no such folder"),
        (["info"], 1, "grasps: no such folder"),
        (["sql", "SELECT 1", "--db", "/etc/hostname"], 1, "a file, not a folder"),
        (["sql", "SELECT * FROM grasp", "--db", "{db}"], 1, "did you mean 'grasps'"),
        (["sql", "SELECT * FROM read_text('/etc/passwd')", "--db", "{db}"], 1, "nothing outside of it"),
        (["sql", "COPY grasps TO 'x'", "--db", "{db}"], 1, "one SELECT statement"),
        (["sql", "SELECT 1", "--db", "{db}", "-o", "no/such/folder/x"], 1, "cannot be written"),
        (["sql", "SELECT 1", "--db", "{db}", "-o", "."], 1, "cannot be written"),
        (["sql", "SELECT 1", "--db", "{db}", "--format", "xml"], 2, "--format"),
        (["sql", b"SELECT '\xff'".decode(errors="surrogateescape"), "--db", "{db}"], 1, "UTF-8"),
        (["sql"], 2, "Missing argument"),
        (["query", "digit_used", "--db", "{db}"], 1, "did you mean 'digits_used'"),
        (["query", "digits_used", "--param", "x", "--db", "{db}"], 2, "KEY=VALUE"),
        (["query", "digits_used", "--param", "x=1", "--db", "{db}"], 1, "allowed: object, subject"),
        (["query"], 2, "--list"),
        (["schema", "contact"], 1, "did you mean 'contacts'"),
        (["inof"], 2, "info"),
        ([], 2, ""),
    ],
)
def test_errors_are_one_message_and_a_status(
    path: Path, tmp_path: Path, arguments: list[str], status: int, said: str
) -> None:
    done = run(*(argument.replace("{db}", str(path)) for argument in arguments), cwd=tmp_path)
    assert done.returncode == status
    assert said in done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_closed_pipe_is_quiet(path: Path) -> None:
    process = started("sql", "FROM range(10000000)", "--db", str(path), "--format", "csv")
    assert process.stdout is not None
    assert process.stderr is not None
    assert process.stdout.readline() == b"range\n"
    process.stdout.close()
    assert process.wait(60) == 1
    assert process.stderr.read() == b""
    process.stderr.close()


def test_an_interrupt_is_quiet_and_says_130(path: Path) -> None:
    endless = "SELECT i FROM range(1000000000000) t(i)"
    process = started("sql", endless, "--db", str(path), "--format", "csv")
    assert process.stdout is not None
    assert process.stdout.readline() == b"i\n"
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (130, b"")


def test_help_is_quick() -> None:
    def seconds() -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert "Commands:" in answer("--help")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    # Seconds of the processor, for other programs may be at work on the machine.
    assert min(seconds() for _ in range(3)) < 0.25


def test_version() -> None:
    assert answer("--version") == f"graspdb {graspdb.__version__}\n"
