"""The pages: grasps to filter, one grasp and those like it, named queries, SQL."""

from collections.abc import Callable
from functools import lru_cache, partial
from importlib import resources
from threading import Lock
from typing import Any, Final

from flask import Blueprint, Response, abort, request, url_for

from graspdb.database import Database
from graspdb.explore import grasps
from graspdb.explore.answers import KINDS, Answer, ChartForm, chart, first_rows, suggested
from graspdb.explore.guard import VIEWER
from graspdb.pages.templates import render
from graspdb.thumbnails import ShapeReader, draw
from graspdb.view.reading import SceneReader
from graspdb_queries.named import named_queries, named_query
from graspdb_queries.similar.answer import Similar
from graspdb_schemas.errors import GraspDBError, QueryError
from graspdb_schemas.vocabulary import DIGITS

_PICTURES_KEPT: Final = 4000
"""Pictures that are kept, of about 5 kB."""

_SMALL, _LARGE = 160, 420
"""Sides of pictures [pixel]."""

_ANSWERED, _REFUSED = 200, 400

_HITS: Final = 12
"""Grasps like one that are shown."""

RESPECTS: Final = {
    "feature": "graspable feature",
    "posture": "posture",
    "contact": "contacts",
    "all": "all three",
}
"""What grasps are compared by, and what that is called."""

_EXAMPLE: Final = """SELECT object, subject, count(*) AS grasps, 1e6 * avg(hull_volume) AS mean_cm3
FROM grasps
GROUP BY ALL
ORDER BY ALL"""

_SCHEMA: Final = """
    SELECT table_name, column_name, comment
    FROM duckdb_columns()
    WHERE schema_name = 'main' AND column_name <> 'ingest_id'
    ORDER BY table_name, column_index
"""


class Pages:
    """The pages of one database.

    Parameters
    ----------
    database : Database
        The database.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._info = database.info()
        self._shapes = ShapeReader(database)
        self._choices = lru_cache(1)(partial(grasps.choices, database))
        self._picture = lru_cache(_PICTURES_KEPT)(self._drawn)
        # A search keeps what it read; two at once would read it twice.
        self._searching = Lock()
        self._scenes = SceneReader(database)
        self._reading = Lock()

    def blueprint(self) -> Blueprint:
        """Return the addresses of the pages; all of them can only be read."""
        addresses: dict[str, Callable[[], Any]] = {
            "": self.grasps,
            "grasp": self.grasp,
            "picture": self.picture,
            "viewer": self.viewer,
            "queries": self.queries,
            "query": self.query,
            "sql": self.sql,
            "style.css": self.style,
            "explore.js": self.script,
        }
        pages = Blueprint("explore", __name__)
        for address, view in addresses.items():
            pages.add_url_rule(f"/{address}", view.__name__, view, methods=["GET"])
        return pages

    def grasps(self) -> tuple[str, int]:
        """Show the grasps that pass a filter."""
        wanted = grasps.asked(request.args, request.args.getlist("digit"))
        try:
            page, problem = grasps.find(self._database, wanted, request.args.get("page", 1, int)), ""
        except QueryError as error:
            page, problem = grasps.Page(0, 1, 1, ()), str(error)
        kept: dict[str, Any] = {**wanted.chosen, "digit": list(wanted.digits), "where": wanted.where}
        return self._render(
            "grasps.html",
            here="grasps",
            wanted=wanted,
            page=page,
            problem=problem,
            choices=self._choices(),
            digits=DIGITS,
            turn=lambda number: url_for("explore.grasps", page=number, **kept),
        )

    def grasp(self) -> tuple[str, int]:
        """Show one grasp, and those like it."""
        key = request.args.get("key", "")
        by = request.args.get("by", "")
        found = self._database.grasp(key)
        row = self._database.sql("SELECT * FROM grasps WHERE grasp = $key", key=key).table.to_pylist()[0]
        like, problem = None, ""
        if by:
            try:
                like = self._similar(key, by)
            except GraspDBError as error:
                problem = str(error)
        return self._render(
            "grasp.html", here="", grasp=found, row=row, by=by, respects=RESPECTS, like=like, problem=problem
        )

    def picture(self) -> Response:
        """Return the picture of a grasp."""
        size = _LARGE if "large" in request.args else _SMALL
        content = self._picture(request.args.get("key", ""), size)
        response = Response(content, content_type="image/webp")
        response.headers["Cache-Control"] = "private, max-age=3600"
        return response

    def viewer(self) -> Response:
        """Return the viewer's page of a grasp."""
        from graspdb.view.page import grasp_page

        with self._reading:
            scene = self._scenes.scene(request.args.get("key", ""))
        response = Response(grasp_page(scene), content_type="text/html; charset=utf-8")
        response.headers["Content-Security-Policy"] = VIEWER
        return response

    def queries(self) -> tuple[str, int]:
        """List the named queries."""
        return self._render("queries.html", here="queries", queries=list(named_queries().values()))

    def query(self) -> tuple[str, int]:
        """Answer a named query."""
        named = named_query(request.args.get("name", ""))
        given = {p.name: v for p in named.parameters if (v := request.args.get(f"p.{p.name}", "").strip())}
        missing = [p.name for p in named.parameters if p.required and p.name not in given]
        answer, problem = None, ""
        if not missing:
            try:
                table = self._database.query(named.name, **given).table
                answer = first_rows(table.to_batches(), table.schema)
            except GraspDBError as error:
                problem = str(error)
        return self._render(
            "query.html", here="queries", named=named, given=given, problem=problem, **_shown(answer)
        )

    def sql(self) -> tuple[str, int]:
        """Answer a statement."""
        statement = request.args.get("statement", "").strip()
        answer, problem = None, ""
        if statement:
            try:
                with self._database.stream(statement) as rows:
                    answer = first_rows(rows, rows.schema)
            except GraspDBError as error:
                problem = str(error)
        return self._render(
            "sql.html",
            here="sql",
            statement=statement or _EXAMPLE,
            asked=bool(statement),
            problem=problem,
            tables=self._tables(),
            **_shown(answer),
        )

    def style(self) -> Response:
        """Return the style of all pages."""
        return Response(render("explore/explore.css"), content_type="text/css; charset=utf-8")

    def script(self) -> Response:
        """Return the script of all pages: keys, and nothing that a page needs."""
        content = resources.files("graspdb.pages").joinpath("static/explore.js").read_bytes()
        return Response(content, content_type="text/javascript; charset=utf-8")

    def _render(self, template: str, *, problem: str = "", **values: Any) -> tuple[str, int]:
        """Return a page, and the status that says whether what was asked could be answered."""
        page = render(f"explore/{template}", url=url_for, info=self._info, problem=problem, **values)
        return page, _REFUSED if problem else _ANSWERED

    def _similar(self, key: str, by: str) -> Similar:
        with self._searching:
            return self._database.similar(key, k=_HITS, by=by)

    def _drawn(self, key: str, size: int) -> bytes:
        shape = next(self._shapes.shapes([key]), None)
        if shape is None:
            abort(404, "There is no such grasp.")
        return draw(shape, size).webp()

    def _tables(self) -> dict[str, list[tuple[str, str]]]:
        """Return name and documentation of the columns of each table."""
        tables: dict[str, list[tuple[str, str]]] = {}
        for table, column, doc in self._database.sql(_SCHEMA).rows():
            tables.setdefault(table, []).append((column, doc or ""))
        return tables


def _shown(answer: Answer | None) -> dict[str, Any]:
    """Return what a page shows of an answer: its table, its chart, and the form of the chart."""
    shown: dict[str, Any] = {"answer": answer, "chart": None, "form": None, "kinds": KINDS, "chosen": ""}
    if answer is None:
        return shown
    if request.args.get("kind") in KINDS:
        form = ChartForm(*(request.args.get(name, "") for name in ("kind", "x", "y", "by")))
        # Another answer may lack the columns of the chart before.
        if drawn := chart(answer, form):
            return shown | {"chart": drawn, "form": form, "chosen": form.kind}
    suits = suggested(answer)
    return shown | {"chart": chart(answer, suits) if suits else None, "form": suits}
