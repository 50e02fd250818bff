"""Whose process is at the other end of a connection from this machine: the kernel knows."""

import ipaddress
import os
import socket
import struct

_SOCK_DIAG_BY_FAMILY = 20
_REQUEST = 1
_ANY_STATE = 0xFFFFFFFF
_HEADER = struct.Struct("=IHHII")
_QUESTION = struct.Struct("=BBBxI2s2s16s16sIII")
_UID_AT = _HEADER.size + 4 + 48 + 12
"""After the message's header come family and states, the socket's identity, and three counters (linux/inet_diag.h)."""


def is_another_user(client: tuple[str, int] | None, server: tuple[str, int | None] | None) -> bool:
    """Tell whether a loopback connection was made by another user of this machine, root included.

    False as well where the kernel does not tell (other systems, gVisor).
    """
    if client is None or server is None or server[1] is None:
        return False
    uid = _owner(client, (server[0], server[1]))
    return uid is not None and uid != os.geteuid()


def _owner(near: tuple[str, int], far: tuple[str, int]) -> int | None:
    """Return the user whose TCP socket is bound to ``near`` and connected to ``far``; None when that cannot be told."""
    try:
        places = [ipaddress.ip_address(host) for host, _ in (near, far)]
    except ValueError:
        return None
    family = socket.AF_INET if all(place.version == 4 for place in places) else socket.AF_INET6
    ends = [place.packed.ljust(16, b"\0") for place in places]
    ports = [struct.pack(">H", port) for _, port in (near, far)]
    unknown = 0xFFFFFFFF  # the socket's cookie
    question = _QUESTION.pack(family, socket.IPPROTO_TCP, 0, _ANY_STATE, *ports, *ends, 0, unknown, unknown)
    try:
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 4) as kernel:
            kernel.settimeout(1.0)
            kernel.send(_HEADER.pack(_HEADER.size + len(question), _SOCK_DIAG_BY_FAMILY, _REQUEST, 1, 0) + question)
            answer = kernel.recv(4096)
    except (OSError, AttributeError):
        return None
    if len(answer) < _UID_AT + 4 or _HEADER.unpack_from(answer)[1] != _SOCK_DIAG_BY_FAMILY:
        return None
    uid: int = struct.unpack_from("=I", answer, _UID_AT)[0]
    return uid
