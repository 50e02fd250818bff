"""A vehicle that speaks REST: measurements in, waypoints out."""

import asyncio
import json
from collections.abc import Callable
from typing import Any

import httpx
import pytest
from sqlalchemy import select

from app.api.accounts.roles import Role
from app.api.accounts.tokens import TokenStore
from app.main import Server
from app.settings import Settings
from app.storage.database import Database
from app.storage.models import BatchRow
from tests.support.api.rest import make_client, mission_spec, running, soundings


async def test_every_item_has_its_own_verdict(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    good = soundings(4)
    items: list[Any] = [
        good[0],
        good[1] | {"depth_m": "deep"},
        good[1] | {"rnge_m": 3},
        "no measurement",
        {k: v for k, v in good[1].items() if k != "lat_deg"},
        good[1],
        good[0],
        good[2] | {"vehicle": "stranger"},
        good[3],
    ]
    answer = await client.post(f"/missions/{mission['id']}/measurements", json={"items": items})
    assert answer.status_code == 200, answer.text
    batch = answer.json()
    verdicts = [item["verdict"] for item in batch["items"]]
    assert [item["index"] for item in batch["items"]] == list(range(9))
    assert verdicts == ["accepted", *["rejected"] * 4, "accepted", "duplicate", "rejected", "accepted"]
    assert (batch["accepted"], batch["rejected"], batch["duplicate"]) == (3, 5, 1)
    reasons = [item["reason"] for item in batch["items"]]
    assert (
        reasons[1] == "depth_m: Input should be a valid number, unable to parse string as a number; expected a number"
    )
    assert reasons[2].endswith("There is no such field; did you mean range_m?")
    assert "lat_deg: Field required" in reasons[4]
    assert "stranger" in reasons[7]
    assert (await client.get(f"/missions/{mission['id']}")).json()["progress"]["soundings"] == 3


async def test_a_value_that_is_not_finite_spoils_its_item_only(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    items = soundings(3)
    items[1]["range_m"] = float("nan")
    answer = await client.post(
        f"/missions/{mission['id']}/measurements",
        content=json.dumps({"items": items}),
        headers={"Content-Type": "application/json"},
    )
    assert answer.status_code == 200, answer.text
    assert [item["verdict"] for item in answer.json()["items"]] == ["accepted", "rejected", "accepted"]
    assert "finite" in answer.json()["items"][1]["reason"]


async def test_a_batch_of_another_shape_is_refused_whole(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    path = f"/missions/{mission['id']}/measurements"
    bodies: list[Any] = [[], {"items": []}, {"items": "x"}, soundings(2), {"items": soundings(1), "vessel": "x"}]
    for body in bodies:
        answer = await client.post(path, json=body)
        assert (answer.status_code, answer.json()["type"]) == (422, "urn:bathyfleet:problem:invalid-request")
    too_many = await client.post(path, json={"items": [None] * 10_001})
    assert too_many.json()["errors"][0]["expected"] == "at most 10000 entries"
    assert (await client.get(f"/missions/{mission['id']}")).json()["progress"]["soundings"] == 0


@pytest.mark.parametrize("text", ["\\u0000", "\\ud800"])
@pytest.mark.parametrize("item", ["a@", {"vehicle": "a@", "target": "@"}, {"@": 1}, {"x": [["@"]]}])
async def test_text_that_cannot_be_stored_spoils_no_other_item(
    client: httpx.AsyncClient, mission: dict[str, Any], text: str, item: Any
) -> None:
    path = f"/missions/{mission['id']}/measurements"
    body = json.dumps({"items": [*soundings(1), item, *soundings(1)]}).replace("@", text)
    headers = {"Content-Type": "application/json"}
    answer = await client.post(path, content=body, headers=headers)
    assert answer.status_code == 200, answer.text
    assert [item["verdict"] for item in answer.json()["items"]] == ["accepted", "rejected", "duplicate"]
    assert "NUL character or a lone surrogate; expected valid Unicode text" in answer.json()["items"][1]["reason"]
    for whole in ({"@": [], "items": soundings(1)}, {"items": {"0": "@"}}, {"items": "@"}, ["@"]):
        answer = await client.post(path, content=json.dumps(whole).replace("@", text), headers=headers)
        assert answer.status_code == 422, answer.text


async def test_a_batch_with_only_unreadable_items_is_answered(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    answer = await client.post(f"/missions/{mission['id']}/measurements", json={"items": [None, 3]})
    assert answer.status_code == 200, answer.text
    assert answer.json()["rejected"] == 2


async def test_an_idempotency_key_is_its_senders_own(make_settings: Callable[..., Settings]) -> None:
    settings = make_settings()
    database = Database(settings.database_url)
    store = TokenStore(database)
    async with running(settings) as server, make_client(server) as client:
        vehicles = [{"name": name, "kind": "rest"} for name in ("one", "two")]
        mission = (await client.post("/missions", json=mission_spec(vehicles=vehicles))).json()
        path = f"/missions/{mission['id']}/measurements"
        tokens = {name: (await store.create(name, Role.VEHICLE, vehicle=name))[1] for name in ("one", "two")}

        async def post(token: str, items: list[dict[str, Any]]) -> httpx.Response:
            headers = {"Authorization": f"Bearer {token}", "Idempotency-Key": "batch-1"}
            return await client.post(path, json={"items": items}, headers=headers)

        first = await post(tokens["one"], soundings(3, "one"))
        other = await post(tokens["two"], soundings(5, "two"))
        assert (first.status_code, other.status_code) == (200, 200), other.text
        assert (first.json()["accepted"], other.json()["accepted"], other.json()["replayed"]) == (3, 5, False)
        again = await post(tokens["one"], soundings(3, "one"))
        assert (again.json()["accepted"], again.json()["replayed"]) == (3, True)
        changed = await post(tokens["one"], soundings(4, "one"))
        assert (changed.status_code, changed.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")
        assert "'batch-1'" in changed.json()["detail"]
        renewed = (await store.create("one", Role.VEHICLE, vehicle="one"))[1]
        assert (await post(renewed, soundings(3, "one"))).json()["replayed"], "a new token of the same vehicle"
    await database.close()


async def test_a_key_of_before_keys_had_owners_is_answered_as_then(make_settings: Callable[..., Settings]) -> None:
    settings = make_settings()
    database = Database(settings.database_url)
    async with running(settings) as server, make_client(server) as client:
        mission = (await client.post("/missions", json=mission_spec())).json()
        path, headers = f"/missions/{mission['id']}/measurements", {"Idempotency-Key": "old"}
        first = await client.post(path, json={"items": soundings(3)}, headers=headers)
        async with database.writing() as session:
            (row,) = (await session.scalars(select(BatchRow))).all()
            assert row.key != "old"
            row.key = "old"  # as the versions before wrote it
        again = await client.post(path, json={"items": soundings(3)}, headers=headers)
        assert again.json() == first.json() | {"replayed": True}
        other = await client.post(path, json={"items": soundings(5)}, headers=headers)
        assert (other.status_code, other.json()["accepted"]) == (200, 2), "it was another sender's"
    await database.close()


async def test_an_idempotency_key_stores_once_and_repeats_the_answer(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    path = f"/missions/{mission['id']}/measurements"
    headers = {"Idempotency-Key": "rover-1"}
    first = (await client.post(path, json={"items": soundings(5)}, headers=headers)).json()
    again = (await client.post(path, json={"items": soundings(5)}, headers=headers)).json()
    assert first["accepted"] == 5
    assert again == first | {"replayed": True}
    other = await client.post(path, json={"items": soundings(6)}, headers=headers)
    assert other.status_code == 409
    assert "new key" in other.json()["remedy"]
    assert (await client.get(f"/missions/{mission['id']}")).json()["progress"]["soundings"] == 5


@pytest.mark.slow
async def test_a_long_poll_is_answered_by_the_start_of_the_mission(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    path = f"/missions/{mission['id']}"
    await client.post(f"{path}/measurements", json={"items": soundings(3)})
    waiting = asyncio.create_task(client.get(f"{path}/vehicles/rover/waypoint", params={"timeout_s": 20}))
    assert (await client.post(f"{path}/start")).status_code == 200
    answer = await waiting
    assert answer.status_code == 200, answer.text
    assert answer.json()["vehicle"] == "rover"
    assert answer.json()["step"] >= 1


async def test_a_vehicle_that_polls_sails_a_whole_mission(client: httpx.AsyncClient) -> None:
    mission = (await client.post("/missions", json=mission_spec(steps=3))).json()
    path = f"/missions/{mission['id']}"
    clock = 1_795_225_140.0
    position = {"lat_deg": 41.1852, "lon_deg": -8.7047, "depth_m": 2.0}
    await client.post(f"{path}/measurements", json={"items": [_sounding(position, clock)]})
    await client.post(f"{path}/start")
    steps: list[int] = []
    while True:
        params = {"timeout_s": 20} | ({"after_step": steps[-1]} if steps else {})
        answer = await client.get(f"{path}/vehicles/rover/waypoint", params=params)
        if answer.status_code == 204:
            continue
        if answer.status_code == 409:
            break
        assert answer.status_code == 200, answer.text
        waypoint = answer.json()
        steps.append(waypoint["step"])
        clock += 10
        position = {key: waypoint[key] for key in ("lat_deg", "lon_deg", "depth_m")}
        posted = await client.post(f"{path}/measurements", json={"items": [_sounding(position, clock)]})
        assert posted.json()["accepted"] == 1, posted.text
    assert steps == [1, 2, 3]
    # Vehicles are stopped first; the mission counts as finished once the last soundings are in its map.
    async with asyncio.timeout(30):
        while (ended := (await client.get(path)).json())["state"] == "running":  # noqa: ASYNC110 - another task changes it
            await asyncio.sleep(0.02)
    assert (ended["state"], ended["progress"]["step"]) == ("finished", 3)


def _sounding(position: dict[str, float], clock: float) -> dict[str, Any]:
    return {"vehicle": "rover", "time_s": clock, "range_m": 9.0, **position}


async def test_nothing_newer_is_204_without_a_body(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    path = f"/missions/{mission['id']}"
    await client.post(f"{path}/start")
    answer = await client.get(f"{path}/vehicles/rover/waypoint", params={"timeout_s": 0})
    assert (answer.status_code, answer.content) == (204, b"")


async def test_who_says_that_it_has_a_waypoint_of_a_step_to_come_is_refused(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    path = f"/missions/{mission['id']}"
    await client.post(f"{path}/start")
    answer = await client.get(f"{path}/vehicles/rover/waypoint", params={"after_step": 1000, "timeout_s": 0})
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "after_step")
    assert "it was given none yet" in answer.text


@pytest.mark.parametrize(("started", "status", "words"), [(True, 409, "stop and hold"), (False, 503, "shutting down")])
async def test_a_stopping_service_ends_the_wait(
    server: Server, client: httpx.AsyncClient, mission: dict[str, Any], started: bool, status: int, words: str
) -> None:
    """Whoever follows it is told to stop, all others to ask again."""
    path = f"/missions/{mission['id']}"
    if started:
        await client.post(f"{path}/start")
    waiting = asyncio.create_task(client.get(f"{path}/vehicles/rover/waypoint", params={"timeout_s": 60}))
    metrics = server.url + "/health"
    while True:  # until the wait has begun: the server answers a later request only after it accepted the earlier one
        await client.get(metrics)
        if len(server.server_state.connections) > 1:
            break
    server.stop()
    answer = await waiting
    assert (answer.status_code, words in answer.json()["detail"]) == (status, True), answer.text
    assert ("retry-after" in answer.headers) is not started
