"""Functions compiled to machine code, for loops of arithmetic too small for numpy's calls."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Return the function, compiled when it is first called; the machine code is kept for later processes.

    Numba keeps it beside the source, or in the user's cache where that cannot be written to. Where neither
    can, every process compiles for itself.
    """
    try:
        return cast(Function, njit(function, cache=True, error_model="numpy"))
    except RuntimeError:
        return cast(Function, njit(function, error_model="numpy"))
