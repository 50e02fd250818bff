"""The service is asked to end: whatever it is doing, its vehicles are stopped first, and the process ends well."""

import asyncio
import signal
from pathlib import Path

import httpx
import pytest

from tests.support.faults.missions import flying, mission_of, pollers, started, steps_more
from tests.support.faults.service import Service, service_in
from tests.support.waiting import until

MISSIONS = 5


async def leave(api: httpx.AsyncClient, tasks: list[asyncio.Task[None]]) -> None:
    """Have vehicles poll no more, and the service notice it: of whom it answers it takes the stop for acknowledged."""
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    for _ in range(3):  # what was closed before them is seen before they are answered
        assert (await api.get("/health/live")).status_code == httpx.codes.OK


def told(service: Service, words: str, before: str = "") -> list[str]:
    """Lines of the log with some words, after what it said before."""
    return [line for line in service.said.removeprefix(before).splitlines() if words in line]


@pytest.mark.slow
async def test_a_service_that_is_ended_while_it_starts_stops_what_it_has_taken_up(tmp_path: Path) -> None:
    async with service_in(tmp_path) as (service, api):
        for number in range(MISSIONS):
            vehicle = {"name": f"sim-{number}", "kind": "sim"}
            await started(api, mission_of([vehicle], name=f"Area {number}", steps=500))
        await service.kill()
        before = service.said
        await service.start()
        await until(lambda: told(service, "mission taken up", before), "the first mission is taken up")
        assert await service.end() == 0, service.said[-3000:]
        taken_up = len(told(service, "mission taken up", before))
        assert len(told(service, "acknowledged the stop", before)) >= taken_up
        assert not told(service, "NOT acknowledged", before)
        states = service.rows("select state from missions")
        assert states == [("running",)] * MISSIONS, "the next start goes on with them"


@pytest.mark.slow
async def test_vehicles_that_poll_are_told_to_stop_before_the_service_answers_no_more(tmp_path: Path) -> None:
    vehicles = pollers()
    async with service_in(tmp_path) as (service, api), flying(api, vehicles, steps=500) as (mission_id, _):
        await steps_more(service, mission_id, 2)
        before = service.said
        assert await service.end() == 0
        assert len(told(service, "acknowledged the stop", before)) == len(vehicles)
        assert not told(service, "NOT acknowledged", before)
        assert all(vehicle.told_to_stop for vehicle in vehicles)


@pytest.mark.slow
async def test_asked_again_it_stops_its_vehicles_all_the_same(tmp_path: Path) -> None:
    vehicles = pollers()
    async with service_in(tmp_path) as (service, api), flying(api, vehicles, steps=500) as (mission_id, tasks):
        await steps_more(service, mission_id, 1)
        await leave(api, tasks)  # each stop is waited for
        assert service.process is not None
        service.process.send_signal(signal.SIGTERM)
        await until(lambda: told(service, "asked to end: stopping the vehicles"), "it begins to end")
        service.process.send_signal(signal.SIGTERM)
        await until(lambda: told(service, "asked to end: the vehicles are being stopped"), "it heard that, too")
        assert await service.process.wait() == 0
        assert len(told(service, "has NOT acknowledged the stop")) == len(vehicles)


@pytest.mark.slow
async def test_while_it_ends_no_flight_begins(tmp_path: Path) -> None:
    vehicles = pollers()
    async with service_in(tmp_path) as (service, api), flying(api, vehicles, steps=500) as (mission_id, tasks):
        waiting = (await api.post("/missions", json=mission_of([{"name": "sim-1", "kind": "sim"}]))).json()["id"]
        await steps_more(service, mission_id, 1)
        await leave(api, tasks)
        assert service.process is not None
        service.process.send_signal(signal.SIGTERM)
        await until(lambda: told(service, "asked to end"), "it begins to end")
        ready = await api.get("/health/ready")
        assert ready.status_code == httpx.codes.SERVICE_UNAVAILABLE
        refused = await api.post(f"/missions/{waiting}/start")
        assert refused.status_code == httpx.codes.CONFLICT, refused.text
        assert "the service ends" in refused.json()["detail"]
        assert await service.process.wait() == 0
