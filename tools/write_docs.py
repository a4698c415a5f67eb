"""Write the pages of ``docs/`` that come from the code: tables and commands."""

import subprocess
import sys
from pathlib import Path

import pyarrow as pa

from graspdb_schemas.tables import TABLE_DOCS, TABLES, doc_of, unit_of

ROOT = Path(__file__).parents[1]

PREFACE = """# Tables

A database is a folder of Delta Lake tables. `make docs` writes this page from the schemas in
`graspdb_schemas.tables`. Columns marked with * are never null. The hand's sites, joints and digits stand in
the order of `graspdb_schemas.vocabulary`.
"""


def table_section(name: str, schema: pa.Schema) -> str:
    """Return one table's heading, what a row stands for, and a line for each column."""
    rows = (
        f"| {field.name}{'' if field.nullable else ' *'} | `{field.type}` | {unit_of(field)} "
        f"| {doc_of(field).replace('|', chr(92) + '|')} |"
        for field in schema
    )
    head = ("| column | type | unit | what it is |", "|---|---|---|---|")
    return "\n".join((f"\n## {name}\n", f"{TABLE_DOCS[name].capitalize()}.\n", *head, *rows, ""))


def tables_page() -> str:
    """Return the page of all tables as Markdown."""
    return PREFACE + "".join(table_section(name, schema) for name, schema in TABLES.items())


def commands_page() -> str:
    """Return the page of all commands as Markdown, made by Typer from their help."""
    command = [sys.executable, "-m", "typer", str(ROOT / "graspdb" / "cli.py"), "utils", "docs"]
    done = subprocess.run([*command, "--name", "graspdb"], capture_output=True, text=True, check=True)
    return done.stdout.rstrip() + "\n"


if __name__ == "__main__":
    (ROOT / "docs" / "tables.md").write_text(tables_page(), encoding="utf-8")
    (ROOT / "docs" / "commands.md").write_text(commands_page(), encoding="utf-8")
