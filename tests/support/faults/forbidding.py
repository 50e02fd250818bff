"""Runs a command as a service manager does whose filter of system calls knows neither Landlock nor seccomp.

The arguments are the command. Such calls fail with EPERM, as under ``SystemCallErrorNumber=EPERM``.
"""

import ctypes
import errno
import os
import platform
import struct
import sys

from app.mapping.readers.confinement.kernel import PR_SET_NO_NEW_PRIVS, prctl, system_call

SECCOMP = {"x86_64": 317, "aarch64": 277}[platform.machine()]
LANDLOCK = (444, 445, 446)
LOAD_NUMBER, EQUAL, RETURN = 0x20, 0x15, 0x06
ALLOW, ERROR = 0x7FFF0000, 0x00050000


class Program(ctypes.Structure):
    """struct sock_fprog."""

    _fields_ = (("length", ctypes.c_ushort), ("instructions", ctypes.c_char_p))


if __name__ == "__main__":
    steps = [(LOAD_NUMBER, 0, 0, 0)]
    for number in (SECCOMP, *LANDLOCK):
        steps += [(EQUAL, 0, 1, number), (RETURN, 0, 0, ERROR | errno.EPERM)]
    code = b"".join(struct.pack("=HBBI", *step) for step in [*steps, (RETURN, 0, 0, ALLOW)])
    prctl(PR_SET_NO_NEW_PRIVS, 1)
    system_call(SECCOMP, 1, 0, ctypes.byref(Program(len(code) // 8, code)))
    os.execvp(sys.argv[1], sys.argv[1:])  # noqa: S606
