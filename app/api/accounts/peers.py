"""Whose process is at the other end of a connection: the kernel is asked when the connection is accepted.

Later is too late: of a connection that was reset, and of a process that ended, the kernel knows no user any more. What
cannot be told is nobody's, so it is not the user's who runs the service.
"""

import ipaddress
import os
import socket
import struct
from collections.abc import Iterator
from functools import cache
from pathlib import Path

Address = ipaddress.IPv4Address | ipaddress.IPv6Address
End = tuple[Address, int]
"""An address and a port."""

OWN_USER = "own_user"
"""Where in a request's ``state`` it is kept whether :func:`is_own_user` was true of its connection."""

_ESTABLISHED, _FIN_WAIT_1, _FIN_WAIT_2, _CLOSE_WAIT = 1, 4, 5, 8
"""States of a TCP socket, as Linux numbers them."""
_OPEN = frozenset((_ESTABLISHED, _FIN_WAIT_1, _FIN_WAIT_2, _CLOSE_WAIT))
"""States in which a process may still have the socket; whether one does is told by its inode."""

_SOCK_DIAG_BY_FAMILY = 20
_REQUEST = 1
_ANY_STATE = 0xFFFFFFFF
_HEADER = struct.Struct("=IHHII")
_QUESTION = struct.Struct("=BBBxI2s2s16s16sIII")
_STATE_AT = _HEADER.size + 1
_UID_AT = _HEADER.size + 4 + 48 + 12
"""After the message's header come family and states, the socket's identity, and three counters (linux/inet_diag.h)."""
_UID_AND_INODE = struct.Struct("=II")


def is_own_user(connection: socket.socket) -> bool:
    """Tell whether an accepted connection was made by a process of the user who runs this one, on this machine.

    This is the one rule for who is local, whatever is spoken over the connection. Other users are not, root included;
    nor is whoever cannot be told: because the connection was closed or reset already, or because this kernel does not
    say (then there are access tokens).
    """
    return user_of(connection) == os.geteuid()


def user_of(connection: socket.socket) -> int | None:
    """Return the user whose process is at the other end of a connection from this machine; None where nobody can tell.

    Only connections by the loopback and by Unix sockets are looked at.
    """
    try:
        if connection.family == socket.AF_UNIX:
            credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
            return _nameable(struct.unpack("3i", credentials)[1])
        near, far = _end(connection.getpeername()), _end(connection.getsockname())
        if not near[0].is_loopback:
            return None
        user = user_of_socket(near, far)
        # Had it been reset meanwhile, the port could be another process' by now, and so could the answer.
        connection.getpeername()
    except (OSError, ValueError):
        return None
    return user


def user_of_socket(near: End, far: End) -> int | None:
    """Return who has the TCP socket that is bound to ``near`` and connected to ``far``; None where nobody can tell."""
    found: tuple[int, int, int] | None
    try:
        found = _asked_by_netlink(near, far)
    except (OSError, AttributeError):
        # A kernel without that interface may still have the table; a socket that is gone is in neither.
        found = _looked_up_in_table(near, far)
    if found is None:
        return None
    state, user, inode = found
    # A socket that its process has closed belongs to nobody, for which the kernel says 0, as for root.
    return _nameable(user) if state in _OPEN and inode else None


def _end(address: tuple[str, int]) -> End:
    host = ipaddress.ip_address(address[0])
    mapped = host.ipv4_mapped if isinstance(host, ipaddress.IPv6Address) else None
    return mapped or host, address[1]


def _nameable(user: int) -> int | None:
    """Return None for the number that stands for every user who has none in this container."""
    return None if user == _stand_in() else user


@cache
def _stand_in() -> int | None:
    try:
        if Path("/proc/self/uid_map").read_text().split() == ["0", "0", str(2**32 - 1)]:
            return None  # every user has a number
        return int(Path("/proc/sys/kernel/overflowuid").read_text())
    except (OSError, ValueError):
        return None


def _asked_by_netlink(near: End, far: End) -> tuple[int, int, int]:
    """Return state, user and inode of a socket. Raises OSError where there is none, or this cannot be asked."""
    family = socket.AF_INET if near[0].version == 4 else socket.AF_INET6
    ends = [end[0].packed.ljust(16, b"\0") for end in (near, far)]
    ports = [struct.pack(">H", end[1]) for end in (near, far)]
    unknown = 0xFFFFFFFF  # the socket's cookie
    question = _QUESTION.pack(family, socket.IPPROTO_TCP, 0, _ANY_STATE, *ports, *ends, 0, unknown, unknown)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 4) as kernel:
        kernel.settimeout(1.0)
        kernel.send(_HEADER.pack(_HEADER.size + len(question), _SOCK_DIAG_BY_FAMILY, _REQUEST, 1, 0) + question)
        answer = kernel.recv(4096)
    if len(answer) < _HEADER.size + 4:
        raise OSError("the kernel's answer is cut off")
    if _HEADER.unpack_from(answer)[1] != _SOCK_DIAG_BY_FAMILY:
        # No such socket, or nobody in this kernel to answer the question: both are the same error.
        raise OSError("the kernel does not tell by this way")
    if len(answer) < _UID_AT + _UID_AND_INODE.size:
        raise OSError("the kernel's answer is cut off")
    user, inode = _UID_AND_INODE.unpack_from(answer, _UID_AT)
    return answer[_STATE_AT], user, inode


def _looked_up_in_table(near: End, far: End, table: Path = Path("/proc/self/net")) -> tuple[int, int, int] | None:
    """Return state, user and inode of a socket from the kernel's tables, which are read from beginning to end."""
    for name, forms in (("tcp", _forms_v4), ("tcp6", _forms_v6)):
        wanted = [list(forms(end)) for end in (near, far)]
        if not all(wanted):
            continue
        try:
            lines = (table / name).read_text().splitlines()[1:]
        except OSError:
            continue
        for line in lines:
            fields = line.split()
            if len(fields) > 9 and [fields[1:2], fields[2:3]] == wanted:
                return int(fields[3], 16), int(fields[7]), int(fields[9])
    return None


def _forms_v4(end: End) -> Iterator[str]:
    if end[0].version == 4:
        yield f"{_words(end[0].packed)}:{end[1]:04X}"


def _forms_v6(end: End) -> Iterator[str]:
    packed = end[0].packed if end[0].version == 6 else b"\0" * 10 + b"\xff\xff" + end[0].packed
    yield f"{_words(packed)}:{end[1]:04X}"


def _words(packed: bytes) -> str:
    """Return an address as the tables have it: as words in this machine's order of bytes."""
    return "".join(f"{word:08X}" for (word,) in struct.iter_unpack("=I", packed))
