"""Named queries: their heads are true, their answers right on small data worked out by hand."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from handmade import session_tables, trial_tables

import graspdb
from graspdb.store import Store
from graspdb_queries.named import Column, Parameter, named_queries, named_query, parse_query
from graspdb_schemas.errors import ParameterError


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[graspdb.Database]:
    """Return anna and ben grasping mug and jug: pinches, and one whole-hand grasp."""
    path: Path = tmp_path_factory.mktemp("named") / "db"
    store = Store.create_or_open(path)
    store.commit_session(session_tables(objects=["mug", "jug"]))
    whole = [f"{digit}_tip" for digit in ("thumb", "index", "middle", "ring", "little")]
    store.commit_trials(
        [
            trial_tables(1, sites=["thumb_tip", "index_tip"], residual_rms=0.001, n_frames=100),
            trial_tables(2, sites=["thumb_tip", "index_tip", "index_pip"], residual_rms=0.003, n_frames=300),
            trial_tables(3, sites=whole, residual_rms=None, status="rejected", missing_fraction=0.5),
            trial_tables(1, subject="ben", object_="jug", sites=["thumb_tip", "ring_tip"]),
        ]
    )
    with graspdb.open(path) as opened:
        yield opened


@pytest.mark.parametrize("name", sorted(named_queries()))
def test_columns_are_those_of_the_head(database: graspdb.Database, name: str) -> None:
    query = named_query(name)
    result = database.query(name, **dict(query.example))
    assert list(result.columns) == [column.name for column in query.columns]
    assert query.title.endswith("?")
    assert all(column.doc for column in query.columns)


@pytest.mark.parametrize("name", sorted(named_queries()))
def test_queries_answer_about_an_empty_database(tmp_path: Path, name: str) -> None:
    Store.create_or_open(tmp_path)
    with graspdb.open(tmp_path) as empty:
        assert empty.query(name, **dict(named_query(name).example)).rows() == []


def test_contact_frequency(database: graspdb.Database) -> None:
    rows = {(row[0], row[1]): row[2:] for row in database.query("contact_frequency").rows()}
    assert rows["mug", "thumb_tip"] == ("thumb", 3, 3, 1.0)
    assert rows["mug", "index_pip"] == ("index", 3, 1, pytest.approx(1 / 3))
    assert rows["jug", "ring_tip"] == ("ring", 1, 1, 1.0)
    assert ("jug", "index_tip") not in rows
    assert {row[0] for row in database.query("contact_frequency", object="jug").rows()} == {"jug"}
    assert database.query("contact_frequency", object="jug", subject="anna").rows() == []


def test_digits_used(database: graspdb.Database) -> None:
    assert database.query("digits_used").rows() == [
        ("jug", "ben", "thumb+ring", 2, 1, 1.0),
        ("mug", "anna", "thumb+index", 2, 2, pytest.approx(2 / 3)),
        ("mug", "anna", "thumb+index+middle+ring+little", 5, 1, pytest.approx(1 / 3)),
    ]


def test_session_overview(database: graspdb.Database) -> None:
    anna, ben = database.query("session_overview", session="s").rows()
    session, subject, trials, rejected, grasps, duration, missing, residual, worst, worst_residual = anna
    assert (session, subject, trials, rejected, grasps) == ("s", "anna", 3, 1, 3)
    assert duration == pytest.approx(0.09)
    # Frames weigh: 100 and 300 with 1/8 missing, 4 with 1/2; residuals of the two tracked trials alone.
    assert missing == pytest.approx((400 * 0.125 + 4 * 0.5) / 404)
    assert residual == pytest.approx(((100 * 0.001**2 + 300 * 0.003**2) / 400) ** 0.5)
    assert (worst, worst_residual) == ("s/anna_mug_2", 0.003)
    assert ben[:3] == ("s", "ben", 1)
    assert database.query("session_overview", session="other").rows() == []


def test_wrong_names_and_parameters(database: graspdb.Database) -> None:
    with pytest.raises(ParameterError, match="did you mean 'digits_used'"):
        database.query("digit_used")
    with pytest.raises(ParameterError, match="did you mean 'object'"):
        database.query("digits_used", objekt="mug")


HEAD = """-- Which?
--
-- Parameters:
--   n      integer = 3     how many
--   factor number          times what
--   all    boolean = false whether all
--
-- Columns:
--   a  first
--   b  second
--
-- More to know,
-- on two lines.

SELECT 1 -- not the head
"""


def test_heads_are_parsed() -> None:
    query = parse_query("q", HEAD)
    assert query.title == "Which?"
    assert query.parameters == (
        Parameter("n", "integer", "how many", default=3),
        Parameter("factor", "number", "times what", required=True),
        Parameter("all", "boolean", "whether all", default=False),
    )
    assert query.columns == (Column("a", "first"), Column("b", "second"))
    assert query.notes == "More to know, on two lines."
    assert query.sql == "SELECT 1 -- not the head"


def test_values_are_read_by_kind() -> None:
    query = parse_query("q", HEAD)
    assert query.bind({"factor": "2.5"}) == {"n": 3, "factor": 2.5, "all": False}
    assert query.bind({"factor": 1, "n": "7", "all": "yes"}) == {"n": 7, "factor": 1.0, "all": True}
    for wrong in ({}, {"factor": "x"}, {"factor": 1, "n": "2.5"}, {"factor": 1, "all": "maybe"}):
        with pytest.raises(ParameterError):
            query.bind(wrong)


@pytest.mark.parametrize(
    "text", ["SELECT 1", "-- Title?\n\nSELECT 1", "-- T?\n--\n-- Columns:\n--   lonely\n\nSELECT 1"]
)
def test_incomplete_heads_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"q\.sql"):
        parse_query("q", text)
