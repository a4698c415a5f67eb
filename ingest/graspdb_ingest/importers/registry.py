"""Which importers there are: one table, by the name of their format."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from graspdb_ingest.importers import (
    arctic,
    bvh,
    contactpose,
    dexycb,
    grab,
    ho3d,
    hot3d,
    keypoints,
    oakink,
)
from graspdb_ingest.importers.base import Importer
from graspdb_schemas.errors import ImportSourceError, ParameterError, nearest

_TABLE: Final = (
    keypoints.IMPORTER,
    bvh.IMPORTER,
    contactpose.IMPORTER,
    bvh.MANIPNET_IMPORTER,
    dexycb.IMPORTER,
    ho3d.IMPORTER,
    grab.IMPORTER,
    arctic.IMPORTER,
    oakink.IMPORTER,
    hot3d.IMPORTER,
)

IMPORTERS: Final[Mapping[str, Importer]] = MappingProxyType({entry.format.name: entry for entry in _TABLE})
"""Every importer by the name of its format; general formats first."""


def importer(name: str) -> Importer:
    """Return an importer by the name of its format.

    Raises
    ------
    ParameterError
        There is no such format.
    """
    if name not in IMPORTERS:
        names = list(IMPORTERS)
        raise ParameterError("format", name, ", ".join(names) + nearest(name, names))
    return IMPORTERS[name]


def with_suggestion(error: ImportSourceError, path: Path, wanted: Importer) -> ImportSourceError:
    """Return an importer's error with what it expected, and what the path looks like instead.

    Parameters
    ----------
    error : ImportSourceError
        What the importer found.
    path : Path
        What was to be imported.
    wanted : Importer
        The importer that did not find its data set there.
    """
    # The general formats come first in the table, and recognise what the special ones do, too.
    others = [entry for entry in reversed(list(IMPORTERS.values())) if entry is not wanted]
    alike = [entry.format.name for entry in others if entry.recognises(path)]
    expected = "; ".join(wanted.format.needs)
    remedy = f"{error.remedy} {wanted.format.name} needs {expected} ({wanted.format.documentation})."
    if alike and not wanted.recognises(path):
        remedy += f" This looks like {' or '.join(alike)}: graspdb import {alike[0]} {path}"
    return ImportSourceError(error.path, error.found, remedy)
