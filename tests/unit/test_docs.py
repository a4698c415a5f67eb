"""The pages of docs/ that come from the code say what the code says."""

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.main import get_command
from write_docs import cli_page, tables_page

from graspdb.cli import app
from graspdb_schemas.tables import TABLES

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize(("page", "written"), [("tables", tables_page), ("cli", cli_page)])
def test_the_page_is_up_to_date(page: str, written: Callable[[], str]) -> None:
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    assert text == written(), "run `make docs`"


def test_every_column_is_documented() -> None:
    page = tables_page()
    for name, schema in TABLES.items():
        section = page.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
        lines = [line for line in section.splitlines() if line.startswith("| ")][1:]
        assert [line.split(" | ")[0].strip("| *`") for line in lines] == schema.names
        assert all(line.rsplit(" | ", 1)[1].strip(" |") for line in lines), name


def test_every_command_is_documented() -> None:
    page = cli_page()
    commands = getattr(get_command(app), "commands", {})
    assert "ingest" in commands
    assert [name for name in commands if f"\n## graspdb {name}\n" not in page] == []
