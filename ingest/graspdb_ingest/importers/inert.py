"""Inert stand-ins for what a data set's pickle is made of: they keep data, check them, and run nothing.

A pickle asks for functions and classes by name and calls them. None of those is ever given to it, but objects
of this module, which become arrays and plain values in `thaw`. So numpy, scipy and chumpy are not called with
anything that a file chose, and chumpy need not be installed.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray

MAX_DENSE: Final = 1 << 24
"""Numbers that a sparse matrix may have when it is written out."""

_MAX_DEPTH: Final = 64
_DTYPE: Final = re.compile(r"[<>=|]?(?:([biufcSU])(\d{1,9})|(\?)|(O)8?)")


class RefusedError(Exception):
    """Something in a pickle that is not data, or not data of the kinds that are admitted."""


class Asked:
    """A function that a pickle asked for by name."""

    __slots__ = ("_answer", "_name")

    def __init__(self, name: str, answer: Callable[..., object]) -> None:
        self._name = name
        self._answer = answer

    def __call__(self, *args: object) -> object:
        """Return the stand-in for what the function would have returned."""
        try:
            return self._answer(*args)
        except (TypeError, ValueError, OverflowError, UnicodeError) as error:
            raise RefusedError(f"{self._name} with arguments that are not its own") from error

    def __setstate__(self, _state: object) -> NoReturn:
        raise RefusedError(f"a change to {self._name}")


class Marker(Asked):
    """A class that other pickled names take as an argument, and that is itself not to be called."""

    def __init__(self, name: str) -> None:
        super().__init__(name, self._refuse)

    def _refuse(self, *_args: object) -> NoReturn:
        raise RefusedError(f"a call of {self._name}")


class DType:
    """A numpy data type: its code, then its byte order."""

    def __init__(self, code: object, *_flags: object) -> None:
        if not isinstance(code, str) or _DTYPE.fullmatch(code) is None:
            raise RefusedError(f"numpy data type {code!r:.40}")
        self.code = "O" if "O" in code else code

    def __setstate__(self, state: object) -> None:
        if not (isinstance(state, tuple) and len(state) >= 5):
            raise RefusedError("a numpy data type with a state that is not its own")
        order, parts = state[1], state[2:5]
        if order not in ("<", ">", "|", "=") or any(part is not None for part in parts):
            raise RefusedError("a numpy data type with fields")
        if self.code != "O" and order in ("<", ">"):
            self.code = order + self.code.lstrip("<>=|")

    @property
    def value(self) -> np.dtype[np.generic]:
        """The data type."""
        return np.dtype(self.code)


class InertArray:
    """An array: shape, type and raw data."""

    def __init__(self) -> None:
        self.shape: tuple[int, ...] | None = None
        self.dtype: np.dtype[np.generic] = np.dtype(np.float64)
        self.fortran = False
        self.data: bytes | bytearray | list[object] = b""

    def __setstate__(self, state: object) -> None:
        if not (isinstance(state, tuple) and len(state) in (4, 5)):
            raise RefusedError("an array with a state that is not its own")
        shape, dtype, fortran, data = state[-4:]
        self.fill(shape, dtype, bool(fortran), data)

    def fill(self, shape: object, dtype: object, fortran: bool, data: object) -> None:
        """Take shape, type and data if they fit each other."""
        if not (isinstance(shape, tuple) and len(shape) <= 16 and all(_is_length(n) for n in shape)):
            raise RefusedError("an array whose shape is not a few lengths")
        if not isinstance(dtype, DType):
            raise RefusedError("an array without a numpy data type")
        # Python 2 wrote the bytes as a string.
        data = data.encode("latin-1") if isinstance(data, str) else data
        objects = dtype.value.hasobject
        wanted = math.prod(shape) * (1 if objects else dtype.value.itemsize)
        if not isinstance(data, bytes | bytearray | list) or isinstance(data, list) is not objects:
            raise RefusedError("an array whose data are not of its type")
        if len(data) != wanted:
            raise RefusedError(f"an array of shape {shape} that does not fit its data")
        self.shape, self.dtype, self.fortran, self.data = shape, dtype.value, fortran, data

    def thaw(self, thawed: "Thawing") -> object:
        """Return the array."""
        if self.shape is None:
            raise RefusedError("an array without data")
        order: Literal["F", "C"] = "F" if self.fortran else "C"
        if isinstance(self.data, list):
            flat = np.empty(len(self.data), dtype=object)
            for i, item in enumerate(self.data):
                flat[i] = thawed.value(item)
            return flat.reshape(self.shape, order=order)
        array = np.frombuffer(self.data, self.dtype).reshape(self.shape, order=order)
        return array.copy(order=order)


class InertScalar(InertArray):
    """A numpy scalar."""

    def thaw(self, thawed: "Thawing") -> object:
        """Return the scalar."""
        value = super().thaw(thawed)
        return value[()] if isinstance(value, np.ndarray) else value


class Node:
    """An object with attributes, as chumpy and scipy write theirs."""

    state: Mapping[object, object]

    def __setstate__(self, state: object) -> None:
        if not isinstance(state, dict):
            raise RefusedError("an object whose state is not its attributes")
        self.state = state

    def attribute(self, thawed: "Thawing", *names: str) -> object:
        """Return the first attribute of these names that there is."""
        for name in names:
            if name in getattr(self, "state", {}):
                return thawed.value(self.state[name])
        raise RefusedError(f"{type(self).__name__} without {' or '.join(names)}")


class Ch(Node):
    """A chumpy array of numbers."""

    def thaw(self, thawed: "Thawing") -> object:
        """Return the array."""
        return _numbers(self.attribute(thawed, "x"))


class Select(Node):
    """Some numbers of a chumpy array, in a shape of their own."""

    def thaw(self, thawed: "Thawing") -> object:
        """Return the selection."""
        source = _numbers(self.attribute(thawed, "a")).ravel()
        chosen = _numbers(self.attribute(thawed, "idxs"), "iu").ravel()
        if len(chosen) and not 0 <= chosen.min() <= chosen.max() < len(source):
            raise RefusedError("a selection beyond its array")
        selected = source[chosen]
        if "preferred_shape" not in self.state:
            return selected
        shape = self.attribute(thawed, "preferred_shape")
        if not (isinstance(shape, tuple | list) and all(_is_length(n) for n in shape)):
            raise RefusedError("a selection whose shape is not a few lengths")
        if math.prod(int(n) for n in shape) != len(selected):
            raise RefusedError(f"a selection of {len(selected)} numbers in shape {tuple(shape)}")
        return selected.reshape([int(n) for n in shape])


class CompressedColumns(Node):
    """A sparse matrix by columns."""

    by_columns = True

    def thaw(self, thawed: "Thawing") -> object:
        """Return the matrix with its zeros.

        It is written out here, since scipy's own code trusts where the columns start, and a wrong start makes
        it reach into foreign memory.
        """
        shape = self.attribute(thawed, "_shape", "shape")
        if not (isinstance(shape, tuple) and len(shape) == 2 and all(_is_length(n) for n in shape)):
            raise RefusedError("a sparse matrix whose shape is not two lengths")
        if math.prod(shape) > MAX_DENSE:
            raise RefusedError(f"a sparse matrix of shape {shape}")
        data = _numbers(self.attribute(thawed, "data"))
        minor, starts = (_numbers(self.attribute(thawed, name), "iu") for name in ("indices", "indptr"))
        n_major, n_minor = (shape[1], shape[0]) if self.by_columns else shape
        if data.ndim != 1 or minor.shape != data.shape or starts.shape != (n_major + 1,):
            raise RefusedError("a sparse matrix whose parts do not fit each other")
        bounds = starts.astype(np.int64)
        counts = bounds[1:] - bounds[:-1]
        if bounds[0] != 0 or bounds[-1] != len(data) or bounds.max() > len(data) or (counts < 0).any():
            raise RefusedError("a sparse matrix whose parts do not fit each other")
        if len(minor) and not 0 <= minor.min() <= minor.max() < n_minor:
            raise RefusedError("a sparse matrix with entries outside of it")
        dense = np.zeros((n_major, n_minor), dtype=data.dtype)
        np.add.at(dense, (np.repeat(np.arange(n_major), counts), minor.astype(np.int64)), data)
        return dense.T.copy() if self.by_columns else dense


class CompressedRows(CompressedColumns):
    """A sparse matrix by rows."""

    by_columns = False


@dataclass
class Thawing:
    """One pass over what was unpickled.

    An object that is met twice is thawed once, so sharing costs nothing; one that holds itself is refused.
    """

    done: dict[int, object]
    open: set[int]

    def value(self, frozen: object) -> object:
        """Return what an unpickled object stands for."""
        if frozen is None or type(frozen) in (bool, int, float, complex, str, bytes):
            return frozen
        key = id(frozen)
        if key in self.done:
            return self.done[key]
        if key in self.open:
            raise RefusedError("an object that holds itself")
        if len(self.open) >= _MAX_DEPTH:
            raise RefusedError(f"objects more than {_MAX_DEPTH} deep in each other")
        self.open.add(key)
        self.done[key] = self._of(frozen)
        self.open.remove(key)
        return self.done[key]

    def _of(self, frozen: object) -> object:
        if isinstance(frozen, InertArray | Ch | Select | CompressedColumns):
            return frozen.thaw(self)
        if type(frozen) is dict:
            return {self._key(key): self.value(value) for key, value in frozen.items()}
        if type(frozen) is list:
            return [self.value(item) for item in frozen]
        if type(frozen) is tuple:
            return tuple(self.value(item) for item in frozen)
        if type(frozen) is bytearray:
            return bytes(frozen)
        raise RefusedError("a name instead of data")

    def _key(self, key: object) -> object:
        if key is None or type(key) in (bool, int, float, str, bytes):
            return key
        raise RefusedError("a dict whose keys are neither text nor numbers")


def thaw(frozen: object) -> object:
    """Return what was unpickled with arrays in place of the stand-ins.

    Parameters
    ----------
    frozen : object
        What an unpickler returned that took its names from `STAND_INS`.

    Raises
    ------
    RefusedError
        If there is anything in it but numbers, text, bytes, dicts, lists, tuples and arrays, if an array
        does not fit its data, or if something holds itself or is nested too deep.
    """
    return Thawing({}, set()).value(frozen)


def _is_length(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and 0 <= int(value) < 2**40


def _numbers(value: object, kinds: str = "biuf") -> NDArray[Any]:
    if not (isinstance(value, np.ndarray) and value.dtype.kind in kinds):
        raise RefusedError("an object in place of an array of numbers")
    return value
