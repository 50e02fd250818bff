"""Signals that end the service: none of them keeps vehicles from being stopped."""

import asyncio
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import structlog

SIGNALS = (signal.SIGINT, signal.SIGTERM)

log = structlog.get_logger(__name__)


class EndSignals:
    """SIGINT and SIGTERM from before the start to the end.

    The first one ends the service: while it starts by a cancellation, then by what :meth:`ended_by` names. Later ones
    end no process that still stops vehicles or writes down what it accepted; after that the next one ends it without
    waiting for anything else.

    Parameters
    ----------
    written
        Whether the service ends, has stopped all vehicles and written everything down.
    """

    def __init__(self, written: Callable[[], bool]) -> None:
        self._written = written
        self._received = False
        self._end: Callable[[int], None] = self._cancel
        self._starting: asyncio.Task[object] | None = None
        self._cancelled = False

    def ended_by(self, end: Callable[[int], None]) -> None:
        """Call this with each signal from now on: the start is over."""
        self._end = end

    @contextmanager
    def caught(self) -> Iterator[None]:
        """Catch signals; a start that one of them cancelled ends here, as if it had been served until then.

        In another thread than the main one no signal can be caught.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        loop = asyncio.get_running_loop()
        self._starting = asyncio.current_task()
        for number in SIGNALS:
            loop.add_signal_handler(number, self._receive, number)
        try:
            yield
        except asyncio.CancelledError:
            if not self._cancelled or self._starting is None or self._starting.uncancel() > 0:
                raise
        finally:
            for number in SIGNALS:
                loop.remove_signal_handler(number)

    def _receive(self, number: int) -> None:
        name, written = signal.Signals(number).name, self._written()
        if self._received and written:
            log.warning("asked to end again: everything is written, it ends at once", signal=name)
            _end_at_once()
            return
        if written:
            words = "everything is written and it ends; another signal ends it at once"
        elif self._received:
            words = "the vehicles are being stopped and everything is written down, then it ends"
        else:
            words = "stopping the vehicles"
        log.warning(f"asked to end: {words}", signal=name)
        self._received = True
        self._end(number)

    def _cancel(self, _number: int) -> None:
        if self._starting is not None and not self._cancelled:
            self._cancelled = True
            self._starting.cancel()


def _end_at_once() -> None:
    """End the process: a thread that hangs would hold up every other way to end."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(0)
