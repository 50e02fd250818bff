"""UDP for IMC: one socket for traffic, one for announces, drained in bulk by the event loop; TCP where it is wished.

asyncio's datagram protocol takes one packet per turn of the loop; a vehicle sends hundreds per second, so the
sockets are read directly until they are empty.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import os
import socket
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import ifaddr

from imc_bridge.network.packet_filter import divert, refuse_all
from imc_bridge.network.streams import TcpStreams
from imc_bridge.settings import BridgeSettings

Address = tuple[str, int]
PacketHandler = Callable[[bytes, Address], None]

LOOPBACK = "127.0.0.1"
_RECEIVE_BUFFER_BYTES = 16 << 20
_SO_REUSEPORT = getattr(socket, "SO_REUSEPORT", 0)
_SO_RCVBUFFORCE = 33
"""Linux: a receive buffer beyond the system's limit, for programs with that privilege."""
_SO_MEMINFO = 55
_MEMINFO = struct.Struct("=9I")
"""Linux: what a socket holds; the last figure counts packets that it had no room for."""
_PACKETS_PER_TURN = 512
_TURN_WALL_S = 0.01
"""After this many packets, or seconds, other tasks get their turn, however fast packets come: a stop must not wait."""
_PACKETS_PER_LOOK = 16
_MAX_UNREACHABLE = 64
_IP_RECVERR = 11
"""Linux: report the ICMP errors that our packets cause; the socket module does not name it."""
_MSG_ERRQUEUE = getattr(socket, "MSG_ERRQUEUE", 0)
_EXTENDED_ERROR = struct.Struct("=IBBBBII")


class PortInUseError(OSError):
    """A port of ours belongs to another program."""


@dataclass(frozen=True, slots=True)
class Interface:
    """An IPv4 address of this machine with the broadcast address of its network."""

    address: str
    broadcast: str


def list_interfaces() -> list[Interface]:
    """Every IPv4 address of this machine except loopback."""
    found = []
    for adapter in ifaddr.get_adapters():
        for ip in adapter.ips:
            if isinstance(ip.ip, str) and not ipaddress.IPv4Address(ip.ip).is_loopback:
                network = ipaddress.IPv4Network(f"{ip.ip}/{ip.network_prefix}", strict=False)
                found.append(Interface(ip.ip, str(network.broadcast_address)))
    return found


def choose_interfaces(settings: BridgeSettings) -> list[Interface]:
    """The interfaces to announce on, besides loopback.

    Raises
    ------
    ValueError
        When a configured address does not belong to this machine; the message lists those that do.
    """
    if settings.loopback_only:
        return []
    present = list_interfaces()
    if not settings.interfaces:
        return present
    by_address = {interface.address: interface for interface in present}
    for address in settings.interfaces:
        if address not in by_address and address != LOOPBACK:
            known = ", ".join(by_address) or "none besides loopback"
            raise ValueError(f"interfaces: this machine has no address {address}; it has {known}")
    return [by_address[address] for address in settings.interfaces if address in by_address]


class Transport:
    """The sockets of one console.

    Parameters
    ----------
    settings
    on_packet
        Called with every packet of the traffic socket.
    on_announce
        Called with every packet of the announce socket.
    """

    def __init__(self, settings: BridgeSettings, on_packet: PacketHandler, on_announce: PacketHandler) -> None:
        self._settings = settings
        self._on_packet = on_packet
        self._on_announce = on_announce
        self._traffic: socket.socket | None = None
        self._announces: socket.socket | None = None
        self._unread: socket.socket | None = None
        """Receives unneeded packets, and half of the errors: the system returns those to either of two on a port."""
        self._loop: asyncio.AbstractEventLoop | None = None
        self.interfaces: list[Interface] = []
        self.announce_port: int | None = None
        self.send_errors: dict[str, int] = {}
        self.unreachable: dict[Address, str] = {}
        """Addresses that answered our packets by an ICMP error, or that no route leads to, with the error's text."""
        self.streams = TcpStreams(on_packet)
        self._joined: set[str] = set()

    def open(self) -> None:
        """Bind the sockets and read them from the running event loop.

        Raises
        ------
        PortInUseError
            Saying which port is taken and what to do.
        ValueError
            When a configured interface is absent.
        """
        settings = self._settings
        self._loop = asyncio.get_running_loop()
        self.interfaces = choose_interfaces(settings)
        host = LOOPBACK if settings.loopback_only else "0.0.0.0"  # noqa: S104 - vehicles come from any interface
        try:
            # Shared with our own second socket only.
            _bound_socket(host, settings.port).close()
            self._traffic = _bound_socket(host, settings.port, shared=True)
        except OSError as error:
            raise PortInUseError(
                f"UDP port {settings.port} cannot be bound ({error.strerror}): another console or bathyfleet "
                "runs here; stop it or set another port and IMC id"
            ) from error
        self._traffic.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self._traffic.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
        _ask_for_errors(self._traffic)
        self._unread = _unread_socket(self._traffic)
        if self._unread is not None:
            self._loop.add_reader(self._unread, self._take_errors, self._unread)
        self._announces = self._bind_announces(host)
        self._loop.add_reader(self._traffic, self._drain, self._traffic, self._on_packet)
        self._loop.add_reader(self._announces, self._drain, self._announces, self._on_announce)

    def _bind_announces(self, host: str) -> socket.socket:
        ports = self._settings.announce_ports
        for port in ports:
            try:
                sock = _bound_socket(host, port)
            except OSError:
                continue
            self.announce_port = port
            self._join_groups(sock)
            return sock
        self.close()
        raise PortInUseError(
            f"all announce ports ({', '.join(map(str, ports))}) are taken on this machine: stop one of the "
            "programs that listen for IMC announces (at most five vehicles and consoles fit on one host)"
        )

    def _join_groups(self, sock: socket.socket) -> None:
        """Hear multicasts on every interface that is there now; one whose address went away is forgotten."""
        group = socket.inet_aton(self._settings.multicast_group)
        present = {interface.address for interface in self.interfaces}
        self._joined &= present
        for address in sorted(present - self._joined):
            # An interface without multicast still has broadcast.
            with contextlib.suppress(OSError):
                sock.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group + socket.inet_aton(address))
                self._joined.add(address)

    def look_for_interfaces(self) -> bool:
        """Take up interfaces that came (a Wi-Fi that connected late) and drop those that went; True when any did."""
        if self._announces is None:
            return False
        try:
            found = choose_interfaces(self._settings)
        except ValueError:
            # A configured one is away for the moment: the others go on.
            found = [i for i in list_interfaces() if i.address in self._settings.interfaces]
        if found == self.interfaces:
            return False
        self.interfaces = found
        self._join_groups(self._announces)
        return True

    def dropped(self) -> int:
        """How many packets the system threw away because our sockets were full; 0 where it does not count."""
        count = 0
        for sock in (self._traffic, self._announces):
            if sock is None:
                continue
            with contextlib.suppress(OSError, struct.error):
                count += _MEMINFO.unpack(sock.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMINFO.size))[-1]
        return count

    @property
    def receive_buffer_bytes(self) -> int:
        """Room for packets that wait for us, as the system gave it; 0 when closed."""
        return 0 if self._traffic is None else self._traffic.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)

    async def close_streams(self) -> None:
        """Close the TCP connections."""
        await self.streams.close()

    def close(self) -> None:
        """Release the sockets; safe to repeat."""
        for sock in (self._traffic, self._announces, self._unread):
            if sock is not None:
                if self._loop is not None:
                    self._loop.remove_reader(sock)
                sock.close()
        self._traffic = self._announces = self._unread = None

    def _drain(self, sock: socket.socket, handler: PacketHandler) -> None:
        end = time.monotonic() + _TURN_WALL_S
        for taken in range(_PACKETS_PER_TURN):
            if taken % _PACKETS_PER_LOOK == _PACKETS_PER_LOOK - 1 and time.monotonic() > end:
                return
            try:
                packet, address = sock.recvfrom(65536)
            except (BlockingIOError, InterruptedError):
                if taken == 0:
                    self._take_errors(sock)
                return
            except OSError:
                self._take_errors(sock)
                return
            self.unreachable.pop(address, None)
            handler(packet, address)
            if sock.fileno() < 0:
                return

    def _take_errors(self, sock: socket.socket) -> None:
        """Empty the queue of ICMP errors, each of which names the address that our packet did not reach."""
        while _MSG_ERRQUEUE and sock.fileno() >= 0:
            try:
                _, ancillary, _, address = sock.recvmsg(0, 512, _MSG_ERRQUEUE)
            except OSError:
                return
            for level, kind, data in ancillary:
                if (level, kind) == (socket.IPPROTO_IP, _IP_RECVERR) and len(data) >= _EXTENDED_ERROR.size:
                    self._note_unreachable(address, os.strerror(_EXTENDED_ERROR.unpack_from(data)[0]))

    def _note_unreachable(self, address: Address, reason: str) -> None:
        if len(self.unreachable) < _MAX_UNREACHABLE or address in self.unreachable:
            self.unreachable[address] = reason

    def send(self, packet: bytes, address: Address) -> bool:
        """Send without waiting, by TCP where a stream leads there; False when that fails, which is counted."""
        if self.streams.wants(address):
            return self.streams.send(packet, address)
        if self._traffic is None:
            return False
        for last in (False, True):
            try:
                self._traffic.sendto(packet, address)
            except OSError as error:
                # The error may be an earlier packet's to another address, reported late.
                self._take_errors(self._traffic)
                if last:
                    reason = error.strerror or type(error).__name__
                    self.send_errors[reason] = self.send_errors.get(reason, 0) + 1
                    self._note_unreachable(address, reason)
            else:
                return True
        return False

    def own_addresses(self) -> Sequence[str]:
        """Addresses under which vehicles may reach us, loopback last."""
        return [*(interface.address for interface in self.interfaces), LOOPBACK]

    def announce(self, packet_for: Callable[[Sequence[str]], bytes]) -> None:
        """Send an announce to every announce port by loopback, multicast and broadcast; nothing when closed.

        Parameters
        ----------
        packet_for
            Makes the packet from our addresses, the one the receiver should use first.
        """
        if self._traffic is None:
            return
        ports = self._settings.announce_ports
        others = [interface.address for interface in self.interfaces]
        packet = packet_for([LOOPBACK, *others])
        for port in ports:
            self.send(packet, (LOOPBACK, port))
        for interface in self.interfaces:
            packet = packet_for([interface.address, *(a for a in others if a != interface.address)])
            with contextlib.suppress(OSError):
                address = socket.inet_aton(interface.address)
                self._traffic.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, address)
            for port in ports:
                self.send(packet, (self._settings.multicast_group, port))
                self.send(packet, (interface.broadcast, port))


def _bound_socket(host: str, port: int, *, shared: bool = False) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sock.setblocking(False)
        if shared and _SO_REUSEPORT:
            sock.setsockopt(socket.SOL_SOCKET, _SO_REUSEPORT, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _RECEIVE_BUFFER_BYTES)
        sock.bind((host, port))
    except OSError:
        sock.close()
        raise
    return sock


def _ask_for_errors(sock: socket.socket) -> None:
    """Have the system queue ICMP errors for ``sock``, each with the address that it is about."""
    if _MSG_ERRQUEUE:
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.IPPROTO_IP, _IP_RECVERR, 1)


def _unread_socket(traffic: socket.socket) -> socket.socket | None:
    """A socket on the port of ``traffic`` that receives the unneeded messages; None where there can be none."""
    if not _SO_REUSEPORT:
        return None
    host, port = traffic.getsockname()
    unread = None
    try:
        unread = _bound_socket(host, port, shared=True)
        refuse_all(unread)
        _ask_for_errors(unread)
        divert(traffic)
    except OSError:
        if unread is not None:
            unread.close()
        return None
    return unread
