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


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a database's folder with something beside it that is nobody's business."""
    tmp_path = tmp_path_factory.mktemp("attacked")
    (tmp_path / "secret.csv").write_text("secret\n8675309\n")
    pq.write_table(pa.table({"secret": [8675309]}), tmp_path / "secret.parquet")
    (tmp_path / "db").mkdir()
    (tmp_path / "db" / "link.csv").symlink_to(tmp_path / "secret.csv")
    (tmp_path / "db" / "notes.txt").write_text("not part of the snapshot")
    return tmp_path / "db"


@pytest.fixture(scope="module")
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
    "WITH x AS (COPY (SELECT 1) TO '{db}/a.parquet' (FORMAT csv, USE_TMP_FILE false)) FROM x",
    "WITH x AS MATERIALIZED (COPY (SELECT 1) TO '{db}/b.parquet' (USE_TMP_FILE false)) SELECT 1",
    "WITH x AS (COPY contacts TO '{outside}/stolen.csv') SELECT 1",
    "WITH x AS (INSERT INTO internal.committed_contacts VALUES ('dead') RETURNING *) FROM x",
    "WITH x AS (DELETE FROM internal.committed_contacts RETURNING *) FROM x",
    "WITH x AS (UPDATE internal.committed_contacts SET ingest_id = 'dead') SELECT 1",
    "WITH x AS (TRUNCATE internal.committed_contacts) SELECT 1",
    "WITH y AS (SELECT 1), x AS (WITH y AS (SELECT 1) DELETE FROM internal.committed_contacts) FROM y",
    "WITH x AS (DELETE FROM internal.committed_contacts RETURNING *) FROM x UNION ALL SELECT 'x'",
    "/* */ wItH x(a) aS (dElEtE fRoM internal.committed_contacts rEtUrNiNg *) SELECT 'DELETE', a FROM x",
    "FROM (WITH x AS (DELETE FROM internal.committed_contacts RETURNING *) FROM x)",
    "SELECT * FROM query('WITH x AS (DELETE FROM internal.committed_contacts RETURNING *) FROM x')",
    "SELECT * FROM json_execute_serialized_sql(json_serialize_sql("
    "'WITH x AS (DELETE FROM internal.committed_contacts RETURNING *) FROM x'))",
    "SELECT * FROM JSON_execute_serialized_sql(json_serialize_sql("
    "'WITH x AS (COPY (SELECT 1) TO ''{db}/a.parquet'' (USE_TMP_FILE false)) FROM x'))",
    "SELECT * FROM query('FROM json_execute_serialized_sql(json_serialize_sql("
    "''WITH x AS (DELETE FROM internal.committed_contacts RETURNING *) FROM x''))')",
    "SELECT * FROM system.main.\"query\"('SELECT 1')",
    "SELECT * FROM contacts, LATERAL query('SELECT 1')",
    "SELECT (SELECT count(*) FROM json_execute_serialized_sql(json_serialize_sql('SELECT 1')))",
    "WITH x AS (FROM \"json_execute_serialized_sql\"(json_serialize_sql('SELECT 1'))) FROM x",
    "PRAGMA json_execute_serialized_sql('x')",
    "PRAGMA copy_database('memory', 'x')",
    "SELECT * FROM read_duckdb('{outside}/secret.csv')",
    "FROM '{outside}/other.duckdb'",
    "SELECT * FROM read_single_csv_file('{outside}/secret.csv')",
    "SELECT * FROM read_single_json_file('{outside}/secret.csv')",
    "SELECT * FROM read_single_parquet_file('{outside}/secret.parquet')",
    "SELECT * FROM read_json_objects_auto('{outside}/secret.csv')",
    "SELECT * FROM read_ndjson_auto('{outside}/secret.csv')",
    "SELECT * FROM parquet_full_metadata('{outside}/secret.parquet')",
    "SELECT * FROM create_external_resource('file')",
    "SELECT * FROM register_external_resource_type('x')",
    "SELECT * FROM deregister_external_resource('x')",
    "SELECT * FROM disable_profiling()",
    "SELECT * FROM duckdb_extension_repositories()",
    "SELECT * FROM pragma_table_info('{outside}/secret.csv')",
    "CREATE VIEW v AS SELECT * FROM read_text('{outside}/secret.csv')",
    "CREATE TEMP VIEW v AS SELECT * FROM read_text('{outside}/secret.csv')",
    "CREATE MACRO f() AS TABLE SELECT * FROM read_text('{outside}/secret.csv')",
    "CREATE TEMP MACRO f() AS (SELECT content FROM read_text('{outside}/secret.csv'))",
    "WITH v AS MATERIALIZED (FROM read_text('{outside}/secret.csv')) FROM v",
    "WITH v(x) AS NOT MATERIALIZED (FROM glob('{outside}/*')) SELECT count(*) FROM v",
    "SELECT list_transform([1], lambda x: (SELECT content FROM read_text('{outside}/secret.csv')))",
    "SELECT * FROM contacts ORDER BY (SELECT content FROM read_text('{outside}/secret.csv'))",
    "SELECT * FROM contacts LIMIT (SELECT length(content) FROM read_text('{outside}/secret.csv'))",
    "SELECT count(*) FILTER (EXISTS (FROM read_text('{outside}/secret.csv'))) FROM contacts",
    "SELECT * FROM read_csv('http://127.0.0.1:9/x.csv')",
    "SELECT * FROM read_parquet('s3://bucket/x.parquet')",
    "SELECT * FROM read_text('gcs://bucket/x')",
    "SELECT * FROM read_text('az://bucket/x')",
    "SELECT * FROM 'https://example.org/x.parquet'",
    "ATTACH 'https://example.org/x.db'",
    "ATTACH 'postgres:dbname=x' (TYPE postgres)",
    "LOAD json",
    "SET extension_directory = '{outside}'",
    "SET custom_extension_repository = '{outside}'",
    "SET log_query_path = '{outside}/log'",
    "SET allowed_directories = ['/']",
    "SET secret_directory = '{outside}'",
    "EXPORT DATABASE '{outside}/export' (FORMAT parquet)",
    "COPY (FROM contacts) TO '{outside}/stolen' (FORMAT parquet, PARTITION_BY (site))",
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
    "statement",
    [
        "DESCRIBE contacts",
        "SHOW TABLES",
        "SUMMARIZE contacts",
        "FROM contacts",
        "VALUES (1)",
        "WITH RECURSIVE r AS (SELECT 1 AS i UNION ALL SELECT i + 1 FROM r WHERE i < 3) FROM r",
        "WITH x AS MATERIALIZED (FROM contacts) FROM x UNION ALL BY NAME FROM x",
        "PIVOT contacts ON site IN ('thumb_tip') USING count(*)",
        "FROM query_table(['contacts'])",
        """SELECT '"type":"DELETE_QUERY_NODE","function_name":"query"' AS "copy", 1 AS query FROM contacts""",
        f"SELECT {' + '.join(['1'] * 900)}",
    ],
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
