"""Grasp databases: built from motion capture, asked in SQL.

Names are loaded when they are first used, so that ``import graspdb`` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from graspdb.database import Database as Database
    from graspdb.explaining import explain_ingest as explain_ingest
    from graspdb.grasp import Grasp as Grasp
    from graspdb.holdings import Info as Info
    from graspdb.importing import import_data_set as import_data_set
    from graspdb.ingestion import IngestReport as IngestReport
    from graspdb.ingestion import ingest as ingest
    from graspdb.maintenance import optimize as optimize
    from graspdb.maintenance import remove as remove
    from graspdb.maintenance import verify as verify
    from graspdb.training.windows import WindowDataset as WindowDataset
    from graspdb.training.windows import WindowStream as WindowStream
    from graspdb_ingest.importers.base import ImportOptions as ImportOptions
    from graspdb_ingest.live import HandEstimate as HandEstimate
    from graspdb_ingest.live import HandTracker as HandTracker
    from graspdb_queries.result import Result as Result
    from graspdb_schemas.errors import GraspDBError as GraspDBError

    open = Database
    __version__: str

_HOMES = {
    "open": ("graspdb.database", "Database"),
    "Database": ("graspdb.database", "Database"),
    "import_data_set": ("graspdb.importing", "import_data_set"),
    "ImportOptions": ("graspdb_ingest.importers.base", "ImportOptions"),
    "ingest": ("graspdb.ingestion", "ingest"),
    "explain_ingest": ("graspdb.explaining", "explain_ingest"),
    "optimize": ("graspdb.maintenance", "optimize"),
    "remove": ("graspdb.maintenance", "remove"),
    "verify": ("graspdb.maintenance", "verify"),
    "IngestReport": ("graspdb.ingestion", "IngestReport"),
    "Info": ("graspdb.holdings", "Info"),
    "Grasp": ("graspdb.grasp", "Grasp"),
    "WindowDataset": ("graspdb.training.windows", "WindowDataset"),
    "WindowStream": ("graspdb.training.windows", "WindowStream"),
    "Result": ("graspdb_queries.result", "Result"),
    "HandEstimate": ("graspdb_ingest.live", "HandEstimate"),
    "HandTracker": ("graspdb_ingest.live", "HandTracker"),
    "GraspDBError": ("graspdb_schemas.errors", "GraspDBError"),
}
"""Public name -> module, and name in that module."""


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name == "__version__":
        from importlib.metadata import version

        return version("graspdb")
    if name not in _HOMES:
        raise AttributeError(f"module 'graspdb' has no attribute {name!r}")
    module, attribute = _HOMES[name]
    value = globals()[name] = getattr(import_module(module), attribute)
    return value


def __dir__() -> list[str]:
    """Return what the module has, names not yet loaded included."""
    return sorted({*globals(), *_HOMES, "__version__"})
