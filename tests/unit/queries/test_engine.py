"""The engine answers SELECTs over its snapshot, and can do nothing else."""

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from graspdb_queries import joins
from graspdb_queries.engine import Engine
from graspdb_queries.source import TableSource
from graspdb_schemas.errors import ParameterError, QueryError
from graspdb_schemas.tables import TABLE_DOCS, TABLES, doc_of


def write_contacts(path: Path, ingests: dict[str, int]) -> str:
    rows = [
        {"grasp": f"{ingest}/{i}", "trial": ingest, "site": "thumb_tip", "gap": i / 1000, "ingest_id": ingest}
        for ingest, n in ingests.items()
        for i in range(n)
    ]
    names = TABLES["contacts"].names
    whole = [{name: row.get(name) for name in names} for row in rows]
    pq.write_table(pa.Table.from_pylist(whole, TABLES["contacts"]), path)
    return str(path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a database's folder with something beside it that is nobody's business."""
    (tmp_path / "secret.csv").write_text("secret\n8675309\n")
    pq.write_table(pa.table({"secret": [8675309]}), tmp_path / "secret.parquet")
    (tmp_path / "db").mkdir()
    (tmp_path / "db" / "link.csv").symlink_to(tmp_path / "secret.csv")
    (tmp_path / "db" / "notes.txt").write_text("not part of the snapshot")
    return tmp_path / "db"


@pytest.fixture
def engine(folder: Path) -> Iterator[Engine]:
    sources = {name: TableSource() for name in TABLES}
    sources["contacts"] = TableSource(
        files=(write_contacts(folder / "a.parquet", {"one": 3}),),
        mixed_files=(write_contacts(folder / "b.parquet", {"two": 4, "dead": 5}),),
        committed=pa.array(["one", "two"]),
    )
    with Engine(sources) as opened:
        yield opened


def test_only_committed_rows_are_seen(engine: Engine) -> None:
    rows = engine.sql("SELECT trial, count(*) FROM contacts GROUP BY trial ORDER BY trial").rows()
    assert rows == [("one", 3), ("two", 4)]


def test_a_table_without_files_has_its_columns_and_no_rows(engine: Engine) -> None:
    for name, schema in TABLES.items():
        if name != "contacts":
            result = engine.sql(f"SELECT * FROM {name}")
            assert result.columns == tuple(schema.names)
            assert result.arrow().cast(schema).num_rows == 0


def test_views_and_columns_are_documented(engine: Engine) -> None:
    views = dict(engine.sql("SELECT view_name, comment FROM duckdb_views() WHERE NOT internal").rows())
    beside = joins.views().values()
    assert views == {**TABLE_DOCS, **{view.name: view.doc for view in beside}}
    comments = engine.sql("SELECT table_name, column_name, comment FROM duckdb_columns() WHERE NOT internal")
    found = {(table, column): comment for table, column, comment in comments.rows() if table in views}
    for name, schema in {**TABLES, **{view.name: view.schema for view in beside}}.items():
        assert engine.sql(f"SELECT * FROM {name}").columns == tuple(schema.names)
        for field in schema:
            assert found[name, field.name].startswith(doc_of(field))


def test_forms_of_an_answer_agree(engine: Engine) -> None:
    result = engine.sql("SELECT grasp, gap, [1, 2] AS l FROM contacts WHERE trial = 'one' ORDER BY grasp")
    assert result.columns == ("grasp", "gap", "l")
    assert len(result) == 3
    assert result.rows()[2] == ("one/2", 0.002, [1, 2])
    assert result.arrow()["gap"].to_pylist() == [0.0, 0.001, 0.002]
    np.testing.assert_array_equal(result.df()["gap"], [0.0, 0.001, 0.002])
    assert result.pl()["l"].to_list() == [[1, 2]] * 3
    assert engine.sql("SELECT 1 WHERE false").rows() == []


def test_stream_gives_the_same_rows_in_batches(engine: Engine) -> None:
    stream = engine.stream("SELECT i FROM range(200000) t(i)")
    batches = list(stream)
    assert len(batches) > 1
    assert pa.Table.from_batches(batches, stream.schema)["i"].to_pylist() == list(range(200000))


def test_parameters_are_bound_not_pasted(engine: Engine) -> None:
    count = "SELECT count(*) FROM contacts WHERE trial = $trial"
    assert engine.sql(count, {"trial": "one"}).rows() == [(3,)]
    assert engine.sql(count, {"trial": "one' OR '1' = '1"}).rows() == [(0,)]
    assert engine.sql("SELECT $a + $b, $n IS NULL", {"a": 1, "b": 2.5, "n": None}).rows() == [(3.5, True)]
    with pytest.raises(ParameterError, match=r"trial.*no value"):
        engine.sql(count)
    with pytest.raises(ParameterError, match="did you mean 'trial'"):
        engine.sql(count, {"trial": "one", "trail": "one"})
    with pytest.raises(QueryError):
        engine.sql("SELECT $a", {"a": object()})


ATTACKS = [
    "SELECT * FROM read_csv('{outside}/secret.csv')",
    "SELECT * FROM read_csv_auto('{outside}/secret.csv')",
    "SELECT * FROM read_text('{outside}/secret.csv')",
    "SELECT * FROM read_blob('{outside}/secret.csv')",
    "SELECT * FROM read_json('/proc/self/environ')",
    "SELECT * FROM read_parquet('{outside}/secret.parquet')",
    "SELECT * FROM read_parquet(['{db}/a.parquet', '{outside}/secret.parquet'])",
    "SELECT * FROM read_parquet('{db}/../secret.parquet')",
    "SELECT * FROM '{outside}/secret.parquet'",
    "SELECT * FROM '{outside}/secret.csv'",
    "SELECT * FROM '/etc/passwd'",
    "SELECT * FROM read_csv('{db}/link.csv')",
    "SELECT * FROM read_text('{db}/notes.txt')",
    "SELECT * FROM read_text('{db}/a.parquet/../../secret.csv')",
    "SELECT * FROM glob('{outside}/*')",
    "SELECT * FROM glob('{db}/*')",
    "SELECT * FROM sniff_csv('{outside}/secret.csv')",
    "SELECT * FROM parquet_metadata('{outside}/secret.parquet')",
    "SELECT * FROM parquet_schema('{outside}/secret.parquet')",
    "SELECT * FROM parquet_file_metadata('{outside}/secret.parquet')",
    "SELECT * FROM parquet_kv_metadata('{outside}/secret.parquet')",
    "SELECT * FROM read_ndjson('{outside}/secret.csv')",
    "SELECT * FROM read_text(['{outside}/secret.csv'])",
    "SELECT * FROM read_text('file://{outside}/secret.csv')",
    "SELECT * FROM query_table('{outside}/secret.csv')",
    "SELECT (SELECT content FROM read_text('{outside}/secret.csv')) FROM contacts",
    "SELECT site_index(content) FROM read_text('{outside}/secret.csv')",
    "SELECT * FROM read_csv('https://example.org/x.csv')",
    "SELECT * FROM query('SELECT * FROM read_text(''{outside}/secret.csv'')')",
    "SELECT * FROM (SELECT content FROM read_text('{outside}/secret.csv')) WHERE 1 IN (SELECT 1)",
    "WITH x AS (SELECT * FROM read_csv('{outside}/secret.csv')) SELECT * FROM x",
    "SELECT getenv('HOME')",
    "SELECT * FROM enable_logging('QueryLog', storage = 'file', storage_path = '{outside}/log')",
    "CALL enable_logging('QueryLog', storage = 'file', storage_path = '{outside}/log')",
    "COPY contacts TO '{outside}/stolen.csv'",
    "COPY (SELECT 1) TO '{db}/new.parquet'",
    "COPY (SELECT 1) TO '{db}/a.parquet'",
    "COPY contacts FROM '{outside}/secret.csv'",
    "EXPORT DATABASE '{outside}/export'",
    "IMPORT DATABASE '{outside}/export'",
    "ATTACH '{outside}/other.db'",
    "ATTACH ':memory:' AS other",
    "DETACH memory",
    "USE memory",
    "INSTALL httpfs",
    "LOAD httpfs",
    "LOAD '{outside}/x.duckdb_extension'",
    "FORCE INSTALL json",
    "SET enable_external_access = true",
    "SET allowed_paths = ['/etc/passwd']",
    "SET temp_directory = '{outside}'",
    "SET VARIABLE x = 1",
    "SET SESSION search_path = 'internal'",
    "SET threads = 1",
    "RESET enable_external_access",
    "PRAGMA enable_profiling",
    "PRAGMA database_list",
    "CALL pragma_version()",
    "CREATE TABLE x AS SELECT 1",
    "CREATE OR REPLACE VIEW contacts AS SELECT 1",
    "CREATE SECRET (TYPE s3)",
    "CREATE MACRO f() AS 1",
    "CREATE OR REPLACE MACRO norm(v) AS 1",
    "CREATE TEMP MACRO norm(v) AS 1",
    "DROP MACRO norm",
    "DROP TABLE internal.committed_contacts",
    "INSERT INTO internal.committed_contacts VALUES ('dead')",
    "COMMENT ON VIEW contacts IS 'x'",
    "DROP VIEW contacts",
    "ALTER VIEW contacts RENAME TO x",
    "INSERT INTO contacts SELECT * FROM contacts",
    "UPDATE contacts SET gap = 0",
    "DELETE FROM contacts",
    "TRUNCATE contacts",
    "BEGIN",
    "CHECKPOINT",
    "VACUUM",
    "PREPARE q AS SELECT 1",
    "EXPLAIN ANALYZE COPY contacts TO '{outside}/stolen.csv'",
    "SELECT 1; COPY contacts TO '{outside}/stolen.csv'",
    "SELECT 1; SELECT 2",
    "SELECT 1 /* */ ; -- \n DROP VIEW contacts",
    "FROM read_text('{outside}/secret.csv')",
    "DESCRIBE SELECT * FROM read_csv('{outside}/secret.csv')",
    "SUMMARIZE SELECT * FROM read_csv('{outside}/secret.csv')",
    "SUMMARIZE '{outside}/secret.csv'",
    "DESCRIBE '{outside}/secret.csv'",
    "SHOW TABLES FROM '{outside}'",
    "SELECT * FROM (DESCRIBE SELECT * FROM read_csv('{outside}/secret.csv'))",
    "SELECT * FROM (SUMMARIZE SELECT * FROM read_csv('{outside}/secret.csv'))",
    "SELECT * FROM read_json_objects('{outside}/secret.csv')",
    "SELECT * FROM read_json_auto('{outside}/secret.csv')",
    "SELECT * FROM read_ndjson_objects('{outside}/secret.csv')",
    "SELECT * FROM parquet_scan('{outside}/secret.csv')",
    "SELECT * FROM parquet_bloom_probe('{outside}/secret.csv', 'x', 1)",
    "SELECT * FROM read_text(current_setting('home_directory') || '{outside}/secret.csv')",
    "SELECT * FROM read_blob('s3://bucket/x')",
    "SELECT * FROM read_blob('hf://x/y')",
    "SELECT * FROM read_text('~/.bashrc')",
    "SELECT * FROM read_text('../../../etc/passwd')",
    "SELECT * FROM query('COPY contacts TO ''{outside}/x.csv''')",
    "SELECT * FROM query('SET threads = 1')",
    "SELECT * FROM query('ATTACH ''{outside}/x.db''')",
    "WITH RECURSIVE t AS (SELECT 1 UNION ALL FROM t, read_text('{outside}/secret.csv')) FROM t",
    "SELECT (FROM read_text('{outside}/secret.csv') LIMIT 1)",
    "SELECT * FROM contacts JOIN LATERAL (SELECT * FROM read_text('{outside}/secret.csv')) ON true",
    "SELECT list(content) FROM read_text('{outside}/secret.csv')",
    "SELECT * FROM contacts WHERE EXISTS (FROM read_text('{outside}/secret.csv'))",
    "VALUES ((SELECT content FROM read_text('{outside}/secret.csv')))",
    "FROM '{outside}/secret.csv' SELECT *",
    "MERGE INTO contacts USING contacts AS c ON true WHEN MATCHED THEN DELETE",
    "EXECUTE q",
    "DEALLOCATE q",
    "COPY (SELECT 1) TO '/dev/stdout'",
    "COPY FROM DATABASE memory TO other",
    "EXPLAIN SELECT * FROM read_text('{outside}/secret.csv')",
    "EXPLAIN ANALYZE SELECT 1",
    "SET GLOBAL lock_configuration = false",
    "SET LOCAL enable_external_access = true",
    "PRAGMA disable_verification",
    "PRAGMA import_database('{outside}')",
    "PRAGMA version",
    "CALL duckdb_extensions()",
    "CALL force_checkpoint()",
    "SELECT * FROM force_checkpoint()",
    "SELECT * FROM disable_logging()",
    "SELECT * FROM which_secret('s3://x', 's3')",
    "SELECT * FROM duckdb_secrets()",
    "SELECT * FROM arrow_scan(0::POINTER, 0::POINTER, 0::POINTER)",
    "SELECT * FROM arrow_scan_dumb(0, 0, 0)",
    "SELECT * FROM pandas_scan(0)",
    "SELECT * FROM pandas_scan(1::POINTER)",
    "SELECT * FROM arrow_scan(1, 2, 3)",
    "SELECT * FROM python_map_function(1)",
    "CREATE TEMP TABLE x AS SELECT 1",
    "CREATE SCHEMA x",
    "CREATE SEQUENCE x",
    "CREATE TYPE t AS INT",
    "CREATE INDEX i ON contacts (gap)",
    "CREATE FUNCTION f() AS 1",
    "CREATE PERSISTENT SECRET (TYPE http)",
    "DROP SECRET x",
    "DROP SCHEMA internal",
    "UPDATE EXTENSIONS",
    "INSTALL json FROM community",
    "COMMIT",
    "ROLLBACK",
    "SELECT * FROM read_csv('{outside}/secret.csv', store_rejects = true)",
    "SELECT * FROM read_parquet('{db}/a.parquet', encryption_config = {{footer_key: 'x'}})",
    "SELECT * FROM read_csv('/proc/self/environ', delim='|')",
    "SELECT * FROM glob('/*')",
    "SELECT * FROM read_text('/proc/self/cmdline')",
    "PIVOT contacts ON site USING count(*)",
    "",
    "-- nothing",
    ";",
]


@pytest.mark.parametrize("attack", ATTACKS)
def test_attacks_are_refused(engine: Engine, folder: Path, attack: str) -> None:
    def listing() -> dict[str, bytes]:
        return {str(file): file.read_bytes() for file in folder.parent.rglob("*") if file.is_file()}

    before = listing()
    with pytest.raises(QueryError) as caught:
        engine.sql(attack.format(outside=folder.parent, db=folder))
    assert "8675309" not in str(caught.value)
    assert "\n" in str(caught.value), "the message says what to do"
    assert listing() == before
    assert engine.sql("SELECT count(*) FROM contacts").rows() == [(7,)]


def test_python_variables_are_not_tables(engine: Engine) -> None:
    secret = pa.table({"secret": [8675309]})
    with pytest.raises(QueryError, match="secret does not exist"):
        engine.sql("SELECT * FROM secret")
    assert secret.num_rows == 1


def test_reading_the_settings_does_not_unlock_them(engine: Engine) -> None:
    external = "SELECT current_setting('enable_external_access'), current_setting('lock_configuration')"
    assert engine.sql(external).rows() == [(False, True)]


@pytest.mark.parametrize(
    ("statement", "found", "remedy"),
    [
        ("SELECT * FROM contact", "contact does not exist", "did you mean 'contacts'"),
        ("SELECT gapp FROM contacts", '"gapp" not found', "did you mean 'gap'"),
        ("SELECT c.gapp FROM contacts c", '"gapp"', "Columns of contacts: .*did you mean 'gap'"),
        ("SELECT sbject FROM (SELECT 1)", '"sbject"', "did you mean 'subject'"),
        ("SELECT * FRO contacts", "syntax error", "LINE 1"),
        ("SELECT cosine(1)", "cosine does not exist", "Did you mean"),
        ("SELECT 'x'::INT", "Could not convert", "schema"),
        ("SELECT '\ud800'", "not UTF-8", "SELECT"),
    ],
)
def test_errors_say_what_and_what_to_do(engine: Engine, statement: str, found: str, remedy: str) -> None:
    with pytest.raises(QueryError, match=found) as caught:
        engine.sql(statement)
    assert caught.match(f"(?s){remedy}")
    assert not str(caught.value).startswith(("Binder", "Catalog", "Parser"))


def test_errors_on_later_rows_are_explained_too(engine: Engine) -> None:
    stream = engine.stream(
        "SELECT (CASE WHEN i > 1500000 THEN 'x' ELSE '1' END)::INT FROM range(2000000) t(i)"
    )
    with pytest.raises(QueryError, match="Could not convert"):
        list(stream)


@pytest.mark.parametrize(
    "statement", ["DESCRIBE contacts", "SHOW TABLES", "SUMMARIZE contacts", "FROM contacts", "VALUES (1)"]
)
def test_other_forms_of_select_work(engine: Engine, statement: str) -> None:
    assert len(engine.sql(statement)) > 0


@pytest.mark.parametrize("first", ["", "FROM (VALUES (1)) UNION ALL "])
def test_an_interrupt_stops_a_long_query(engine: Engine, first: str) -> None:
    endless = first + "SELECT sum(a.i * b.i) FROM range(10000000) a(i), range(10000000) b(i)"
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        list(engine.stream(endless))
    assert engine.sql("SELECT 1").rows() == [(1,)]


def test_a_damaged_file_is_a_clear_error(tmp_path: Path) -> None:
    (tmp_path / "x.parquet").write_bytes(b"PAR1 and nothing else")
    sources = {name: TableSource() for name in TABLES}
    with pytest.raises(QueryError, match="restore the folder"):
        Engine({**sources, "contacts": TableSource(files=(str(tmp_path / "x.parquet"),))})


def test_the_library_allows_what_the_engine_forbids(folder: Path) -> None:
    """The attacks above are real: without the engine's lock DuckDB would read the file."""
    rows = duckdb.connect().execute(f"SELECT * FROM read_csv('{folder.parent}/secret.csv')").fetchall()
    assert rows == [(8675309,)]
