"""What a supervisor such as systemd is told: that the service answers, that it lives, that it ends.

The protocol is sd_notify(3): datagrams to the socket that the environment names. Without one nothing is sent.
"""

import asyncio
import faulthandler
import os
import socket
from collections.abc import AsyncIterator, Coroutine, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from typing import Any

FULL_QUEUE_S = 1.0
BEATS = 3
"""So many signs of life are sent in the time after which the supervisor takes the process for dead."""


@dataclass(frozen=True)
class SystemdNotifier:
    """Tells systemd, where that supervises this process, how the service is.

    Parameters
    ----------
    address : str or None
        Of its socket; None: nobody supervises it.
    patience_s : float or None
        After so many seconds without a sign of life it ends the process; None: it does not wait for any.
    """

    address: str | None = None
    patience_s: float | None = None

    @classmethod
    def of(cls, environment: Mapping[str, str]) -> "SystemdNotifier":
        """Return the one that the environment names: ``NOTIFY_SOCKET``, ``WATCHDOG_USEC`` and ``WATCHDOG_PID``."""
        address = environment.get("NOTIFY_SOCKET", "")
        if address[:1] not in ("/", "@"):
            return cls()
        ours = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        microseconds = environment.get("WATCHDOG_USEC", "")
        watches = ours and microseconds.isdecimal() and int(microseconds) > 0
        return cls(address, int(microseconds) / 1e6 if watches else None)

    def tell(self, **words: str) -> None:
        """Send what is so, for example ``READY="1"``; a supervisor that does not listen is no reason to end."""
        if self.address is None:
            return
        text = "\n".join(f"{name}={value}" for name, value in words.items())
        # An address that begins with @ is no file: a name that only the kernel knows.
        where = "\0" + self.address[1:] if self.address[0] == "@" else self.address
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sending, suppress(OSError):
            # A sign of life may be lost, others follow; anything else is worth a moment where its queue is full.
            sending.settimeout(0.0 if "WATCHDOG" in words else FULL_QUEUE_S)
            sending.sendto(text.encode(), where)

    @asynccontextmanager
    async def watching(self) -> AsyncIterator[None]:
        """Send signs of life as long as the event loop turns; whoever is ended without any says where it hung."""
        if self.patience_s is not None:
            # Of the thread that is ended only, which is the loop's: others go on and cannot be read meanwhile.
            faulthandler.enable(all_threads=False)
        async with _beside(self._live()):
            yield

    @asynccontextmanager
    async def told_of(self, stopping: asyncio.Event) -> AsyncIterator[None]:
        """Tell when the end begins."""
        async with _beside(self._stop(stopping)):
            yield

    async def _stop(self, stopping: asyncio.Event) -> None:
        await stopping.wait()
        self.tell(STOPPING="1", STATUS="stops the vehicles")

    async def _live(self) -> None:
        if self.patience_s is None:
            return
        while True:
            self.tell(WATCHDOG="1")
            await asyncio.sleep(self.patience_s / BEATS)


@asynccontextmanager
async def _beside(work: Coroutine[Any, Any, None]) -> AsyncIterator[None]:
    task = asyncio.create_task(work)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
