"""Who asks is settled before a body is read; nobody's bodies take all the room."""

import asyncio
import difflib
import json
import threading
from collections.abc import AsyncIterator, Callable
from typing import Any

import httpx
import pytest
from fastapi.routing import APIRoute

from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.api.bodies import admission as bodies
from app.api.bodies import json_route, unread
from app.api.bodies.intake import BodyKind, Intakes
from app.api.bodies.json_route import JsonRoute
from app.api.http import field_problems, json_text
from app.api.schemas import ScanBatch
from app.main import Server, create_app
from app.settings import Settings
from app.storage.database import Database
from tests.support.api.rest import make_client, mission_spec, running, soundings

NOWHERE = "0197a3c8-6f2e-7c41-9d0f-5b2f6f0c1a2b"
SIZE = 60_000_000
ANSWER_S = 30


class Tokens:
    """A service that asks for tokens."""

    def __init__(self, server: Server, tokens: dict[Role, str]) -> None:
        self.server = server
        self.port = int(server.url.rpartition(":")[2])
        self._tokens = tokens

    def header(self, role: Role | None) -> dict[str, str]:
        return {} if role is None else {"Authorization": f"Bearer {self._tokens[role]}"}


@pytest.fixture
async def service(make_settings: Callable[..., Settings]) -> AsyncIterator[Tokens]:
    settings = make_settings(max_import_bytes=2**26)
    async with running(settings) as server:
        database = Database(settings.database_url)
        store = TokenStore(database)
        tokens = {role: (await store.create(role, role))[1] for role in Role}
        await database.close()
        yield Tokens(server, tokens)


@pytest.fixture
def hung_up_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """For clients that do not send on what is not wanted: the service need not wait for it."""
    monkeypatch.setattr(unread, "DRAIN_S", 0.1)


@pytest.fixture
async def mission_id(service: Tokens) -> str:
    async with make_client(service.server) as client:
        answer = await client.post("/missions", json=mission_spec(), headers=service.header(Role.OPERATOR))
        return str(answer.json()["id"])


async def ask(port: int, method: str, path: str, headers: dict[str, str], body: bytes = b"") -> tuple[int, bytes]:
    """Send a head and the beginning of a body; return the status and all that is said until the connection ends."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        lines = [f"{method} /api/v1{path} HTTP/1.1", "Host: localhost", *(f"{k}: {v}" for k, v in headers.items())]
        writer.write("\r\n".join([*lines, "", ""]).encode() + body)
        async with asyncio.timeout(ANSWER_S):
            said = await reader.read()
        return int(said.split(b" ", 2)[1]), said
    finally:
        writer.close()


LONG = [
    {"Content-Length": str(SIZE)},
    {"Transfer-Encoding": "chunked"},
    {"Content-Length": "60000", "Expect": "100-continue"},
]
JSON = {"Content-Type": "application/json"}


@pytest.mark.usefixtures("hung_up_on")
@pytest.mark.parametrize("length", LONG, ids=["declared", "chunked", "asks first"])
@pytest.mark.parametrize(
    ("role", "method", "path", "status"),
    [
        (None, "POST", "/missions", 401),
        (None, "POST", f"/missions/{NOWHERE}/measurements", 401),
        (None, "POST", f"/missions/{NOWHERE}/imports", 401),
        (None, "PUT", "/nothing/here", 404),
        (Role.VIEWER, "POST", f"/missions/{NOWHERE}/scans", 403),
        (Role.VEHICLE, "PUT", f"/missions/{NOWHERE}/reference", 403),
        (Role.VEHICLE, "POST", f"/missions/{NOWHERE}/measurements", 404),
        (Role.OPERATOR, "POST", f"/missions/{NOWHERE}/imports", 404),
        (Role.OPERATOR, "POST", f"/missions/{NOWHERE}/start", 404),
    ],
)
async def test_who_may_not_ask_is_told_so_before_a_body_is_sent(
    service: Tokens, length: dict[str, str], role: Role | None, method: str, path: str, status: int
) -> None:
    answered, said = await ask(service.port, method, path, JSON | length | service.header(role))
    assert answered == status
    assert b"100 Continue" not in said
    assert b"connection: close" in said.lower()


async def test_a_body_that_was_asked_for_is_read(service: Tokens) -> None:
    body = json.dumps(mission_spec()).encode()
    headers = JSON | {"Content-Length": str(len(body)), "Expect": "100-continue", "Connection": "close"}
    answered, said = await ask(service.port, "POST", "/missions", headers | service.header(Role.OPERATOR), body)
    assert answered == 100
    assert b"HTTP/1.1 201" in said


async def test_an_answer_arrives_at_whoever_sends_on_regardless(service: Tokens) -> None:
    async with make_client(service.server) as client:
        for _ in range(2):
            answer = await client.post(f"/missions/{NOWHERE}/imports", content=bytes(20_000_000))
            assert answer.status_code == 401


async def test_a_connection_is_kept_where_the_body_was_read(service: Tokens, mission_id: str) -> None:
    async with make_client(service.server) as client:
        for status, items in ((200, soundings(2)), (422, [])):
            answer = await client.post(
                f"/missions/{mission_id}/measurements", json={"items": items}, headers=service.header(Role.VEHICLE)
            )
            assert answer.status_code == status
            assert "connection" not in answer.headers


def test_every_route_that_may_change_something_says_who_may_and_what_it_takes() -> None:
    app = create_app(Settings(database_url="sqlite+aiosqlite:///:memory:"))
    middleware = next(m for m in app.user_middleware if m.cls is bodies.BodyMiddleware)
    intakes = middleware.kwargs["intakes"]
    assert isinstance(intakes, Intakes)
    found = [one for method in ("POST", "PUT", "PATCH", "DELETE") for one in intakes.of(method)]
    assert len(found) >= 20
    for one in found:
        assert one.role is not None, one.route.path
        assert (one.kind is BodyKind.JSON) <= isinstance(one.route, JsonRoute), one.route.path
        assert isinstance(one.route, APIRoute)
        assert not one.route._embed_body_fields
    files = {one.route.operation_id for one in found if one.kind is BodyKind.FILE}
    assert files == {"importLog", "importSoundings", "proposeZones", "readDrawing", "setReference"}


@pytest.mark.usefixtures("hung_up_on")
async def test_packed_json_is_not_unpacked(service: Tokens) -> None:
    headers = JSON | {"Content-Encoding": "gzip", "Content-Length": "100"} | service.header(Role.OPERATOR)
    assert (await ask(service.port, "POST", "/missions", headers))[0] == 415


@pytest.mark.usefixtures("hung_up_on")
async def test_a_route_that_takes_no_body_reads_little(service: Tokens, mission_id: str) -> None:
    headers = service.header(Role.OPERATOR)
    path = f"/missions/{mission_id}/forecast"
    assert (await ask(service.port, "POST", path, headers | {"Content-Length": "70000"}))[0] == 413
    async with make_client(service.server) as client:
        assert (await client.delete(f"/missions/{mission_id}/sound-speed", headers=headers)).status_code == 200
        answer = await client.request("DELETE", f"/missions/{mission_id}/sound-speed", headers=headers, content=b"{}")
        assert answer.status_code == 200


async def test_nobody_takes_all_the_room_there_is_for_bodies(make_settings: Callable[..., Settings]) -> None:
    settings = make_settings(max_body_bytes=10**6, max_import_bytes=10**6, max_bytes_in_flight=2 * 10**6)
    async with running(settings) as server:
        database = Database(settings.database_url)
        store = TokenStore(database)
        ana, ben = [(await store.create(name, Role.OPERATOR))[1] for name in ("ana", "ben")]
        await database.close()
        port = int(server.url.rpartition(":")[2])
        head = "POST /api/v1/missions HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(
            f"{head}Authorization: Bearer {ana}\r\nExpect: 100-continue\r\nContent-Length: 900000\r\n\r\n".encode()
        )
        assert b"100" in await reader.readline()  # it is being read, and its room is taken
        length = JSON | {"Content-Length": "900000", "Expect": "100-continue"}
        status, said = await ask(port, "POST", "/missions", length | {"Authorization": f"Bearer {ana}"})
        assert (status, b"too-many-bytes" in said, b"retry-after" in said.lower()) == (429, True, True)
        other, ours = await asyncio.open_connection("127.0.0.1", port)
        ours.write(
            f"{head}Authorization: Bearer {ben}\r\nExpect: 100-continue\r\nContent-Length: 900000\r\n\r\n".encode()
        )
        assert b"100" in await other.readline()
        async with make_client(server) as client:
            small = await client.post("/missions", json=mission_spec(), headers={"Authorization": f"Bearer {ana}"})
            assert small.status_code == 201  # what vehicles send is never kept out by large bodies
        writer.close()
        ours.close()


@pytest.fixture
def explained(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The threads in which suggestions were looked for, one for each name that they were looked for."""
    found: list[str] = []
    look = difflib.get_close_matches

    def counted(*arguments: Any, **options: Any) -> Any:
        found.append(threading.current_thread().name)
        return look(*arguments, **options)

    monkeypatch.setattr(difflib, "get_close_matches", counted)
    return found


def unknown(count: int, first: int = 0) -> dict[str, int]:
    return {f"unknown_{first + i}": 0 for i in range(count)}


async def test_of_an_item_with_very_many_wrong_fields_nothing_is_made(
    service: Tokens, mission_id: str, explained: list[str]
) -> None:
    batch = {"items": [soundings(1)[0] | unknown(10_000), soundings(1)[0]]}
    async with make_client(service.server) as client:
        answer = await client.post(
            f"/missions/{mission_id}/measurements", json=batch, headers=service.header(Role.VEHICLE)
        )
    verdicts = answer.json()["items"]
    assert [verdict["verdict"] for verdict in verdicts] == ["rejected", "accepted"]
    assert verdicts[0]["reason"].startswith("10006 fields: there are no more than ")
    assert not explained


async def test_a_batch_of_nothing_but_wrong_fields_is_not_even_read(
    service: Tokens, mission_id: str, explained: list[str]
) -> None:
    one, many = [soundings(1)[0] | unknown(200_000)], [soundings(1)[0] | unknown(20, 20 * i) for i in range(10_000)]
    async with make_client(service.server) as client:
        for items in (one, many):
            answer = await client.post(
                f"/missions/{mission_id}/measurements", json={"items": items}, headers=service.header(Role.VEHICLE)
            )
            assert answer.status_code == httpx.codes.REQUEST_ENTITY_TOO_LARGE
            assert answer.json()["type"] == "urn:bathyfleet:problem:body-too-large"
    assert not explained


async def test_wrong_fields_of_very_many_items_are_explained_beside_the_loop(
    service: Tokens, mission_id: str, explained: list[str]
) -> None:
    batch = {"items": [soundings(1)[0] | unknown(10, 10 * i) for i in range(1000)]}
    async with make_client(service.server) as client:
        answer = await client.post(
            f"/missions/{mission_id}/measurements", json=batch, headers=service.header(Role.VEHICLE)
        )
    assert answer.json()["rejected"] == 1000
    assert "unknown_0: There is no such field" in answer.json()["items"][0]["reason"]
    assert len(explained) <= field_problems.MAX_ERRORS
    assert all(name.startswith("bodies") for name in explained)


@pytest.mark.parametrize(
    ("spec", "status", "said"),
    [
        (mission_spec() | unknown(200_000), 413, "more than 20000 names and texts"),
        (mission_spec() | unknown(5000), 422, "5000 values cannot be taken"),
        (mission_spec(area={"type": "Polygon", "coordinates": [[[0.1, 0.1]] * 5000]}), 422, "at most 1000 are taken"),
        (mission_spec(area={"type": "Polygon", "coordinates": [[[0.1, 0.1]] * 100_000]}), 413, "one entry of a list"),
        (mission_spec(keep_out=[[0] * 1000] * 500), 413, "more than 400000 values"),
        (mission_spec(vehicles=[{}] * 5000), 422, "vehicles"),
        (mission_spec(name="x" * 4_000_000), 422, "name"),
        (mission_spec(name=[["y"] * 2000] * 9), 422, "name"),
    ],
    ids=["keys", "fewer keys", "ring", "long ring", "values", "vehicles", "text", "list for a text"],
)
async def test_a_description_far_too_large_costs_little(
    service: Tokens, explained: list[str], spec: dict[str, Any], status: int, said: str
) -> None:
    async with make_client(service.server) as client:
        answer = await client.post("/missions", json=spec, headers=service.header(Role.OPERATOR))
    assert answer.status_code == status
    assert said in answer.text
    assert len(answer.content) < 100_000
    assert len(explained) <= field_problems.MAX_ERRORS
    assert all(name.startswith("bodies") for name in explained)


def test_ranges_of_a_scan_are_looked_at_until_the_first_that_is_wrong() -> None:
    scan = {"vehicle": "rover", "time_s": 1, "lat_deg": 41, "lon_deg": -8, "bearing_step_deg": 1, "reach_m": 9}
    batch = {"items": [scan | {"ranges_m": [[]] * 3000}] * 100}
    for item in ScanBatch.model_validate(batch).items:
        assert isinstance(item, str)
        assert item.startswith("ranges_m.0: ")
        assert "ranges_m.1" not in item


async def test_large_bodies_are_read_beside_the_loop(service: Tokens, monkeypatch: pytest.MonkeyPatch) -> None:
    threads: dict[bool, str] = {}
    parse = json_text.parse

    def noted(body: bytes) -> Any:
        threads[len(body) > json_route.IN_THREAD_BYTES] = threading.current_thread().name
        return parse(body)

    monkeypatch.setattr(json_route, "parse", noted)
    async with make_client(service.server) as client:
        for spec in (mission_spec(), mission_spec() | {"name": "\\u0041" * 100_000}):
            body = json.dumps(spec).replace("\\\\", "\\")
            await client.post("/missions", content=body, headers=JSON | service.header(Role.OPERATOR))
    assert threads[True].startswith("bodies")
    assert threads[False] == threading.current_thread().name


async def test_a_large_batch_of_good_measurements_is_taken_as_a_small_one(service: Tokens, mission_id: str) -> None:
    items = [soundings(1, start_s=1_795_225_140.0 + 0.1 * i)[0] for i in range(1500)]
    items[700] = items[700] | {"lat_deg": 91.0}
    items[900] = items[900] | {"vehicle": "nobody"}
    headers = service.header(Role.VEHICLE) | {"Idempotency-Key": "backlog"}
    async with make_client(service.server) as client:
        path = f"/missions/{mission_id}/measurements"
        answer = (await client.post(path, json={"items": items}, headers=headers)).json()
        again = (await client.post(path, json={"items": items}, headers=headers)).json()
    assert (answer["accepted"], answer["rejected"], answer["duplicate"]) == (1498, 2, 0)
    assert [item["index"] for item in answer["items"]] == list(range(1500))
    assert "lat_deg" in answer["items"][700]["reason"]
    assert "nobody" in answer["items"][900]["reason"]
    assert again == answer | {"replayed": True}


@pytest.mark.slow
async def test_a_file_that_stops_arriving_or_has_no_end_is_given_up(make_settings: Callable[..., Settings]) -> None:
    async with running(make_settings(slow_client_s=1, max_import_bytes=5000)) as server, make_client(server) as client:
        mission = (await client.post("/missions", json=mission_spec())).json()["id"]
        port = int(server.url.rpartition(":")[2])
        path = f"/missions/{mission}/imports?filename=a.xyz"
        assert (await ask(port, "POST", path, {"Content-Length": "4000"}, b"1 2 3\n"))[0] == 408
        assert (await ask(port, "POST", path, {"Content-Length": "6000"}))[0] == 413
        chunk = b"fff\r\n" + b"1" * 4095 + b"\r\n"
        assert (await ask(port, "POST", path, {"Transfer-Encoding": "chunked"}, chunk * 2))[0] == 413


async def test_a_client_that_leaves_within_its_body_is_forgotten(
    make_settings: Callable[..., Settings], caplog: pytest.LogCaptureFixture
) -> None:
    async with running(make_settings()) as server, make_client(server) as client:
        mission = (await client.post("/missions", json=mission_spec())).json()["id"]
        port = int(server.url.rpartition(":")[2])
        for path in (f"/missions/{mission}/imports?filename=a.xyz", "/missions"):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            head = f"POST /api/v1{path} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
            writer.write(f"{head}Content-Length: 400000\r\nExpect: 100-continue\r\n\r\n".encode())
            assert b"100" in await reader.readline()
            writer.close()
        assert (await client.get("/health/live")).status_code == 200
        middleware = server._app.middleware_stack
        while not isinstance(middleware, bodies.BodyMiddleware):
            middleware = middleware.app
        async with asyncio.timeout(ANSWER_S):
            while middleware.budget.held:
                await client.get("/health/live")
    assert not [record for record in caplog.records if record.exc_info]


async def test_what_a_page_of_an_allowed_site_may_not_do_it_is_told(make_settings: Callable[..., Settings]) -> None:
    settings = make_settings(allowed_origins=("https://console.example",))
    database = Database(settings.database_url)
    async with running(settings) as server, make_client(server) as client:
        await TokenStore(database).create("somebody", Role.VIEWER)
        answer = await client.post("/missions", json={}, headers={"Origin": "https://console.example"})
        assert answer.status_code == httpx.codes.UNAUTHORIZED
        assert answer.headers["access-control-allow-origin"] in ("*", "https://console.example")
    await database.close()
