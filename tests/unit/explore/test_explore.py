"""`graspdb explore`: it answers whoever has the address, only reads, and says what the API says."""

import re
import threading
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import hostile_database
import mug_database
import pytest
import worked_example
from flask.testing import FlaskClient

import graspdb
from graspdb.explore import Server, create_app
from graspdb.explore.answers import ROWS, Answer, chart, first_rows, suggested
from graspdb.explore.grasps import PAGE, asked, find
from graspdb_queries.named import named_queries
from graspdb_schemas.errors import ParameterError, QueryError

TOKEN = "the-token"
HOST = "localhost"


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[graspdb.Database]:
    folder = tmp_path_factory.mktemp("explore") / "db"
    worked_example.build(folder)
    with graspdb.open(folder) as opened:
        yield opened


def client_of(database: graspdb.Database) -> FlaskClient:
    return create_app(database, TOKEN, {HOST}).test_client()


@pytest.fixture(scope="module")
def client(database: graspdb.Database) -> FlaskClient:
    return client_of(database)


def shown(html: str) -> list[str]:
    """Return the keys of the grasps whose pictures a page shows, in order."""
    return re.findall(r'alt="Picture of grasp ([^"]*)"', html)


@pytest.mark.parametrize(
    "path", ["/", "/wrong/", "/the-toke/", "/the-token2/sql", "/favicon.ico", "/the-tokén/"]
)
def test_a_wrong_token_is_refused_and_told_nothing(client: FlaskClient, path: str) -> None:
    answer = client.get(path)
    assert answer.status_code == 403
    assert answer.content_type.startswith("text/plain")
    assert TOKEN not in answer.text
    assert "anna" not in answer.text


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:4711", "127.0.0.1", "127.0.0.1:80", "localhost:4711", ""]
)
def test_another_host_header_is_refused(client: FlaskClient, host: str) -> None:
    answer = client.get(f"/{TOKEN}/", headers={"Host": host})
    assert answer.status_code in (400, 403)
    assert "anna" not in answer.text


@pytest.mark.parametrize("method", ["POST", "PUT", "PATCH", "DELETE"])
def test_nothing_can_be_sent(client: FlaskClient, method: str) -> None:
    for page in ("", "sql", "grasp", "query"):
        assert client.open(f"/{TOKEN}/{page}", method=method).status_code == 405


@pytest.mark.parametrize(
    "statement",
    [
        "INSERT INTO grasps VALUES (1)",
        "DELETE FROM internal.empty_markers",
        "UPDATE trials SET status = 'ok'",
        "CREATE TABLE t AS SELECT 1",
        "DROP VIEW grasps",
        "COPY grasps TO 'out.csv'",
        "ATTACH 'other.db'",
        "EXPORT DATABASE 'out'",
        "INSTALL httpfs",
        "SET enable_external_access = true",
        "PRAGMA threads = 1",
        "SELECT 1; DROP VIEW grasps",
        "SELECT * FROM read_csv('/etc/passwd')",
        "SELECT * FROM '/etc/passwd'",
        "SELECT * FROM read_text('/etc/passwd')",
        "CALL pragma_version()",
    ],
)
def test_sql_that_writes_or_leaves_the_database_is_refused(
    client: FlaskClient, database: graspdb.Database, statement: str
) -> None:
    before = database.info()
    answer = client.get(f"/{TOKEN}/sql", query_string={"statement": statement})
    assert answer.status_code == 400
    assert 'role="alert"' in answer.text
    assert "root:" not in answer.text
    assert database.info() == before
    assert not Path("out.csv").exists()


def test_every_page_says_what_may_run_in_it(client: FlaskClient) -> None:
    for page in ("", "queries", "sql", "style.css", "explore.js"):
        headers = client.get(f"/{TOKEN}/{page}").headers
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self'" in policy
        assert "unsafe" not in policy
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert "Access-Control-Allow-Origin" not in headers


@pytest.mark.parametrize(
    ("form", "where"),
    [
        ({}, "TRUE"),
        ({"subject": "ben"}, "subject = 'ben'"),
        ({"subject": "ben", "object": "mug"}, "subject = 'ben' AND object = 'mug'"),
        ({"side": "left"}, "side = 'left'"),
        ({"digit": ["thumb", "ring"]}, "list_has_all(digits, ['thumb', 'ring'])"),
        ({"where": "hull_volume > 3e-5 OR side = 'left'"}, "hull_volume > 3e-5 OR side = 'left'"),
        (
            {"object": "mug", "where": "hull_volume > 3e-5 OR side = 'left'"},
            "object = 'mug' AND hull_volume > 3e-5",
        ),
        ({"where": "hull_volume > 3e-5 -- large ones"}, "hull_volume > 3e-5"),
        ({"subject": "nobody'; DROP VIEW grasps --"}, "FALSE"),
    ],
)
def test_a_filter_shows_the_grasps_that_sql_gives(
    client: FlaskClient, database: graspdb.Database, form: dict[str, str], where: str
) -> None:
    answer = client.get(f"/{TOKEN}/", query_string=form)
    wanted = [row[0] for row in database.sql(f"SELECT grasp FROM grasps WHERE {where}").rows()]
    assert answer.status_code == 200
    assert sorted(shown(answer.text)) == sorted(wanted)
    assert f'<b id="total">{len(wanted)}</b>' in answer.text


@pytest.mark.parametrize(
    "where", ["nonsense", "1", "TRUE) OR (TRUE", "subject = 'a'; DROP VIEW grasps", "SELECT 1"]
)
def test_a_filter_that_is_no_condition_is_explained(client: FlaskClient, where: str) -> None:
    answer = client.get(f"/{TOKEN}/", query_string={"where": where})
    assert answer.status_code == 400
    assert 'role="alert">' in answer.text
    assert shown(answer.text) == []


def test_pages_of_grasps_have_each_of_them_once(tmp_path: Path) -> None:
    from handmade import session_tables, trial_tables

    from graspdb.store import Store

    store = Store.create_or_open(tmp_path / "db")
    store.commit_session(session_tables())
    store.commit_trials([trial_tables(number) for number in range(2 * PAGE + 3)])
    with graspdb.open(tmp_path / "db") as database:
        pages = [find(database, asked({}, []), number) for number in (1, 2, 3)]
        assert [len(page.rows) for page in pages] == [PAGE, PAGE, 3]
        keys = [row["grasp"] for page in pages for row in page.rows]
        assert len(set(keys)) == len(keys) == pages[0].total == 2 * PAGE + 3
        assert find(database, asked({}, []), 99) == pages[2]
        assert find(database, asked({}, []), -1) == pages[0]


@pytest.fixture(scope="module")
def mugs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[graspdb.Database]:
    with graspdb.open(mug_database.build(tmp_path_factory.mktemp("mug") / "db")) as opened:
        yield opened


@pytest.mark.parametrize("by", ["feature", "contact"])
def test_more_like_this_shows_the_grasps_that_the_api_gives(mugs: graspdb.Database, by: str) -> None:
    asked_for = {"key": "made/handle0/right/0", "by": by}
    answer = client_of(mugs).get(f"/{TOKEN}/grasp", query_string=asked_for)
    expected = mugs.similar("made/handle0/right/0", k=12, by=by)
    assert answer.status_code == 200
    assert expected.hits
    assert shown(answer.text) == [hit.grasp for hit in expected.hits]
    assert f"cost {expected.hits[0].cost:.3g}" in answer.text


def test_a_search_without_an_answer_says_why(mugs: graspdb.Database) -> None:
    asked_for = {"key": "made/handle0/right/0", "by": "posture"}
    answer = client_of(mugs).get(f"/{TOKEN}/grasp", query_string=asked_for)
    with pytest.raises(QueryError) as refused:
        mugs.similar("made/handle0/right/0", by="posture")
    assert answer.status_code == 400
    assert str(refused.value).splitlines()[0] in answer.text


def test_a_respect_that_there_is_not_is_explained(client: FlaskClient, database: graspdb.Database) -> None:
    key = database.sql("SELECT min(grasp) FROM grasps").rows()[0][0]
    answer = client.get(f"/{TOKEN}/grasp", query_string={"key": key, "by": "colour"})
    assert answer.status_code == 400
    assert "feature, posture, contact, all" in answer.text


@pytest.mark.parametrize(
    ("page", "key"), [("grasp", "s/nobody"), ("viewer", "s/nobody"), ("query?name=", "x")]
)
def test_what_there_is_not_is_named(client: FlaskClient, page: str, key: str) -> None:
    path = f"{page}{key}" if "?" in page else f"{page}?key={key}"
    answer = client.get(f"/{TOKEN}/{path}")
    assert answer.status_code == 400
    assert key in answer.text


def test_a_picture_of_no_grasp_is_not_found(client: FlaskClient) -> None:
    assert client.get(f"/{TOKEN}/picture?key=nobody").status_code == 404


@pytest.mark.parametrize("name", sorted(named_queries()))
def test_every_named_query_has_its_answer(client: FlaskClient, database: graspdb.Database, name: str) -> None:
    given = dict(named_queries()[name].example)
    answer = client.get(
        f"/{TOKEN}/query", query_string={"name": name, **{f"p.{k}": v for k, v in given.items()}}
    )
    expected = database.query(name, **given)
    assert answer.status_code == 200
    assert answer.text.count("<tr>") == 1 + min(len(expected), ROWS)
    for column in expected.columns:
        assert re.search(rf"<th[^>]*>{column}</th>", answer.text)


def test_a_query_with_a_wrong_parameter_is_explained(client: FlaskClient) -> None:
    answer = client.get(f"/{TOKEN}/query", query_string={"name": "where_grasped", "p.radius": "wide"})
    assert answer.status_code == 400
    assert "parameter radius: found &#39;wide&#39;" in answer.text


def test_sql_has_its_rows_and_a_chart(client: FlaskClient) -> None:
    statement = "SELECT subject, count(*) AS n FROM grasps GROUP BY subject ORDER BY subject"
    answer = client.get(f"/{TOKEN}/sql", query_string={"statement": statement})
    assert re.findall(r"<td[^>]*>([^<]*)</td>", answer.text) == ["anna", "3", "ben", "3"]
    assert re.findall(r"<title>(anna: 3|ben: 3)</title>", answer.text) == ["anna: 3", "ben: 3"]


def test_long_answers_are_cut_and_say_so(client: FlaskClient) -> None:
    answer = client.get(f"/{TOKEN}/sql", query_string={"statement": "SELECT range AS i FROM range(1000000)"})
    assert answer.text.count("<tr>") == ROWS + 1
    assert f"The first {ROWS} rows" in answer.text


def answer_to(database: graspdb.Database, statement: str) -> Answer:
    with database.stream(statement) as rows:
        return first_rows(rows, rows.schema)


@pytest.mark.parametrize(
    ("statement", "form"),
    [
        ("SELECT 'a' AS name, 1 AS n UNION ALL SELECT 'b', 2", ("bars", "name", "n", "")),
        ("SELECT i AS x, i * i AS y FROM range(9) t(i)", ("points", "x", "y", "")),
        ("SELECT i AS x, i * i AS y, 'g' || i % 2 AS g FROM range(99) t(i)", ("points", "x", "y", "g")),
        ("SELECT 'a' AS name", None),
        ("SELECT 1 AS n WHERE FALSE", None),
    ],
)
def test_the_chart_suits_the_answer(
    database: graspdb.Database, statement: str, form: tuple[str, str, str, str] | None
) -> None:
    answer = answer_to(database, statement)
    found = suggested(answer)
    assert (None if found is None else (found.kind, found.x, found.y, found.by)) == form
    if found is not None:
        drawn = chart(answer, found)
        assert drawn is not None
        assert len(drawn.marks) == len(answer.rows)


def test_names_in_the_data_are_text_in_every_page(tmp_path: Path) -> None:
    with graspdb.open(hostile_database.build(tmp_path / "db")) as database:
        client, name = client_of(database), hostile_database.SCRIPT
        key = database.sql("SELECT grasp FROM grasps").rows()[0][0]
        pages = {
            "": {"where": f"subject = '{name}'"},
            "grasp": {"key": key, "by": name},
            "query": {"name": "digits_used"},
            "sql": {"statement": f"SELECT *, '{name}' AS \"{name}\" FROM grasps"},
        }
        for page, arguments in pages.items():
            html = client.get(f"/{TOKEN}/{page}", query_string=arguments).text
            assert "&lt;script&gt;alert(1)&lt;/script&gt;" in html, page
            assert "<script>" not in html, page
            assert "<img src=x" not in html, page
            assert set(re.findall(r"<script[^>]*>", html)) == {f'<script src="/{TOKEN}/explore.js" defer>'}


def test_the_server_listens_on_loopback_with_a_new_token_each_time(database: graspdb.Database) -> None:
    servers = [Server(database), Server(database)]
    addresses = [server.address for server in servers]
    tokens = [re.fullmatch(r"http://127\.0\.0\.1:\d+/([\w-]{20,})/", address) for address in addresses]
    assert None not in tokens
    assert len({match[1] for match in tokens if match}) == 2
    thread = threading.Thread(target=servers[0].serve)
    thread.start()
    try:
        with urllib.request.urlopen(addresses[0]) as answer:
            assert len(shown(answer.read().decode())) == 6
        with pytest.raises(ParameterError, match="a port that is free"):
            Server(database, int(addresses[0].split(":")[2].split("/")[0]))
    finally:
        servers[0].stop()
        thread.join()
        servers[1].close()
