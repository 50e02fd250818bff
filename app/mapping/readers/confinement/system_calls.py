"""A seccomp filter: from now on the kernel does for this process what computing takes, and nothing else (seccomp(2)).

An allow-list: what is not on it fails with ENOSYS, to which libraries are used from older kernels.
"""

import ctypes
import errno
import os
import platform
import struct
from dataclasses import dataclass

from app.mapping.readers.confinement.kernel import system_call

_NUMBERS = {
    # Calls on what is open already, and on names of files; opening is judged below.
    "read": (0, 63), "pread64": (17, 67), "readv": (19, 65), "preadv": (295, 69), "lseek": (8, 62),
    "write": (1, 64), "pwrite64": (18, 68), "writev": (20, 66), "close": (3, 57), "fstat": (5, 80),
    "newfstatat": (262, 79), "statx": (332, 291), "stat": (4, None), "lstat": (6, None), "access": (21, None),
    "faccessat": (269, 48), "readlink": (89, None), "readlinkat": (267, 78), "getcwd": (79, 17),
    "getdents64": (217, 61), "dup": (32, 23), "fadvise64": (221, 223), "poll": (7, None), "ppoll": (271, 73),
    # Memory.
    "munmap": (11, 215), "mremap": (25, 216), "madvise": (28, 233), "brk": (12, 214), "mincore": (27, 232),
    # The process itself, and time.
    "futex": (202, 98), "set_robust_list": (273, 99), "rseq": (334, 293), "membarrier": (324, 283),
    "rt_sigaction": (13, 134), "rt_sigprocmask": (14, 135), "rt_sigreturn": (15, 139), "sigaltstack": (131, 132),
    "restart_syscall": (219, 128), "exit": (60, 93), "exit_group": (231, 94), "arch_prctl": (158, None),
    "clock_gettime": (228, 113), "clock_getres": (229, 114), "clock_nanosleep": (230, 115), "nanosleep": (35, 101),
    "gettimeofday": (96, 169), "time": (201, None), "times": (100, 153), "getrusage": (98, 165),
    "getrandom": (318, 278), "sched_yield": (24, 124), "sched_getaffinity": (204, 123), "getcpu": (309, 168),
    "getpid": (39, 172), "gettid": (186, 178), "getppid": (110, 173), "getuid": (102, 174), "geteuid": (107, 175),
    "getgid": (104, 176), "getegid": (108, 177), "uname": (63, 160), "sysinfo": (99, 179), "getrlimit": (97, 163),
}  # fmt: skip
"""What is allowed whatever its arguments: numbers on x86-64 and on ARM (64 bits)."""

_OPEN, _OPENAT = (2, None), (257, 56)
_MMAP, _MPROTECT = (9, 222), (10, 226)
_PRLIMIT, _TGKILL, _FCNTL = (302, 261), (234, 131), (72, 25)

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_PROT_EXEC = 4
_F_SETLKW, _F_DUPFD_CLOEXEC = 7, 1030

_LOAD, _EQUAL, _GREATER, _ANY_BIT, _RETURN = 0x20, 0x15, 0x25, 0x45, 0x06
_ALLOW, _ERROR, _KILL_PROCESS = 0x7FFF0000, 0x00050000, 0x80000000
_NUMBER_AT, _ARCHITECTURE_AT, _ARGUMENTS_AT = 0, 4, 16
_SET_MODE_FILTER = 1


@dataclass(frozen=True)
class _Machine:
    column: int
    architecture: int
    seccomp: int


_MACHINES = {"x86_64": _Machine(0, 0xC000003E, 317), "aarch64": _Machine(1, 0xC00000B7, 277)}


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("instructions", ctypes.c_char_p))


def _step(code: int, value: int, if_true: int = 0, if_false: int = 0) -> bytes:
    return struct.pack("=HBBI", code, if_true, if_false, value)


def _refuse(number: int) -> bytes:
    return _step(_RETURN, _ERROR | number)


def _argument(index: int) -> bytes:
    # The lower half of a 64-bit word, on little-endian machines, which both are.
    return _step(_LOAD, _ARGUMENTS_AT + 8 * index)


def _unless(bits: int, argument: int, error: int) -> list[bytes]:
    """Allow where an argument has none of the bits."""
    return [_argument(argument), _step(_ANY_BIT, bits, 0, 1), _refuse(error), _step(_RETURN, _ALLOW)]


def _only(value: int, argument: int) -> list[bytes]:
    """Allow where an argument has the value."""
    return [_argument(argument), _step(_EQUAL, value, 1, 0), _refuse(errno.EPERM), _step(_RETURN, _ALLOW)]


def _rules(*, opening: bool) -> list[tuple[tuple[int | None, int | None], list[bytes]]]:
    """Return the calls that depend on their arguments, each with how it is judged; every way ends in a return."""
    own = _only(0, 0)
    locks = [
        _argument(1), _step(_GREATER, _F_SETLKW, 1, 0), _step(_RETURN, _ALLOW),
        _step(_EQUAL, _F_DUPFD_CLOEXEC, 1, 0), _refuse(errno.EPERM), _step(_RETURN, _ALLOW),
    ]  # fmt: skip
    return [
        (_OPEN, _unless(_WRITING, 1, errno.EACCES) if opening else [_refuse(errno.EACCES)]),
        (_OPENAT, _unless(_WRITING, 2, errno.EACCES) if opening else [_refuse(errno.EACCES)]),
        (_MMAP, _unless(_PROT_EXEC, 2, errno.EPERM)),
        (_MPROTECT, _unless(_PROT_EXEC, 2, errno.EPERM)),
        (_PRLIMIT, own),
        (_TGKILL, _only(os.getpid(), 0)),
        (_FCNTL, locks),
    ]


def make_filter(machine: str, *, opening: bool) -> bytes:
    """Return the filter's instructions for a machine. Raises KeyError for one whose calls are not known."""
    kind = _MACHINES[machine]
    steps = [
        _step(_LOAD, _ARCHITECTURE_AT),
        _step(_EQUAL, kind.architecture, 1, 0),
        _step(_RETURN, _KILL_PROCESS),
        _step(_LOAD, _NUMBER_AT),
    ]
    for always in _NUMBERS.values():
        if (number := always[kind.column]) is not None:
            steps += [_step(_EQUAL, number, 0, 1), _step(_RETURN, _ALLOW)]
    for numbers, judged in _rules(opening=opening):
        if (number := numbers[kind.column]) is not None:
            steps += [_step(_EQUAL, number, 0, len(judged)), *judged]
    steps.append(_refuse(errno.ENOSYS))
    return b"".join(steps)


def restrict(*, opening: bool) -> None:
    """Let the kernel refuse what is not on the list, for every thread of this process and for good.

    The process must have set PR_SET_NO_NEW_PRIVS.

    Parameters
    ----------
    opening
        Whether files may still be opened for reading, where something else says which ones.

    Raises
    ------
    OSError
        Where the kernel has no such filters, or the machine is neither x86-64 nor ARM with 64 bits.
    """
    machine = platform.machine()
    if machine not in _MACHINES:
        raise OSError(errno.ENOSYS, f"no list of system calls for {machine}")
    instructions = make_filter(machine, opening=opening)
    program = _Program(len(instructions) // 8, instructions)
    system_call(_MACHINES[machine].seccomp, _SET_MODE_FILTER, 0, ctypes.byref(program))
