"""A database in the browser: on this machine alone, for whoever has the address, to look and not to write."""

from graspdb.explore.app import create_app
from graspdb.explore.server import Server

__all__ = ["Server", "create_app"]
