"""Alarms over REST: who may take them, and that pages, the list and the audit log say who did."""

import asyncio
import json
from collections.abc import Callable
from typing import Any

import httpx
import pytest
import websockets

from app.api.accounts.roles import Role
from app.main import Server
from app.missions.alarm_kinds import AlarmKind
from app.settings import Settings
from tests.support.api.rest import Guarded, make_client, running
from tests.support.missions.alarms import SECRET, hook, told_by
from tests.support.waiting import until


async def raise_alarm(server: Server, mission_id: str) -> str:
    """Raise an alarm as a mission does; returns its id."""
    live = await server._app.state.edge.service.get(mission_id)
    await live.journal.alarm(AlarmKind.VEHICLE_LOST, "rover is lost: silent", vehicle="rover")
    return str(live.journal.alarms.open[-1].id)


async def test_operators_take_alarms_and_viewers_see_who_did(guarded: Guarded, path: str) -> None:
    mission_id = path.rpartition("/")[2]
    alarm_id = await raise_alarm(guarded.server, mission_id)
    taking = f"/alarms/{alarm_id}/acknowledge"
    for role in (Role.VIEWER, Role.VEHICLE):
        refused = await guarded.client.post(taking, headers=guarded.as_(role))
        assert refused.status_code == 403
        assert (await guarded.client.post("/alarms/test", headers=guarded.as_(role))).status_code == 403
    assert (await guarded.client.post(taking)).status_code == 401
    assert (await guarded.client.get("/alarms")).status_code == 401
    [seen] = (await guarded.client.get("/alarms?state=open", headers=guarded.as_("viewer"))).json()
    assert (seen["id"], seen["state"], seen["kind"]) == (alarm_id, "open", "vehicle_lost")

    taken = await guarded.client.post(taking, headers=guarded.as_("operator"))
    assert taken.status_code == 200, taken.text
    again = await guarded.client.post(taking, headers=guarded.as_("admin"))
    assert again.json() == taken.json()
    assert taken.json()["acknowledged_by"] == "the operator"
    headers = guarded.as_("viewer")
    assert (await guarded.client.get("/alarms?state=open", headers=headers)).json() == []
    of_mission = {"mission": mission_id, "state": "acknowledged"}
    assert (await guarded.client.get("/alarms", headers=headers, params=of_mission)).json() == [taken.json()]
    assert (await guarded.client.get(f"/alarms/{alarm_id}", headers=headers)).json() == taken.json()
    missing = await guarded.client.get("/alarms/b2", headers=headers)
    assert (missing.status_code, missing.json()["type"]) == (404, "urn:bathyfleet:problem:alarm-not-found")
    lines = (await guarded.client.get("/audit", headers=guarded.as_("admin"))).json()
    assert ("acknowledgeAlarm", "the operator", "done") in {(r["action"], r["actor"], r["result"]) for r in lines}


async def test_two_pages_see_the_alarm_and_who_took_it(
    server: Server, client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    url = server.url.replace("http", "ws") + f"/api/v1/missions/{mission['id']}/live"
    async with websockets.connect(url) as one, websockets.connect(url) as other:
        for page in (one, other):
            assert json.loads(await page.recv())["alarms"] == []
        alarm_id = await raise_alarm(server, mission["id"])
        for page in (one, other):
            assert (await _alarm(page))["state"] == "open"
        await client.post(f"/alarms/{alarm_id}/acknowledge")
        for page in (one, other):
            said = await _alarm(page)
            assert (said["id"], said["state"]) == (alarm_id, "acknowledged")
            assert said["acknowledged_by"]


async def _alarm(page: Any) -> dict[str, Any]:
    async with asyncio.timeout(60):
        while (message := json.loads(await page.recv()))["type"] != "alarm":
            pass
    return dict(message["alarm"])


async def test_a_test_is_delivered_and_no_answer_shows_an_address_or_a_secret(
    make_settings: Callable[..., Settings], capsys: pytest.CaptureFixture[str]
) -> None:
    with hook(500) as program:
        settings = make_settings(alarms=told_by(program))
        async with running(settings) as server, make_client(server) as client:
            made = await client.post("/alarms/test", json={"severity": "critical"})
            assert made.status_code == 201, made.text
            path = f"/alarms/{made.json()['id']}"

            async def delivered() -> bool:
                [delivery] = (await client.get(path)).json()["deliveries"]
                return bool(delivery["state"] == "delivered" and delivery["attempts"] == 2)

            await until(delivered, "it arrives at the second attempt")
            said = (await client.get(path)).text + (await client.get("/metrics")).text
            unknown = await client.post("/alarms/test", json={"to": "http://192.0.2.1/"})
            assert unknown.status_code == 422
            assert unknown.json()["errors"][0]["field"] == "to"
            assert 'bathyfleet_alarm_deliveries_total{result="delivered"}' in said
    logged = capsys.readouterr()
    for text in (said, logged.out, logged.err):
        assert program.url not in text
        assert SECRET not in text
    assert len(program.requests) == 2
