"""Small missions of polling vehicles, and what has to be true of them whatever went wrong."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

import httpx
import numpy as np
from shapely.geometry import Point, Polygon

from app.mapping.coordinates.georeference import LocalFrame
from tests.support.faults.service import PATIENCE_S, Service
from tests.support.missions.polling import PollingVehicle
from tests.support.waiting import until

SIDE_M = 60.0
FRAME = LocalFrame(41.185, -8.705)


def mission_of(vehicles: Sequence[dict[str, Any]], **changes: Any) -> dict[str, Any]:
    """A mission over a square of 60 m."""
    corners = np.array([[0, 0], [SIDE_M, 0], [SIDE_M, SIDE_M], [0, SIDE_M]], dtype=float)
    lat, lon = FRAME.to_geographic(corners[:, 0], corners[:, 1])
    ring = [[float(x), float(y)] for x, y in zip(lon, lat, strict=True)]
    values = {
        "name": "Whatever happens",
        "area": {"type": "Polygon", "coordinates": [[*ring, ring[0]]]},
        "vehicles": list(vehicles),
        "steps": 30,
        "cell_m": 2.0,
        "step_deadline_s": 20.0,
    }
    return values | changes


def pollers() -> list[PollingVehicle]:
    """Two vehicles that poll."""
    return [PollingVehicle("one", FRAME, 2.0, 2.0), PollingVehicle("two", FRAME, 8.0, 2.0)]


async def started(api: httpx.AsyncClient, spec: dict[str, Any]) -> str:
    """Create a mission and start it; returns its id."""
    created = await api.post("/missions", json=spec)
    assert created.status_code == httpx.codes.CREATED, created.text
    mission_id: str = created.json()["id"]
    begun = await api.post(f"/missions/{mission_id}/start")
    assert begun.status_code == httpx.codes.OK, begun.text
    return mission_id


@asynccontextmanager
async def flying(
    api: httpx.AsyncClient, vehicles: Sequence[PollingVehicle], **changes: Any
) -> AsyncIterator[tuple[str, list[asyncio.Task[None]]]]:
    """A started mission of polling vehicles that do their part; yields its id and their tasks."""
    spec = mission_of([{"name": vehicle.name, "kind": "rest"} for vehicle in vehicles], **changes)
    mission_id = await started(api, spec)
    tasks = [asyncio.create_task(vehicle.run(api, mission_id)) for vehicle in vehicles]
    try:
        yield mission_id, tasks
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def steps_more(service: Service, mission_id: str, count: int) -> None:
    """Wait until so many more steps are committed."""
    before = service.steps(mission_id)

    async def there() -> bool:
        return service.steps(mission_id) >= before + count

    await until(there, f"{count} more steps are committed after step {before}")


async def state_of(api: httpx.AsyncClient, mission_id: str) -> dict[str, Any]:
    """The mission as it is shown."""
    answer = await api.get(f"/missions/{mission_id}")
    assert answer.status_code == httpx.codes.OK, answer.text
    found: dict[str, Any] = answer.json()
    return found


async def ended(api: httpx.AsyncClient, mission_id: str, patience_s: float = PATIENCE_S) -> dict[str, Any]:
    """The mission once it runs no more."""

    async def over() -> bool:
        return (await state_of(api, mission_id))["state"] != "running"

    await until(over, "the mission runs no more", patience_s)
    return await state_of(api, mission_id)


async def log_of(api: httpx.AsyncClient, mission_id: str) -> list[str]:
    """The lines of a mission's log as ``level kind: message``."""
    answer = await api.get(f"/missions/{mission_id}/events", headers={"Accept": "application/json"})
    return [f"{event['level']} {event['kind']}: {event['message']}" for event in answer.json()]


def check_rows(service: Service, mission_id: str, vehicles: Sequence[PollingVehicle] = ()) -> None:
    """Every step once, waypoints inside the area, accepted soundings stored once, no order flown twice."""
    steps = [n for (n,) in service.rows("select number from steps where mission_id = ? order by number", mission_id)]
    assert steps == list(range(1, len(steps) + 1)), "every step once"
    area = Polygon([(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M)]).buffer(0.01)
    for east, north in service.rows("select east_m, north_m from waypoints where mission_id = ?", mission_id):
        assert area.contains(Point(east, north)), "every waypoint lies in the area"
    for vehicle in vehicles:
        query = "select time_s from soundings where mission_id = ? and vehicle = ? and verdict = 'accepted'"
        stored = Counter(time_s for (time_s,) in service.rows(query, mission_id, vehicle.name))
        assert set(vehicle.accepted) <= set(stored), "no sounding that was accepted is lost"
        assert not stored or max(stored.values()) == 1, "none is stored twice"
        assert vehicle.steps_seen == sorted(set(vehicle.steps_seen)), "no step is flown twice, or after a later one"
