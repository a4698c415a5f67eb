"""Open3D, with a message that helps where the system lacks a library it needs."""

import importlib
import re
from collections.abc import Mapping
from contextlib import redirect_stdout
from io import StringIO
from types import MappingProxyType, ModuleType
from typing import Final

from graspdb_schemas.errors import MissingLibraryError

DEBIAN_PACKAGES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "libusb-1.0.so.0": "libusb-1.0-0",
        "libGL.so.1": "libgl1",
        "libEGL.so.1": "libegl1",
        "libX11.so.6": "libx11-6",
        "libudev.so.1": "libudev1",
        "libidn2.so.0": "libidn2-0",
        "libgomp.so.1": "libgomp1",
        "libstdc++.so.6": "libstdc++6",
    }
)
"""Debian and Ubuntu package of each system library that Open3D loads."""


def load_open3d() -> ModuleType:
    """Import Open3D and return it.

    Raises
    ------
    MissingLibraryError
        If it, or a system library that it needs, is not installed; with the package to install.
    """
    try:
        # In a notebook Open3D tells of its own viewer there, which nothing here uses.
        with redirect_stdout(StringIO()):
            return importlib.import_module("open3d")
    except (ImportError, OSError) as error:
        raise MissingLibraryError("Open3D", str(error), _remedy(str(error))) from error


def _remedy(message: str) -> str:
    found = re.search(r"(\S+\.so[.\d]*): cannot open shared object file", message)
    if found is None:
        return "Install it with: pip install open3d-cpu (Linux on x86-64) or pip install open3d"
    library = found.group(1)
    everything = " ".join(dict.fromkeys(DEBIAN_PACKAGES.values()))
    if library not in DEBIAN_PACKAGES:
        return (
            f"Install the system's package that holds {library}; "
            f"on Debian and Ubuntu find it with: apt-file search {library}"
        )
    return (
        f"On Debian and Ubuntu: apt-get install {DEBIAN_PACKAGES[library]} "
        f"(all that Open3D needs: {everything})"
    )
