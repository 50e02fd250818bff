"""Text fields of messages, read without losing memory.

imcpy 1.1.2 counts one reference too many whenever a text field is read, so that the text is never freed: a vehicle's
states and announces would cost the service some hundred megabytes a week. Whether the installed imcpy does so is seen
once, when this module is imported; one that does not is left alone.
"""

import ctypes
import sys
from typing import Any

import imcpy

_HELD_BY_THE_LOOK = 2  # the variable, and the argument of getrefcount


def _surplus() -> int:
    """How many references too many a text has that was just read."""
    message = imcpy.Announce()
    message.services = "a text that nobody else has"
    text = message.services
    return sys.getrefcount(text) - _HELD_BY_THE_LOOK


_LOSES_MEMORY = _surplus() == 1
_release = ctypes.pythonapi.Py_DecRef
_release.argtypes = [ctypes.py_object]
_release.restype = None


def text(message: Any, field: str) -> str:
    """Return a text field of a message."""
    value: str = getattr(message, field)
    if _LOSES_MEMORY:
        _release(value)  # ``value`` itself still holds it
    return value
