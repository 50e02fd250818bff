"""The OpenAPI document and the page that shows it."""

import re
import threading
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from app.api.http import openapi
from app.main import Server
from tests.support.api.contract import CONTRACT


@pytest.fixture
async def document(shared_server: Server) -> dict[str, Any]:
    async with httpx.AsyncClient(base_url=shared_server.url, timeout=60) as client:
        answer: dict[str, Any] = (await client.get("/api/openapi.json")).json()
    return answer


def operations(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {
        f"{method.upper()} {path.removeprefix('/api/v1')}": operation
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    }


async def test_every_operation_of_the_contract_has_its_stable_name(document: dict[str, Any]) -> None:
    assert {key: operation["operationId"] for key, operation in operations(document).items()} == CONTRACT


async def test_every_operation_is_described(document: dict[str, Any]) -> None:
    for key, operation in operations(document).items():
        assert operation["summary"], key
        assert operation["description"], key
        assert set(operation["tags"]) <= {tag["name"] for tag in document["tags"]}, key
        for parameter in operation.get("parameters", []):
            assert parameter.get("description") or parameter["schema"].get("description"), (key, parameter["name"])


async def test_every_error_is_a_problem_document(document: dict[str, Any]) -> None:
    for key, operation in operations(document).items():
        for status, response in operation["responses"].items():
            if int(status) < 400 or (key, status) == ("GET /health/ready", "503"):
                continue
            content = response["content"]
            assert list(content) == ["application/problem+json"], (key, status)
            assert content["application/problem+json"]["schema"] == {"$ref": "#/components/schemas/Problem"}
            for example in content["application/problem+json"]["examples"].values():
                assert example["value"]["status"] == int(status)
    assert "HTTPValidationError" not in document["components"]["schemas"]


async def test_every_reference_leads_somewhere(document: dict[str, Any]) -> None:
    for name in re.findall(r"'#/components/schemas/([^']+)'", str(document)):
        assert name in document["components"]["schemas"]


async def test_live_messages_are_in_the_document_for_generated_clients(document: dict[str, Any]) -> None:
    branches = document["components"]["schemas"]["LiveMessage"]["anyOf"]
    assert {"$ref": "#/components/schemas/SnapshotMessage"} in branches
    assert {"$ref": "#/components/schemas/TargetsMessage"} in branches
    assert {"$ref": "#/components/schemas/SearchMessage"} in branches
    assert {"$ref": "#/components/schemas/AlarmMessage"} in branches
    assert {"$ref": "#/components/schemas/TrafficMessage"} in branches
    assert len(branches) == 10


async def test_what_is_always_sent_is_required_in_the_document(document: dict[str, Any]) -> None:
    schema = document["components"]["schemas"]["VehicleView"]
    assert set(schema["required"]) == set(schema["properties"])
    assert document["components"]["schemas"]["MissionSpec"]["required"] == ["name", "area"]


async def test_vehicles_are_heard_while_the_document_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    app = FastAPI(title="bathyfleet")
    openapi.install(app)
    made_in = []

    def noted(**told: Any) -> dict[str, Any]:
        made_in.append(threading.current_thread())
        return get_openapi(**told)

    monkeypatch.setattr("app.api.http.openapi.get_openapi", noted)
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://localhost") as client:
        answers = [(await client.get("/openapi.json")).json() for _ in range(2)]
    assert answers[0]["info"]["title"] == "bathyfleet"
    assert answers[1] == answers[0]
    assert len(made_in) == 1
    assert made_in[0] is not threading.current_thread()


async def test_the_page_needs_no_internet(shared_server: Server) -> None:
    async with httpx.AsyncClient(base_url=shared_server.url, timeout=60) as client:
        page = await client.get("/api/docs")
        assert page.status_code == 200
        addresses = re.findall(r'(?:src|href)="([^"]+)"', page.text)
        assert addresses
        for address in addresses:
            assert address.startswith("/")
            assert (await client.get(address)).status_code == 200
