"""Who did what, when, and what came of it is written down, whatever came of it."""

import json
import logging
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.api.accounts import audit_log
from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.settings import Settings
from app.storage.database import Database
from tests.support.api.rest import make_client, mission_spec, running, soundings


@pytest.fixture
async def tokens(make_settings: Callable[..., Settings]) -> AsyncIterator[dict[str, dict[str, str]]]:
    """Headers by role."""
    database = Database(make_settings().database_url)
    made = {role.value: (await TokenStore(database).create(f"the {role}", role))[1] for role in Role}
    yield {role: {"Authorization": f"Bearer {token}"} for role, token in made.items()}
    await database.close()


async def entries(client: httpx.AsyncClient, headers: dict[str, str], **choice: Any) -> list[dict[str, Any]]:
    answer = await client.get("/audit", headers=headers, params=choice)
    assert answer.status_code == 200, answer.text
    listed: list[dict[str, Any]] = answer.json()
    return listed


@pytest.mark.slow
async def test_every_command_is_written_down_before_it_is_answered(
    make_settings: Callable[..., Settings], tokens: dict[str, dict[str, str]]
) -> None:
    admin, operator = tokens["admin"], tokens["operator"]
    async with running(make_settings()) as server, make_client(server) as client:

        async def newest() -> tuple[Any, ...]:
            entry = (await entries(client, admin, limit=1))[0]
            return entry["actor"], entry["role"], entry["action"], entry["result"], entry["status"]

        made = await client.post("/missions", json=mission_spec(), headers=operator | {"X-Request-Id": "watch-2"})
        assert await newest() == ("the operator", "operator", "createMission", "done", 201)
        assert (await entries(client, admin))[0]["request_id"] == "watch-2"
        path = f"/missions/{made.json()['id']}"
        await client.post(f"{path}/pause", headers=operator)
        assert await newest() == ("the operator", "operator", "pauseMission", "refused", 409)
        await client.post(f"{path}/abort", headers=tokens["viewer"])
        assert await newest() == ("the viewer", "viewer", "abortMission", "refused", 403)
        await client.post(f"{path}/abort", headers={"Authorization": "Bearer bf_stolen"})
        assert await newest() == ("", "", "abortMission", "refused", 401)
        await client.post(f"{path}/abort", headers=operator | {"Origin": "https://evil.example"})
        assert (await newest())[2:] == ("abortMission", "refused", 403)
        await client.post("/missions", json={"name": 7}, headers=operator)
        assert (await newest())[2:] == ("createMission", "refused", 422)
        await client.post("/missions", content=b"x" * 10_000_000, headers=operator)
        assert (await newest())[2:] == ("createMission", "refused", 413)

        before = len(await entries(client, admin))
        await client.post(f"{path}/measurements", json={"items": soundings(2)}, headers=tokens["vehicle"])
        await client.get(path, headers=operator)
        assert len(await entries(client, admin)) == before  # data and questions are no commands
        await client.post(f"{path}/measurements", json={"items": soundings(2)}, headers=tokens["viewer"])
        assert (await newest())[:3] == ("the viewer", "viewer", "postMeasurements")

        whole = await entries(client, admin)
        assert {entry["origin"] for entry in whole} == {"127.0.0.1"}
        ofmission = await entries(client, admin, mission=made.json()["id"], actor="the operator")
        assert [entry["action"] for entry in ofmission] == ["pauseMission"]
        assert await entries(client, admin, before=whole[2]["id"]) == whole[3:]
        for role in ("viewer", "vehicle", "operator"):
            assert (await client.get("/audit", headers=tokens[role])).status_code == 403


async def test_strangers_cannot_fill_the_disk_with_refusals(
    make_settings: Callable[..., Settings], tokens: dict[str, dict[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit_log, "STRANGERS_PER_MINUTE", 3)
    async with running(make_settings()) as server, make_client(server) as client:
        for _ in range(10):
            assert (await client.post("/missions", json=mission_spec())).status_code == 401
        written = await entries(client, tokens["admin"])
        assert 3 <= len(written) <= 4


async def test_no_secret_is_ever_logged(
    make_settings: Callable[..., Settings], tokens: dict[str, dict[str, str]], caplog: pytest.LogCaptureFixture
) -> None:
    """Tokens come in headers, in queries and as sockets' protocols; guessed ones are somebody's as well."""
    import websockets

    caplog.set_level(logging.DEBUG)
    secrets = [headers["Authorization"].split()[1] for headers in tokens.values()]
    guess = "bf_mistyped-by-one-letter"
    async with running(make_settings()) as server, make_client(server) as client:
        for secret in (*secrets, guess):
            for header in (f"Bearer {secret}", f"Basic {secret}", secret):
                await client.post("/missions", json={"name": 1}, headers={"Authorization": header})
            await client.get("/missions", params={"token": secret})
            await client.get("/missions/none/events", params={"token": secret, "after": "x"})
            url = f"{server.url.replace('http', 'ws', 1)}/api/v1/missions/none/live"
            for target, more in (
                (f"{url}?token={secret}", {}),
                (url, {"additional_headers": {"Authorization": f"Bearer {secret}"}}),
                (url, {"subprotocols": [websockets.Subprotocol(secret)]}),
            ):
                try:
                    async with websockets.connect(target, **more) as live:
                        await live.recv()
                except websockets.WebSocketException:
                    pass
        logged = "\n".join(
            f"{record.getMessage()} {record.__dict__}"
            for record in caplog.records
            if not record.name.startswith(("websockets.client", "httpcore", "httpx"))
        )
        kept = json.dumps(await entries(client, tokens["admin"], limit=1000))
    assert "request" in logged
    for secret in (*secrets, guess):
        assert secret not in logged
        assert secret not in kept


@pytest.mark.usefixtures("no_settings_around")
async def test_the_databases_password_is_never_shown(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    from app.settings import SettingsError, load_settings
    from app.storage.upkeep.prepare import DatabaseNotReadyError, prepare_database

    caplog.set_level(logging.DEBUG)
    said = []
    for url in ("postgresql://fleet:hunter2@127.0.0.1:9/none", "postgresql://fleet:hunter2@127.0.0.1:nine/none"):
        try:
            await prepare_database(load_settings(database_url=url).database_url, may_upgrade=True)
        except (DatabaseNotReadyError, SettingsError, ValueError) as error:
            said.append(str(error))
    with pytest.raises(SettingsError) as refused:
        load_settings(database_url="mysql://fleet:hunter2@h/d")
    assert len(said) == 2
    assert "hunter2" not in f"{said} {refused.value} {caplog.text}"
