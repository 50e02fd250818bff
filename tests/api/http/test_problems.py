"""Whatever is sent, the answer says what was wrong with which field and what would be right; the service goes on."""

import json
from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest

from app.api.http.problems import TITLES, URN
from app.main import Server
from tests.support.api.rest import make_client, mission_spec, soundings
from tests.support.missions.specs import AREA


@pytest.fixture
async def client(shared_server: Server) -> AsyncIterator[httpx.AsyncClient]:
    async with make_client(shared_server) as client:
        yield client


JSON = {"Content-Type": "application/json"}


def box(west: float, south: float, wide: float, high: float) -> dict[str, Any]:
    """A rectangle, degrees."""
    east, north = west + wide, south + high
    return {
        "type": "Polygon",
        "coordinates": [[[west, south], [east, south], [east, north], [west, north], [west, south]]],
    }


def assert_problem(answer: httpx.Response, status: int, kind: str) -> dict[str, Any]:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = answer.json()
    assert problem["type"] == URN + kind
    assert problem["title"] == TITLES[kind][1]
    assert problem["status"] == status
    assert problem["instance"] == f"{answer.request.url.path}#{answer.headers['x-request-id']}"
    assert problem["detail"]
    return problem


@pytest.mark.parametrize(
    ("changes", "field", "expected"),
    [
        ({"steps": 0}, "steps", "a number ≥ 1"),
        ({"steps": 2.5}, "steps", "a whole number"),
        ({"steps": 10**30}, "steps", "a number ≤ 100000"),
        ({"budget": {"steps": 4}}, "steps", "give one of them"),
        ({"budget": {}}, "budget", "give exactly one of minutes, km_per_vehicle, steps"),
        ({"budget": {"minutes": 0}}, "budget.minutes", "a number > 0"),
        ({"budget": {"minute": 5}}, "budget.minute", "did you mean minutes?"),
        ({"vehicles": [{"name": "a", "speed_mps": 6}]}, "vehicles.0.speed_mps", "a number ≤ 5"),
        ({"cell_m": "wide"}, "cell_m", "a number"),
        ({"limits": {"max_stp_m": 5}}, "limits.max_stp_m", "did you mean max_step_m?"),
        ({"limits": {"max_step_m": -1}}, "limits.max_step_m", "a number > 0"),
        ({"limits": {"min_depth_m": 9, "max_depth_m": 3}}, "limits", "max_depth_m must be at least min_depth_m"),
        ({"vehicles": [{"name": "a b"}]}, "vehicles.0.name", "text that matches ^[A-Za-z0-9][A-Za-z0-9._-]*$"),
        ({"vehicles": [{"nme": "a"}]}, "vehicles.0.nme", "did you mean name?"),
        ({"vehicles": [{"name": "a", "kind": "submarine"}]}, "vehicles.0.kind", "'imc', 'rest', 'sim' or 'neptus'"),
        ({"vehicles": [{"name": "a"}, {"name": "a"}]}, "vehicles", "every vehicle takes part once"),
        ({"area": {"type": "Point"}}, "area.type", "'Polygon'"),
        ({"area": AREA | {"coordinates": [AREA["coordinates"][0][:-1]]}}, "area.coordinates", "repeat the first"),
        ({"name": ""}, "name", "at least 1 character"),
        ({"name": "   "}, "name", "one line of text that is not blank"),
        ({"name": " \n "}, "name", "one line of text that is not blank"),
        ({"name": "Quay\nSubject: x"}, "name", "one line of text that is not blank"),
        ({"name": None}, "name", "text in quotes"),
        ({"seed": -1}, "seed", "a number ≥ 0"),
        ({"colour": "red"}, "colour", "one of accuracy_m, after, area"),
    ],
)
async def test_a_wrong_value_is_named_with_what_would_be_right(
    client: httpx.AsyncClient, changes: dict[str, Any], field: str, expected: str
) -> None:
    before = (await client.get("/missions")).json()
    problem = assert_problem(await client.post("/missions", json=mission_spec(**changes)), 422, "invalid-request")
    errors = {error["field"]: error for error in problem["errors"]}
    assert field in errors
    assert expected in errors[field]["expected"]
    assert errors[field]["location"] == "body"
    assert (await client.get("/missions")).json() == before


@pytest.mark.parametrize(
    ("changes", "field", "value", "expected"),
    [
        ({"cell_m": 100}, "cell_m", 100, "make cell_m at most 27"),
        ({"cell_m": 1, "area": box(-8.7, 41.0, 0.6, 0.45)}, "cell_m", 1, "make cell_m at least 26, or the area"),
        ({"area": box(-8.7, 41.0, 5.0, 0.01)}, "area", "{'type': 'Polygon'", "choose a smaller one"),
        ({"area": box(-100.0, 41.0, 190.0, 0.01)}, "area", "{'type': 'Polygon'", "a mission of its own"),
        ({"budget": {"steps": 4}}, "steps", 3, "give one of them"),
        ({"recovery": {"point": [-8.7046, 41.5]}}, "recovery.point", "[-8.7046, 41.5]", "10000 m"),
        ({"recovery": {"point": [41.1853, -8.7046]}}, "recovery.point", "[41.1853, -8.7046]", "[-8.7046, 41.1853]"),
        ({"recovery": {"point": [-1.0, 51.0]}}, "recovery.point", "[-1.0, 51.0]", "of a place near it"),
        (
            {"recovery": {"point": [-8.7044, 41.18545]}, "keep_out": [box(-8.7045, 41.1854, 0.0002, 0.0001)]},
            "recovery.point",
            "[-8.7044, 41.18545]",
            "vehicles may go to",
        ),
        ({"planner": {"name": "cao2"}}, "planner.name", "cao2", "use one of"),
        ({"after": "nope"}, "after", "nope", "leave it out"),
        ({"site": "nope"}, "site", "nope", "GET /api/v1/sites"),
        ({"planner": {"name": "swath"}}, "vehicles.0.sensor", None, "give it sensor multibeam"),
        ({"keep_out": [box(-8.706, 41.184, 0.01, 0.01)]}, "keep_out", "[{'type': 'Polygon'", "smaller"),
    ],
)
async def test_what_contradicts_the_rest_is_named_with_its_value(
    client: httpx.AsyncClient, changes: dict[str, Any], field: str, value: object, expected: str
) -> None:
    problem = assert_problem(await client.post("/missions", json=mission_spec(**changes)), 422, "invalid-request")
    [error] = problem["errors"]
    assert (error["location"], error["field"]) == ("body", field)
    assert str(error["value"]).startswith(str(value))
    assert expected in error["expected"], error


async def test_what_an_import_lacks_is_told_of_its_query(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    path = f"/missions/{mission['id']}/imports"
    for query, field in (({}, "crs"), ({"crs": "EPSG:4326"}, "sd_m")):
        answer = await client.post(path, params={"filename": "a.xyz"} | query, content=b"-8.7049 41.1851 5\n")
        assert [(e["location"], e["field"]) for e in answer.json()["errors"]] == [("query", field)], answer.text


async def test_exchanged_coordinates_are_told(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    item = soundings(1)[0]
    for lat, lon, words in (
        (item["lon_deg"], item["lat_deg"], "latitude and longitude look exchanged"),
        (51.0, -1.0, "give a position near the map"),
    ):
        sent = {"items": [item | {"lat_deg": lat, "lon_deg": lon}]}
        answer = await client.post(f"/missions/{mission['id']}/measurements", json=sent)
        assert words in answer.json()["items"][0]["reason"]
        assert "smaller area" not in answer.text


async def test_a_missing_field_is_named(client: httpx.AsyncClient) -> None:
    problem = assert_problem(await client.post("/missions", json={"name": "x"}), 422, "invalid-request")
    assert problem["errors"] == [
        {
            "location": "body",
            "field": "area",
            "value": None,
            "message": "Field required",
            "expected": "a value: the field is required",
        }
    ]


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
async def test_numbers_that_are_not_finite_are_refused(client: httpx.AsyncClient, number: str) -> None:
    body = json.dumps(mission_spec(cell_m=0)).replace('"cell_m": 0', f'"cell_m": {number}')
    problem = assert_problem(await client.post("/missions", content=body, headers=JSON), 422, "invalid-request")
    assert problem["errors"][0]["field"] == "cell_m"
    assert problem["errors"][0]["expected"] == "a finite number, not NaN or infinity"


@pytest.mark.parametrize(
    "body",
    [b'{"name": ', b"\xff\xfe", b'{"name": "\xff"}', b"[" * 100_000, b'{"a": ' + b"9" * 5000 + b"}", b"'x'"],
    ids=["cut off", "not UTF-8", "not UTF-8 inside", "nested too deep", "digits without end", "single quotes"],
)
async def test_a_body_that_is_not_json_is_refused(client: httpx.AsyncClient, body: bytes) -> None:
    assert_problem(await client.post("/missions", content=body, headers=JSON), 400, "malformed-body")


@pytest.mark.parametrize("body", [b"[]", b"3", b'"text"', b"null", b"{}"])
async def test_json_of_another_shape_is_refused(client: httpx.AsyncClient, body: bytes) -> None:
    assert_problem(await client.post("/missions", content=body, headers=JSON), 422, "invalid-request")


@pytest.mark.parametrize("text", ["\\u0000", "\\ud800"])
@pytest.mark.parametrize("place", ["name", "planner"])
async def test_text_that_no_database_can_store_is_refused(client: httpx.AsyncClient, text: str, place: str) -> None:
    spec = mission_spec(name="@") if place == "name" else mission_spec(planner={"name": "cao", "options": {"@": 1}})
    body = json.dumps(spec).replace("@", text)
    problem = assert_problem(await client.post("/missions", content=body, headers=JSON), 422, "invalid-request")
    assert problem["errors"][0]["expected"] == "valid Unicode text"


async def test_escaped_text_that_is_fine_is_taken(client: httpx.AsyncClient) -> None:
    body = json.dumps(mission_spec(name="Leixões \U0001f30a \\u0000 kept as letters"))
    answer = await client.post("/missions", content=body, headers=JSON)
    assert answer.status_code == 201
    assert answer.json()["name"] == "Leixões \U0001f30a \\u0000 kept as letters"


@pytest.mark.parametrize("content_type", ["text/plain", "application/x-www-form-urlencoded", None])
async def test_only_json_is_taken(client: httpx.AsyncClient, content_type: str | None) -> None:
    headers = {"Content-Type": content_type} if content_type else {}
    body = json.dumps(mission_spec()).encode()
    problem = assert_problem(
        await client.post("/missions", content=body, headers=headers), 415, "unsupported-media-type"
    )
    assert "application/json" in problem["remedy"]


@pytest.mark.parametrize("chunked", [False, True])
async def test_a_body_above_the_limit_is_refused(client: httpx.AsyncClient, chunked: bool) -> None:
    body = b" " * (8 * 2**20 + 1)

    async def parts() -> Any:
        for start in range(0, len(body), 2**16):
            yield body[start : start + 2**16]

    content = parts() if chunked else body
    answer = await client.post("/missions", content=content, headers=JSON)
    problem = assert_problem(answer, 413, "body-too-large")
    assert "8388608 bytes" in problem["detail"]


async def test_an_unknown_path_is_a_problem(client: httpx.AsyncClient) -> None:
    problem = assert_problem(await client.get("/mision"), 404, "not-found")
    assert "/api/v1/mision" in problem["detail"]


async def test_a_wrong_method_names_the_right_one(client: httpx.AsyncClient) -> None:
    answer = await client.put("/vehicles", json={})
    problem = assert_problem(answer, 405, "method-not-allowed")
    assert problem["remedy"] == "Use GET"
    assert answer.headers["allow"] == "GET"


async def test_an_unknown_mission_is_a_problem(client: httpx.AsyncClient) -> None:
    for path in ("", "/map", "/map.tif", "/map.overlay.png", "/events", "/vehicles/a/waypoint"):
        problem = assert_problem(await client.get(f"/missions/nowhere{path}"), 404, "mission-not-found")
        assert "'nowhere'" in problem["detail"]


@pytest.mark.parametrize(
    ("query", "location", "field"),
    [
        ("vehicles/rover/waypoint?timeout_s=1e9", "query", "timeout_s"),
        ("vehicles/rover/waypoint?timeout_s=nan", "query", "timeout_s"),
        ("vehicles/rover/waypoint?after_step=x", "query", "after_step"),
        ("vehicles/ro%00ver/waypoint", "path", "name"),
        ("events?limit=0", "query", "limit"),
        ("map.overlay.png?layer=colour", "query", "layer"),
    ],
)
async def test_wrong_parameters_are_named(
    client: httpx.AsyncClient, mission: dict[str, Any], query: str, location: str, field: str
) -> None:
    problem = assert_problem(await client.get(f"/missions/{mission['id']}/{query}"), 422, "invalid-request")
    assert [(e["location"], e["field"]) for e in problem["errors"]] == [(location, field)]


async def test_what_is_wrong_with_a_parameter_s_value_is_told_of_the_parameter(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    answer = await client.get(f"/missions/{mission['id']}/profile", params={"line": "8,91;8,92"})
    [error] = assert_problem(answer, 422, "invalid-request")["errors"]
    assert (error["location"], error["field"]) == ("query", "line")
    assert "longitude,latitude" in error["expected"]


async def test_an_unknown_planner_names_those_there_are(client: httpx.AsyncClient) -> None:
    answer = await client.post("/missions", json=mission_spec(planner={"name": "oracle-of-delphi"}))
    problem = assert_problem(answer, 422, "invalid-request")
    assert problem["errors"][0]["field"] == "planner.name"
    assert "cao" in problem["remedy"]


async def test_an_option_that_there_is_none_of_names_those_of_its_planner(client: httpx.AsyncClient) -> None:
    answer = await client.post("/missions", json=mission_spec(planner={"name": "lawnmower", "options": {"gap_m": 5}}))
    [error] = assert_problem(answer, 422, "invalid-request")["errors"]
    assert (error["field"], error["value"]) == ("planner.options.gap_m", 5)
    assert (
        error["expected"]
        == "its options are cruise_depth_m, keep_line_order, line_heading_deg, line_spacing_m, turn_radius_m"
    )


async def test_a_move_that_is_not_allowed_says_what_to_do(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    problem = assert_problem(await client.post(f"/missions/{mission['id']}/pause"), 409, "move-refused")
    assert problem["detail"] == "cannot pause a mission that is ready; allowed from: running"
    assert "start" in problem["remedy"]


async def test_many_faults_are_counted_and_the_first_listed(client: httpx.AsyncClient) -> None:
    vehicles = [{"name": f"v{i}", "depth_m": -1} for i in range(90)]
    answer = await client.post("/missions", json=mission_spec(vehicles=vehicles))
    problem = assert_problem(answer, 422, "invalid-request")
    assert problem["detail"].startswith("90 values cannot be taken")
    assert len(problem["errors"]) == 50
