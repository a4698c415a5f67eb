"""The pages of docs/ that come from the code say what the code says."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest
from typer.main import get_command

from graspdb.cli import app
from graspdb_schemas.tables import TABLES

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def write_docs() -> ModuleType:
    """Load the script behind ``make docs``."""
    spec = importlib.util.spec_from_file_location("write_docs", ROOT / "tools" / "write_docs.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", ["tables", "queries", "cli"])
def test_the_page_is_up_to_date(write_docs: ModuleType, page: str) -> None:
    written = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    assert written == getattr(write_docs, f"{page}_page")(), "run `make docs`"


def test_every_column_is_documented(write_docs: ModuleType) -> None:
    page = write_docs.tables_page()
    for name, schema in TABLES.items():
        section = page.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
        lines = [line for line in section.splitlines() if line.startswith("| ")][1:]
        assert [line.split(" | ")[0].strip("| `") for line in lines] == schema.names
        assert all(line.rsplit(" | ", 1)[1].strip(" |") for line in lines), name


def test_every_command_and_option_is_documented(write_docs: ModuleType) -> None:
    page = write_docs.cli_page()
    commands = getattr(get_command(app), "commands", {})
    assert "ingest" in commands
    for name, command in commands.items():
        assert f"\n## graspdb {name}\n" in page
        assert command.help, name
        assert [option.name for option in command.params if not getattr(option, "help", None)] == [], name
