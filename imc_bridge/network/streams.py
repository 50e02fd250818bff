"""TCP for IMC: one connection per vehicle that offers ``imc+tcp``, for networks that UDP does not get through.

A stream has no packet borders: packets are found by their synchronisation word and length.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterator

from imc_bridge.network.codec import FOOTER_SIZE, HEADER_SIZE, PacketFault, peek, sync_follows

Address = tuple[str, int]
PacketHandler = Callable[[bytes, Address], None]

RETRY_WALL_S = 2.0
CONNECT_TIMEOUT_WALL_S = 5.0
_CHUNK = 65536
_MOST_UNSENT = 1 << 20
"""A vehicle that does not take this much any more is disconnected: old references are worth nothing."""


class PacketSplitter:
    """Cuts a stream into packets and skips whatever is none.

    Attributes
    ----------
    skipped : int
        Bytes that belonged to no packet.
    """

    def __init__(self) -> None:
        self.skipped = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Yield the packets that ``data`` completes."""
        buffer = self._buffer
        buffer += data
        start = 0
        while len(buffer) - start >= HEADER_SIZE + FOOTER_SIZE:
            size = _packet_size(bytes(buffer[start : start + HEADER_SIZE]))
            if size is None or (len(buffer) - start > size + 1 and not sync_follows(buffer, start + size)):
                start += 1
                self.skipped += 1
                continue
            if len(buffer) - start < size:
                break
            yield bytes(buffer[start : start + size])
            start += size
        del buffer[:start]


def _packet_size(header: bytes) -> int | None:
    """Length of the packet that begins with ``header``, None when none does."""
    found = peek(header, whole=False)
    return None if isinstance(found, PacketFault) else HEADER_SIZE + found.size + FOOTER_SIZE


class TcpStreams:
    """Connections to vehicles, made again whenever they break.

    Parameters
    ----------
    on_packet
        Called with every packet and the address it came from.
    """

    def __init__(self, on_packet: PacketHandler) -> None:
        self._on_packet = on_packet
        self._tasks: dict[Address, asyncio.Task[None]] = {}
        self._writers: dict[Address, asyncio.StreamWriter] = {}
        self.errors: dict[Address, str] = {}
        """Why the last attempt for an address failed."""

    def want(self, address: Address) -> None:
        """Keep a connection to this address from now on."""
        if address not in self._tasks:
            self._tasks[address] = asyncio.create_task(self._keep(address), name=f"imc-tcp-{address}")

    def drop(self, address: Address) -> None:
        """Give a connection up."""
        task = self._tasks.pop(address, None)
        if task is not None:
            task.cancel()

    def wants(self, address: Address) -> bool:
        """Whether this address is one of a stream."""
        return address in self._tasks

    def send(self, packet: bytes, address: Address) -> bool:
        """Send over the stream to ``address``; False when it is not connected."""
        writer = self._writers.get(address)
        if writer is None or writer.is_closing():
            return False
        if writer.transport.get_write_buffer_size() > _MOST_UNSENT:
            writer.close()
            return False
        writer.write(packet)
        return True

    async def close(self) -> None:
        """Close every connection."""
        tasks = list(self._tasks.values())
        self._tasks.clear()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _keep(self, address: Address) -> None:
        while True:
            try:
                async with asyncio.timeout(CONNECT_TIMEOUT_WALL_S):
                    reader, writer = await asyncio.open_connection(*address)
            except (OSError, TimeoutError) as error:
                self.errors[address] = (error.strerror if isinstance(error, OSError) else None) or "no answer"
                await asyncio.sleep(RETRY_WALL_S)
                continue
            self.errors.pop(address, None)
            self._writers[address] = writer
            try:
                await self._read(reader, address)
            finally:
                del self._writers[address]
                writer.close()
                with contextlib.suppress(OSError):
                    await writer.wait_closed()
            self.errors[address] = "the vehicle closed the connection"
            await asyncio.sleep(RETRY_WALL_S)

    async def _read(self, reader: asyncio.StreamReader, address: Address) -> None:
        splitter = PacketSplitter()
        while True:
            try:
                data = await reader.read(_CHUNK)
            except OSError:
                return
            if not data:
                return
            for packet in splitter.feed(data):
                self._on_packet(packet, address)
