"""Requests that one process sends on to another: in the name of whoever asked, with his role, once."""

import uuid
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets
from sqlalchemy import text

from app.api.access import auth
from app.api.accounts.tokens import TokenStore
from app.api.middleware import forwarding
from app.main import Server
from app.missions.clock import now
from app.settings import Settings
from app.storage.database import Database
from app.storage.models import MissionOwnerRow, MissionRow, ProcessRow
from app.storage.processes.process_lock import ProcessLock
from tests.support.api.rest import Tokens, make_client, make_tokens, mission_spec, running, soundings
from tests.support.imc import log_writer
from tests.support.waiting import until


@dataclass(kw_only=True)
class Two(Tokens):
    """The process that has a mission, and another one."""

    owner: Server
    other: Server
    at_other: httpx.AsyncClient
    path: str


@pytest.fixture
async def two(make_settings: Callable[..., Settings]) -> AsyncIterator[Two]:
    settings = make_settings()
    database = Database(settings.database_url)
    store = TokenStore(database)
    tokens = await make_tokens(store)
    async with AsyncExitStack() as stack:
        owner, other = [await stack.enter_async_context(running(settings)) for _ in range(2)]
        at_owner, at_other = [await stack.enter_async_context(make_client(server)) for server in (owner, other)]
        headers = {"Authorization": f"Bearer {tokens['operator']}"}
        created = await at_owner.post("/missions", json=mission_spec(), headers=headers)
        assert created.status_code == 201, created.text
        path = f"/missions/{created.json()['id']}"
        yield Two(owner=owner, other=other, at_other=at_other, tokens=tokens, store=store, path=path)
    store.close()
    await database.close()


async def test_everyone_has_there_the_role_that_he_has_here(two: Two) -> None:
    seen = await two.at_other.get(two.path, headers=two.as_("viewer"))
    assert seen.status_code == 200, seen.text
    assert (await two.at_other.get(two.path)).status_code == 401
    assert (await two.at_other.post(f"{two.path}/start", headers=two.as_("viewer"))).status_code == 403
    bound: dict[str, Any] = {"json": {"items": soundings(2, vehicle="two")}, "headers": two.as_("rover")}
    refused = await two.at_other.post(f"{two.path}/measurements", **bound)
    assert (refused.status_code, "belongs to vehicle 'rover'" in refused.json()["detail"]) == (403, True)
    assert (await two.at_other.get("/missions", headers=two.as_("viewer"))).json()[0]["id"] in two.path
    assert (await two.at_other.post(f"{two.path}/abort", headers=two.as_("operator"))).status_code == 200
    headers = two.as_("viewer") | {"Accept": "application/json"}
    events = (await two.at_other.get(f"{two.path}/events", headers=headers)).json()
    assert any("the operator" in event["message"] for event in events), "his name is in the mission's log"
    audit = (await two.at_other.get("/audit", headers=two.as_("admin"))).json()
    assert ("the operator", "operator") in {(row["actor"], row["role"]) for row in audit}


@pytest.mark.slow
async def test_a_log_is_sent_to_one_process_and_read_by_the_other(two: Two, tmp_path: Path) -> None:
    content = log_writer.write(tmp_path / "Data.lsf.gz", log_writer.survey(100)).read_bytes()
    query = {"filename": "Data.lsf.gz", "vehicle": "wrong"}
    operator = two.as_("operator")
    sent = await two.at_other.post(f"{two.path}/logs", content=content, params=query, headers=operator)
    assert sent.status_code == 202, sent.text
    log = f"{two.path}/logs/{sent.json()['id']}"

    async def done() -> bool:
        return bool((await two.at_other.get(log, headers=operator)).json()["state"] == "done")

    await until(done, "it is read")
    assert (await two.at_other.get(two.path, headers=operator)).json()["progress"]["soundings"] == 100
    again = await two.at_other.post(f"{two.path}/logs", content=content, params={"filename": "a.gz"}, headers=operator)
    log = f"{two.path}/logs/{again.json()['id']}"

    async def refused() -> bool:
        return bool((await two.at_other.get(log, headers=operator)).json()["state"] == "failed")

    await until(refused, "it is one vehicle's")
    taken_back = await two.at_other.delete(f"{two.path}/logs/{sent.json()['id']}", headers=operator)
    assert (taken_back.status_code, taken_back.json()["taken_back_by"]) == (200, "the operator")
    assert (await two.at_other.get(two.path, headers=operator)).json()["progress"]["soundings"] == 0


async def test_live_views_that_are_sent_on_end_with_their_token(two: Two, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(auth, "RECHECK_S", 0.05)
    url = f"{two.other.url.replace('http', 'ws', 1)}/api/v1{two.path}/live"
    events = two.at_other.stream("GET", f"{two.path}/events", headers=two.as_("viewer"))
    async with websockets.connect(url, additional_headers=two.as_("viewer")) as socket, events as stream:
        assert "snapshot" in str(await socket.recv())
        viewer = next(row for row in await two.store.all() if row.role == "viewer")
        await two.store.revoke(viewer.id)
        await socket.wait_closed()
        assert socket.close_code == 4401
        async for _ in stream.aiter_lines():
            pass  # until it ends


@pytest.mark.parametrize("same", [True, False], ids=["its own address", "another name of it"])
async def test_a_process_sends_nothing_to_itself(
    make_settings: Callable[..., Settings], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, same: bool
) -> None:
    """As when what a process left behind that had the address before is still taken for alive."""
    monkeypatch.setattr(forwarding, "TAKEOVER_S", 0.5)
    file = tmp_path / "fleet.db"
    settings = make_settings(database_url=f"sqlite+aiosqlite:///{file}")
    async with running(settings) as server, make_client(server) as client:
        created = (await client.post("/missions", json=mission_spec())).json()
        database = Database(settings.database_url)
        mission = str(uuid.uuid4())
        url = server.url if same else server.url.replace("127.0.0.1", "localhost")
        async with database.writing() as session:
            row = await session.get_one(MissionRow, created["id"])
            columns = {column.name: getattr(row, column.name) for column in MissionRow.__table__.columns}
            session.add(MissionRow(**(columns | {"id": mission})))
            session.add(ProcessRow(id=99, url=url, secret="what it had", certificate=None, began_at=now()))  # noqa: S106
            await session.flush()
            session.add(MissionOwnerRow(mission_id=mission, process_id=99, since=now()))
        lock = ProcessLock(Path(f"{file}-process-99"), 99)
        try:
            answer = await client.get(f"/missions/{mission}")
            assert answer.status_code == 503, answer.text
            assert answer.json()["type"] == "urn:bathyfleet:problem:mission-elsewhere"
            assert ("same address" in answer.json()["detail"]) == same
            live = f"{server.url.replace('http', 'ws', 1)}/api/v1/missions/{mission}/live"
            async with websockets.connect(live) as socket:
                await socket.wait_closed()
                assert socket.close_code == 1013
        finally:
            lock.release()
            async with database.reading() as session:
                assert (await session.execute(text("select count(*) from processes"))).scalar() == 2
            await database.close()
