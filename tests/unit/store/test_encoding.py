"""Files have dictionaries of texts alone, when they are written and when they are joined."""

from pathlib import Path

import pyarrow.parquet as pq
from deltalake import DeltaTable
from handmade import session_tables, trial_tables

from graspdb.store import Store


def columns_with_dictionaries(store: Store, table: str) -> set[str]:
    found = set()
    for file in DeltaTable(str(store.path / table)).file_uris():
        group = pq.ParquetFile(file).metadata.row_group(0)
        for number in range(group.num_columns):
            column = group.column(number)
            if column.has_dictionary_page:
                found.add(column.path_in_schema)
    return found


def test_texts_alone_have_dictionaries(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "db")
    store.commit_session(session_tables())
    for number in range(2):
        store.commit_trial(trial_tables(number))
    texts = {"ingest_id", "trial", "side"}
    assert columns_with_dictionaries(store, "frames") == texts
    store.optimize()
    assert columns_with_dictionaries(store, "frames") == texts
