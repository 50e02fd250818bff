"""What a route does not know is refused: parameters of the query, and an `Idempotency-Key` without effect."""

from typing import Any

import httpx
import pytest

from app.api.access.address_key import UNNAMED
from app.main import Server, create_app
from app.settings import Settings
from tests.support.api.rest import Guarded, mission_spec, soundings

INVALID = "urn:bathyfleet:problem:invalid-request"


async def test_a_start_that_was_to_be_tried_only_is_none(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    path = f"/missions/{mission['id']}"
    answer = await client.post(f"{path}/start", params={"dry_run": "true"})
    assert (answer.status_code, answer.json()["type"]) == (422, INVALID)
    [error] = answer.json()["errors"]
    assert (error["location"], error["field"], error["value"]) == ("query", "dry_run", "true")
    assert (await client.get(path)).json()["state"] == "ready"


@pytest.mark.parametrize(
    ("target", "field", "expected"),
    [
        ("/map.png?layer=slope", "layer", "one of crs, interval_m, max, min, order, vehicle"),
        ("/map.geojson?interval=2", "interval", "did you mean interval_m?"),
        ("/map/tiles?stp=1", "stp", "did you mean step?"),
        ("/tiles/depth/14/7799/6125.png?colours=3", "colours", "one of max, min"),
        ("/tiles/depth.json?rnage=3", "rnage", "one of max, min"),
        ("/preflight?verbose=1", "verbose", "no parameters in the query"),
        ("/report.pdf?language=pt", "language", "did you mean lang?"),
        ("/imports?file=a", "file", "no parameters in the query"),
    ],
)
async def test_unknown_parameters_are_named_with_what_was_meant(
    client: httpx.AsyncClient, mission: dict[str, Any], target: str, field: str, expected: str
) -> None:
    answer = await client.get(f"/missions/{mission['id']}{target}")
    assert (answer.status_code, answer.json()["type"]) == (422, INVALID)
    [error] = answer.json()["errors"]
    assert (error["location"], error["field"], error["expected"]) == ("query", field, expected)


async def test_imports_say_what_a_parameter_was_meant_for(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    sent = {"filename": "a.xyz", "crs": "EPSG:4326", "sdm": "0.3"}
    answer = await client.post(f"/missions/{mission['id']}/imports", params=sent, content=b"-8.7049 41.1851 5\n")
    assert [(e["field"], e["expected"]) for e in answer.json()["errors"]] == [("sdm", "did you mean sd_m?")]


async def test_whoever_may_not_ask_is_told_only_that(guarded: Guarded) -> None:
    answer = await guarded.client.get("/missions?all=1")
    assert (answer.status_code, answer.json()["type"]) == (401, "urn:bathyfleet:problem:unauthenticated")


async def test_interfaces_of_standards_keep_their_own_rules(server: Server, client: httpx.AsyncClient) -> None:
    capabilities = f"{server.url}/wms?SERVICE=WMS&REQUEST=GetCapabilities&MAP_RESOLUTION=96&DPI=96"
    assert (await client.get(capabilities)).status_code == 200
    refused = await client.get(f"{server.url}/ogc/collections?verbose=1")
    assert refused.json()["type"] == "urn:bathyfleet:problem:invalid-parameter"
    assert (await client.get(f"{server.url}/health/live?probe=1")).status_code == 200
    assert (await client.get(f"{server.url}{UNNAMED}?a=1")).status_code == 404


async def test_a_step_that_was_not_flown_and_a_stranger_s_soundings_are_none(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    path = f"/missions/{mission['id']}"
    await client.post(f"{path}/measurements", json={"items": soundings(12)})
    assert (await client.get(f"{path}/map/tiles?step=0")).status_code == 200
    beyond = await client.get(f"{path}/map/tiles?step=9999")
    assert beyond.status_code == 422
    assert [(e["location"], e["field"]) for e in beyond.json()["errors"]] == [("query", "step")]
    assert (await client.get(f"{path}/soundings?vehicle=rover&state=used")).json()["total"] == 12
    stranger = await client.get(f"{path}/soundings?vehicle=nobody")
    assert (stranger.status_code, stranger.json()["type"]) == (404, "urn:bathyfleet:problem:vehicle-not-found")
    assert "rover" in stranger.json()["remedy"]


async def test_an_idempotency_key_without_effect_is_refused(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    key = {"Idempotency-Key": "a-1"}
    path = f"/missions/{mission['id']}"
    before = len((await client.get("/missions")).json())
    for target, body in (
        ("/missions", mission_spec()),
        ("/sites", {"name": "Quay"}),
        (f"{path}/notes", {"text": "Ferry"}),
        (f"{path}/vehicles", {"name": "second"}),
        (f"{path}/vehicles/rover/go", {"position": [-8.7046, 41.1853]}),
        (f"{path}/start", None),
    ):
        answer = await client.post(target, json=body, headers=key)
        assert (answer.status_code, answer.json()["type"]) == (400, "urn:bathyfleet:problem:invalid-parameter"), target
        assert "Idempotency-Key" in answer.json()["detail"]
    assert len((await client.get("/missions", headers=key)).json()) == before
    for _ in range(2):
        answer = await client.post(f"{path}/measurements", json={"items": soundings(2)}, headers=key)
        assert answer.status_code == 200
    assert answer.json()["replayed"]


@pytest.mark.slow
def test_the_document_tells_that_every_operation_may_refuse_parameters() -> None:
    paths = create_app(Settings(database_url="sqlite+aiosqlite:///:memory:")).openapi()["paths"]
    assert all("422" in operation["responses"] for methods in paths.values() for operation in methods.values())
