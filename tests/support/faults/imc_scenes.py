"""What can go wrong between the service and IMC vehicles, each as a scene; see ``scenes.py``."""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import imcpy
from shapely.geometry import Point, Polygon

from simulator.network import NetworkFaults
from tests.support.faults.cut import Afar, cable
from tests.support.faults.missions import (
    FRAME,
    SIDE_M,
    check_rows,
    ended,
    log_of,
    mission_of,
    started,
    state_of,
    steps_more,
)
from tests.support.faults.sea import LIMITS, NAMES, OTHERS, OURS, Sea, imc_vehicles
from tests.support.faults.service import PATIENCE_S, Service, service_in
from tests.support.waiting import until

SAME_M = 0.05
"""Two places that are nearer are the same."""


async def bad_radio(folder: Path, *, steps: int, speed: float, seed: int = 0) -> dict[str, Any]:
    """Fly over UDP that loses 30 %, doubles and reorders packets and takes 2 s of the vehicles' time each way."""
    faults = NetworkFaults(
        loss=0.3, duplicate=0.2, reorder=0.2, hold_s=1.0 / speed, delay_s=2.0 / speed, jitter_s=0.5 / speed
    )
    async with Sea(speed=speed, faults=faults) as sea, _service(folder, sea) as (service, api):
        mission_id = await _begun(api, NAMES, steps=steps)
        last = await ended(api, mission_id, PATIENCE_S + 60.0 * steps / speed)
        assert last["state"] == "finished", last["reason"]
        _check(service, sea, mission_id)
        lines = await log_of(api, mission_id)
    return _figures(service, mission_id) | {"speed": speed, "said": _warnings(lines)}


async def vanished(folder: Path, *, steps: int, speed: float) -> dict[str, Any]:
    """Let a vehicle vanish in the middle of a mission, and return."""
    gone = NAMES[0]
    async with Sea(speed=speed) as sea, _service(folder, sea) as (service, api):
        mission_id = await _begun(api, NAMES, steps=steps)
        await steps_more(service, mission_id, 2)
        await sea.vanish(gone)

        async def lost() -> bool:
            return any(f"{gone} is lost" in line for line in await log_of(api, mission_id))

        await until(lost, "the log says that it is lost")
        [shown] = [v for v in (await state_of(api, mission_id))["vehicles"] if v["name"] == gone]
        assert shown["link"] == "lost"
        assert shown["reason"]
        told = len(sea.told[gone])
        await steps_more(service, mission_id, 2)
        assert len(sea.told[gone]) == told
        await sea.launch(gone)

        async def follows() -> bool:
            lines = await log_of(api, mission_id)
            return sum(f"{gone} follows" in line for line in lines) == 2

        await until(follows, "it follows again")
        last = await ended(api, mission_id, PATIENCE_S + 60.0 * steps / speed)
        assert last["state"] == "finished", last["reason"]
        _check(service, sea, mission_id)
        lines = await log_of(api, mission_id)
        with_it = service.rows(
            "select count(*) from waypoints where vehicle = ? and step > ? and status = 'reached'", gone, steps // 2
        )
        assert with_it[0][0] > 0, "it takes part again"
    return _figures(service, mission_id) | {"speed": speed, "said": _warnings(lines)}


async def lied_to_over_imc(folder: Path, *, steps: int, speed: float) -> dict[str, Any]:
    """Fly with a vehicle that also reports impossible depths and ranges, numbers that are none, and jumps."""
    liar = NAMES[0]
    async with Sea(speed=speed) as sea, _service(folder, sea) as (service, api):
        mission_id = await _begun(api, NAMES, steps=steps)
        lying = asyncio.create_task(_lie(sea, liar))
        last = await ended(api, mission_id, PATIENCE_S + 60.0 * steps / speed)
        assert not lying.done() or lying.exception() is None
        lying.cancel()
        await asyncio.gather(lying, return_exceptions=True)
        assert last["state"] == "finished", last["reason"]
        _check(service, sea, mission_id)
        wrong = service.rows(
            "select count(*) from soundings where verdict = 'accepted' and not (depth_m > 0 and depth_m < 11100)"
        )
        assert wrong[0][0] == 0
        refused = dict(
            service.rows("select substr(reason, 1, 30), count(*) from soundings where verdict = 'rejected' group by 1")
        )
        lines = await log_of(api, mission_id)
    return _figures(service, mission_id) | {"speed": speed, "refused": refused, "said": _warnings(lines)}


async def bad_day_at_sea(folder: Path, *, speed: float) -> dict[str, Any]:
    """Fly over a bad radio with one vehicle that lies and another that vanishes and returns."""
    liar, gone = NAMES
    faults = NetworkFaults(loss=0.3, duplicate=0.2, reorder=0.2, hold_s=1.0 / speed, delay_s=2.0 / speed)
    async with Sea(speed=speed, faults=faults) as sea, _service(folder, sea) as (service, api):
        mission_id = await _begun(api, NAMES, steps=500)
        lying = asyncio.create_task(_lie(sea, liar))
        await steps_more(service, mission_id, 1)
        await sea.vanish(gone)

        async def lost() -> bool:
            return any(f"{gone} is lost" in line for line in await log_of(api, mission_id))

        await until(lost, "the log says that it is lost")
        await steps_more(service, mission_id, 1)
        await sea.launch(gone)

        async def follows() -> bool:
            return any(
                v["name"] == gone and v["link"] == "engaged" for v in (await state_of(api, mission_id))["vehicles"]
            )

        await until(follows, "it follows again")
        await steps_more(service, mission_id, 1)
        assert not lying.done()
        lying.cancel()
        await asyncio.gather(lying, return_exceptions=True)
        stopped = (await api.post(f"/missions/{mission_id}/abort")).json()
        assert len(stopped["stops"]) == 2
        _check(service, sea, mission_id)
        return _figures(service, mission_id)


async def two_services(folder: Path, *, steps: int, speed: float) -> dict[str, Any]:
    """Run two services on one network; each leads its vehicle, and neither gets the other's."""
    folders = [folder / "ours", folder / "theirs"]
    for each in folders:
        each.mkdir()
    async with (
        Sea(speed=speed) as sea,
        _service(folders[0], sea, OURS) as (ours, our_api),
        _service(folders[1], sea, OTHERS) as (theirs, their_api),
    ):
        our_mission = await _begun(our_api, NAMES[:1], steps=steps)
        await steps_more(ours, our_mission, 1)

        async def seen() -> bool:
            vehicles = (await their_api.get("/vehicles")).json()
            return any(v["name"] == NAMES[0] and "another console" in v["reason"] for v in vehicles)

        await until(seen, "they see that our vehicle is led by another console")
        # What they begin with it is refused, with the reason.
        created = await their_api.post("/missions", json=_spec(NAMES[:1], steps))
        refused = await their_api.post(f"/missions/{created.json()['id']}/start")
        assert refused.status_code == httpx.codes.CONFLICT, refused.text
        assert NAMES[0] in refused.json()["detail"]
        assert "of another console" in refused.json()["detail"]
        their_mission = await _begun(their_api, NAMES[1:], steps=steps)
        for api, service, mission_id in ((our_api, ours, our_mission), (their_api, theirs, their_mission)):
            last = await ended(api, mission_id, PATIENCE_S + 60.0 * steps / speed)
            assert last["state"] == "finished", last["reason"]
            check_rows(service, mission_id)
        assert sea.commanders(NAMES[0]) == {OURS}
        assert sea.commanders(NAMES[1]) == {OTHERS}
        _check_destinations(sea, ours, theirs)
    return {"steps of each": steps, "speed": speed, "refused": refused.json()["detail"]}


async def cut_in_two(folder: Path, *, steps: int, cuts: int, speed: float) -> dict[str, Any]:
    """Cut the network between the service and the vehicles, and join it again."""
    away = Afar(speed)
    with cable() as between:
        async with (
            away.afloat(folder, between),
            service_in(folder, settings=away.settings()) as (service, api),
        ):
            mission_id = await _begun(api, NAMES, steps=steps)
            for count in range(1, cuts + 1):
                await steps_more(service, mission_id, 2)
                between.pull()

                async def lost(count: int = count) -> bool:
                    lines = await log_of(api, mission_id)
                    return all(sum(f"{name} is lost" in line for line in lines) >= count for name in NAMES)

                await until(lost, "both are told to be lost")
                assert (await state_of(api, mission_id))["state"] == "running"
                between.put_back()

                async def back() -> bool:
                    return all(v["link"] == "engaged" for v in (await state_of(api, mission_id))["vehicles"])

                await until(back, "both follow again")
            last = await ended(api, mission_id, PATIENCE_S + 60.0 * steps / speed)
            assert last["state"] == "finished", last["reason"]
            check_rows(service, mission_id)
            lines = await log_of(api, mission_id)
    return _figures(service, mission_id) | {"cuts": cuts, "speed": speed, "said": _warnings(lines)}


async def _lie(sea: Sea, name: str) -> None:
    """Say one thing after the other that cannot be, for as long as it lasts."""
    values = (math.nan, math.inf, -math.inf, 1e308, -9000.0, 20_000.0)
    turn = 0
    while True:
        turn += 1
        value = values[turn % len(values)]
        state = imcpy.EstimatedState()
        state.lat, state.lon = math.radians(FRAME.origin_lat_deg), math.radians(FRAME.origin_lon_deg)
        match turn % 5:
            case 0:
                state.depth = value
            case 1:
                state.lat = value
            case 2:
                state.x, state.y = 4000.0, -4000.0
            case 3:
                state.psi = value
            case _:
                state.z, state.alt = value, value
        sea.say(name, state)
        distance = imcpy.Distance()
        distance.src_ent = 0
        distance.validity, distance.value = imcpy.Distance.ValidityEnum.VALID, value
        sea.say(name, distance)
        fuel = imcpy.FuelLevel()
        fuel.value = value
        sea.say(name, fuel)
        await asyncio.sleep(0.3 / sea.speed)


@asynccontextmanager
async def _service(folder: Path, sea: Sea, imc_id: int = OURS) -> AsyncIterator[tuple[Service, httpx.AsyncClient]]:
    async with service_in(folder, settings=sea.settings(imc_id)) as opened:
        yield opened


def _spec(names: tuple[str, ...], steps: int) -> dict[str, Any]:
    return mission_of(imc_vehicles(*names), steps=steps, limits=LIMITS, step_deadline_s=120.0)


async def _begun(api: httpx.AsyncClient, names: tuple[str, ...], *, steps: int) -> str:
    """Start a mission once its vehicles are ready; returns its id."""

    async def ready() -> bool:
        vehicles = (await api.get("/vehicles")).json()
        return {v["name"] for v in vehicles if v["link"] == "ready"} >= set(names)

    await until(ready, f"{', '.join(names)} are ready")
    return await started(api, _spec(names, steps))


def _check(service: Service, sea: Sea, mission_id: str) -> None:
    check_rows(service, mission_id)
    _check_destinations(sea, service)


def _check_destinations(sea: Sea, *services: Service) -> None:
    """No vehicle is sent back to where an earlier order led, unless a later step leads there, too.

    Where no step leads, vehicles wait or go aside, again where they did before, and inside the area; then they go on.
    """
    area = Polygon([(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M)]).buffer(0.01)
    query = "select east_m, north_m from waypoints where vehicle = ?"
    for name in NAMES:
        planned = [place for service in services for place in service.rows(query, name)]
        sent: list[tuple[float, float]] = []
        for place in sea.destinations(name):
            if not any(_same(place, step) for step in planned):
                assert area.contains(Point(place)), f"{name} was sent to {place}, outside of the area"
            elif not sent or not _same(place, sent[-1]):
                sent.append(place)
        for place in sent:
            times, steps = (sum(_same(place, other) for other in places) for places in (sent, planned))
            assert times <= steps, f"{name} was sent to {place} {times} times by {steps} steps: {sent}"


def _same(place: tuple[float, float], other: tuple[float, float]) -> bool:
    return math.dist(place, other) < SAME_M


def _figures(service: Service, mission_id: str) -> dict[str, Any]:
    waypoints = service.rows("select status, count(*) from waypoints where mission_id = ? group by 1", mission_id)
    soundings = service.rows("select verdict, count(*) from soundings where mission_id = ? group by 1", mission_id)
    return {"steps": service.steps(mission_id), "waypoints": dict(waypoints), "soundings": dict(soundings)}


def _warnings(lines: list[str]) -> list[str]:
    return [line for line in lines if line.startswith(("warning", "alarm"))]
