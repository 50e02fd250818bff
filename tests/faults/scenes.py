"""What can go wrong, each as a scene with a real service: it asserts what must hold and returns figures.

Tests play them short, ``benchmarks/faults.py`` at length.
"""

import asyncio
import random
import sqlite3
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any

import httpx

from tests.faults.disks import Disk
from tests.faults.missions import (
    check_rows,
    ended,
    flying,
    log_of,
    pollers,
    state_of,
    steps_more,
    until,
)
from tests.faults.service import PATIENCE_S, Service, service_in

LONGEST_DELAY_S = 0.4


async def killed_again_and_again(folder: Path, *, kills: int, steps: int, seed: int) -> dict[str, Any]:
    """Kill -9 the service at random moments of a mission, some of them while it is only starting again."""
    chance = random.Random(seed)  # noqa: S311 - chooses moments, guards nothing
    vehicles = pollers()
    most = max(1, int(1.5 * steps / kills) - 1)
    at: list[int] = []
    async with service_in(folder) as (service, api), flying(api, vehicles, steps=steps) as (mission_id, tasks):
        for kill in range(kills):
            if kill % 4 != 3:
                await steps_more(service, mission_id, chance.randint(1, most))
            # Anywhere in a step, or (every fourth time) while the mission is only being taken up again.
            await asyncio.sleep(chance.uniform(0.0, LONGEST_DELAY_S))
            for task in tasks:
                assert not task.done() or task.exception() is None
            await service.kill()
            at.append(service.steps(mission_id))
            await service.start()
            await service.await_ready(api)
        async with asyncio.timeout(PATIENCE_S + 2.0 * steps):
            await asyncio.gather(*tasks)
        # The vehicles are stopped first; the last soundings go into the map before the mission counts as finished.
        last = await ended(api, mission_id)
        assert last["state"] == "finished", last["reason"]
        check_rows(service, mission_id, vehicles)
        assert service.steps(mission_id) == steps
    assert at[-1] < steps, "every kill came while the mission was running"
    assert len(set(at)) > kills // 3, "the kills came at different steps"
    accepted = sum(len(vehicle.accepted) for vehicle in vehicles)
    return {"kills": kills, "steps": steps, "seed": seed, "killed after step": at, "soundings accepted": accepted}


async def disk_full(folder: Path, disk: Disk, *, steps: int, fills: int) -> dict[str, Any]:
    """Fill the database's disk in the middle of a mission, and give it room again."""
    vehicles = pollers()
    async with (
        service_in(folder, database=disk.folder / "fleet.db") as (service, api),
        flying(api, vehicles, steps=steps) as (mission_id, tasks),
    ):
        for _ in range(fills):
            await steps_more(service, mission_id, 3)
            disk.fill(service)
            await _nothing_is_written(service, api, mission_id, "the disk")
            disk.free(service)
            await steps_more(service, mission_id, 2)
        await _flown_to_the_end(service, api, mission_id, tasks, steps)
        check_rows(service, mission_id, vehicles)
        lines = await log_of(api, mission_id)
        assert sum("alarm storage: for" in line for line in lines) >= fills, lines
        assert (await api.get("/health/ready")).status_code == httpx.codes.OK
    return {"steps": steps, "fills": fills, "disk": disk.kind, "said": _told(lines)}


async def locked(folder: Path, *, steps: int, locks: int, busy_ms: int) -> dict[str, Any]:
    """Hold the database locked from another program for longer than a writer waits."""
    vehicles = pollers()
    async with (
        service_in(folder, world={"BUSY_MS": str(busy_ms)}) as (service, api),
        flying(api, vehicles, steps=steps) as (mission_id, tasks),
    ):
        for _ in range(locks):
            await steps_more(service, mission_id, 3)
            async with _held(service.database):
                await _nothing_is_written(service, api, mission_id, "another program holds the database locked")
            await steps_more(service, mission_id, 2)
        await _flown_to_the_end(service, api, mission_id, tasks, steps)
        check_rows(service, mission_id, vehicles)
        lines = await log_of(api, mission_id)
        assert sum("alarm storage: for" in line for line in lines) >= locks, lines
    return {"steps": steps, "locks": locks, "busy timeout ms": busy_ms, "said": _told(lines)}


async def aborted_without_a_disk(folder: Path, disk: Disk) -> dict[str, Any]:
    """Abort a mission that cannot write: its vehicles are stopped and the operator is answered, and it stays aborted."""
    vehicles = pollers()
    async with (
        service_in(folder, database=disk.folder / "fleet.db") as (service, api),
        flying(api, vehicles, steps=500) as (mission_id, tasks),
    ):
        await steps_more(service, mission_id, 2)
        disk.fill(service)
        await _nothing_is_written(service, api, mission_id, "the disk")
        for vehicle in vehicles:
            vehicle.gives_up = True
        answer = await api.post(f"/missions/{mission_id}/abort")
        assert answer.status_code == httpx.codes.OK, answer.text
        said = answer.json()
        assert said["mission"]["state"] == "aborted"
        assert "nothing can be written down" in said["mission"]["reason"]
        assert [stop["acknowledged"] for stop in said["stops"]] == [True, True]
        async with asyncio.timeout(PATIENCE_S):
            await asyncio.gather(*tasks)
        disk.free(service)

        async def written() -> bool:
            return bool(service.rows("select state from missions where state = 'aborted'"))

        await until(written, "the abort is written down")
        check_rows(service, mission_id, vehicles)
        await service.kill()
        await service.start()
        await service.await_ready(api)
        last = await state_of(api, mission_id)
        assert (last["state"], last["reason"]) == ("aborted", "")
        lines = await log_of(api, mission_id)
        assert sum("acknowledged the stop" in line for line in lines) == 2
    return {"disk": disk.kind, "said": said["mission"]["reason"]}


async def _nothing_is_written(service: Service, api: httpx.AsyncClient, mission_id: str, why: str) -> None:
    """See that everyone is told, and that the mission neither goes on nor ends."""

    async def told() -> bool:
        return why in (await state_of(api, mission_id))["reason"]

    await until(told, f"the mission says {why!r}")
    before = service.steps(mission_id)
    shown = await state_of(api, mission_id)
    assert shown["state"] == "running"
    ready = await api.get("/health/ready")
    assert ready.status_code == httpx.codes.SERVICE_UNAVAILABLE
    assert why in ready.json()["components"]["database"]
    refused = await api.post(f"/missions/{mission_id}/notes", json={"text": "on watch"})
    assert refused.status_code == httpx.codes.SERVICE_UNAVAILABLE, refused.text
    assert refused.json()["type"].endswith("database-unavailable")
    assert why in refused.json()["detail"]
    assert int(refused.headers["Retry-After"]) > 0
    assert service.steps(mission_id) == before, "no step while it cannot be written down"


async def _flown_to_the_end(
    service: Service, api: httpx.AsyncClient, mission_id: str, tasks: list[asyncio.Task[None]], steps: int
) -> None:
    async with asyncio.timeout(PATIENCE_S + 2.0 * steps):
        await asyncio.gather(*tasks)
    last = await ended(api, mission_id)
    assert last["state"] == "finished", last["reason"]
    assert service.steps(mission_id) == steps


@asynccontextmanager
async def _held(database: Path) -> AsyncIterator[None]:
    """Hold a write transaction, as a program does that was left in the middle of one."""
    with closing(sqlite3.connect(database, isolation_level=None, timeout=30)) as connection:
        connection.execute("BEGIN IMMEDIATE")
        yield
        connection.execute("ROLLBACK")


def _told(lines: list[str]) -> list[str]:
    return [line for line in lines if " storage: " in line]
