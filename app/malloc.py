"""How the process gets its memory from the system."""

import ctypes
import gc
import platform
from collections.abc import Iterator
from contextlib import contextmanager

ARENAS = 2
LARGE_BYTES = 512 * 1024

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8


def keep_memory_together() -> None:
    """Let all threads share few pools of memory, and give large arrays back to the system at once.

    The C library gives every thread a pool of its own and raises by itself what it takes for large. Maps and decisions
    are made by many threads: within hours their half-empty pools took as much again as everything else. Other C
    libraries than glibc have no such pools.
    """
    if platform.libc_ver()[0] != "glibc":
        return
    libc = ctypes.CDLL(None)
    for setting, value in ((_M_ARENA_MAX, ARENAS), (_M_MMAP_THRESHOLD, LARGE_BYTES), (_M_TRIM_THRESHOLD, LARGE_BYTES)):
        libc.mallopt(setting, value)


@contextmanager
def settled() -> Iterator[None]:
    """Leave what was made so far out of the search for garbage, until the end of the block.

    Modules, models and compiled code are hundreds of thousands of objects; to look through all of them stops every
    thread for as long as half a second, and happens whenever a large request makes many new ones.
    """
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
