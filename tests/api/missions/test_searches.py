"""Missions that search, over HTTP."""

import json
from typing import Any

import httpx

from tests.support.missions.searches import search_json
from tests.support.missions.specs import lon_lat


def scan(time_s: float, **changes: Any) -> dict[str, Any]:
    lon, lat = lon_lat(14, 5)
    return {
        "vehicle": "boat",
        "time_s": time_s,
        "lat_deg": lat,
        "lon_deg": lon,
        "bearing_step_deg": 2.0,
        "reach_m": 10.0,
        "ranges_m": [None] * 180,
    } | changes


async def test_scans_go_in_and_the_site_comes_out(client: httpx.AsyncClient) -> None:
    made = await client.post("/missions", json=search_json(vehicles=[{"name": "boat", "kind": "rest", "depth_m": 0}]))
    assert made.status_code == 201, made.text
    path = f"/missions/{made.json()['id']}"
    before = (await client.get(f"{path}/search")).json()
    assert (before["version"], before["rows"], before["cols"]) == (0, 30, 30)
    wall = scan(2.0, first_bearing_deg=-20.0, bearing_step_deg=1.0, ranges_m=[6.0] * 40)
    answer = await client.post(f"{path}/scans", json={"items": [scan(1.0), wall]})
    assert answer.status_code == 200, answer.text
    assert answer.json()["accepted"] == 2
    after = (await client.get(f"{path}/search")).json()
    assert after["version"] == 2
    assert after["cells"] != before["cells"]
    assert (await client.get(f"{path}/search", params={"after": 2})).status_code == 204
    progress = (await client.get(path)).json()["progress"]["search"]
    assert progress["explored_pct"] > 20
    obstacles = await client.get(f"{path}/search/obstacles.geojson")
    assert obstacles.headers["content-type"] == "application/geo+json"
    listed = {product["name"]: product["href"] for product in (await client.get(f"{path}/products")).json()}
    assert listed["obstacles.geojson"] == f"/api/v1{path}/search/obstacles.geojson"
    found = [f["properties"]["found"] for f in obstacles.json()["features"]]
    assert found.count(False) == 1
    assert found.count(True) >= 1


async def test_a_scan_that_cannot_be_read_is_named_and_spoils_no_other(client: httpx.AsyncClient) -> None:
    made = await client.post("/missions", json=search_json(vehicles=[{"name": "boat", "kind": "rest", "depth_m": 0}]))
    path = f"/missions/{made.json()['id']}"
    items = [scan(1.0), scan(2.0, reach_m=-1), scan(1.0), scan(3.0, vehicle="nobody"), scan(4.0)]
    answer = await client.post(f"{path}/scans", json={"items": items})
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert (found["accepted"], found["rejected"], found["duplicate"]) == (2, 2, 1)
    assert [item["index"] for item in found["items"]] == [0, 1, 2, 3, 4]
    verdicts = ["accepted", "rejected", "duplicate", "rejected", "accepted"]
    assert [item["verdict"] for item in found["items"]] == verdicts
    assert found["items"][1]["reason"].startswith("reach_m: ")
    assert "nobody" in found["items"][3]["reason"]
    assert (await client.get(f"{path}/search")).json()["version"] == 2


async def test_a_scan_with_text_that_cannot_be_stored_spoils_no_other(client: httpx.AsyncClient) -> None:
    made = await client.post("/missions", json=search_json(vehicles=[{"name": "boat", "kind": "rest", "depth_m": 0}]))
    body = json.dumps({"items": [scan(1.0), scan(2.0, vehicle="boat\0"), scan(3.0)]})
    path = f"/missions/{made.json()['id']}/scans"
    answer = await client.post(path, content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 200, answer.text
    assert [item["verdict"] for item in answer.json()["items"]] == ["accepted", "rejected", "accepted"]
    assert answer.json()["items"][1]["reason"].startswith("vehicle: ")


async def test_a_survey_has_no_search(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    path = f"/missions/{mission['id']}"
    for answer in (
        await client.get(f"{path}/search"),
        await client.get(f"{path}/search/obstacles.geojson"),
        await client.post(f"{path}/scans", json={"items": [scan(1.0)]}),
    ):
        assert (answer.status_code, answer.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")
