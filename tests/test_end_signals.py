"""Signals end the service: never while it stops vehicles or writes, at once after that."""

import asyncio
import os
import signal

import pytest
from structlog.testing import CapturingLogger

from app import end_signals
from app.end_signals import EndSignals
from tests.support.waiting import until


async def test_a_signal_ends_the_process_at_once_only_when_everything_is_written(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, written, ended = CapturingLogger(), asyncio.Event(), list[int]()
    monkeypatch.setattr(end_signals, "log", log)
    monkeypatch.setattr(os, "_exit", ended.append)
    received = list[int]()
    signals = EndSignals(written.is_set)
    with signals.caught():
        signals.ended_by(received.append)
        for count in (1, 2):
            os.kill(os.getpid(), signal.SIGTERM)
            await until(lambda count=count: len(received) == count, "it is heard")  # type: ignore[misc]
        assert not ended, "vehicles are being stopped"
        written.set()
        os.kill(os.getpid(), signal.SIGINT)
        await until(lambda: ended, "it ends at once")
    assert ended == [0]
    assert len(received) == 2
    assert [call.args[0].partition(";")[0] for call in log.calls] == [
        "asked to end: stopping the vehicles",
        "asked to end: the vehicles are being stopped and everything is written down, then it ends",
        "asked to end again: everything is written, it ends at once",
    ]


async def test_a_first_signal_to_a_service_that_ends_already_lets_it_end(monkeypatch: pytest.MonkeyPatch) -> None:
    received, ended = list[int](), list[int]()
    monkeypatch.setattr(os, "_exit", ended.append)
    signals = EndSignals(lambda: True)
    with signals.caught():
        signals.ended_by(received.append)
        os.kill(os.getpid(), signal.SIGTERM)
        await until(lambda: received, "it is heard")
    assert not ended
