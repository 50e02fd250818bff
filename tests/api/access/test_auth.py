"""Who may ask for what."""

import importlib
import pkgutil
from collections.abc import Callable
from typing import Any

import httpx
import pytest
import websockets
from fastapi.routing import APIRoute

import app.api
from app.api.access import auth
from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.api.mission import mission_of
from app.main import Server, create_app
from app.settings import Settings, StartupError
from app.storage.database import Database
from tests.support.api.rest import Guarded, make_client, mission_spec, new_mission, running, soundings


async def test_once_a_token_exists_requests_need_one(guarded: Guarded) -> None:
    for sent in (None, "Bearer bf_guess", "Basic YTpi", "Bearer", "bf_guess"):
        headers = {} if sent is None else {"Authorization": sent}
        answer = await guarded.client.get("/missions", headers=headers)
        assert answer.status_code == 401, sent
        assert answer.headers["www-authenticate"].startswith("Bearer")
        assert answer.json()["type"] == "urn:bathyfleet:problem:unauthenticated"
        assert "bathyfleet token create" in answer.json()["remedy"]


async def test_tokens_in_the_query_are_not_taken_over_http(guarded: Guarded) -> None:
    answer = await guarded.client.get("/missions", params={"token": guarded.tokens["admin"]})
    assert answer.status_code == 401


async def test_an_expired_or_revoked_token_is_refused(guarded: Guarded) -> None:
    assert (await guarded.client.get("/missions", headers=guarded.as_("expired"))).status_code == 401
    viewer = next(row for row in await guarded.store.all() if row.role == "viewer")
    assert (await guarded.client.get("/missions", headers=guarded.as_("viewer"))).status_code == 200
    assert await guarded.store.revoke(viewer.id)
    assert not await guarded.store.revoke(viewer.id)
    assert (await guarded.client.get("/missions", headers=guarded.as_("viewer"))).status_code == 401


async def test_health_needs_no_token(guarded: Guarded) -> None:
    for name in ("/health", "/health/live", "/health/ready"):
        assert (await guarded.client.get(name)).status_code == 200


COMMAND = {"viewer": 403, "vehicle": 403, "operator": 200, "admin": 200}
MEASURE = {"viewer": 403, "vehicle": 200, "operator": 200, "admin": 200}
LOOK = {"viewer": 200, "vehicle": 200, "operator": 200, "admin": 200}


@pytest.mark.parametrize(
    ("method", "suffix", "body", "allowed"),
    [
        ("GET", "", None, LOOK),
        ("GET", "/events", None, LOOK),
        ("POST", "/measurements", {"items": soundings(2)}, MEASURE),
        ("POST", "/vehicles", {"name": "two", "kind": "rest"}, COMMAND),
        ("DELETE", "/vehicles/rover", None, COMMAND),
        ("POST", "/start", None, COMMAND),
        ("POST", "/abort", None, COMMAND),
    ],
)
async def test_roles_bound_what_a_token_may_do(
    guarded: Guarded, method: str, suffix: str, body: Any, allowed: dict[str, int]
) -> None:
    for role in Role:
        path = await new_mission(guarded)
        headers = guarded.as_(role.value) | {"Accept": "application/json"}
        answer = await guarded.client.request(method, path + suffix, json=body, headers=headers)
        assert answer.status_code == allowed[role], answer.text
        if answer.status_code == 403:
            assert f"role {role}" in answer.json()["detail"]
        await guarded.client.post(f"{path}/abort", headers=guarded.as_("operator"))


async def test_a_bound_token_acts_for_its_vehicle_only(guarded: Guarded, path: str) -> None:
    own = await guarded.client.post(f"{path}/measurements", json={"items": soundings(2)}, headers=guarded.as_("rover"))
    assert own.status_code == 200
    other = await guarded.client.post(
        f"{path}/measurements", json={"items": soundings(2, vehicle="two")}, headers=guarded.as_("rover")
    )
    assert (other.status_code, "belongs to vehicle 'rover'" in other.json()["detail"]) == (403, True)
    waypoint = await guarded.client.get(f"{path}/vehicles/two/waypoint", headers=guarded.as_("rover"))
    assert waypoint.status_code == 403


async def test_the_socket_takes_the_token_from_the_header_and_never_from_the_address(
    guarded: Guarded, path: str
) -> None:
    url = f"{guarded.server.url.replace('http', 'ws', 1)}/api/v1{path}/live"
    async with websockets.connect(url, additional_headers=guarded.as_("viewer")) as socket:
        assert "snapshot" in str(await socket.recv())
    for query in ("", f"?token={guarded.tokens['viewer']}"):
        async with websockets.connect(url + query) as socket:
            with pytest.raises(websockets.ConnectionClosedError) as closed:
                await socket.recv()
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4401


async def test_live_views_end_with_their_token(guarded: Guarded, path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(auth, "RECHECK_S", 0.05)
    url = f"{guarded.server.url.replace('http', 'ws', 1)}/api/v1{path}/live"
    events = guarded.client.stream("GET", f"{path}/events", headers=guarded.as_("viewer"))
    async with websockets.connect(url, additional_headers=guarded.as_("viewer")) as socket, events as stream:
        await socket.recv()
        viewer = next(row for row in await guarded.store.all() if row.role == "viewer")
        await guarded.store.revoke(viewer.id)
        await socket.wait_closed()
        assert socket.close_code == 4401
        async for _ in stream.aiter_lines():
            pass  # until it ends


async def test_the_log_names_the_token_that_commanded(guarded: Guarded, path: str) -> None:
    await guarded.client.post(f"{path}/abort", headers=guarded.as_("operator"))
    headers = guarded.as_("viewer") | {"Accept": "application/json"}
    entries = (await guarded.client.get(f"{path}/events", headers=headers)).json()
    assert any("the operator" in entry["message"] for entry in entries)


async def test_tokens_are_kept_as_hashes(guarded: Guarded) -> None:
    kept = " ".join(str(vars(row)) for row in await guarded.store.all())
    assert not any(token in kept for token in guarded.tokens.values())


async def test_a_page_of_another_site_cannot_command(server: Server, client: httpx.AsyncClient) -> None:
    foreign = {"Origin": "https://evil.example"}
    answer = await client.post("/missions", json=mission_spec(), headers=foreign)
    assert (answer.status_code, answer.json()["type"]) == (403, "urn:bathyfleet:problem:forbidden")
    own = await client.post("/missions", json=mission_spec(), headers={"Origin": server.url})
    assert own.status_code == 201
    url = f"{server.url.replace('http', 'ws', 1)}/api/v1/missions/{own.json()['id']}/live"
    async with websockets.connect(url, origin=websockets.Origin("https://evil.example")) as socket:
        with pytest.raises(websockets.ConnectionClosedError) as closed:
            await socket.recv()
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 4403


async def test_a_name_that_was_rebound_to_this_machine_is_not_local(client: httpx.AsyncClient) -> None:
    answer = await client.get("/missions", headers={"Host": "evil.example:8080"})
    assert answer.status_code == 403


async def test_an_allowed_origin_may_command(make_settings: Callable[..., Settings]) -> None:
    origin = "https://console.example"
    async with (
        running(make_settings(allowed_origins=(origin,))) as server,
        make_client(server) as client,
    ):
        answer = await client.post("/missions", json=mission_spec(), headers={"Origin": origin})
        assert answer.status_code == 201
        assert answer.headers["access-control-allow-origin"] == origin


async def test_other_machines_are_refused_without_tokens(make_settings: Callable[..., Settings]) -> None:
    """The application may be served by other means than ``bathyfleet serve``; it looks at who asks, too."""
    app = create_app(make_settings())
    transport = httpx.ASGITransport(app, client=("192.0.2.7", 4711))
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=transport, base_url="http://localhost/api/v1") as client,
    ):
        answer = await client.get("/missions")
        assert answer.status_code == 403
        assert "bathyfleet token create" in answer.json()["remedy"]


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
async def test_listening_to_other_machines_needs_a_token(make_settings: Callable[..., Settings], host: str) -> None:
    settings = make_settings(host=host)
    app = create_app(settings)
    with pytest.raises(StartupError, match="bathyfleet token create"):
        async with app.router.lifespan_context(app):
            pass

    insecure = create_app(make_settings(host=host, insecure=True))
    async with insecure.router.lifespan_context(insecure):
        pass

    database = Database(settings.database_url)
    await TokenStore(database).create("someone", Role.OPERATOR)
    await database.close()
    async with app.router.lifespan_context(app):
        pass


def test_every_route_of_a_mission_knows_who_asks_before_it_looks_for_the_mission() -> None:
    names = [module.name for module in pkgutil.walk_packages(app.api.__path__, "app.api.")]
    modules = [importlib.import_module(name) for name in names]
    routes = [route for module in modules if hasattr(module, "router") for route in module.router.routes]
    found = 0
    for route in routes:
        calls = [one.call for one in route.dependant.dependencies] if isinstance(route, APIRoute) else []
        if mission_of in calls:
            found += 1
            roles = [isinstance(call, auth.RoleCheck) for call in calls]
            assert roles.index(True) < calls.index(mission_of), route.path
    assert found > 30


async def test_who_may_not_look_is_not_told_whether_there_is_a_mission(guarded: Guarded, path: str) -> None:
    for there in (path, "/missions/00000000-0000-4000-8000-000000000000"):
        assert (await guarded.client.get(there)).status_code == 401
        refused = await guarded.client.get(f"{there}/vehicles/rover/waypoint", headers=guarded.as_("viewer"))
        assert refused.status_code == 403
    missing = await guarded.client.get(there, headers=guarded.as_("viewer"))
    assert missing.json()["type"].endswith("mission-not-found")
