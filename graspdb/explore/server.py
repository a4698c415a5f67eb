"""The server: it listens on this machine's loopback alone."""

import logging
import secrets
from typing import Final

from werkzeug.serving import make_server

from graspdb.database import Database
from graspdb.explore.app import create_app
from graspdb_schemas.errors import ParameterError

_LOOPBACK: Final = "127.0.0.1"
_TOKEN_BYTES: Final = 16


class Server:
    """Serves the pages of a database until it is closed.

    Parameters
    ----------
    database : Database
        The database.
    port : int
        Port to listen on; 0 for any that is free.

    Attributes
    ----------
    address : str
        Where the pages are; whoever has it can read the database.

    Raises
    ------
    ParameterError
        The port is taken or not allowed.
    """

    def __init__(self, database: Database, port: int = 0) -> None:
        token = secrets.token_urlsafe(_TOKEN_BYTES)
        # Every request would be a line in the terminal, with the token in it.
        logging.getLogger("werkzeug").setLevel(logging.ERROR)
        hosts: set[str] = set()
        app = create_app(database, token, hosts)
        try:
            self._server = make_server(_LOOPBACK, port, app, threaded=True)
        except (OSError, OverflowError, SystemExit) as error:
            raise ParameterError("port", port, "a port that is free; 0 takes any") from error
        hosts |= {f"{name}:{self._server.port}" for name in (_LOOPBACK, "localhost")}
        self.address = f"http://{_LOOPBACK}:{self._server.port}/{token}/"

    def serve(self) -> None:
        """Answer requests until `stop` or Ctrl-C."""
        try:
            self._server.serve_forever()
        finally:
            self.close()

    def close(self) -> None:
        """Give the port back."""
        self._server.server_close()

    def stop(self) -> None:
        """Let `serve`, in another thread, return."""
        self._server.shutdown()
