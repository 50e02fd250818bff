"""Landlock: from now on this process reaches no file and no socket but those it has open (landlock(7))."""

import ctypes
import os
from collections.abc import Sequence
from pathlib import Path

from app.mapping.readers.confinement.kernel import system_call

CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446
"""The same numbers on every architecture."""

_VERSION = 1
_PATH_BENEATH = 1
_READ_FILE, _READ_DIR = 1 << 2, 1 << 3
# What each version of the interface can handle: 13 rights in the first, then REFER, TRUNCATE, IOCTL_DEV.
_FILES = {1: (1 << 13) - 1, 2: (1 << 14) - 1, 3: (1 << 15) - 1, 5: (1 << 16) - 1}
_NETWORK_FROM, _TCP = 4, 0b11
_SCOPED_FROM, _ABSTRACT_SOCKETS_AND_SIGNALS = 6, 0b11


class _Ruleset(ctypes.Structure):
    _fields_ = (("files", ctypes.c_uint64), ("network", ctypes.c_uint64), ("scoped", ctypes.c_uint64))


class _Beneath(ctypes.Structure):
    _pack_ = 1
    _fields_ = (("allowed", ctypes.c_uint64), ("folder", ctypes.c_int32))


def version() -> int:
    """Return the kernel's version of the interface. Raises OSError where there is none."""
    return system_call(CREATE_RULESET, None, 0, _VERSION)


def restrict(readable: Sequence[Path]) -> int:
    """Deny every file but those in the folders ``readable``, which may be read; returns the kernel's version.

    The process must have set PR_SET_NO_NEW_PRIVS. Raises OSError where the kernel lacks Landlock.
    """
    found = version()
    files = _FILES[max(known for known in _FILES if known <= found)]
    attributes = _Ruleset(
        files,
        _TCP if found >= _NETWORK_FROM else 0,
        _ABSTRACT_SOCKETS_AND_SIGNALS if found >= _SCOPED_FROM else 0,
    )
    # Kernels take a longer structure than they know where the rest of it is zero.
    rules = system_call(CREATE_RULESET, ctypes.byref(attributes), ctypes.sizeof(attributes), 0)
    try:
        for folder in readable:
            _allow(rules, folder)
        system_call(RESTRICT_SELF, rules, 0)
    finally:
        os.close(rules)
    return found


def _allow(rules: int, folder: Path) -> None:
    descriptor = os.open(folder, os.O_PATH | os.O_CLOEXEC | os.O_DIRECTORY)
    try:
        beneath = _Beneath(_READ_FILE | _READ_DIR, descriptor)
        system_call(ADD_RULE, rules, _PATH_BENEATH, ctypes.byref(beneath), 0)
    finally:
        os.close(descriptor)
