"""What a user may say of a data set, checked before anything is read."""

import re
from typing import Final

from graspdb_ingest.importers.base import ImportOptions
from graspdb_ingest.importers.order import key_point_names
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.units import METRES_PER, metres_per

_SESSION: Final = re.compile(r"[^/\s]+")


def check_options(options: ImportOptions) -> None:
    """Refuse what no clip could be read with.

    Raises
    ------
    ParameterError
        An option is not allowed; the message says what is.
    """
    if options.units is not None and metres_per(options.units) is None:
        raise ParameterError("units", options.units, ", ".join(METRES_PER))
    if options.order is not None:
        key_point_names(options.order)
    if options.rate is not None and not options.rate > 0:
        raise ParameterError("rate", options.rate, "frames per second above zero")
    if options.session is not None and not _SESSION.fullmatch(options.session):
        raise ParameterError("session", options.session, "a name without slash and space")
    for name, folder in (("objects", options.objects), ("mano", options.mano)):
        if folder is not None and not folder.exists():
            raise ParameterError(name, str(folder), "a folder or file that exists")
