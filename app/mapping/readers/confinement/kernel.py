"""System calls without a wrapper in the standard library."""

import ctypes
import os
from typing import Any

_LIBC = ctypes.CDLL(None, use_errno=True)

PR_SET_PDEATHSIG = 1
PR_SET_DUMPABLE = 4
PR_SET_NO_NEW_PRIVS = 38


def system_call(number: int, *arguments: Any) -> int:
    """Call the kernel by number. Raises OSError."""
    return _checked(_LIBC.syscall(ctypes.c_long(number), *(_word(argument) for argument in arguments)))


def prctl(option: int, value: int) -> None:
    """Set an attribute of the process. Raises OSError."""
    zero = ctypes.c_ulong(0)
    _checked(_LIBC.prctl(ctypes.c_int(option), ctypes.c_ulong(value), zero, zero, zero))


def unshare(flags: int) -> None:
    """Move into namespaces of its own. Raises OSError."""
    _checked(_LIBC.unshare(ctypes.c_int(flags)))


def _word(argument: Any) -> Any:
    return ctypes.c_long(argument) if isinstance(argument, int) else argument


def _checked(returned: int) -> int:
    if returned < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return returned
