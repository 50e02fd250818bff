"""Where sentences come from: datagrams, a server that is connected to, and a file or device that is read on."""

import asyncio
import contextlib
import errno
import ipaddress
import os
import socket
import stat
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path

import structlog

from app.missions.traffic.sentences import MOST_BYTES

READ_BYTES = 1 << 16
AGAIN_S, MOST_AGAIN_S = 1.0, 30.0
"""How soon a source that failed is tried again; the wait doubles up to the latter."""
LOOK_S = 0.25
"""How often a file is looked at for what was added."""
SILENT_S = 120.0
"""A connection that is silent for so long is made anew: the other side may be gone without a word."""
MULTICAST_HEADER = b"UdPbC\x00"
"""Before sentences in datagrams of a ship's network (IEC 61162-450)."""

Take = Callable[[bytes, "Source"], None]

log = structlog.get_logger(__name__)


class LineSplitter:
    """Cuts what comes in pieces into lines; a line that does not end is let go."""

    def __init__(self) -> None:
        self._rest = b""
        self._overlong = False

    def cut(self, piece: bytes) -> list[bytes]:
        """Return the lines that are whole now, empty ones left out."""
        *whole, self._rest = (self._rest + piece).replace(b"\r", b"\n").split(b"\n")
        if self._overlong and whole:
            whole, self._overlong = whole[1:], False
        if len(self._rest) > MOST_BYTES:
            self._rest, self._overlong = b"", True
        return [line for line in whole if line]


class Source(ABC):
    """One place that sentences come from; tried again for as long as it fails.

    Attributes
    ----------
    trouble
        Why nothing can be heard; empty: it is open.
    """

    def __init__(self, name: str, take: Take) -> None:
        self.name = name
        self.trouble = "not opened yet"
        self.sentences = 0
        self.heard_s: float | None = None
        """When the last sentence of AIS came, the event loop's time."""
        self._take = take
        self._wait_s = AGAIN_S
        self._task: asyncio.Task[None] | None = None

    def open(self) -> None:
        """Begin to listen."""
        self._task = asyncio.create_task(self._keep())

    async def close(self) -> None:
        """Listen no more."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _keep(self) -> None:
        while True:
            try:
                await self._listen()
            except OSError as error:
                # Words of our own libraries name addresses, and differ.
                self._fail(os.strerror(error.errno) if error.errno and error.errno > 0 else str(error) or "no answer")
            except Exception as error:
                log.exception("a source of AIS broke off", source=self.name)
                self._fail(type(error).__name__)
            await asyncio.sleep(self._wait_s)
            self._wait_s = min(2.0 * self._wait_s, MOST_AGAIN_S)

    def _fail(self, why: str) -> None:
        if self.trouble != why:
            log.warning("AIS cannot be heard", source=self.name, reason=why)
        self.trouble = why

    def _opened(self) -> None:
        if self.trouble:
            log.info("AIS is listened for", source=self.name)
        self.trouble = ""

    def _heard(self, lines: list[bytes]) -> None:
        for line in lines:
            self._take(line, self)
        if lines:
            self._wait_s = AGAIN_S

    @abstractmethod
    async def _listen(self) -> None:
        """Listen until that ends; OSError says why it cannot."""


class UdpSource(Source):
    """Datagrams to a port; to a group's address, of that group."""

    def __init__(self, address: str, port: int, take: Take) -> None:
        super().__init__(f"UDP {address}:{port}", take)
        self._address, self._port = address, port
        self.port = port
        """Where it listens, once it does."""

    async def _listen(self) -> None:
        loop = asyncio.get_running_loop()
        ended = loop.create_future()
        opened = _udp_socket(self._address, self._port)
        try:
            transport, _ = await loop.create_datagram_endpoint(lambda: _Datagrams(self, ended), sock=opened)
        except BaseException:
            opened.close()
            raise
        self.port = opened.getsockname()[1]
        self._opened()
        try:
            await ended
        finally:
            transport.close()

    def received(self, data: bytes) -> None:
        """Take a datagram."""
        # Each is whole: a rest without an end of line belongs to no other.
        self._heard(LineSplitter().cut(data.removeprefix(MULTICAST_HEADER) + b"\n"))


class _Datagrams(asyncio.DatagramProtocol):
    def __init__(self, source: UdpSource, ended: "asyncio.Future[None]") -> None:
        self._source, self._ended = source, ended

    def datagram_received(self, data: bytes, addr: object) -> None:
        self._source.received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        if not self._ended.done():
            self._ended.set_result(None)


def _udp_socket(address: str, port: int) -> socket.socket:
    ip = ipaddress.ip_address(address)
    opened = socket.socket(socket.AF_INET6 if ip.version == 6 else socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.setblocking(False)
        if ip.is_multicast:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            opened.bind((address, port))
            if ip.version == 4:
                opened.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, ip.packed + bytes(4))
            else:
                opened.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP, ip.packed + struct.pack("@I", 0))
        else:
            opened.bind((address, port))
    except BaseException:
        opened.close()
        raise
    return opened


class TcpSource(Source):
    """A server that sends sentences to whoever connects."""

    def __init__(self, host: str, port: int, take: Take) -> None:
        super().__init__(f"TCP {host}:{port}", take)
        self._host, self._port = host, port

    async def _listen(self) -> None:
        try:
            async with asyncio.timeout(SILENT_S):
                reader, writer = await asyncio.open_connection(self._host, self._port, limit=READ_BYTES)
        except TimeoutError:
            raise TimeoutError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT)) from None
        try:
            self._opened()
            lines = LineSplitter()
            while True:
                try:
                    async with asyncio.timeout(SILENT_S):
                        piece = await reader.read(READ_BYTES)
                except TimeoutError:
                    return self._fail(f"silent for {SILENT_S:g} s")
                if not piece:
                    return self._fail("the other side closed the connection")
                self._heard(lines.cut(piece))
                await asyncio.sleep(0)  # a flood leaves others their turn
        finally:
            writer.close()
            with contextlib.suppress(OSError):
                await writer.wait_closed()


class FileSource(Source):
    """A file that a receiver's program adds to, a pipe, or a serial device that was set up.

    What a file has already was said before: reading begins at its end. One that is put in its place is read from its
    beginning.
    """

    def __init__(self, path: Path, take: Take) -> None:
        super().__init__(f"file {path}", take)
        self._path = path
        self._began = False

    async def _listen(self) -> None:
        opened = await asyncio.to_thread(os.open, self._path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            about = os.fstat(opened)
            if stat.S_ISDIR(about.st_mode):
                return self._fail("it is a folder")
            regular = stat.S_ISREG(about.st_mode)
            if regular and not self._began:
                os.lseek(opened, 0, os.SEEK_END)
            self._began = True
            self._opened()
            lines = LineSplitter()
            while True:
                piece = await asyncio.to_thread(_read_on, opened)
                self._heard(lines.cut(piece))
                if not piece:
                    await asyncio.sleep(LOOK_S)
                    if regular and await asyncio.to_thread(_replaced, opened, self._path):
                        self._wait_s = LOOK_S
                        return None
                else:
                    await asyncio.sleep(0)
        finally:
            os.close(opened)


def _read_on(opened: int) -> bytes:
    try:
        return os.read(opened, READ_BYTES)
    except BlockingIOError:
        return b""


def _replaced(opened: int, path: Path) -> bool:
    """Tell whether there is another file at a path than the open one, or less in it than was read."""
    about = os.fstat(opened)
    try:
        now = path.stat()
    except FileNotFoundError:
        return False  # whoever writes it will put one there
    return (now.st_dev, now.st_ino) != (about.st_dev, about.st_ino) or now.st_size < os.lseek(opened, 0, os.SEEK_CUR)
