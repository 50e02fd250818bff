"""Questions of the checklist: asked before a start, and in the log who confirmed them."""

from collections.abc import AsyncIterator, Callable
from typing import Any

import httpx
import pytest
from pydantic import ValidationError

from app.settings import Settings
from tests.support.api.rest import make_client, mission_spec, running

QUESTIONS = ("Hatches closed", "Recovery boat ready")


@pytest.fixture
async def asking(make_settings: Callable[..., Settings]) -> AsyncIterator[httpx.AsyncClient]:
    """A client of a service whose checklist has questions."""
    async with running(make_settings(checklist=QUESTIONS)) as server, make_client(server) as client:
        yield client


async def ready(client: httpx.AsyncClient) -> str:
    """A mission whose vehicle is there."""
    vehicles = [{"name": "rover", "kind": "sim"}]
    return str((await client.post("/missions", json=mission_spec(vehicles=vehicles))).json()["id"])


async def said(client: httpx.AsyncClient, mission: str) -> list[tuple[str, str]]:
    answer = await client.get(f"/missions/{mission}/events", headers={"Accept": "application/json"})
    events: list[dict[str, Any]] = answer.json()
    return [(one["level"], one["message"]) for one in events if "before the start" in one["message"]]


async def test_the_log_keeps_who_confirmed_what(asking: httpx.AsyncClient) -> None:
    mission = await ready(asking)
    assert (await asking.get(f"/missions/{mission}/preflight")).json()["questions"] == list(QUESTIONS)
    body = {"confirmed": [QUESTIONS[1], QUESTIONS[0]], "note": "calm"}
    started = await asking.post(f"/missions/{mission}/start", json=body)
    assert started.status_code == 200, started.text
    assert await said(asking, mission) == [
        ("info", "local operator confirmed before the start: Hatches closed; Recovery boat ready")
    ]


@pytest.mark.parametrize("body", [None, {"confirmed": []}, {"confirmed": [QUESTIONS[0]]}])
async def test_the_log_says_what_nobody_confirmed(asking: httpx.AsyncClient, body: dict[str, Any] | None) -> None:
    mission = await ready(asking)
    assert (await asking.post(f"/missions/{mission}/start", json=body)).status_code == 200
    confirmed = (body or {}).get("confirmed", [])
    left = [question for question in QUESTIONS if question not in confirmed]
    assert (await said(asking, mission))[-1] == ("warning", f"nobody confirmed before the start: {'; '.join(left)}")
    assert len(await said(asking, mission)) == (2 if confirmed else 1)


async def test_what_is_no_question_starts_nothing(asking: httpx.AsyncClient) -> None:
    mission = await ready(asking)
    refused = await asking.post(f"/missions/{mission}/start", json={"confirmed": ["Hatches closed", "Hatch shut"]})
    assert refused.status_code == 422
    (fault,) = refused.json()["errors"]
    assert fault["field"] == "confirmed.1"
    assert "'Hatch shut'" in fault["message"]
    assert "Recovery boat ready" in fault["expected"]
    assert (await asking.get(f"/missions/{mission}")).json()["state"] == "ready"


async def test_without_questions_nothing_is_asked(client: httpx.AsyncClient) -> None:
    mission = await ready(client)
    assert (await client.get(f"/missions/{mission}/preflight")).json()["questions"] == []
    assert (await client.post(f"/missions/{mission}/start")).status_code == 200
    assert await said(client, mission) == []


@pytest.mark.parametrize("checklist", [["", "x"], ["two\nlines"], ["x" * 201], ["Hatches", "Hatches"], ["x"] * 41])
def test_questions_can_be_read_and_are_asked_once(checklist: list[str]) -> None:
    with pytest.raises(ValidationError, match="checklist"):
        Settings(checklist=checklist)
