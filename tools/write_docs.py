"""Write the pages of docs/ that come from the code: docs/tables.md, docs/queries.md and docs/cli.md."""

import os
import sys
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

from typer.models import CommandInfo
from typer.testing import CliRunner

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests"))

import worked_example  # noqa: E402

from graspdb.cli import app  # noqa: E402
from graspdb.database import Database  # noqa: E402
from graspdb.output import write_table  # noqa: E402
from graspdb_queries.joins import describe_views  # noqa: E402
from graspdb_queries.macros import macros  # noqa: E402
from graspdb_queries.named import named_queries  # noqa: E402
from graspdb_queries.result import Result  # noqa: E402
from graspdb_schemas.describe import DescribedTable, describe_tables  # noqa: E402

DOCS = ROOT / "docs"
WIDTH = "100"
SHOWN = 8
"""Rows of an answer that the page about queries shows."""

CELL = 40
"""Characters of a cell of these answers."""


def tables_page() -> str:
    """Return the page about the tables."""
    return "\n".join(_tables()) + "\n"


def _tables() -> Iterator[str]:
    yield "# Tables"
    yield ""
    yield "Made by `make docs` from the declared schemas; `graspdb schema` prints the same."
    yield ""
    yield "Lengths are in metres, angles in radians, times in seconds, masses in kilograms. Shapes stand in"
    yield "round brackets. A value that is missing is null. Rows of every table but `trials` count once"
    yield "`trials` names their `ingest_id`; `graspdb sql` shows these alone. docs/store.md explains that,"
    yield "and how to join trials to the very rows of objects and hands that they stand on."
    for table in describe_tables():
        yield from _table(table)
    yield ""
    yield "# Views"
    yield ""
    yield "`graspdb sql` and `graspdb export duckdb` have two views beside the tables. Trials may stand on"
    yield "several versions of an object or a hand (docs/store.md); these views are the exact join."
    for view in describe_views():
        yield from _table(view)


def _table(table: DescribedTable) -> Iterator[str]:
    yield ""
    yield f"## {table.name}"
    yield ""
    yield f"{table.doc[0].upper()}{table.doc[1:]}."
    yield ""
    yield "| column | type | unit | what it holds |"
    yield "|---|---|---|---|"
    for column in table.columns:
        kind = f"`{column.kind}`" + ("" if column.nullable else ", never null")
        yield f"| `{column.name}` | {kind} | {column.unit} | {_escaped(column.doc)} |"


def queries_page() -> str:
    """Return the page about named queries and functions, each query with its answer on the worked example."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "grasps"
        worked_example.build(path)
        with Database(path) as database:
            return "\n".join(_queries(database)) + "\n"


def _queries(database: Database) -> Iterator[str]:
    yield "# Queries"
    yield ""
    yield "Made by `make docs` from the heads of `queries/graspdb_queries/sql/*.sql`; `graspdb query --list`"
    yield "prints the same. `graspdb query NAME --param KEY=VALUE` answers on the command line,"
    yield "`db.query(NAME, key=value)` in Python; the files are SQL to copy and change."
    yield ""
    yield "The answers shown are those on a small made-up database, `tests/worked_example.py`, on which"
    yield "`tests/unit/queries/test_answers.py` works them out by hand. A subject and an object are names:"
    yield "where two sessions use one name for two people or things, copy the query and group by session too."
    for query in named_queries().values():
        yield ""
        yield f"## {query.name}"
        yield ""
        yield query.title
        yield ""
        if query.parameters:
            yield "| parameter | kind | default | what it does |"
            yield "|---|---|---|---|"
            for parameter in query.parameters:
                default = "must be given" if parameter.required else _default(parameter.default)
                cells = (parameter.kind, default, parameter.doc)
                yield f"| `{parameter.name}` | {' | '.join(_escaped(cell) for cell in cells)} |"
            yield ""
        yield "| column | what it holds |"
        yield "|---|---|"
        for column in query.columns:
            yield f"| `{column.name}` | {_escaped(column.doc)} |"
        if query.notes:
            yield ""
            yield query.notes
        yield ""
        yield "```text"
        yield " ".join(["$ graspdb query", query.name, *(f"--param {k}={v}" for k, v in query.example)])
        yield from _answer(database.query(query.name, **dict(query.example)))
        yield "```"
    yield ""
    yield "# Functions"
    yield ""
    yield "Functions that every SELECT may call, in `graspdb sql`, in Python, and in the file that"
    yield "`graspdb export duckdb` writes; `graspdb schema --functions` prints them. Vectors are lists of 3,"
    yield "quaternions unit quaternions w x y z, transforms 4 x 4 matrices row by row. What is null, or has"
    yield "a null in it, gives null; a name that is no site, digit or joint angle is an error."
    yield ""
    yield "| function | what it gives | example |"
    yield "|---|---|---|"
    for macro in macros():
        yield f"| `{macro.call}` | {_escaped(macro.doc)} | `{macro.example}` |"


def _answer(result: Result) -> Iterator[str]:
    """Yield the rows of an answer as ``graspdb query`` shows them, the first few."""
    text = StringIO()
    few = result.arrow().slice(0, SHOWN)
    write_table(few.to_reader(), text, width=CELL)
    *lines, _ = text.getvalue().splitlines()
    yield from lines
    yield f"{len(result)} rows" + (f", of which {SHOWN} are shown" if len(result) > SHOWN else "")


def _default(value: object) -> str:
    return "" if value is None else f"`{value}`"


def cli_page() -> str:
    """Return the reference of the command line, as ``--help`` prints it."""
    parts = [
        "# Command line",
        "Made by `make docs` from what `--help` prints.",
        _section("graspdb", []),
        *(_section(f"graspdb {name}", name.split()) for name in command_names()),
    ]
    return "\n\n".join(parts) + "\n"


def command_names() -> list[str]:
    """Return the names of all commands, those of groups behind the group's, in the order of help."""
    names = [_name(command) for command in app.registered_commands]
    for group in app.registered_groups:
        inner = group.typer_instance
        if inner is not None:
            title = str(group.name or inner.info.name)
            names += [title, *(f"{title} {_name(command)}" for command in inner.registered_commands)]
    return names


def _name(command: CommandInfo) -> str:
    return str(command.name or getattr(command.callback, "__name__", ""))


def _section(title: str, arguments: list[str]) -> str:
    environment = {"COLUMNS": WIDTH, "TERMINAL_WIDTH": WIDTH, "GRASPDB": ""}
    result = CliRunner(env=environment).invoke(app, [*arguments, "--help"], prog_name="graspdb")
    if result.exit_code:
        raise RuntimeError(f"graspdb {' '.join(arguments)} --help failed: {result.output}")
    text = "\n".join(line.rstrip() for line in result.output.strip().splitlines())
    return f"## {title}\n\n```text\n{text}\n```"


def _escaped(text: str) -> str:
    """Return a text that a Markdown table shows as it is."""
    return text.replace("|", "\\|").replace("<", "&lt;")


def main() -> None:
    """Write all pages."""
    os.environ.pop("GRASPDB", None)
    (DOCS / "tables.md").write_text(tables_page(), encoding="utf-8")
    (DOCS / "queries.md").write_text(queries_page(), encoding="utf-8")
    (DOCS / "cli.md").write_text(cli_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
