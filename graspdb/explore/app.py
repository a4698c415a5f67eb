"""The application: its addresses, and what is said where something cannot be answered."""

from collections.abc import Collection

from flask import Flask, Response, url_for
from werkzeug.exceptions import HTTPException

from graspdb.database import Database
from graspdb.explore.guard import guard
from graspdb.explore.pages import Pages
from graspdb.pages.templates import render
from graspdb_schemas.errors import GraspDBError


def create_app(database: Database, token: str, hosts: Collection[str]) -> Flask:
    """Return the application.

    Parameters
    ----------
    database : Database
        What is shown: one state of it, which nothing here changes.
    token : str
        Secret that every address begins with.
    hosts : collection of str
        Values of the ``Host`` header that are answered; looked at with each request.
    """
    app = Flask("graspdb.pages", static_folder=None)
    guard(app, token, hosts)
    app.register_blueprint(Pages(database).blueprint(), url_prefix=f"/{token}")
    app.register_error_handler(GraspDBError, _refused)
    app.register_error_handler(HTTPException, _failed)
    return app


def _refused(error: GraspDBError) -> tuple[str, int]:
    """Say what cannot be answered, and what to do."""
    return render("explore/error.html", message=str(error), url=url_for, here=""), 400


def _failed(error: HTTPException) -> Response:
    """Say what went wrong in plain text: who has no token sees nothing of the pages."""
    said = f"{error.code}: {error.description}\n"
    return Response(said, status=error.code, content_type="text/plain; charset=utf-8")
