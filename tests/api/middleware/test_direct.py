"""Requests that are answered without the framework's detours get the very answers that it would give."""

from typing import Any

import httpx
import pytest
from fastapi.routing import APIRoute

from app.api.middleware.direct import DirectRoutes, plan_of
from app.main import Server, create_app
from app.settings import Settings
from tests.support.api.rest import Guarded

ITEM = {"vehicle": "v", "time_s": 1.0, "lat_deg": 41.0, "lon_deg": -8.0, "depth_m": 2.0}
REQUESTS: list[tuple[str, str, dict[str, Any]]] = [
    ("GET", "/missions/{id}", {}),
    ("GET", "/missions", {}),
    ("GET", "/missions/{id}/steps?limit=2", {}),
    ("GET", "/missions/{id}/preflight", {}),
    ("GET", "/vehicles", {}),
    ("GET", "/health/ready", {}),
    ("GET", "/layers", {}),
    ("GET", "/missions/{id}/corrections", {}),
    # What is wrong with a request is said in the same words.
    ("GET", "/missions/{id}/steps?limit=0&after=x", {}),
    ("GET", "/missions/not there", {}),
    ("GET", "/missions/0197a3c8-6f2e-7c41-9d0f-5b2f6f0c1a2b", {}),
    ("GET", "/nothing", {}),
    ("PATCH", "/missions/{id}", {}),
    ("HEAD", "/missions", {}),
    ("GET", "/missions/{id}/vehicles/nobody/waypoint?timeout_s=0", {}),
    ("GET", "/missions/{id}/vehicles/nobody/waypoint?timeout_s=1e9", {}),
    ("POST", "/missions/{id}/measurements", {}),
    ("POST", "/missions/{id}/measurements", {"json": None}),
    ("POST", "/missions/{id}/measurements", {"json": {"items": []}}),
    ("POST", "/missions/{id}/measurements", {"json": {"items": [ITEM, {"vehicle": 3}]}}),
    ("POST", "/missions/{id}/measurements", {"json": {"items": [ITEM]}, "headers": {"Idempotency-Key": "a b"}}),
    ("POST", "/missions/{id}/measurements", {"content": b"{", "headers": {"Content-Type": "application/json"}}),
    ("POST", "/missions/{id}/measurements", {"content": b"{}", "headers": {"Content-Type": "text/plain"}}),
    ("POST", "/missions/{id}/pause", {}),
    ("PUT", "/missions/{id}/budget", {"json": {}}),
    ("POST", "/missions/{id}/notes", {"json": {"text": " "}}),
    ("DELETE", "/missions/{id}/sound-speed", {}),
    # What a route does not know is refused the same way.
    ("GET", "/missions?all=1", {}),
    ("POST", "/missions/{id}/start?dry_run=true", {}),
    ("POST", "/missions/{id}/start", {"headers": {"Idempotency-Key": "a"}}),
]


@pytest.mark.parametrize("who", ["operator", "viewer", "vehicle", ""])
async def test_both_ways_answer_the_same(guarded: Guarded, path: str, who: str) -> None:
    app = guarded.server.config.app
    headers = {"X-Request-Id": "same"} | ({"Authorization": f"Bearer {guarded.tokens[who]}"} if who else {})
    mission = path.rstrip("/").rpartition("/")[2]
    for method, target, more in REQUESTS:
        asked = more | {"headers": headers | more.get("headers", {})}
        url = target.replace("{id}", mission)
        direct = await guarded.client.request(method, url, **asked)
        app.dependency_overrides[test_both_ways_answer_the_same] = None
        try:
            usual = await guarded.client.request(method, url, **asked)
        finally:
            app.dependency_overrides.clear()
        assert _said(direct) == _said(usual), (method, target)


def _said(answer: httpx.Response) -> tuple[int, dict[str, str], bytes]:
    changing = {"date", "content-length"} if answer.request.url.path.endswith("/vehicles") else {"date"}
    return answer.status_code, {k: v for k, v in answer.headers.items() if k not in changing}, answer.content


def test_all_routes_but_those_with_ways_of_their_own_are_answered_directly() -> None:
    app = create_app(Settings(database_url="sqlite+aiosqlite:///:memory:"))
    middleware = next(m for m in app.user_middleware if m.cls is DirectRoutes)
    routers = middleware.kwargs["routers"]
    assert isinstance(routers, tuple)
    routes = [r for router in routers for r in router.routes if isinstance(r, APIRoute)]
    left = {route.operation_id for route in routes if plan_of(route) is None}
    assert len(routes) > 50
    assert left == {"getTile"}


async def test_requests_are_counted_by_their_route(server: Server, client: httpx.AsyncClient) -> None:
    await client.get("/missions")
    assert 'route="/api/v1/missions"' in (await client.get("/metrics")).text
