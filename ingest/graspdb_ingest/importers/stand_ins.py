"""Which names a data set's pickle may ask for, and what it is given for them."""

from collections.abc import Mapping
from typing import Final

from graspdb_ingest.importers.inert import (
    Asked,
    Ch,
    CompressedColumns,
    CompressedRows,
    DType,
    InertArray,
    InertScalar,
    Marker,
    Node,
    RefusedError,
    Select,
)


def _reconstruct(kind: object, _shape: object, _code: object) -> InertArray:
    # The shape here is a formality, (0,); the array's own comes with its data.
    if kind is not _NDARRAY:
        raise RefusedError("an array of a class of its own")
    return InertArray()


def _from_buffer(buffer: object, dtype: object, shape: object, order: object) -> InertArray:
    array = InertArray()
    array.fill(shape, dtype, order == "F", buffer)
    return array


def _scalar(dtype: object, data: object) -> InertScalar:
    scalar = InertScalar()
    scalar.fill((), dtype, False, data)
    return scalar


def _encode(text: object, encoding: object) -> bytes:
    if not isinstance(text, str) or encoding not in ("latin1", "latin-1"):
        raise RefusedError("bytes in an encoding of their own")
    return text.encode("latin-1")


def _no_bytes() -> bytes:
    return b""


def _new(kind: object, base: object, _state: object) -> object:
    if not (isinstance(kind, type) and issubclass(kind, Node)) or base is not _OBJECT:
        raise RefusedError("an object of a class that is not admitted")
    return kind()


def _items(items: object = ()) -> list[object]:
    if not isinstance(items, list | tuple):
        raise RefusedError("a set that is not made of a list")
    return list(items)


def _pairs(items: object = ()) -> dict[object, object]:
    pairs = [tuple(pair) for pair in _items(items) if isinstance(pair, list | tuple)]
    return {key: value for key, value in pairs if isinstance(key, str | int)}


_NDARRAY: Final = Marker("numpy.ndarray")
_OBJECT: Final = Marker("object")

_NUMPY_ROOMS: Final = ("numpy.core", "numpy._core")
_BUILTINS: Final = ("__builtin__", "builtins")

STAND_INS: Final[Mapping[tuple[str, str], object]] = {
    ("numpy", "ndarray"): _NDARRAY,
    ("numpy", "dtype"): Asked("numpy.dtype", DType),
    **{
        (f"{room}.{module}", name): Asked(f"numpy {name}", answer)
        for room in _NUMPY_ROOMS
        for module, name, answer in (
            ("multiarray", "_reconstruct", _reconstruct),
            ("multiarray", "scalar", _scalar),
            ("numeric", "_frombuffer", _from_buffer),
        )
    },
    **{(module, "object"): _OBJECT for module in _BUILTINS},
    **{(module, "set"): Asked("set", _items) for module in _BUILTINS},
    **{(module, "bytes"): Asked("bytes", _no_bytes) for module in _BUILTINS},
    **{(module, "_reconstructor"): Asked("_reconstructor", _new) for module in ("copy_reg", "copyreg")},
    ("_codecs", "encode"): Asked("encode", _encode),
    ("collections", "OrderedDict"): Asked("OrderedDict", _pairs),
    ("chumpy.ch", "Ch"): Ch,
    ("chumpy.reordering", "Select"): Select,
    **{
        (f"scipy.sparse.{hidden}{short}", f"{short}_matrix"): kind
        for hidden in ("", "_")
        for short, kind in (("csc", CompressedColumns), ("csr", CompressedRows))
    },
}
"""What is given to a pickle for each name that it may ask for; every other name is refused."""
