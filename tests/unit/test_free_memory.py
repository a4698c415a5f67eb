"""What a process has freed goes back to the system, also from below what it still uses."""

import ctypes
import resource
import sys
from pathlib import Path

import pytest

from graspdb import free_memory
from graspdb.free_memory import give_back_free_memory

BLOCK, N_BLOCKS = 50_000, 2_000


def resident() -> int:
    """Return how much memory the process has [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


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


def test_where_the_c_library_cannot_it_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(ctypes, "CDLL", asked.append)
    monkeypatch.setattr(free_memory, "_trim", free_memory._trim.__wrapped__)
    give_back_free_memory()
    assert not asked
