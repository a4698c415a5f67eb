"""Files of data sets read into memory with their sizes bounded: pickles, NPY, NPZ.

Nothing is ever unpacked to disk. Arrays of objects, in which GRAB and ARCTIC keep dicts, are read as
`pickles` reads them.
"""

import io
import math
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np

from graspdb_ingest.importers.pickles import unpickle
from graspdb_schemas.errors import ImportSourceError, UnsafeFileError

MAX_BYTES: Final = 1 << 30
"""Bytes of one file, and of all that is read of one archive, unpacked."""

_AGAIN: Final = "Download it again; the download may have been cut off."
_LINK: Final = 0o120000


def read_bytes(path: Path) -> bytes:
    """Return the content of a file.

    Raises
    ------
    ImportSourceError
        If it is missing or larger than `MAX_BYTES`.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise UnsafeFileError(
                path, f"it has more than {MAX_BYTES >> 20} MiB", "Check that it is the right file."
            )
        return path.read_bytes()
    except OSError as error:
        raise ImportSourceError(
            path, f"it cannot be read ({error.strerror})", "Download it again."
        ) from error


def read_pickle(path: Path) -> object:
    """Return what a pickle file holds, as `unpickle` reads it.

    Raises
    ------
    ImportSourceError
        If the file is missing, too large, cut off, or holds anything but data (UnsafeFileError).
    """
    return unpickle(read_bytes(path), path)


def read_npy(path: Path) -> object:
    """Return the array of an NPY file, or what lies in it where it is a single object.

    Raises
    ------
    ImportSourceError
        If the file is missing, too large, cut off, or holds anything but data (UnsafeFileError).
    """
    return _array(read_bytes(path), path)


def read_npz(path: Path, names: Iterable[str] | None = None) -> dict[str, object]:
    """Return the arrays of an NPZ file by name, single objects taken out of theirs.

    Parameters
    ----------
    path : Path
        The file.
    names : iterable of str, optional
        Those to read; all by default. One that is not there is left out.

    Raises
    ------
    ImportSourceError
        If the file is missing, too large, cut off, or holds anything but arrays of data (UnsafeFileError).
    """
    read_size = 0
    arrays: dict[str, object] = {}
    wanted = None if names is None else set(names)
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                name = _checked(member, path).removesuffix(".npy")
                if wanted is not None and name not in wanted:
                    continue
                read_size += member.file_size
                if read_size > MAX_BYTES:
                    raise UnsafeFileError(path, f"it unpacks to more than {MAX_BYTES >> 20} MiB", _AGAIN)
                arrays[name] = _array(archive.read(member), path)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise ImportSourceError(path, f"it is no whole NPZ file ({error})", _AGAIN) from error
    except OSError as error:
        raise ImportSourceError(path, f"it cannot be read ({error.strerror or error})", _AGAIN) from error
    return arrays


def _checked(member: zipfile.ZipInfo, path: Path) -> str:
    """Return a member's name if it is that of an array in the archive itself and not of another place."""
    name = member.filename
    parts = name.replace("\\", "/").split("/")
    link = (member.external_attr >> 16) & 0o170000 == _LINK
    if link or ".." in parts or parts[0] in ("", ".") or ":" in parts[0] or not name.endswith(".npy"):
        kind = "a link" if link else "not an array of its own"
        raise UnsafeFileError(
            path, f"its member {name!r:.100} is {kind}", "Get the file from where it is published."
        )
    return name


def _array(data: bytes, path: Path) -> object:
    """Return the array in the bytes of an NPY file."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        if version == (1, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
        elif version == (2, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_2_0(stream)
        else:
            raise ValueError(f"version {version}")
    except ValueError as error:
        raise ImportSourceError(path, f"it is no whole array ({error})", _AGAIN) from error
    body = stream.read()
    if dtype.hasobject:
        return _objects(body, shape, path)
    if len(body) != math.prod(shape) * dtype.itemsize:
        found = f"it has {len(body)} bytes for an array of shape {shape} and type {dtype}"
        raise ImportSourceError(path, found, _AGAIN)
    return np.frombuffer(body, dtype).reshape(shape, order="F" if fortran else "C")


def _objects(body: bytes, shape: tuple[int, ...], path: Path) -> object:
    array = unpickle(body, path)
    if not isinstance(array, np.ndarray) or array.shape != shape:
        raise ImportSourceError(path, f"its objects are not in an array of shape {shape}", _AGAIN)
    return array[()] if shape == () else array
