"""What processes of their own make: the same as here, until nobody waits for it, and nothing is left behind."""

import asyncio
import os
import signal
import time
from collections.abc import AsyncIterator
from pathlib import Path

import psutil
import pytest

from app.missions.errors import InvalidRequestError, MapNotReadyError, ProductUnavailableError
from app.missions.operations.work_processes import WorkProcesses
from tests.support.children import new_children
from tests.support.waiting import until


def where(*_: object) -> tuple[int, int]:
    """Which process this is, and how much it yields to others."""
    return os.getpid(), os.nice(0)


def refuse() -> None:
    raise InvalidRequestError("format", "it cannot be", "ask for another")


def divide(one: float, by: float) -> float:
    return one / by


def never_end(mark: Path) -> None:
    """Say that it has begun, with a process of its own beside it."""
    if os.fork() == 0:
        signal.pause()
    mark.touch()
    time.sleep(1000)


def end_itself() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.fixture
async def maker() -> AsyncIterator[WorkProcesses]:
    maker = WorkProcesses()
    yield maker
    await maker.close()


def living() -> list[psutil.Process]:
    return [one for one in psutil.Process().children(recursive=True) if one.status() != psutil.STATUS_ZOMBIE]


async def begun(maker: WorkProcesses, mark: Path) -> tuple["asyncio.Task[None]", list[psutil.Process]]:
    """What makes something that never ends, and its two processes."""
    before = living()
    task = asyncio.create_task(maker.make(never_end, mark))
    await until(lambda: mark.exists() or task.done(), "it has begun")
    assert not task.done()
    processes = [one for one in living() if one not in before]
    assert len(processes) == 2
    return task, processes


def ended(processes: list[psutil.Process]) -> bool:
    return not any(one.is_running() and one.status() != psutil.STATUS_ZOMBIE for one in processes)


async def test_it_is_another_process_and_yields_to_this_one(maker: WorkProcesses) -> None:
    process, niceness = await maker.make(where)
    assert process != os.getpid()
    assert niceness >= 10
    assert not psutil.pid_exists(process)


async def test_refusals_and_faults_are_told_as_here(maker: WorkProcesses) -> None:
    with pytest.raises(InvalidRequestError, match="it cannot be") as refused:
        await maker.make(refuse)
    assert (refused.value.field, refused.value.remedy) == ("format", "ask for another")
    with pytest.raises(ZeroDivisionError):
        await maker.make(divide, 1.0, 0.0)
    assert await maker.make(divide, 1.0, by=2.0) == 0.5


async def test_one_that_nobody_waits_for_any_more_ends_with_what_it_started(
    maker: WorkProcesses, tmp_path: Path
) -> None:
    making, processes = await begun(maker, tmp_path / "begun")
    waiting = asyncio.create_task(maker.make(where))
    making.cancel()
    with pytest.raises(asyncio.CancelledError):
        await making
    await until(lambda: ended(processes), "both processes ended")
    assert (await waiting)[0] != os.getpid()


async def test_a_process_that_is_killed_is_told_and_the_next_one_works(maker: WorkProcesses) -> None:
    with pytest.raises(ProductUnavailableError, match="signal 9") as told:
        await maker.make(end_itself)
    assert "ask again" in told.value.remedy
    assert await maker.make(divide, 6.0, 2.0) == 3.0


async def test_a_process_that_is_not_needed_after_all_leaves_room(maker: WorkProcesses) -> None:
    with pytest.raises(MapNotReadyError):
        async with maker.process("json"):
            raise MapNotReadyError("there is nothing yet")
    children = new_children()
    async with maker.process("json") as process:
        children()[0].kill()
        with pytest.raises(ProductUnavailableError, match="signal 9"):
            await process.make(divide, 1.0, 2.0)
    assert await maker.make(divide, 1.0, 2.0) == 0.5


async def test_it_ends_with_the_service(tmp_path: Path) -> None:
    maker = WorkProcesses()
    making, processes = await begun(maker, tmp_path / "begun")
    waiting = asyncio.create_task(maker.make(where))
    await maker.close()
    for task in (making, waiting):
        with pytest.raises(ProductUnavailableError, match="the service is ending"):
            await task
    await until(lambda: ended(processes), "both processes ended")
