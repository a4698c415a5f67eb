"""Named queries and the DuckDB export as a user meets them, against the same asked in Python."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import duckdb
import pytest
from handmade import session_tables, trial_tables
from typer.testing import CliRunner
from worked_example import build

import graspdb
from graspdb.cli import app
from graspdb.output import _plain
from graspdb.store import Store
from graspdb_queries.macros import macros
from graspdb_queries.named import named_queries, named_query
from graspdb_schemas.errors import ParameterError, QueryError


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("queries") / "db"
    build(folder)
    return folder


@pytest.fixture(scope="module")
def database(path: Path) -> Iterator[graspdb.Database]:
    with graspdb.open(path) as opened:
        yield opened


def told(*arguments: str) -> str:
    done = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


def objects(result: graspdb.Result) -> list[dict[str, Any]]:
    """Return an answer as JSON has it."""
    plain = [dict(zip(result.columns, row, strict=True)) for row in result.rows()]
    return json.loads(
        json.dumps([{k: _plain(dict(v) if k == "loadings" else v) for k, v in row.items()} for row in plain])
    )  # type: ignore[no-any-return]


@pytest.mark.parametrize("name", sorted(named_queries()))
def test_the_command_gives_what_python_gives(path: Path, database: graspdb.Database, name: str) -> None:
    example = named_query(name).example
    given = [word for key, value in example for word in ("--param", f"{key}={value}")]
    rows = json.loads(told("query", name, *given, "--db", str(path), "--format", "json"))
    assert rows == objects(database.query(name, **dict(example)))


def test_sql_gives_what_python_gives(path: Path, database: graspdb.Database) -> None:
    statement = (
        "SELECT grasp, to_mm(grip_aperture) AS mm, digit_pattern(digits) AS d FROM grasps ORDER BY grasp"
    )
    rows = json.loads(told("sql", statement, "--db", str(path), "--format", "json"))
    result = database.sql(statement)
    assert rows == objects(result)
    assert result.df().to_dict("records") == rows
    assert result.pl().to_dicts() == rows
    assert result.arrow().to_pylist() == rows


def test_functions_and_views_are_listed() -> None:
    listed = told("schema", "--functions")
    assert all(macro.call in listed for macro in macros())
    described = json.loads(told("schema", "--functions", "--json"))
    assert [entry["name"] for entry in described] == [macro.name for macro in macros()]
    assert "the very row of objects" in told("schema", "grasp_objects")


def test_the_exported_file_answers_as_the_database_does(path: Path, tmp_path: Path) -> None:
    file = tmp_path / "grasps.duckdb"
    assert str(file) in told("export", "duckdb", str(file), "--db", str(path))
    with graspdb.open(path) as database, duckdb.connect(str(file), read_only=True) as plain:
        for name in (*database.tables, "grasp_objects", "grasp_hands"):
            statement = f"SELECT * FROM {name} ORDER BY ALL"
            assert plain.sql(statement).to_arrow_table().equals(database.sql(statement).arrow()), name
        for query in named_queries().values():
            if not query.parameters:
                assert plain.sql(query.sql).fetchall() == database.query(query.name).rows()
        asked = "SELECT joint_angle(q, 'index_mcp_flexion') FROM grasps ORDER BY grasp"
        assert plain.sql(asked).fetchall() == database.sql(asked).rows()
        comments = "SELECT comment FROM duckdb_columns() WHERE table_name = 'grasps' AND column_name = 'q'"
        assert plain.sql(comments).fetchall() == database.sql(comments).rows()
    assert file.stat().st_size < 2_000_000
    assert [entry.name for entry in tmp_path.iterdir()] == [file.name]


def test_the_exported_file_shows_its_snapshot_and_committed_rows_alone(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "db")
    store.commit_session(session_tables())
    store.commit_trials([trial_tables(1), trial_tables(2)])
    # The rows of the trial that is replaced stay in a file with those of another.
    store.commit_trial(trial_tables(2, input_key="new", sites=["thumb_tip"]))
    with graspdb.open(store.path) as database:
        database.export("duckdb", tmp_path / "views.duckdb")
    store.commit_trial(trial_tables(3))
    with duckdb.connect(str(tmp_path / "views.duckdb"), read_only=True) as plain:
        assert plain.sql("SELECT count(*) FROM trials").fetchall() == [(2,)]
        assert plain.sql("SELECT count(*) FROM contacts").fetchall() == [(4,)]


def test_exports_that_cannot_be_made(database: graspdb.Database, tmp_path: Path) -> None:
    taken = tmp_path / "taken.duckdb"
    taken.write_text("mine")
    with pytest.raises(QueryError, match="there is such a file already"):
        database.export("duckdb", taken)
    assert taken.read_text() == "mine"
    with pytest.raises(QueryError, match="there is no folder"):
        database.export("duckdb", tmp_path / "no" / "x.duckdb")
    with pytest.raises(ParameterError, match="did you mean 'duckdb'"):
        database.export("duckbd", tmp_path / "x")
    assert [entry.name for entry in tmp_path.iterdir()] == ["taken.duckdb"]


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["query", "synergy", "--db", "{db}"], 1, "did you mean 'synergies'"),
        (["query", "synergies", "--param", "postures=grasp", "--db", "{db}"], 1, "did you mean 'grasps'"),
        (["query", "grip_aperture", "--param", "window=long", "--db", "{db}"], 1, "a value of kind number"),
        (["query", "grip_aperture", "--param", "window=nan", "--db", "{db}"], 1, "a value of kind number"),
        (["query", "grasps_with_digits", "--db", "{db}"], 1, "parameter digits: found 'no value'"),
        (
            ["query", "grasps_with_digits", "--param", "digits=pinky", "--db", "{db}"],
            1,
            "no digit is called pinky",
        ),
        (["query", "grasp_clusters", "--param", "clusters=0", "--db", "{db}"], 1, "at least 1"),
        (
            ["sql", "SELECT joint_angle(q, 'index_mcp') FROM grasps", "--db", "{db}"],
            1,
            "no joint angle is called",
        ),
        (["sql", "SELECT * FROM grasp_object", "--db", "{db}"], 1, "did you mean 'grasp_objects'"),
        (["export", "duckdb", ".", "--db", "{db}"], 1, "there is such a file already"),
        (["export", "duckbd", "x", "--db", "{db}"], 2, "duckdb"),
        (["export", "duckdb", "x", "--db", "nowhere"], 1, "no such folder"),
    ],
)
def test_what_a_user_gets_wrong(
    path: Path, tmp_path: Path, arguments: list[str], status: int, said: str
) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "graspdb", *(argument.replace("{db}", str(path)) for argument in arguments)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={key: value for key, value in os.environ.items() if key != "GRASPDB"},
        check=False,
    )
    assert said in done.stderr
    assert done.returncode == status
    assert "Traceback" not in done.stdout + done.stderr
    assert list(tmp_path.iterdir()) == []
