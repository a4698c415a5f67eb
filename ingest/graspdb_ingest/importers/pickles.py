"""Pickles read as data: arrays and plain containers, and nothing else.

A pickle is a small program, and running a stranger's is running a stranger's code. Here its instructions are
looked through first: those that call for outside objects or extensions are refused, and their number is
bounded. Names are answered by `STAND_INS` alone.
"""

import io
import pickle
import pickletools
import warnings
from pathlib import Path
from typing import Final

from graspdb_ingest.importers.inert import RefusedError, thaw
from graspdb_ingest.importers.stand_ins import STAND_INS
from graspdb_schemas.errors import ImportSourceError, UnsafeFileError

MAX_INSTRUCTIONS: Final = 200_000
"""Instructions of a pickle; a file of a data set has some hundreds."""

MAX_TUPLES: Final = 10_000
"""Tuples of a pickle, and so how deep they can lie in each other."""

# fmt: off
_ADMITTED: Final = frozenset((
    "PROTO", "FRAME", "STOP", "MARK", "POP", "POP_MARK", "NONE", "NEWTRUE", "NEWFALSE",
    "INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT",
    "STRING", "BINSTRING", "SHORT_BINSTRING", "UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8",
    "BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "BYTEARRAY8",
    "EMPTY_LIST", "LIST", "APPEND", "APPENDS", "EMPTY_DICT", "DICT", "SETITEM", "SETITEMS",
    "EMPTY_TUPLE", "TUPLE", "TUPLE1", "TUPLE2", "TUPLE3",
    "PUT", "BINPUT", "LONG_BINPUT", "MEMOIZE", "GET", "BINGET", "LONG_BINGET",
    "GLOBAL", "STACK_GLOBAL", "REDUCE", "NEWOBJ", "BUILD",
))
# fmt: on
_TUPLES: Final = frozenset(("TUPLE", "TUPLE1", "TUPLE2", "TUPLE3"))
_PUTS: Final = frozenset(("PUT", "BINPUT", "LONG_BINPUT"))

_REMEDY: Final = (
    "Do not open it with other programs either; download it again from where the data set is published."
)


class _DataUnpickler(pickle.Unpickler):
    """An unpickler that knows the names of `STAND_INS` and no others."""

    def find_class(self, module_name: str, global_name: str, /) -> object:
        name = (module_name, global_name)
        if name not in STAND_INS:
            raise RefusedError(f"the name {module_name}.{global_name}"[:200])
        return STAND_INS[name]


def unpickle(data: bytes, path: Path) -> object:
    """Return the numbers, text, bytes, dicts, lists, tuples and arrays that a pickle holds.

    Strings of Python 2 are read as Latin-1; chumpy arrays and sparse matrices, as in MANO's model files,
    become dense arrays, numpy scalars stay numpy scalars, and sets become lists.

    Parameters
    ----------
    data : bytes
        The pickle, of any protocol; what follows its end is not looked at.
    path : Path
        Where it comes from, for messages.

    Raises
    ------
    UnsafeFileError
        If it asks for any name, or holds any instruction, that data do not need.
    ImportSourceError
        If it is cut off or not a pickle.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of escapes in damaged strings
            _look_through(data)
            return thaw(_DataUnpickler(io.BytesIO(data), fix_imports=False, encoding="latin-1").load())
    except RefusedError as refused:
        raise UnsafeFileError(path, f"its pickle holds {refused}, which is not data", _REMEDY) from refused
    except (
        pickle.UnpicklingError,
        ArithmeticError,
        AttributeError,
        EOFError,
        LookupError,
        TypeError,
        ValueError,
    ) as error:
        raise ImportSourceError(
            path, f"it is no whole pickle ({error})", "Download it again; the download may have been cut off."
        ) from error


def _look_through(data: bytes) -> None:
    """Raise RefusedError if a pickle has instructions that are not needed for data, or too many."""
    tuples = 0
    for count, (opcode, argument, _position) in enumerate(pickletools.genops(data)):
        if opcode.name not in _ADMITTED:
            raise RefusedError(f"the instruction {opcode.name}")
        if count >= MAX_INSTRUCTIONS:
            raise RefusedError(f"more than {MAX_INSTRUCTIONS} instructions")
        tuples += opcode.name in _TUPLES
        if tuples > MAX_TUPLES:
            raise RefusedError(f"more than {MAX_TUPLES} tuples")
        # The reader reserves memory up to the highest number of a place.
        if opcode.name in _PUTS and not (isinstance(argument, int) and argument < MAX_INSTRUCTIONS):
            raise RefusedError(f"a memory place of number {argument}")
