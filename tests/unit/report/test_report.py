"""The report on a session says what the database says, of that session alone, and escapes every name."""

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import hostile_database
import pytest
import worked_example
from handmade import session_tables, trial_tables

import graspdb
from graspdb.output import OutputError
from graspdb.report import SessionReport, read_report, report_page, write_report
from graspdb.report.density import contact_densities
from graspdb.store import Store
from graspdb.validation.contacts import contact_errors
from graspdb_ingest.trial_tables import TrialTables
from graspdb_schemas.errors import QueryError


class Page(HTMLParser):
    """The elements and the text of a page, as a browser would take them."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.open: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep an element with its attributes."""
        self.elements.append((tag, dict(attrs)))
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Leave an element, and those in it that were not closed."""
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        """Keep a text, unless it is style."""
        if "style" not in self.open:
            self.texts.append(data)

    @property
    def text(self) -> str:
        """All text of the page."""
        return " ".join(self.texts)


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[graspdb.Database]:
    """Return the worked example beside a session of another name, with trials of its own."""
    folder = tmp_path_factory.mktemp("report") / "db"
    worked_example.build(folder)
    store = Store.create_or_open(folder)
    store.commit_session(session_tables("other", subjects=["anna"], objects=["mug"]))
    store.commit_trials([trial_tables(7, session="other")])
    with graspdb.open(folder) as opened:
        yield opened


@pytest.fixture(scope="module")
def report(database: graspdb.Database) -> SessionReport:
    return read_report(database, "s")


def test_it_counts_what_sql_counts(database: graspdb.Database, report: SessionReport) -> None:
    counted = database.sql(
        "SELECT subject, count(*), count(*) FILTER (status = 'rejected'), sum(n_grasps) "
        "FROM trials WHERE session = 's' GROUP BY subject ORDER BY subject"
    ).rows()
    assert [(s.subject, s.n_trials, s.n_rejected, s.n_grasps) for s in report.subjects] == counted
    assert sum(o.n_trials for o in report.objects) == len(report.quality.trials) == 9
    grasps = database.sql("SELECT grasp FROM grasps WHERE session = 's'").rows()
    assert sorted(grasp.grasp for grasp in report.grasps) == sorted(row[0] for row in grasps)


def test_no_row_of_another_session_is_in_it(report: SessionReport) -> None:
    keys = [g.grasp for g in report.grasps] + [t.trial for t in (*report.quality.trials, *report.timelines)]
    assert keys
    assert all(key.startswith("s/") for key in keys)


def test_a_part_of_a_database_is_a_database(database: graspdb.Database) -> None:
    with database.session("other") as part:
        assert part.info().rows["grasps"] == 1
        assert part.sql("SELECT session FROM objects").rows() == [("other",)]
        assert part.grasp("other/anna_mug_7/right/0").object == "mug"
    assert database.info().rows["grasps"] == 7


def test_a_session_that_is_not_there_is_named_with_those_that_are(database: graspdb.Database) -> None:
    with pytest.raises(QueryError, match=r"'othr'; did you mean 'other'\?\nIts sessions: other, s\."):
        read_report(database, "othr")


def test_rejected_trials_stand_with_their_reasons(report: SessionReport) -> None:
    assert [(t.trial, t.reasons) for t in report.quality.rejected] == [
        ("s/anna_mug_3", ("hand not tracked",))
    ]
    assert ("s/anna_mug_3", ("hand not tracked", "50 % of the hand markers missing")) in [
        (again.trial, again.why) for again in report.quality.rerecord
    ]


def test_markers_that_are_never_seen_are_missing_in_every_frame(report: SessionReport) -> None:
    # Of the two markers of every made-up trial the first is always seen, the second never.
    assert report.quality.missing == {"a": 0.0, "b": 1.0}


def test_time_lines_have_the_apertures_and_events_of_the_frames(report: SessionReport) -> None:
    line = next(line for line in report.timelines if line.trial == "s/anna_mug_1")
    curve = line.curves["right"]
    assert curve.times == pytest.approx(worked_example.TIMES)
    assert curve.aperture == pytest.approx(worked_example.APERTURES)
    assert [(hold.grasp, hold.onset, hold.lift) for hold in line.holds] == [
        ("s/anna_mug_1/right/0", 0.3, 0.5)
    ]
    assert {(touch.digit, touch.begin) for touch in line.touches} == {("thumb", 0.3), ("index", 0.4)}


def test_densities_are_those_of_the_query(database: graspdb.Database) -> None:
    with database.session("s") as part:
        found = {density.object: density for density in contact_densities(part)}
        assert sorted(found) == ["jug", "mug"]
        for name, density in found.items():
            asked = part.query("where_grasped", object=name).table.sort_by("point")
            assert density.density.tolist() == asked["contact_density"].to_pylist()
            assert density.points[:, 0].tolist() == asked["x"].to_pylist()


def test_table_1_is_that_of_validate(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "db")
    store.commit_session(session_tables())
    store.commit_trials([trial_tables(number, subject="anna") for number in range(3)])
    with graspdb.open(tmp_path / "db") as measured:
        report = read_report(measured, "s")
        assert report.table_1 == contact_errors(measured)
    assert [error.all_points.n for error in report.table_1] == [3, 3]
    page = Page(report_page(report, {}, {}))
    assert "thumb+index" in page.text
    mean = 1e3 * report.table_1[0].all_points.mean
    assert f"{mean:.1f}" in page.text


def test_without_measured_contacts_there_is_no_table_1(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "db")
    store.commit_session(session_tables())
    store.commit_trials([trial_tables(1, sites=[])])
    with graspdb.open(tmp_path / "db") as database:
        report = read_report(database, "s")
    assert report.table_1 == ()
    assert "centres of pressure" not in report_page(report, {}, {})


def test_a_session_of_rejected_trials_has_a_report(tmp_path: Path) -> None:
    store = Store.create_or_open(tmp_path / "db")
    store.commit_session(session_tables())
    tables = trial_tables(
        1, object_=None, status="rejected", reasons=["no markers"], residual_rms=None
    ).tables

    store.commit_trials([TrialTables({"trials": tables["trials"]})])
    with graspdb.open(tmp_path / "db") as database:
        write_report(database, "s", tmp_path / "report.html")
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "no markers" in page.text
    assert "No grasp was found in this session." in page.text


def test_every_name_is_shown_as_it_is_and_nothing_of_it_runs(tmp_path: Path) -> None:
    with graspdb.open(hostile_database.build(tmp_path / "db")) as database:
        write_report(database, "s", tmp_path / "report.html")
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    names = (hostile_database.SCRIPT, hostile_database.IMAGE, hostile_database.AMPERSAND)
    assert [name for name in names if name not in page.text] == []
    assert "script" not in {tag for tag, _ in page.elements}
    assert [name for _, attributes in page.elements for name in attributes if name.startswith("on")] == []


def test_the_page_is_whole_and_asks_nobody_for_anything(database: graspdb.Database, tmp_path: Path) -> None:
    write_report(database, "s", tmp_path / "report.html")
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    addresses = [
        str(attributes[name])
        for tag, attributes in page.elements
        for name in ("src", "href")
        if name in attributes
    ]
    assert all(re.match(r"data:image/webp;base64,|#", address) for address in addresses)
    pictured = [attributes["alt"] for tag, attributes in page.elements if tag == "img"]
    assert sum(str(alt).startswith("Grasp s/") for alt in pictured) == 6
    ids = {attributes.get("id") for _, attributes in page.elements}
    assert {address[1:] for address in addresses if address.startswith("#")} <= ids


def test_a_report_that_cannot_be_written_says_so(database: graspdb.Database, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"no/report\.html: cannot be written"):
        write_report(database, "s", tmp_path / "no" / "report.html")
