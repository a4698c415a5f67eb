"""What is documented is what there is: help of every command and option, and the pages made from the code."""

import pytest
import write_docs
from typer.main import get_command

from graspdb.cli import app

REMEDY = "run `make docs`"


def test_the_page_about_the_tables_is_fresh() -> None:
    assert (write_docs.DOCS / "tables.md").read_text(encoding="utf-8") == write_docs.tables_page(), REMEDY


def test_the_page_about_the_command_line_is_fresh() -> None:
    assert (write_docs.DOCS / "cli.md").read_text(encoding="utf-8") == write_docs.cli_page(), REMEDY


@pytest.mark.parametrize("name", write_docs.command_names())
def test_every_command_and_option_says_what_it_does(name: str) -> None:
    command = get_command(app).commands[name]
    assert command.help, f"graspdb {name} has no help"
    for parameter in command.params:
        assert getattr(parameter, "help", None), f"{parameter.name} of graspdb {name} has no help"
