"""A database at an s3:// URL, on a server of object storage that the tests start."""

import multiprocessing
import sys
from collections.abc import Iterator
from pathlib import Path

import duckdb
import pytest
import removed_person
from deltalake.fs import DeltaStorageHandler
from handmade import N_FRAMES, session_tables, trial_tables
from pyarrow.fs import FileSelector
from s3_server import BUCKET, s3_server
from typer.testing import CliRunner

import graspdb
from graspdb.cli import app
from graspdb.store import Outcome, Store, fence, lease
from graspdb.store.location import ObjectStorage
from graspdb.store.lock import alone, writing
from graspdb_queries.object_storage import OPTIONS, read_through
from graspdb_schemas.errors import DatabaseError, QueryError
from graspdb_schemas.tables import TABLES

N_TRIALS = 3


@pytest.fixture(scope="module", autouse=True)
def server() -> Iterator[None]:
    with s3_server() as environment, pytest.MonkeyPatch.context() as patch:
        for name, value in environment.items():
            patch.setenv(name, value)
        yield


@pytest.fixture(scope="module")
def url() -> str:
    """Return a database with three trials."""
    place = f"s3://{BUCKET}/lab/db"
    fill(place, "a")
    return place


def fill(place: str, session: str) -> None:
    store = Store.create_or_open(place)
    store.commit_session(session_tables(session))
    for number in range(N_TRIALS):
        store.commit_trial(trial_tables(number, session=session))


def test_rows_are_those_of_a_database_in_a_folder(url: str, tmp_path: Path) -> None:
    fill(str(tmp_path / "db"), "a")
    with graspdb.open(url) as remote, graspdb.open(tmp_path / "db") as local:
        assert remote.info().rows == local.info().rows
        for name in TABLES:
            own = [c for c in TABLES[name].names if c not in ("ingest_id", "context")]
            query = f"SELECT {', '.join(own)} FROM {name} ORDER BY ALL"
            assert remote.sql(query).arrow().equals(local.sql(query).arrow()), name


def test_the_command_line_takes_the_url(url: str) -> None:
    done = CliRunner().invoke(
        app, ["sql", "SELECT count(*) AS n FROM frames", "--db", url, "--format", "csv"]
    )
    assert done.stdout.split() == ["n", str(N_TRIALS * N_FRAMES)]


def test_an_unchanged_trial_makes_no_version_and_a_forced_one_replaces(url: str) -> None:
    store = Store.open(url)
    store.commit_session(session_tables("a"))
    before = store.snapshot().versions
    assert store.commit_trial(trial_tables(0, session="a")).outcome == Outcome.UNCHANGED
    assert store.snapshot().versions == before
    assert store.commit_trial(trial_tables(0, session="a"), force=True).outcome == Outcome.REPLACED
    assert store.sweep()["frames"] == N_FRAMES
    with graspdb.open(url) as database:
        assert database.info().rows["trials"] == N_TRIALS


def test_writers_at_once_lose_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    monkeypatch.setitem(sys.modules, Path(__file__).stem, sys.modules[__name__])
    place = f"s3://{BUCKET}/shared"
    start = multiprocessing.get_context("spawn").Process
    processes = [start(target=fill, args=(place, session)) for session in ("a", "b")]
    for process in processes:
        process.start()
    for process in processes:
        process.join(120)
    assert [process.exitcode for process in processes] == [0, 0]
    with graspdb.open(place) as database:
        counted = database.sql(
            "SELECT session, count(*) FROM trials GROUP BY session ORDER BY session"
        ).rows()
        assert counted == [("a", N_TRIALS), ("b", N_TRIALS)]
        frames = database.sql("SELECT count(*) FROM frames").rows()
        assert frames == [(2 * N_TRIALS * N_FRAMES,)]


@pytest.mark.parametrize(
    "attack",
    [
        "SELECT * FROM read_text('{url}/trials/_delta_log/00000000000000000000.json')",
        "SELECT * FROM read_parquet('{url}/trials/*.parquet')",
        "SELECT * FROM glob('{url}/**')",
        "SELECT * FROM read_parquet('s3://other/x.parquet')",
        "SELECT * FROM read_text('/etc/hostname')",
        "COPY trials TO '{url}/stolen.csv'",
    ],
)
def test_queries_read_nothing_but_the_snapshot(url: str, attack: str) -> None:
    with graspdb.open(url) as database, pytest.raises(QueryError):
        database.sql(attack.format(url=url))


@pytest.mark.parametrize(
    ("place", "said"),
    [
        (f"s3://{BUCKET}/nothing", "no such folder"),
        ("s3://no-such-bucket/db", "AWS_ENDPOINT_URL"),
        (f"s3://{BUCKET}", "s3://bucket/folder"),
        (f"s3://{BUCKET}/a*b", "s3://bucket/folder"),
        ("gs://bucket/db", "s3://bucket/folder"),
    ],
)
def test_a_place_without_a_database_is_named(place: str, said: str) -> None:
    with pytest.raises(DatabaseError, match=said) as caught:
        graspdb.open(place)
    assert place in str(caught.value)


def test_a_server_that_is_not_there_is_named(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    with pytest.raises(DatabaseError, match=r"127\.0\.0\.1:9"):
        graspdb.open(url)


def test_a_place_with_other_things_is_left_alone(url: str) -> None:
    with pytest.raises(DatabaseError, match="not empty: it holds 'db'"):
        Store.create_or_open(url.removesuffix("/db"))


@pytest.fixture(scope="module")
def person() -> str:
    """Return a database with a person who is to be removed."""
    place = f"s3://{BUCKET}/study/db"
    removed_person.fill(place)
    return place


def object_names(place: str) -> list[str]:
    """Return the names of all objects of a database."""
    found = DeltaStorageHandler(place, OPTIONS).get_file_info_selector(FileSelector("", recursive=True))
    return [info.path for info in found if info.is_file]


def test_earlier_states_are_listed_and_read(person: str) -> None:
    told = CliRunner().invoke(app, ["info", "--history", "--db", person]).stdout.splitlines()
    assert [line.split()[0] for line in told[:-1]] == ["5", "4", "3", "2", "1", "0"]
    assert "1 trials replaced" in told[0]
    with graspdb.open(person, as_of=2) as database:
        assert database.info().rows["trials"] == 2
        assert database.sql("SELECT count(*) FROM frames").rows() == [(2 * N_FRAMES,)]


def test_exports_hold_the_grasps(person: str, tmp_path: Path) -> None:
    with graspdb.open(person) as database:
        assert database.export("parquet", tmp_path / "parquet").counts == {"grasps": 4}
        database.export("duckdb", tmp_path / "views.duckdb")
    # Any other client of DuckDB reads S3 by its extension httpfs.
    with duckdb.connect(str(tmp_path / "views.duckdb"), read_only=True) as views:
        read_through(views, [person])
        assert views.sql("SELECT count(*) FROM grasps").fetchall() == [(4,)]


def leases(place: str) -> list[str]:
    """Return what those who are at work say that they are at."""
    return [name.partition("-")[0] for name in object_names(f"{place}/trials/{lease.LEASES}")]


def test_who_may_be_writing_is_waited_for(person: str, monkeypatch: pytest.MonkeyPatch) -> None:
    storage = DeltaStorageHandler(f"{person}/trials/{lease.LEASES}", OPTIONS)
    storage.open_output_stream("writing-killed").close()
    root = ObjectStorage(person)
    with writing(root):
        assert leases(person) == ["writing", "writing"]
    with monkeypatch.context() as patched:
        patched.setattr(fence, "_PATIENCE", 0)
        with (
            pytest.raises(DatabaseError, match=r"trials/_graspdb/writing-killed is there\. Run again"),
            alone(root),
        ):
            pass
    monkeypatch.setattr(lease, "_LONGEST", -1)
    with alone(root):
        assert leases(person) == ["alone"]
    assert leases(person) == []


def test_nobody_writes_while_young_files_are_deleted(person: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fence, "_PATIENCE", 0)
    store = Store.open(person)
    with alone(store.path):
        with pytest.raises(DatabaseError, match="somebody else is at work"):
            store.commit_trial(trial_tables(7))
        with pytest.raises(DatabaseError, match="somebody else is at work"), alone(store.path):
            pass
        assert leases(person) == ["alone"]


def tables_with_traces(place: str) -> set[str]:
    """Return the tables of a database with objects that have traces of the person."""
    storage = DeltaStorageHandler(place, OPTIONS)
    return {
        name.partition("/")[0]
        for name in object_names(place)
        if removed_person.is_trace(name, storage.open_input_file(name).read())
    }


def test_what_is_removed_leaves_no_byte_and_damage_is_found(person: str) -> None:
    assert len(graspdb.remove(person, "subject", [f"s/{removed_person.PERSON}"]).trials) == 2
    assert tables_with_traces(person) >= {"sessions", "subjects", "hands", "trials", "frames"}
    done = graspdb.optimize(person, retention_hours=0)
    assert done["frames"].swept == 3 * N_FRAMES
    assert (done["frames"].files_after, done["frames"].vacuumed) == (1, 5)
    assert tables_with_traces(person) == set()
    assert graspdb.verify(person).whole
    (file,) = (name for name in object_names(person) if name.startswith("grasps/part"))
    DeltaStorageHandler(person, OPTIONS).delete_file(file)
    assert graspdb.verify(person).tables["grasps"].problems == (f"file {Path(file).name} is missing",)
