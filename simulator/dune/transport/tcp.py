"""DUNE's TCP server: every client gets all that the node sends and may command it, without any announce."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable

from simulator.network import Address

FIRST_PORT = 7001
_HEADER = struct.Struct("<HHH")
_SYNC = 0xFE54
_OVERHEAD = 22


class TcpServer:
    """Accepts consoles.

    Parameters
    ----------
    on_packet
        Gets every packet and its sender's address.
    """

    def __init__(self, on_packet: Callable[[bytes, Address], None]) -> None:
        self._on_packet = on_packet
        self._server: asyncio.Server | None = None
        self._clients: set[asyncio.StreamWriter] = set()

    async def open(self, host: str, first_port: int, tries: int) -> Address:
        """Listen on the first free port. Raises OSError when none is."""
        for port in range(first_port, first_port + tries):
            try:
                self._server = await asyncio.start_server(self._serve, host, port)
            except OSError:
                continue
            return host, port
        raise OSError(f"none of the TCP ports {first_port} to {first_port + tries - 1} is free on {host}")

    @property
    def connected(self) -> bool:
        """Whether anyone listens."""
        return bool(self._clients)

    def send(self, data: bytes) -> None:
        """Send a packet to every client."""
        for writer in self._clients:
            writer.write(data)

    def close(self) -> None:
        """Stop listening and disconnect everyone."""
        if self._server is not None:
            self._server.close()
            self._server = None
        for writer in self._clients:
            writer.close()
        self._clients.clear()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        sender: Address = writer.get_extra_info("peername")[:2]
        self._clients.add(writer)
        try:
            while True:
                head = await reader.readexactly(_HEADER.size)
                sync, _, size = _HEADER.unpack(head)
                if sync != _SYNC:
                    return
                self._on_packet(head + await reader.readexactly(size + _OVERHEAD - _HEADER.size), sender)
        except (OSError, asyncio.IncompleteReadError):
            return
        finally:
            self._clients.discard(writer)
            writer.close()
