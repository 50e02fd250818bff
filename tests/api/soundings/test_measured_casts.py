"""Casts from what vehicles measure of the water: offered, never applied by themselves, and right where they are."""

import math
import time
from datetime import datetime
from typing import Any

import httpx
import numpy as np
import pytest

from tests.support.api.rest import mission_spec

BEGIN_S = math.floor(time.time()) - 7200.0
FLOOR_M, SONAR_M, ASSUMED_MPS = 20.0, 2.0, 1500.0
AREA_LAT, AREA_LON = 41.18515, -8.7045


def water_mps(depth_m: float) -> float:
    """Warm water on cold."""
    return 1525.0 - 0.2 * depth_m - 20.0 / (1.0 + math.exp(-(depth_m - 8.0)))


def item(after_s: float, depth_m: float, **changes: Any) -> dict[str, Any]:
    place = {"lat_deg": AREA_LAT, "lon_deg": AREA_LON, "depth_m": depth_m, "heading_deg": 0.0}
    return {"vehicle": "rover", "time_s": BEGIN_S + after_s} | place | changes


def dive(deepest_m: float = 18.0, seconds: int = 300) -> list[dict[str, Any]]:
    """Down and up, with a sound speed each second."""
    rng = np.random.default_rng(2)
    found = []
    for second in range(seconds):
        depth_m = deepest_m * (1.0 - abs(2.0 * second / seconds - 1.0))
        speed = water_mps(depth_m) + 0.1 * float(rng.standard_normal())
        found.append(item(second, depth_m, sound_speed_mps=round(speed, 3)))
    return found


def range_in_water_m(angle_rad: float) -> float:
    """What a sonar that takes sound for evenly fast measures to the floor: a ray of many thin layers."""
    edges = np.linspace(SONAR_M, FLOOR_M, 4001)
    middle = 0.5 * (edges[1:] + edges[:-1])
    speeds = np.array([water_mps(float(depth)) for depth in middle])
    sine = math.sin(abs(angle_rad)) * speeds / water_mps(SONAR_M)
    travelled_s = float(np.sum(np.diff(edges) / (speeds * np.sqrt(1.0 - sine**2))))
    return travelled_s * ASSUMED_MPS


def pings(count: int = 20) -> list[dict[str, Any]]:
    angles = np.linspace(-60.0, 60.0, 41)
    ranges = [round(range_in_water_m(math.radians(angle)), 4) for angle in angles.tolist()]
    beams = {"angles_deg": angles.tolist(), "ranges_m": ranges}
    return [item(600.0 + number, SONAR_M, lat_deg=AREA_LAT + 1e-5 * number, beams=beams) for number in range(count)]


@pytest.fixture
async def path(client: httpx.AsyncClient) -> str:
    rover = {"name": "rover", "kind": "rest", "sensor": "multibeam"}
    answer = await client.post("/missions", json=mission_spec(vehicles=[rover]))
    assert answer.status_code == 201, answer.text
    return f"/missions/{answer.json()['id']}"


async def post(client: httpx.AsyncClient, path: str, items: list[dict[str, Any]]) -> None:
    answer = await client.post(f"{path}/measurements", json={"items": items})
    assert answer.status_code == 200, answer.text


async def measured(client: httpx.AsyncClient, path: str, **wanted: Any) -> list[dict[str, Any]]:
    answer = await client.get(f"{path}/sound-speed/measured", params=wanted)
    assert answer.status_code == 200, answer.text
    return list(answer.json())


async def test_a_cast_of_the_vehicle_puts_the_depths_right_once_it_is_added(
    client: httpx.AsyncClient, path: str
) -> None:
    await post(client, path, dive())
    await post(client, path, pings())
    (cast,) = await measured(client, path)
    assert (cast["vehicle"], cast["file"], cast["probe"]) == ("rover", None, "rest")
    depths, speeds = zip(*cast["profile"], strict=True)
    assert depths[0] < 1.0
    assert depths[-1] > 17.0
    assert speeds == pytest.approx([water_mps(depth) for depth in depths], abs=0.6)
    assert len(cast["bins"]) == len(cast["profile"])
    assert all(count >= 3 and sd < 2.0 for count, sd in cast["bins"])
    assert abs(cast["lag_mps"]) < 0.2
    assert (await client.get(f"{path}/corrections")).json()["sound_speed"] is None, "none counts by itself"
    raw = await depths_of_beams(client, path)
    added = {name: cast[name] for name in ("profile", "time", "position")} | {"name": "rover's"}
    body = {"casts": [added], "assumed_mps": ASSUMED_MPS}
    answer = await client.post(f"{path}/sound-speed/casts", json=body)
    assert answer.status_code == 200, answer.text
    right = await depths_of_beams(client, path)
    assert abs(raw - FLOOR_M).max() > 0.15
    assert abs(right - FLOOR_M).max() < 0.02, "within the sound speed's noise"
    assert np.ptp(right) < 0.1 * np.ptp(raw), "outer beams lie as deep as inner ones"


async def depths_of_beams(client: httpx.AsyncClient, path: str) -> np.ndarray:
    """The corrected depth of each beam."""
    answer = await client.post(f"{path}/beams/points", json={})
    assert answer.status_code == 200, answer.text
    found = np.array(answer.json()["depth_m"], dtype=float)
    assert len(found) == 20 * 41
    return found


async def test_casts_are_of_a_vehicle_and_a_time(client: httpx.AsyncClient, path: str) -> None:
    await post(client, path, dive())
    assert len(await measured(client, path, vehicle="rover")) == 1
    assert await measured(client, path, vehicle="another") == []
    (down,) = await measured(client, path, until_s=BEGIN_S + 150.0)
    assert down["lag_mps"] is None
    assert datetime.fromisoformat(down["time"]).timestamp() == pytest.approx(BEGIN_S + 75.0, abs=10.0)
    assert await measured(client, path, from_s=BEGIN_S + 1000.0) == []
    for wrong in ({"from_s": "nan"}, {"from_s": BEGIN_S + 1.0, "until_s": BEGIN_S}):
        answer = await client.get(f"{path}/sound-speed/measured", params=wrong)
        assert answer.status_code == 422
        assert [error["field"] for error in answer.json()["errors"]] == ["from_s"]


async def test_nonsense_of_a_vehicle_never_becomes_a_cast(client: httpx.AsyncClient, path: str) -> None:
    absurd = [343.0, -1.0, 1e30, 0.0, 1700.0]
    await post(client, path, [item(k, 0.5 * k, sound_speed_mps=absurd[k % 5]) for k in range(60)])
    await post(client, path, [item(1e9 + k, 0.3 * k, sound_speed_mps=1500.0) for k in range(60)])
    await post(client, path, [item(k, 5.0, sound_speed_mps=1500.0) for k in range(100, 400)])
    assert await measured(client, path) == [], "nor does one depth alone"
