"""UDP for IMC: one socket for traffic, one for announces, drained in bulk by the event loop.

asyncio's datagram protocol takes one packet per turn of the loop; a vehicle sends hundreds per second, so the
sockets are read directly until they are empty.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import socket
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import ifaddr

from imc_bridge.settings import BridgeSettings

Address = tuple[str, int]
PacketHandler = Callable[[bytes, Address], None]

LOOPBACK = "127.0.0.1"
_RECEIVE_BUFFER_BYTES = 4 << 20
_PACKETS_PER_TURN = 512
"""Then other tasks get their turn, however fast packets come."""


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


class UdpTransport:
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
        self._loop: asyncio.AbstractEventLoop | None = None
        self.interfaces: list[Interface] = []
        self.announce_port: int | None = None
        self.send_errors: dict[str, int] = {}

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
            self._traffic = _bound_socket(host, settings.port)
        except OSError as error:
            raise PortInUseError(
                f"UDP port {settings.port} cannot be bound ({error.strerror}): another console or bathyfleet "
                "runs here; stop it or set another port and IMC id"
            ) from error
        self._traffic.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self._traffic.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
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
            group = socket.inet_aton(self._settings.multicast_group)
            for interface in self.interfaces:
                # An interface without multicast still has broadcast.
                with contextlib.suppress(OSError):
                    membership = group + socket.inet_aton(interface.address)
                    sock.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
            return sock
        self.close()
        raise PortInUseError(
            f"all announce ports ({', '.join(map(str, ports))}) are taken on this machine: stop one of the "
            "programs that listen for IMC announces (at most five vehicles and consoles fit on one host)"
        )

    def close(self) -> None:
        """Release the sockets; safe to repeat."""
        for sock in (self._traffic, self._announces):
            if sock is not None:
                if self._loop is not None:
                    self._loop.remove_reader(sock)
                sock.close()
        self._traffic = self._announces = None

    def _drain(self, sock: socket.socket, handler: PacketHandler) -> None:
        for _ in range(_PACKETS_PER_TURN):
            try:
                packet, address = sock.recvfrom(65536)
            except (BlockingIOError, InterruptedError):
                return
            except OSError:
                return
            handler(packet, address)
            if sock.fileno() < 0:
                return

    def send(self, packet: bytes, address: Address) -> bool:
        """Send without waiting; a failure is counted by its reason and told by False."""
        if self._traffic is None:
            return False
        try:
            self._traffic.sendto(packet, address)
        except OSError as error:
            reason = error.strerror or type(error).__name__
            self.send_errors[reason] = self.send_errors.get(reason, 0) + 1
            return False
        return True

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


def _bound_socket(host: str, port: int) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
        sock.bind((host, port))
    except OSError:
        sock.close()
        raise
    return sock
