"""A fault of the program is answered without internals and leaves the service running."""

import httpx
from fastapi import FastAPI

from app.api.http import error_handlers
from app.api.middleware.requests import RequestMiddleware


async def test_an_unexpected_error_is_a_problem_without_internals() -> None:
    app = FastAPI()
    error_handlers.install(app)
    app.add_middleware(RequestMiddleware)

    @app.get("/broken")
    async def broken() -> None:
        raise RuntimeError("the password is swordfish")

    transport = httpx.ASGITransport(app)
    async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
        answer = await client.get("/broken", headers={"X-Request-Id": "my-id-1"})
    assert answer.status_code == 500
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["type"] == "urn:bathyfleet:problem:internal"
    assert answer.json()["instance"] == "/broken#my-id-1"
    assert "my-id-1" in answer.json()["remedy"]
    assert "swordfish" not in answer.text
