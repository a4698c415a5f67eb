"""What a process has freed goes back to the system, also from below what it still uses."""

import ctypes
import sys
from pathlib import Path

import pytest

from graspdb.free_memory import give_back_free_memory

BLOCK, N_BLOCKS = 50_000, 2_000


def resident() -> int:
    """Return how much memory the process has [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


@pytest.mark.skipif(
    sys.platform != "linux", reason="other C libraries give memory back by themselves or not at all"
)
def test_memory_below_a_block_in_use_is_given_back() -> None:
    library = ctypes.CDLL(None)
    if not hasattr(library, "malloc_trim"):
        pytest.skip("not glibc")
    library.malloc.restype, library.free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
    blocks = [library.malloc(BLOCK) for _ in range(N_BLOCKS)]
    for block in blocks:
        ctypes.memset(block, 1, BLOCK)
    full = resident()
    for block in blocks[:-1]:
        library.free(block)
    give_back_free_memory()
    assert full - resident() > 0.8 * BLOCK * N_BLOCKS
    library.free(blocks[-1])


def test_where_the_c_library_cannot_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    give_back_free_memory.__globals__["_trim"].cache_clear()
    give_back_free_memory()
    give_back_free_memory.__globals__["_trim"].cache_clear()
