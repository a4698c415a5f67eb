"""The pages of docs/ that come from the code say what the code says."""

import importlib.util
from pathlib import Path

from graspdb_schemas.tables import TABLES

ROOT = Path(__file__).parents[2]


def written_tables_page() -> str:
    """Return what ``make docs`` would write."""
    spec = importlib.util.spec_from_file_location("write_docs", ROOT / "tools" / "write_docs.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return str(module.tables_page())


def test_the_page_of_tables_is_up_to_date() -> None:
    page = (ROOT / "docs" / "tables.md").read_text(encoding="utf-8")
    assert page == written_tables_page(), "run `make docs`"


def test_every_column_is_documented() -> None:
    page = written_tables_page()
    for name, schema in TABLES.items():
        section = page.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
        lines = [line for line in section.splitlines() if line.startswith("| ")][1:]
        assert [line.split(" | ")[0].strip("| *`") for line in lines] == schema.names
        assert all(line.rsplit(" | ", 1)[1].strip(" |") for line in lines), name
