"""kill -9 at any moment: the mission goes on from its last committed step, and nothing that was accepted is lost."""

import asyncio
import os
import random
import socket
import sqlite3
import sys
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from shapely.geometry import Point, Polygon

from app.mapping.georeference import LocalFrame
from tests.missions.polling import PollingVehicle

KILLS = 8
STEPS = 100
LONGEST_DELAY_S = 0.4
SIDE_M = 60.0
ORIGIN = (41.185, -8.705)
PATIENCE_S = 120.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Service:
    """The real service as a process of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.port = free_port()
        self.database = folder / "fleet.db"
        self.process: asyncio.subprocess.Process | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/api/v1"

    async def start(self) -> None:
        with (self.folder / "service.log").open("ab") as log:
            self.process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-c", "from app.cli import main; main()", "serve", "--port", str(self.port)),
                *("--database", f"sqlite+aiosqlite:///{self.database}", "--log-format", "json"),
                env={key: value for key, value in os.environ.items() if not key.startswith("BATHYFLEET_")}
                | {"BATHYFLEET_IMC__ENABLED": "false"},
                cwd=self.folder,
                stdout=log,
                stderr=log,
            )

    async def await_ready(self, api: httpx.AsyncClient) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while True:
                assert self.process is not None
                assert self.process.returncode is None, (self.folder / "service.log").read_text()[-3000:]
                try:
                    if (await api.get("/health/ready")).status_code == httpx.codes.OK:
                        return
                except httpx.TransportError:
                    pass
                await asyncio.sleep(0.05)

    async def kill(self) -> None:
        assert self.process is not None
        self.process.kill()
        await self.process.wait()


@asynccontextmanager
async def service_in(folder: Path) -> AsyncIterator[Service]:
    service = Service(folder)
    try:
        yield service
    finally:
        if service.process is not None and service.process.returncode is None:
            await service.kill()


def mission_of(frame: LocalFrame) -> dict[str, Any]:
    corners = np.array([[0, 0], [SIDE_M, 0], [SIDE_M, SIDE_M], [0, SIDE_M], [0, 0]], dtype=float)
    lat, lon = frame.to_geographic(corners[:, 0], corners[:, 1])
    ring = [[float(x), float(y)] for x, y in zip(lon, lat, strict=True)]
    return {
        "name": "Killed again and again",
        "area": {"type": "Polygon", "coordinates": [[*ring[:-1], ring[0]]]},
        "vehicles": [{"name": "one", "kind": "rest"}, {"name": "two", "kind": "rest"}],
        "steps": STEPS,
        "cell_m": 2.0,
        "step_deadline_s": 20.0,
    }


@pytest.mark.timeout(900)
async def test_a_mission_survives_being_killed_at_random_moments(tmp_path: Path) -> None:
    chance = random.Random(2026)  # noqa: S311 - chooses moments, guards nothing
    frame = LocalFrame(*ORIGIN)
    vehicles = [PollingVehicle("one", frame, 2.0, 2.0), PollingVehicle("two", frame, 8.0, 2.0)]
    kills = 0
    steps_at_kills = []
    async with service_in(tmp_path) as service, httpx.AsyncClient(base_url=service.url, timeout=30) as api:
        await service.start()
        await service.await_ready(api)
        created = await api.post("/missions", json=mission_of(frame))
        assert created.status_code == httpx.codes.CREATED, created.text
        mission_id = created.json()["id"]
        assert (await api.post(f"/missions/{mission_id}/start")).status_code == httpx.codes.OK

        flying = [asyncio.create_task(vehicle.run(api, mission_id)) for vehicle in vehicles]
        while kills < KILLS:
            if kills % 4 != 3:
                await steps_more(service.database, mission_id, chance.randint(1, 4))
            # Anywhere in a step, or (every fourth time) while the mission is only being taken up again.
            await asyncio.sleep(chance.uniform(0.0, LONGEST_DELAY_S))
            for task in flying:
                assert not task.done() or task.exception() is None
            await service.kill()
            kills += 1
            steps_at_kills.append(committed_steps(service.database, mission_id))
            await service.start()
            await service.await_ready(api)

        async with asyncio.timeout(PATIENCE_S * 4):
            await asyncio.gather(*flying)
            # The vehicles are stopped first; the last soundings go into the map before the mission counts as finished.
            while (ended := (await api.get(f"/missions/{mission_id}")).json())["state"] == "running":  # noqa: ASYNC110
                await asyncio.sleep(0.05)

    assert steps_at_kills[-1] < STEPS, "every kill came while the mission was running"
    assert len(set(steps_at_kills)) > KILLS // 3, "the kills came at different steps"
    assert ended["state"] == "finished", ended["reason"]
    rows = sqlite3.connect(service.database)
    steps = [n for (n,) in rows.execute("select number from steps order by committed_at, number")]
    assert steps == list(range(1, STEPS + 1)), "every step once, in order"
    area = Polygon([(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M)]).buffer(0.01)
    for east, north in rows.execute("select east_m, north_m from waypoints"):
        assert area.contains(Point(east, north))
    for vehicle in vehicles:
        stored = Counter(
            time_s
            for (time_s,) in rows.execute(
                "select time_s from soundings where vehicle = ? and verdict = 'accepted'", (vehicle.name,)
            )
        )
        assert set(vehicle.accepted) <= set(stored), "no sounding that was accepted is lost"
        assert max(stored.values()) == 1, "none is stored twice"
        assert vehicle.steps_seen == sorted(vehicle.steps_seen), "no vehicle is ever sent back to an earlier step"
        assert len(set(vehicle.steps_seen)) == len(vehicle.steps_seen), "no step is flown twice"
    rows.close()


async def steps_more(database: Path, mission_id: str, count: int) -> None:
    before = committed_steps(database, mission_id)
    async with asyncio.timeout(PATIENCE_S):
        while committed_steps(database, mission_id) < before + count:  # noqa: ASYNC110 - another process changes it
            await asyncio.sleep(0.02)


def committed_steps(database: Path, mission_id: str) -> int:
    connection = sqlite3.connect(database)
    try:
        (count,) = connection.execute("select count(*) from steps where mission_id = ?", (mission_id,)).fetchone()
        return int(count)
    finally:
        connection.close()
