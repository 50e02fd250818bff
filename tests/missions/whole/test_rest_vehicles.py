"""Two vehicles and an operator that speak nothing but HTTP sail a mission to its product."""

import asyncio
import io
from typing import Any

import httpx
import numpy as np
import pytest
import rasterio

from app.main import serve
from app.missions.settings import ImcSettings
from app.settings import Settings
from tests.support.missions.polling import PollingVehicle
from tests.support.missions.specs import FRAME, spec_json
from tests.support.storage.databases import query

SIDE_M = 50.0
STEPS = 12


@pytest.mark.slow
@pytest.mark.timeout(300)
async def test_a_mission_of_two_polling_vehicles_from_create_to_geotiff(database_url: str) -> None:
    settings = Settings(port=0, database_url=database_url, imc=ImcSettings(enabled=False), time_scale=10)
    started: asyncio.Future[object] = asyncio.get_running_loop().create_future()
    serving = asyncio.create_task(serve(settings, started=started.set_result))
    both: set[asyncio.Future[Any]] = {serving, started}
    await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
    server = started.result()
    try:
        async with httpx.AsyncClient(base_url=server.url + "/api/v1", timeout=60, verify=False) as api:  # type: ignore[attr-defined]  # noqa: S501
            spec = spec_json(
                SIDE_M,
                vehicles=[{"name": "one", "kind": "rest"}],
                steps=STEPS,
                planner={"name": "cao"},
                cell_m=1.0,
                step_deadline_s=600,
            )
            created = await api.post("/missions", json=spec)
            assert created.status_code == httpx.codes.CREATED, created.text
            mission_id = created.json()["id"]
            path = f"/missions/{mission_id}"
            joined = await api.post(f"{path}/vehicles", json={"name": "two", "kind": "rest"})
            assert joined.is_success, joined.text
            vehicles = [PollingVehicle("one", FRAME, 2.0, 2.0), PollingVehicle("two", FRAME, 12.0, 2.0)]
            assert (await api.get(f"{path}/map.tif")).status_code == httpx.codes.NOT_FOUND
            assert (await api.post(f"{path}/start")).status_code == httpx.codes.OK
            async with asyncio.timeout(200):
                await asyncio.gather(*(vehicle.run(api, mission_id) for vehicle in vehicles))
            ended = (await api.get(path)).json()
            while ended["state"] == "running":  # the vehicles are told first
                ended = (await api.get(path)).json()
            assert (ended["state"], ended["progress"]["step"]) == ("finished", STEPS), ended["reason"]
            product = await api.get(f"{path}/map.tif")
            assert product.headers["content-type"].startswith("image/tiff")
            events = (await api.get("/vehicles")).json()
    finally:
        server.stop()  # type: ignore[attr-defined]
        await serving

    assert {v["name"]: v["mission_id"] for v in events} == {"one": None, "two": None}
    for vehicle in vehicles:
        assert vehicle.steps_seen == list(range(1, STEPS + 1))
        assert vehicle.told_to_stop
    with rasterio.open(io.BytesIO(product.content)) as image:
        depth = np.abs(image.read(1, masked=True))
        assert image.shape == (50, 50)
    assert 8.0 < float(depth.min()) <= float(depth.max()) < 16.0
    counts = "select vehicle, count(*) from soundings where verdict = 'accepted' group by vehicle"
    stored = dict(query(database_url, counts))
    statuses = {status for (status,) in query(database_url, "select status from waypoints")}
    assert stored == {vehicle.name: len(vehicle.accepted) for vehicle in vehicles}
    assert statuses == {"reached"}
