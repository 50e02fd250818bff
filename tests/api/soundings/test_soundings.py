"""Soundings that are not in the map, the checklist, notes, steps and tiles over HTTP."""

import json
import struct
from typing import Any

import httpx
import pytest

from tests.support.api.rest import mission_spec, soundings


@pytest.fixture
async def path(client: httpx.AsyncClient, mission: dict[str, Any]) -> str:
    """Path of a mission with twelve soundings, and one that lies far outside."""
    path = f"/missions/{mission['id']}"
    away = soundings(1, start_s=1_795_300_000.0)[0] | {"lat_deg": 41.19}
    await client.post(f"{path}/measurements", json={"items": [*soundings(12), away]})
    return path


async def test_a_rejected_sounding_is_restored_and_rejected_again(client: httpx.AsyncClient, path: str) -> None:
    page = (await client.get(f"{path}/soundings")).json()
    assert (page["total"], page["next_after"]) == (1, None)
    (item,) = page["items"]
    assert item["state"] == "rejected"
    assert "outside the area" in item["reason"]
    restored = await client.post(f"{path}/soundings/{item['id']}/restore", json={"note": "navigation was right"})
    assert (restored.status_code, restored.json()["state"]) == (200, "restored")
    progress = (await client.get(path)).json()["progress"]
    assert (progress["soundings"], progress["rejected"]) == (13, 0)
    rejected = await client.post(f"{path}/soundings/{item['id']}/reject")
    assert rejected.json()["state"] == "withdrawn"
    events = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
    assert [e["data"]["ruling"] for e in events if e["kind"] == "sounding"] == ["restored", "rejected"]


async def test_pages_follow_each_other(client: httpx.AsyncClient, path: str) -> None:
    first = (await client.get(f"{path}/soundings", params={"state": "used", "limit": 10})).json()
    second = (
        await client.get(f"{path}/soundings", params={"state": "used", "limit": 10, "after": first["next_after"]})
    ).json()
    assert (len(first["items"]), len(second["items"]), second["next_after"]) == (10, 2, None)
    assert first["total"] == second["total"] == 12


async def test_a_sounding_that_is_not_there_is_not_found(client: httpx.AsyncClient, path: str) -> None:
    answer = await client.post(f"{path}/soundings/999999/restore")
    assert (answer.status_code, answer.json()["type"]) == (404, "urn:bathyfleet:problem:sounding-not-found")


async def test_the_map_comes_as_tiles_and_then_only_what_changed(client: httpx.AsyncClient, path: str) -> None:
    whole = await client.get(f"{path}/map/tiles")
    assert whole.headers["content-encoding"] == "deflate"
    header = header_of(whole.content)
    assert header["base"] is None
    again = header_of((await client.get(f"{path}/map/tiles", params={"since": header["tag"]})).content)
    assert (again["base"], again["tiles"]) == (header["tag"], [])
    past = header_of((await client.get(f"{path}/map/tiles", params={"step": 0, "layer": "slope"})).content)
    assert past["layers"][-1] == "slope"
    assert past["tag"].endswith("@0")


def header_of(content: bytes) -> dict[str, Any]:
    assert content[:4] == b"BFM1"
    (length,) = struct.unpack_from("<I", content, 4)
    found: dict[str, Any] = json.loads(content[8 : 8 + length])
    return found


async def test_the_checklist_tells_a_problem_from_a_note(client: httpx.AsyncClient, path: str) -> None:
    found = (await client.get(f"{path}/preflight")).json()
    status = {check["id"]: check["status"] for check in found["checks"]}
    assert found["ready"] is True
    assert status["tide"] == "note"
    assert status["area"] == "ok"
    empty = (await client.post("/missions", json=mission_spec(name="Empty", vehicles=[]))).json()
    found = (await client.get(f"/missions/{empty['id']}/preflight")).json()
    problems = {check["id"]: check for check in found["checks"] if check["status"] == "problem"}
    assert found["ready"] is False
    assert set(problems) == {"vehicles"}
    assert all(check["remedy"] for check in problems.values())
    table = "2020/01/01 00:00:00.000 1.0\n2020/01/01 06:00:00.000 3.0\n"
    await client.put(f"{path}/tide", json={"table": table, "table_name": "old"})
    found = (await client.get(f"{path}/preflight")).json()
    assert next(c for c in found["checks"] if c["id"] == "tide")["status"] == "problem"


@pytest.mark.parametrize(
    ("level", "battery", "status"),
    [(40, "ok", "ok"), (39, "low", "warning"), (15, "low", "warning"), (14, "critical", "problem")],
)
async def test_the_checklist_and_the_vehicles_view_judge_a_battery_alike(
    client: httpx.AsyncClient, path: str, level: float, battery: str, status: str
) -> None:
    name = (await client.get(path)).json()["vehicles"][0]["name"]
    place = {"vehicle": name, "time_s": 1.79e9, "lat_deg": 41.1852, "lon_deg": -8.7046, "depth_m": 1.5}
    await client.post(f"{path}/measurements", json={"items": [place | {"battery_pct": level}]})
    vehicle = next(v for v in (await client.get(path)).json()["vehicles"] if v["name"] == name)
    checks = (await client.get(f"{path}/preflight")).json()["checks"]
    assert vehicle["battery"] == battery
    assert [c["status"] for c in checks if c["id"] == f"battery.{name}"] == [status]


async def test_notes_are_kept_in_the_log_and_empty_ones_refused(client: httpx.AsyncClient, path: str) -> None:
    note = await client.post(f"{path}/notes", json={"text": " Ferry at 14:10 "})
    assert (note.status_code, note.json()["message"], note.json()["kind"]) == (201, "Ferry at 14:10", "note")
    assert (await client.post(f"{path}/notes", json={"text": "  "})).status_code == 422


async def test_one_vehicle_is_aborted_and_its_answer_told(client: httpx.AsyncClient) -> None:
    vehicles = [{"name": name, "kind": "sim", "sensor": "dvl"} for name in ("a", "b")]
    mission = (await client.post("/missions", json=mission_spec(vehicles=vehicles))).json()
    path = f"/missions/{mission['id']}"
    await client.post(f"{path}/start")
    answer = (await client.post(f"{path}/vehicles/a/abort")).json()
    assert [(stop["vehicle"], stop["acknowledged"]) for stop in answer["stops"]] == [("a", True)]
    assert answer["mission"]["state"] == "running"
    assert (await client.post(f"{path}/vehicles/a/abort")).status_code == 404
    assert (await client.get(f"{path}/steps")).status_code == 200
    await client.post(f"{path}/abort")
