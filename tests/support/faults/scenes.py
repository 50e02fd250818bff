"""What can go wrong, each as a scene with a real service: it asserts what must hold and returns figures.

Tests play them short, ``benchmarks/service/faults.py`` at length.
"""

import asyncio
import random
import sqlite3
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any

import httpx

from tests.support.faults.disks import Disk
from tests.support.faults.missions import FRAME, check_rows, ended, flying, log_of, pollers, state_of, steps_more
from tests.support.faults.service import PATIENCE_S, Service, service_in
from tests.support.missions.polling import PollingVehicle
from tests.support.waiting import until

LONGEST_DELAY_S = 0.4


async def killed_again_and_again(folder: Path, *, kills: int, steps: int, seed: int) -> dict[str, Any]:
    """Kill -9 the service at random moments of a mission, some of them while it is only starting again."""
    chance = random.Random(seed)  # noqa: S311 - chooses moments, guards nothing
    vehicles = pollers()
    for vehicle in vehicles:
        vehicle.waits_after_step = steps - 2  # however fast the machine is, no kill comes after the end
    most = max(1, int(1.5 * steps / kills) - 1)
    at: list[int] = []
    async with service_in(folder) as (service, api), flying(api, vehicles, steps=steps) as (mission_id, tasks):
        for kill in range(kills):
            if kill % 4 != 3:
                left = steps - 1 - service.steps(mission_id)
                await steps_more(service, mission_id, min(chance.randint(1, most), left // (kills - kill)))
            # Anywhere in a step, or (every fourth time) while the mission is only being taken up again.
            await asyncio.sleep(chance.uniform(0.0, LONGEST_DELAY_S))
            for task in tasks:
                assert not task.done() or task.exception() is None
            await service.kill()
            at.append(service.steps(mission_id))
            assert service.rows("select state from missions where id = ?", mission_id) == [("running",)]
            await service.start()
            await service.await_ready(api)
        for vehicle in vehicles:
            vehicle.waits_after_step = None
        async with asyncio.timeout(PATIENCE_S + 2.0 * steps):
            await asyncio.gather(*tasks)
        # The vehicles are stopped first; the last soundings go into the map before the mission counts as finished.
        last = await ended(api, mission_id)
        assert last["state"] == "finished", last["reason"]
        check_rows(service, mission_id, vehicles)
        assert service.steps(mission_id) == steps
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
    """Abort a mission that cannot write: its vehicles are stopped, the operator is answered, and it stays aborted."""
    vehicles = pollers()
    async with (
        service_in(folder, database=disk.folder / "fleet.db") as (service, api),
        flying(api, vehicles, steps=500) as (mission_id, tasks),
    ):
        await steps_more(service, mission_id, 2)
        said = await _aborted(service, api, mission_id, disk, vehicles, tasks)
        await service.kill()
        await service.start()
        await service.await_ready(api)
        last = await state_of(api, mission_id)
        assert (last["state"], last["reason"]) == ("aborted", "")
        lines = await log_of(api, mission_id)
        assert sum("acknowledged the stop" in line for line in lines) == 2
    return {"disk": disk.kind, "said": said}


def _set(clock: Path, off_s: float) -> None:
    """Set the wall clock at once: a service that reads it meanwhile finds the time before or after."""
    new = clock.with_suffix(".new")
    new.write_text(str(off_s))
    new.rename(clock)


async def clock_jumps(folder: Path, jumps_s: Sequence[float]) -> dict[str, Any]:
    """Set the wall clock of the service's machine forward and back in the middle of a mission."""
    clock = folder / "clock"
    clock.write_text("0")
    vehicles = pollers()
    steps = 6 * (len(jumps_s) + 1)
    async with (
        service_in(folder, world={"CLOCK": str(clock)}) as (service, api),
        flying(api, vehicles, steps=steps) as (mission_id, tasks),
    ):
        for count, jump_s in enumerate(jumps_s, 1):
            await steps_more(service, mission_id, 3)
            _set(clock, jump_s)

            async def told(count: int = count) -> bool:
                return sum("clock was set" in line for line in await log_of(api, mission_id)) == count

            for vehicle in vehicles:
                vehicle.waits = True  # so that the mission does not end before
            await until(told, "the log tells of the clock")
            for vehicle in vehicles:
                vehicle.waits = False
        await _flown_to_the_end(service, api, mission_id, tasks, steps)
        check_rows(service, mission_id, vehicles)
        shown = await state_of(api, mission_id)
        assert 0.0 <= shown["progress"]["elapsed_s"] < 3600.0, "a mission lasts as long as it lasted"
        lines = await log_of(api, mission_id)
    return {"steps": steps, "set by s": list(jumps_s), "said": [line for line in lines if " clock: " in line]}


class Liar(PollingVehicle):
    """Does its part, and with every batch posts what cannot be."""

    def lies(self) -> list[dict[str, object]]:
        """One of each kind of nonsense."""
        self.time_s += 1.0
        honest = self.measurement()
        here = {"lat_deg": honest["lat_deg"], "lon_deg": honest["lon_deg"]}
        wrong: list[dict[str, object]] = [
            {"range_m": 20_000.0},
            {"range_m": -4.0},
            {"range_m": 0.0},
            {"depth_m": -500.0},
            {"depth_m": 12_000.0},
            {"lat_deg": 95.0},
            {"lon_deg": -190.0},
            {"lat_deg": 0.0, "lon_deg": 0.0},
            {"lat_deg": FRAME.origin_lat_deg + 0.02},
            {"range_m": 1e308},
            {"depth_m": 1e308},
            {"vehicle": "nobody"},
        ]
        return [honest | here | lie | {"time_s": self.time_s + 0.01 * n} for n, lie in enumerate(wrong, 1)]

    async def travel(self, api: httpx.AsyncClient, mission_id: str, waypoint: dict[str, float]) -> None:
        """Lie, then go there."""
        lies = self.lies()
        answer = await api.post(f"/missions/{mission_id}/measurements", json={"items": lies})
        if answer.status_code == httpx.codes.SERVICE_UNAVAILABLE:
            await super().travel(api, mission_id, waypoint)
            return
        assert answer.status_code == httpx.codes.OK, answer.text
        for lie, verdict in zip(lies, answer.json()["items"], strict=True):
            assert verdict["verdict"] == "rejected", (lie, verdict)
            assert verdict["reason"].partition(":")[0], verdict
        for text in ("NaN", "Infinity", "1e999", "null"):
            body = (
                f'{{"items": [{{"vehicle": "{self.name}", "time_s": {self.time_s}, "lat_deg": {text}, "lon_deg": 1}}]}}'
            )
            said = await api.post(
                f"/missions/{mission_id}/measurements", content=body, headers={"Content-Type": "application/json"}
            )
            assert said.status_code != httpx.codes.INTERNAL_SERVER_ERROR, said.text
            assert not any(item["verdict"] == "accepted" for item in said.json().get("items", []))
        await super().travel(api, mission_id, waypoint)


async def lied_to(folder: Path, *, steps: int) -> dict[str, Any]:
    """Fly with a vehicle that posts impossible depths, numbers that are none, and places where it cannot be."""
    liar, honest = Liar("one", FRAME, 2.0, 2.0), PollingVehicle("two", FRAME, 8.0, 2.0)
    async with (
        service_in(folder) as (service, api),
        flying(api, [liar, honest], steps=steps) as (mission_id, tasks),
    ):
        await _flown_to_the_end(service, api, mission_id, tasks, steps)
        check_rows(service, mission_id, [liar, honest])
        rejected = dict(
            service.rows(
                "select substr(reason, 1, instr(reason, ':')), count(*) from soundings where verdict = 'rejected' "
                "group by 1"
            )
        )
        assert len(rejected) >= 4, "what was refused is kept with the reason"
        depths = [d for (d,) in service.rows("select depth_m from soundings where verdict = 'accepted'")]
        assert all(5.0 < depth < 20.0 for depth in depths)
        shown = await state_of(api, mission_id)
        assert shown["progress"]["rejected"] == sum(rejected.values()), "the page counts what was refused"
    return {"steps": steps, "rejected by reason": rejected, "accepted": len(depths)}


async def bad_day(folder: Path, disk: Disk) -> dict[str, Any]:
    """One thing after the other in one mission: a full disk, a lock, a clock that is set, an abort without a disk."""
    clock = folder / "clock"
    clock.write_text("0")
    vehicles = [Liar("one", FRAME, 2.0, 2.0), PollingVehicle("two", FRAME, 8.0, 2.0)]
    world = {"CLOCK": str(clock), "BUSY_MS": "200"}
    async with (
        service_in(folder, database=disk.folder / "fleet.db", world=world) as (service, api),
        flying(api, vehicles, steps=500) as (mission_id, tasks),
    ):
        await steps_more(service, mission_id, 2)
        disk.fill(service)
        await _nothing_is_written(service, api, mission_id, "the disk")
        disk.free(service)
        await steps_more(service, mission_id, 1)
        async with _held(service.database):
            await _nothing_is_written(service, api, mission_id, "another program holds the database locked")
        await steps_more(service, mission_id, 1)
        _set(clock, -86400)

        async def told() -> bool:
            return any("clock was set back by 86400 s" in line for line in await log_of(api, mission_id))

        await until(told, "the log tells of the clock")
        await steps_more(service, mission_id, 1)
        await _aborted(service, api, mission_id, disk, vehicles, tasks)
        check_rows(service, mission_id, vehicles)
        rejected = service.rows("select count(distinct reason) from soundings where verdict = 'rejected'")
        assert rejected[0][0] >= 4, "what the liar said is kept with the reason"
        return {"said": _told(await log_of(api, mission_id))}


async def _aborted(
    service: Service,
    api: httpx.AsyncClient,
    mission_id: str,
    disk: Disk,
    vehicles: Sequence[PollingVehicle],
    tasks: Sequence[asyncio.Task[None]],
) -> str:
    """Abort while the disk is full; returns what the operator was answered."""
    disk.fill(service)
    await _nothing_is_written(service, api, mission_id, "the disk")
    for vehicle in vehicles:
        vehicle.gives_up = True

    async def asking() -> bool:
        for task in tasks:
            if task.done():
                task.result()  # the error of a vehicle that failed, not that it was waited for
        return all(vehicle.asks for vehicle in vehicles)

    await until(asking, "both vehicles ask where to go")
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
    return str(said["mission"]["reason"])


async def _nothing_is_written(service: Service, api: httpx.AsyncClient, mission_id: str, why: str) -> None:
    """See that everyone is told, and that the mission neither goes on nor ends."""

    async def told() -> bool:
        # What is small may still find room on a full disk.
        ready = await api.get("/health/ready")
        unready = ready.status_code == httpx.codes.SERVICE_UNAVAILABLE and why in ready.json()["components"]["database"]
        return unready and why in (await state_of(api, mission_id))["reason"]

    await until(told, f"the mission and its health say {why!r}")
    before = service.steps(mission_id)
    shown = await state_of(api, mission_id)
    assert shown["state"] == "running"
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
