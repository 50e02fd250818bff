"""Lets the system drop unneeded packets before this process has to read them.

One LAUV sends 660 servo positions and attitudes a second, in simulations several times that. They fill a socket within
some milliseconds in which this process does something else. So a second socket, which is never read, shares the port,
and the system puts them there by their id. What is lost of the first one's is a loss; what is lost of the second one's
is meant to be.
"""

from __future__ import annotations

import ctypes
import socket
import struct

import imcpy

LOUD = ("ServoPosition", "EulerAngles", "AngularVelocity", "Acceleration")
"""Messages that come unasked at 94 Hz and more, and that nothing here uses."""

_SO_ATTACH_FILTER, _SO_ATTACH_REUSEPORT_CBPF = 26, 51
_INSTRUCTION = struct.Struct("=HBBI")
_LOAD_HALF, _JUMP_EQUAL, _RETURN = 0x28, 0x15, 0x06
_SYNC_AS_READ = 0x54FE
"""A little-endian packet's first two bytes, read in network order; others are none of ours to sort."""
_KEEP, _AWAY = 0, 1


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("code", ctypes.c_void_p))


def divert(kept: socket.socket) -> None:
    """Let packets with loud messages go to the second socket on the port of ``kept``.

    Parameters
    ----------
    kept
        Bound before the second one, both with SO_REUSEPORT.

    Raises
    ------
    OSError
        Where the system cannot do that: then both get some of everything, and the second one has to be closed.
    """
    ids = [int(getattr(imcpy, name)().msg_id) for name in LOUD]
    swapped = [(number & 0xFF) << 8 | number >> 8 for number in ids]
    code = [(_LOAD_HALF, 0, 0, 0), (_JUMP_EQUAL, 0, 1 + len(ids), _SYNC_AS_READ), (_LOAD_HALF, 0, 0, 2)]
    code += [(_JUMP_EQUAL, len(ids) - k, 0, number) for k, number in enumerate(swapped)]
    code += [(_RETURN, 0, 0, _KEEP), (_RETURN, 0, 0, _AWAY)]
    _attach(kept, _SO_ATTACH_REUSEPORT_CBPF, code)


def refuse_all(sock: socket.socket) -> None:
    """Let the system throw away every packet that comes for a socket; errors of what was sent still reach it.

    Raises
    ------
    OSError
        Where the system cannot do that.
    """
    _attach(sock, _SO_ATTACH_FILTER, [(_RETURN, 0, 0, 0)])


def _attach(sock: socket.socket, option: int, code: list[tuple[int, int, int, int]]) -> None:
    packed = ctypes.create_string_buffer(b"".join(_INSTRUCTION.pack(*line) for line in code))
    program = _Program(len(code), ctypes.addressof(packed))
    sock.setsockopt(socket.SOL_SOCKET, option, bytes(program))
