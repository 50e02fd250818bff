"""Whose process is at the other end of a connection."""

import os
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from app.api.accounts import peers

Connection = tuple[socket.socket, socket.socket]
"""A client's end and the accepted one."""
HOSTS = ["127.0.0.1", "127.0.0.9", "::1", "::ffff:127.0.0.1"]


@pytest.fixture
def connect() -> Iterator[Callable[[str], Connection]]:
    with ExitStack() as stack:

        def make(host: str, listening_on: str = "") -> Connection:
            family = socket.AF_INET6 if ":" in (listening_on or host) else socket.AF_INET
            listening = stack.enter_context(closing(socket.socket(family)))
            if family == socket.AF_INET6:
                listening.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
            listening.bind((listening_on or host, 0))
            listening.listen()
            client = stack.enter_context(closing(socket.create_connection((host, listening.getsockname()[1]))))
            accepted, _ = listening.accept()
            stack.enter_context(closing(accepted))
            return client, accepted

        yield make


def reset(client: socket.socket) -> None:
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()


@pytest.fixture(params=["netlink", "table"])
def _source(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """By either way in which a kernel tells."""
    if request.param == "table":
        monkeypatch.delattr(socket, "AF_NETLINK")


@pytest.mark.usefixtures("_source")
@pytest.mark.parametrize("host", HOSTS)
def test_who_connects_to_himself_is_the_own_user(connect: Callable[[str], Connection], host: str) -> None:
    _, accepted = connect(host)
    assert peers.user_of(accepted) == os.geteuid()
    assert peers.is_own_user(accepted)


@pytest.mark.usefixtures("_source")
def test_both_families_meet_where_one_socket_listens_for_both(connect: Callable[[str, str], Connection]) -> None:
    assert peers.is_own_user(connect("127.0.0.1", "::")[1])
    assert peers.is_own_user(connect("::1", "::")[1])


@pytest.mark.usefixtures("_source")
def test_a_connection_that_was_closed_or_reset_is_nobodys(connect: Callable[[str], Connection]) -> None:
    for end in (socket.socket.close, reset):
        client, accepted = connect("127.0.0.1")
        client.sendall(b"a request that can still be read")
        end(client)
        assert peers.user_of(accepted) is None
        assert not peers.is_own_user(accepted)


@pytest.mark.usefixtures("_source")
def test_who_only_has_nothing_more_to_say_is_still_there(connect: Callable[[str], Connection]) -> None:
    client, accepted = connect("127.0.0.1")
    client.shutdown(socket.SHUT_WR)
    assert peers.is_own_user(accepted)


def test_where_the_kernel_does_not_tell_nobody_is_the_own_user(
    connect: Callable[[str], Connection], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delattr(socket, "AF_NETLINK")
    monkeypatch.setattr(peers._looked_up_in_table, "__defaults__", (tmp_path,))
    _, accepted = connect("127.0.0.1")
    assert peers.user_of(accepted) is None
    assert not peers.is_own_user(accepted)


def test_a_unix_socket_tells_by_itself() -> None:
    near, far = socket.socketpair(socket.AF_UNIX)
    with near, far:
        assert peers.is_own_user(near)


def test_a_socket_without_another_end_is_nobodys() -> None:
    with socket.socket() as alone:
        assert not peers.is_own_user(alone)
