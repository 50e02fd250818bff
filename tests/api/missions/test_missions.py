"""The life of a mission over REST."""

import asyncio
from typing import Any

import httpx
import pytest

from app.exploration.pcao.model import default_model
from tests.support.api.rest import mission_spec, soundings
from tests.support.missions.searches import search_json
from tests.support.missions.specs import AREA


async def test_a_new_mission_is_found_where_the_answer_says(client: httpx.AsyncClient) -> None:
    answer = await client.post("/missions", json=mission_spec())
    assert answer.status_code == 201
    created = answer.json()
    assert answer.headers["location"] == f"/api/v1/missions/{created['id']}"
    assert created["state"] == "ready"
    assert created["spec"]["limits"]["max_step_m"] == 10.0
    seen = (await client.get(f"/missions/{created['id']}")).json()
    assert seen["spec"] == created["spec"]
    assert seen["vehicles"][0]["name"] == "rover"
    assert [m["id"] for m in (await client.get("/missions")).json()] == [created["id"]]


async def test_a_mission_names_the_one_that_it_follows(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    following = (await client.post("/missions", json=mission_spec(after=mission["id"]))).json()
    assert following["after"] == following["spec"]["after"] == mission["id"]
    listed = {one["id"]: one["after"] for one in (await client.get("/missions")).json()}
    assert listed == {mission["id"]: None, following["id"]: mission["id"]}
    refused = await client.post("/missions", json=mission_spec(after="nobody"))
    assert refused.status_code == 422
    assert [fault["field"] for fault in refused.json()["errors"]] == ["after"]


async def test_a_mission_without_a_vehicle_is_a_draft_until_it_gets_one(client: httpx.AsyncClient) -> None:
    draft = (await client.post("/missions", json=mission_spec(vehicles=[]))).json()
    assert draft["state"] == "draft"
    path = f"/missions/{draft['id']}"
    refused = await client.post(f"{path}/start")
    assert refused.status_code == 409
    assert "vehicles" in refused.json()["remedy"]

    joined = await client.post(f"{path}/vehicles", json={"name": "rover", "kind": "rest"})
    assert joined.status_code == 200, joined.text
    assert joined.json()["state"] == "ready"
    again = await client.post(f"{path}/vehicles", json={"name": "rover", "kind": "rest"})
    assert (again.status_code, again.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")

    left = await client.delete(f"{path}/vehicles/rover")
    assert left.status_code == 200, left.text
    assert left.json()["state"] == "draft"
    assert (await client.delete(f"{path}/vehicles/rover")).status_code == 404


@pytest.mark.parametrize("body", [None, {}, {"note": "tide turns"}])
async def test_actions_move_the_mission_and_keep_the_note(
    client: httpx.AsyncClient, mission: dict[str, Any], body: dict[str, str] | None
) -> None:
    path = f"/missions/{mission['id']}"
    for action, state in [("start", "running"), ("pause", "paused"), ("resume", "running"), ("abort", "aborted")]:
        answer = (
            await client.post(f"{path}/{action}", json=body)
            if body is not None
            else await client.post(f"{path}/{action}")
        )
        assert answer.status_code == 200, answer.text
        assert answer.json()["mission"]["state"] == state
    entries = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
    assert "aborted" in " ".join(entry["message"] for entry in entries)
    if body:
        assert any(body["note"] in entry["message"] for entry in entries)
    assert all("local operator" in e["message"] for e in entries if e["kind"] == "state")


async def test_an_action_takes_no_unknown_fields(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    answer = await client.post(f"/missions/{mission['id']}/start", json={"nota": "x"})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["expected"] == "did you mean note?"
    answer = await client.post(f"/missions/{mission['id']}/finish", json={"return_home": True})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["expected"] == "did you mean return?"
    assert (await client.get(f"/missions/{mission['id']}")).json()["state"] == "ready"


async def test_a_mission_flies_with_the_trained_controller_that_it_holds(client: httpx.AsyncClient) -> None:
    model = default_model().model_dump(mode="json")
    spec = mission_spec(planner={"name": "pcao", "options": {"model": model}})
    created = (await client.post("/missions", json=spec)).json()
    assert created["spec"]["planner"]["options"]["model"]["P"] == model["P"]
    model["P"][1]["vertical"][0][0] = 99.0
    refused = await client.post("/missions", json=spec)
    assert refused.status_code == 422
    error = refused.json()["errors"][0]
    assert error["field"] == "planner.options.model"
    assert "P[1].vertical has eigenvalues" in error["message"]


async def test_two_starts_at_the_same_time_start_once(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    answers = await asyncio.gather(*(client.post(f"/missions/{mission['id']}/start") for _ in range(2)))
    assert sorted(answer.status_code for answer in answers) == [200, 409]


async def test_vehicles_and_planners_are_listed(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    await client.post(f"/missions/{mission['id']}/measurements", json={"items": soundings(1)})
    assert [v["name"] for v in (await client.get("/vehicles")).json()] == ["rover"]
    planners = {p["name"]: p for p in (await client.get("/planners")).json()}
    assert {"cao", "random", "lawnmower"} <= set(planners)
    assert planners["cao"]["options"]["type"] == "object"
    of_lines = {"cruise_depth_m", "turn_radius_m", "line_spacing_m", "line_heading_deg", "keep_line_order"}
    assert set(planners["lawnmower"]["options"]["properties"]) == of_lines
    assert "rollouts" in planners["rollout"]["options"]["properties"]
    assert "rollouts" not in planners["cao"]["options"]["properties"]


async def test_outlines_are_taken_as_programs_for_maps_write_them(client: httpx.AsyncClient) -> None:
    [ring] = AREA["coordinates"]
    high = {"type": "Polygon", "coordinates": [[[*place, 12.5] for place in ring]]}
    parts = {"type": "MultiPolygon", "coordinates": [[ring]]}
    feature = {"type": "Feature", "id": 1, "properties": {"name": "quay"}, "geometry": parts}
    for area in (high, parts, feature):
        answer = await client.post("/missions", json=mission_spec(area=area))
        assert answer.status_code == 201, answer.text
        assert answer.json()["spec"]["area"] == AREA
    several = {"type": "MultiPolygon", "coordinates": [[ring], [ring]]}
    answer = await client.post("/missions", json=mission_spec(area=several))
    [error] = answer.json()["errors"]
    assert (error["field"], error["expected"]) == ("area.coordinates", "give one polygon")


async def test_a_mission_is_as_long_as_its_minutes_and_keeps_both_figures(client: httpx.AsyncClient) -> None:
    vehicles = [
        {"name": "rover", "kind": "rest", "speed_mps": 2.0, "turn_radius_m": 8},
        {"name": "slow", "kind": "rest"},
    ]
    spec = mission_spec(vehicles=vehicles, budget={"minutes": 10})
    del spec["steps"]
    created = (await client.post("/missions", json=spec)).json()
    assert created["spec"]["budget"] == {"minutes": 10}
    assert created["spec"]["steps"] == created["progress"]["steps"] == 120
    shown = {name: created["progress"][name] for name in ("budget", "minutes_left", "km_left_per_vehicle")}
    assert shown == {"budget": {"minutes": 10}, "minutes_left": 10, "km_left_per_vehicle": 1.2}
    assert [(v["speed_mps"], v["turn_radius_m"]) for v in created["spec"]["vehicles"]] == [(2.0, 8.0), (None, None)]
    again = await client.post("/missions", json=created["spec"])
    assert (again.status_code, again.json()["spec"]) == (201, created["spec"])
    checks = (await client.get(f"/missions/{created['id']}/preflight")).json()["checks"]
    (duration,) = [check["message"] for check in checks if check["id"] == "duration"]
    assert duration.startswith("at most 10 min at 1.3 to 2 m/s; 2.0 km of tracks by 2 vehicles")


async def test_vehicles_tell_what_they_have_flown_in_their_mission(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    await client.post(f"/missions/{mission['id']}/measurements", json={"items": soundings(1)})
    seen = (await client.get(f"/missions/{mission['id']}")).json()
    assert seen["efficiency_pct"] is None
    flown = {name: seen["vehicles"][0][name] for name in ("phase", "flown_m", "on_plan_m", "idle_s")}
    assert flown == {"phase": "stopped", "flown_m": 0.0, "on_plan_m": 0.0, "idle_s": 0.0}


async def test_in_a_search_all_fly_at_the_missions_speed(client: httpx.AsyncClient) -> None:
    search = search_json(vehicles=[{"name": "boat", "kind": "rest", "speed_mps": 0.5}])
    refused = await client.post("/missions", json=search)
    assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, "vehicles.0.speed_mps")


async def test_a_mission_that_has_not_started_is_described_anew_and_keeps_its_id(client: httpx.AsyncClient) -> None:
    created = (await client.post("/missions", json=mission_spec())).json()
    path = f"/missions/{created['id']}"
    changed = mission_spec(name="Quay, north side", vehicles=[], steps=7)
    answer = await client.put(path, json=changed)
    assert answer.status_code == 200, answer.text
    seen = answer.json()
    assert (seen["id"], seen["name"], seen["state"]) == (created["id"], "Quay, north side", "draft")
    assert (seen["spec"]["steps"], seen["vehicles"]) == (7, [])
    assert (await client.get(path)).json()["spec"] == seen["spec"]
    assert [one["name"] for one in (await client.get("/missions")).json()] == ["Quay, north side"]
    lines = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
    assert [line["message"].split(" by ")[0] for line in lines] == ["created", "described anew"]
    back = await client.put(path, json=mission_spec())
    assert (back.status_code, back.json()["state"]) == (200, "ready")
    assert back.json()["created_at"] == created["created_at"]

    wrong = await client.put(path, json=mission_spec(limits={"max_step_m": -1}))
    assert (wrong.status_code, wrong.json()["errors"][0]["field"]) == (422, "limits.max_step_m")
    assert (await client.get(path)).json()["spec"] == back.json()["spec"]
    assert (await client.put("/missions/none", json=mission_spec())).status_code == 404

    await client.post(f"{path}/start")
    late = await client.put(path, json=mission_spec())
    assert late.status_code == 409
    assert "copy it" in late.json()["remedy"]
    await client.post(f"{path}/abort")


async def test_the_length_of_a_mission_changes_while_it_runs_and_is_paused(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    path = f"/missions/{mission['id']}"
    await client.post(f"{path}/start")
    answer = await client.put(f"{path}/budget", json={"minutes": 80})
    assert answer.status_code == 200, answer.text
    assert answer.json()["progress"]["budget"] == answer.json()["spec"]["budget"] == {"minutes": 80}
    assert answer.json()["progress"]["steps"] == answer.json()["spec"]["steps"] > 100
    await client.post(f"{path}/pause")
    assert (await client.put(f"{path}/budget", json={"km_per_vehicle": 1.5})).status_code == 200
    seen = (await client.get(path)).json()
    assert (seen["state"], seen["progress"]["budget"]) == ("paused", {"km_per_vehicle": 1.5})
    entries = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
    [_, line] = [entry for entry in entries if entry["kind"] == "budget"]
    assert line["message"] == "the length is 1.5 km per vehicle now, it was 80 min: changed by local operator"
    assert line["data"] == {"actor": "local operator", "before": {"minutes": 80}, "budget": {"km_per_vehicle": 1.5}}


@pytest.mark.parametrize(
    ("body", "field", "words"),
    [
        ({"minutes": -3}, "minutes", "greater than 0"),
        ({"minutes": 20_000}, "minutes", "10080"),
        ({"steps": 0}, "steps", "1"),
        ({"minuets": 20}, "minuets", "did you mean minutes?"),
        ({"minutes": 20, "steps": 3}, "body", "exactly one of minutes, km_per_vehicle, steps"),
        ({}, "body", "exactly one of minutes, km_per_vehicle, steps"),
        ({"km_per_vehicle": 0.0005}, "km_per_vehicle", "none would begin"),
    ],
)
async def test_a_length_that_cannot_be_is_refused_with_its_field(
    client: httpx.AsyncClient, mission: dict[str, Any], body: dict[str, Any], field: str, words: str
) -> None:
    path = f"/missions/{mission['id']}"
    await client.post(f"{path}/start")
    answer = await client.put(f"{path}/budget", json=body)
    assert answer.status_code == 422, answer.text
    [fault] = answer.json()["errors"]
    assert (fault["location"], fault["field"]) == ("body", field)
    assert fault["value"] == body.get(field, str(body)), "what is no single value is shown as text"
    assert words in fault["message"] + fault["expected"]
    assert (await client.get(path)).json()["progress"]["budget"] == mission["progress"]["budget"]


async def test_missions_that_ended_and_searches_keep_their_length(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    path = f"/missions/{mission['id']}"
    ready = await client.put(f"{path}/budget", json={"steps": 7})
    assert (ready.status_code, ready.json()["state"], ready.json()["progress"]["steps"]) == (200, "ready", 7)
    await client.post(f"{path}/abort")
    ended = await client.put(f"{path}/budget", json={"minutes": 80})
    assert (ended.status_code, ended.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")
    assert "its length stays as it is" in ended.json()["detail"]
    search = (await client.post("/missions", json=search_json())).json()
    refused = await client.put(f"/missions/{search['id']}/budget", json={"steps": 7})
    assert refused.status_code == 409
    assert "search.window_s" in refused.json()["detail"]
    assert "PUT /api/v1/missions/{id}" in refused.json()["remedy"]
    assert (await client.put("/missions/nobody/budget", json={"steps": 7})).status_code == 404


async def test_missions_are_listed_in_pages_where_these_are_asked_for(client: httpx.AsyncClient) -> None:
    made = [(await client.post("/missions", json=mission_spec())).json()["id"] for _ in range(3)]

    async def listed(**query: str | int) -> list[str]:
        return [one["id"] for one in (await client.get("/missions", params=query)).json()]

    newest = await listed()
    assert newest[:3] == made[::-1]
    assert await listed(limit=2) == newest[:2]
    assert await listed(before=made[1]) == newest[2:]
    assert await listed(before=made[2], limit=1) == newest[1:2]
    gone = await client.get("/missions", params={"before": "nowhere"})
    assert gone.status_code == httpx.codes.NOT_FOUND
    assert gone.json()["remedy"] == "begin again without `before`"
    assert (await client.get("/missions", params={"limit": 0})).status_code == httpx.codes.UNPROCESSABLE_ENTITY
