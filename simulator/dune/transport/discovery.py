"""Hearing the announces of others: the first free announce port, taken exclusively."""

from __future__ import annotations

import socket
from collections.abc import Iterable
from ipaddress import ip_address

from simulator.network import PacketHandler, UdpEndpoint

MULTICAST_GROUP = "224.0.75.69"
_EVERY_ADDRESS = "0.0.0.0"  # noqa: S104 - only such sockets receive broadcasts and multicasts


async def listen_for_announces(host: str, ports: Iterable[int], handler: PacketHandler) -> UdpEndpoint:
    """Take the first free announce port; on a real network also join LSTS' multicast group.

    All nodes of one simulator share one port, although every real DUNE takes its own: a host has five, and the
    consumers need theirs.

    Parameters
    ----------
    host
        The address that the nodes bind.
    ports
        Candidates in order.
    handler
        Gets every packet.

    Raises
    ------
    OSError
        When all of them are taken; the message names them.
    """
    local = ip_address(host).is_loopback
    tried = []
    for port in ports:
        try:
            endpoint = await UdpEndpoint.open((host if local else _EVERY_ADDRESS, port), handler)
        except OSError:
            tried.append(port)
            continue
        if not local:
            membership = socket.inet_aton(MULTICAST_GROUP) + socket.inet_aton(host)
            endpoint.set_option(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        return endpoint
    raise OSError(
        f"all announce ports are taken on {host} ({', '.join(map(str, tried))}); "
        "stop another listener on this host or give other announce ports"
    )
