"""Write the pages of docs/ that come from the code: docs/tables.md and docs/cli.md."""

import os
from collections.abc import Iterator
from pathlib import Path

from typer.models import CommandInfo
from typer.testing import CliRunner

from graspdb.cli import app
from graspdb_schemas.describe import describe_tables

DOCS = Path(__file__).resolve().parents[1] / "docs"
WIDTH = "100"


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
    """Write both pages."""
    os.environ.pop("GRASPDB", None)
    (DOCS / "tables.md").write_text(tables_page(), encoding="utf-8")
    (DOCS / "cli.md").write_text(cli_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
