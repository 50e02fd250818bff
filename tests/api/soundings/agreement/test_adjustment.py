"""Tracks adjusted for drift over REST: what overlaps is compared, raw positions stay, one call undoes it."""

from typing import Any

import httpx
import numpy as np
import pytest

from app.arrays import FloatArray
from tests.support.api.rest import mission_spec
from tests.support.mapping.drifting import OFF_M, SIDE_M, bottom_m, drift_of, pinged_while_drifting, ways
from tests.support.missions.specs import lon_lat, rectangle


async def swath_mission(client: httpx.AsyncClient) -> str:
    kinds = [{"name": name, "kind": "rest", "sensor": "multibeam"} for name in ("rover", "scout")]
    body = mission_spec(area=rectangle(0, 0, SIDE_M, SIDE_M), cell_m=1.0, vehicles=kinds)
    created = await client.post("/missions", json=body)
    assert created.status_code == 201, created.text
    return f"/missions/{created.json()['id']}"


async def post(client: httpx.AsyncClient, path: str, items: list[dict[str, Any]]) -> None:
    for first in range(0, len(items), 100):
        answer = await client.post(f"{path}/measurements", json={"items": items[first : first + 100]})
        assert answer.status_code == 200, answer.text
        assert answer.json()["rejected"] == 0, answer.text


async def depths(client: httpx.AsyncClient, path: str) -> FloatArray:
    answer = await client.get(f"{path}/map")
    assert answer.status_code == 200, answer.text
    found = answer.json()
    return np.array([[np.nan if depth is None else depth for depth in row] for row in found["depth_m"]], dtype=float)


def rmse(found: FloatArray) -> float:
    at = np.arange(found.shape[0]) + 0.5
    return float(np.sqrt(np.nanmean((found - bottom_m(*np.meshgrid(at, at))) ** 2)))


@pytest.mark.slow
async def test_a_map_bent_by_drift_is_straightened_and_bent_again(client: httpx.AsyncClient) -> None:
    path = await swath_mission(client)
    first, second = ways()
    drift = drift_of(second)
    await post(client, path, pinged_while_drifting("rover", first, np.zeros((len(first), 2))))
    await post(client, path, pinged_while_drifting("scout", second, drift))
    bent = await depths(client, path)
    assert (await client.get(f"{path}/adjustment")).json()["applied"] is False

    fixes = []
    for vehicle, way in (("rover", first), ("scout", second)):
        lon, lat = lon_lat(way[0, 1], way[0, 2])
        fixes.append({"vehicle": vehicle, "time_s": way[0, 0], "lat_deg": lat, "lon_deg": lon, "sd_m": 0.2})
    lon, lat = lon_lat(first[-1, 1], first[-1, 2])
    fixes.append({"vehicle": "rover", "time_s": first[-1, 0], "lat_deg": lat, "lon_deg": lon, "sd_m": 0.2})
    answer = await client.post(f"{path}/adjustment", json={"fixes": fixes})
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert found["applied"]
    assert found["by_ties"]
    assert found["actor"]
    assert found["held_out"]["after_m"] < 0.6 * found["held_out"]["before_m"]
    scout = next(track for track in found["tracks"] if track["vehicle"] == "scout")
    # Its lines went on eastwards as it drifted: part of that may be the other one's wrong heading and scale of speed.
    assert scout["max_m"] == pytest.approx(np.hypot(OFF_M, 0.5 * OFF_M), abs=1.4)
    used = [tie for tie in found["ties"]["features"] if tie["properties"]["outcome"] == "used"]
    assert len(used) == found["ties_used"] > 10

    straight = await depths(client, path)
    assert rmse(straight) < 0.5 * rmse(bent)
    assert (await client.get(f"{path}/adjustment")).json() == found
    events = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
    assert any("tracks adjusted by" in event["message"] for event in events)

    report = (await client.get(f"{path}/report.html")).text
    assert f'value="{found["ties_used"]}" data-of="adjustment.ties_used"' in report
    assert "Positions are those that the vehicles told" not in report

    again = (await client.post(f"{path}/adjustment", json={"fixes": fixes})).json()
    assert again["tracks"] == found["tracks"]  # it begins from raw positions

    undone = await client.delete(f"{path}/adjustment")
    assert undone.status_code == 200
    assert undone.json()["applied"] is False
    np.testing.assert_array_equal(await depths(client, path), bent)


async def test_a_clock_that_was_decades_off_for_a_sounding_holds_nothing_up(client: httpx.AsyncClient) -> None:
    path = await swath_mission(client)
    way, _ = ways()
    items = pinged_while_drifting("rover", way[:20], np.zeros((20, 2)))
    await post(client, path, [items[0] | {"time_s": items[0]["time_s"] - 86_400.0 * 20_000}, *items])
    answer = await client.post(f"{path}/adjustment")
    assert answer.status_code == 200, answer.text
