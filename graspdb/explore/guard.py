"""Who may see the pages: whoever has the address with its token, from this machine, and nobody else."""

import hmac
from collections.abc import Collection
from typing import Final

from flask import Flask, Response, abort, request

_PAGES: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; frame-src 'self'; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'self'"
)
"""Nothing runs or loads but what comes from here: a name in the data cannot become a script."""

VIEWER: Final = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""The viewer's page carries all that it needs, as it does on disk: it can ask nobody for anything."""


def guard(app: Flask, token: str, hosts: Collection[str]) -> None:
    """Let an application answer only requests for the right host with the right token.

    A page from elsewhere that makes the browser ask this machine, by a name of its own that leads here, is
    refused by its ``Host`` header; one that asks by our name does not know the token.

    Parameters
    ----------
    app : Flask
        The application; its addresses begin with the token.
    token : str
        The secret.
    hosts : collection of str
        Values of the ``Host`` header that are ours, with port.
    """

    @app.before_request
    def _check() -> None:
        if request.host not in hosts:
            abort(403, "This address is not ours.")
        given = request.path.removeprefix("/").partition("/")[0]
        if not hmac.compare_digest(given.encode(), token.encode()):
            abort(403, "The address is not whole: copy it from the terminal once more.")

    @app.after_request
    def _close(response: Response) -> Response:
        response.headers.setdefault("Content-Security-Policy", _PAGES)
        response.headers.setdefault("Cache-Control", "no-store")
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Cross-Origin-Resource-Policy"] = "same-origin"
        response.headers["Cross-Origin-Opener-Policy"] = "same-origin"
        return response
