"""Several services on one database: any of them answers for every mission, and a killed one's missions go on."""

import asyncio
import json
import signal
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path

import httpx
import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from tests.support.faults.missions import mission_of, pollers
from tests.support.faults.service import Service, service_in
from tests.support.storage.databases import Databases, query

PATIENCE_S = 120.0

Running = tuple[Service, httpx.AsyncClient]


@pytest.fixture
async def two(tmp_path: Path, databases: Databases) -> AsyncIterator[tuple[Running, Running]]:
    """Two services on one database."""
    url = databases.fresh("postgresql")
    async with AsyncExitStack() as stack:
        running = []
        for name in ("one", "other"):
            (folder := tmp_path / name).mkdir()
            # Sooner than by default, and not so soon that one is taken for dead whose machine is only busy.
            world = {"HUNG_LOOKS": "15"}
            running.append(await stack.enter_async_context(service_in(folder, database_url=url, world=world)))
        yield running[0], running[1]


@pytest.mark.slow
@pytest.mark.timeout(600)
async def test_any_of_them_answers_and_a_killed_ones_mission_goes_on(two: tuple[Running, Running]) -> None:
    (first, at_first), (second, at_second) = two
    vehicles = pollers()
    spec = mission_of([{"name": vehicle.name, "kind": "rest"} for vehicle in vehicles], steps=12)
    created = await at_first.post("/missions", json=spec)
    assert created.status_code == httpx.codes.CREATED, created.text
    mission = f"/missions/{created.json()['id']}"

    # What one has, the other shows.
    assert (await at_second.get(mission)).json() == (await at_first.get(mission)).json()
    listed = [(await api.get("/missions")).json() for api in (at_first, at_second)]
    assert [[m["id"] for m in found] for found in listed] == [[created.json()["id"]]] * 2
    missing = await at_second.get(mission[:-1] + "0" if not mission.endswith("0") else mission[:-1] + "1")
    assert missing.status_code == httpx.codes.NOT_FOUND
    assert (await at_second.post(f"{mission}/pause")).status_code == httpx.codes.CONFLICT
    forged = {"X-Bathyfleet-Peer": "guessed", "X-Bathyfleet-For": "127.0.0.1", "X-Bathyfleet-Host": "localhost"}
    refused = await at_second.get("/missions", headers=forged)
    assert refused.status_code == httpx.codes.MISDIRECTED_REQUEST, "a stranger's words are not believed"

    # Vehicles and an operator speak to the second only, which sends everything on to the first.
    assert (await at_second.post(f"{mission}/start")).status_code == httpx.codes.OK
    flying = [asyncio.create_task(vehicle.run(at_second, created.json()["id"])) for vehicle in vehicles]
    live = second.url.replace("http", "ws") + f"{mission}/live"
    async with connect(live) as viewer:
        assert json.loads(await viewer.recv())["type"] == "snapshot"
        await step_more(at_second, mission, 3)
        await first.kill()
        # The viewer is sent away once, and finds the mission where it went.
        with pytest.raises(ConnectionClosed):
            await asyncio.wait_for(receive_all(viewer), PATIENCE_S)
    before = int((await at_second.get(mission)).json()["progress"]["step"])
    async with connect(live) as viewer:
        assert json.loads(await viewer.recv())["mission"]["id"] == created.json()["id"]
    async with asyncio.timeout(PATIENCE_S):
        await asyncio.gather(*flying)
        while (ended := (await at_second.get(mission)).json())["state"] == "running":  # noqa: ASYNC110
            await asyncio.sleep(0.05)
    assert before < 12
    assert ended["state"] == "finished", ended["reason"]
    steps = [
        number for (number,) in query(first.database_url, "select number from steps order by committed_at, number")
    ]
    assert steps == list(range(1, 13)), "every step once, in order"
    for vehicle in vehicles:
        accepted = "select time_s from soundings where vehicle = :name and verdict = 'accepted'"
        stored = [time_s for (time_s,) in query(first.database_url, accepted, name=vehicle.name)]
        assert set(vehicle.accepted) <= set(stored), "no sounding that was accepted is lost"
        assert len(stored) == len(set(stored)), "none is stored twice"
        assert vehicle.steps_seen == sorted(set(vehicle.steps_seen)), "no step is flown twice"


@pytest.mark.slow
@pytest.mark.timeout(600)
async def test_a_hung_ones_mission_goes_on_elsewhere_and_is_left_alone_when_it_wakes(
    two: tuple[Running, Running],
) -> None:
    """Its machine is held up, or its loop stands still: it keeps its connections, and answers nobody."""
    (first, at_first), (second, at_second) = two
    vehicles = pollers()
    spec = mission_of([{"name": vehicle.name, "kind": "rest"} for vehicle in vehicles], steps=10)
    created = await at_first.post("/missions", json=spec)
    identity = created.json()["id"]
    mission = f"/missions/{identity}"
    assert (await at_first.post(f"{mission}/start")).status_code == httpx.codes.OK
    first.process.send_signal(signal.SIGSTOP)
    try:
        async with asyncio.timeout(PATIENCE_S):
            while "mission taken up" not in second.said:  # noqa: ASYNC110 - another process looks
                await asyncio.sleep(0.05)
        flying = [asyncio.create_task(vehicle.run(at_second, identity)) for vehicle in vehicles]
        await step_more(at_second, mission, 2)
    finally:
        first.process.send_signal(signal.SIGCONT)
    async with asyncio.timeout(PATIENCE_S):
        while "taken for dead" not in first.said and "not answer" not in first.said:  # noqa: ASYNC110 - as above
            await asyncio.sleep(0.05)
        await asyncio.gather(*flying)
        while (ended := (await at_second.get(mission)).json())["state"] == "running":  # noqa: ASYNC110 - as above
            await asyncio.sleep(0.05)
        assert (await at_first.get(mission)).json()["state"] == ended["state"] == "finished", ended["reason"]
    steps = [
        number for (number,) in query(first.database_url, "select number from steps order by committed_at, number")
    ]
    assert steps == list(range(1, 11)), "every step once, in order"


async def receive_all(viewer: ClientConnection) -> None:
    while True:
        await viewer.recv()


async def step_more(api: httpx.AsyncClient, mission: str, count: int) -> None:
    async def step() -> int:
        return int((await api.get(mission)).json()["progress"]["step"])

    before = await step()
    async with asyncio.timeout(PATIENCE_S):
        while await step() < before + count:  # noqa: ASYNC110 - another process changes it
            await asyncio.sleep(0.02)
