"""Functions compiled to machine code, for loops of arithmetic too small for numpy's calls."""

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, Final, TypeVar, cast

from numba import njit
from numba.core.caching import FunctionCache, IndexDataCacheFile

Function = TypeVar("Function", bound=Callable[..., Any])

PACKAGE: Final = Path(__file__).parent


def compiled(function: Function) -> Function:
    """Return the function, compiled when it is first called; the machine code is kept for later processes.

    Numba keeps it beside the source, or in the user's cache where that cannot be written to. Where neither
    can, every process compiles for itself.
    """
    dispatcher = njit(function, error_model="numpy")
    with suppress(RuntimeError):  # there is nowhere to keep it
        dispatcher._cache = _PackageCache(function)
    return cast(Function, dispatcher)


def is_kept(function: Callable[..., Any]) -> bool:
    """Return whether a compiled function's machine code is there from an earlier process."""
    cache = cast(Any, function)._cache
    return isinstance(cache, _PackageCache) and cache.holds_any()


class _PackageCache(FunctionCache):
    """Numba's cache, but no machine code outlives a change of any compiled function of the package.

    Numba itself looks at the file of a function alone, though what the function calls is compiled into it.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        self._cache_file = IndexDataCacheFile(  # type: ignore[no-untyped-call]
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=source_stamp(PACKAGE),
        )

    def holds_any(self) -> bool:
        """Return whether anything is kept, and not out of date."""
        return bool(self._cache_file._load_index())  # type: ignore[no-untyped-call]


@cache
def source_stamp(package: Path) -> str:
    """Return a hash of all modules of a package that have compiled functions."""
    texts = (path.read_bytes() for path in sorted(package.rglob("*.py")))
    return sha256(b"\0".join(text for text in texts if b"@compiled" in text)).hexdigest()
