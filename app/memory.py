"""How the process gets its memory from the system."""

import ctypes
import platform

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
