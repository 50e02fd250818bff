"""Vehicles' own logs taken back over REST: stopped while they are read, and out of everything when they were."""

import asyncio
import gzip
import json
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.operations.imports import log_batches, log_process
from tests.api.soundings.test_logs import ended, lines, mapped, send
from tests.support.api.rest import Guarded, mission_spec, new_mission, soundings
from tests.support.imc import log_writer as writer
from tests.support.mapping.multibeam import line, write_gsf
from tests.support.missions.specs import FRAME, rectangle
from tests.support.storage.databases import query
from tests.support.waiting import until

PINGS = 150


@pytest.fixture
async def path(client: httpx.AsyncClient, mission: dict[str, Any]) -> str:
    return f"/missions/{mission['id']}"


@pytest.fixture
def content(tmp_path: Path) -> bytes:
    return writer.write(tmp_path / "Data.lsf.gz", writer.survey(PINGS)).read_bytes()


async def take_back(client: httpx.AsyncClient, path: str, log: dict[str, Any]) -> dict[str, Any]:
    answer = await client.delete(f"{path}/logs/{log['id']}")
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    assert found == (await client.get(f"{path}/logs/{log['id']}")).json()
    return found


async def count(client: httpx.AsyncClient, path: str, what: str = "soundings") -> int:
    return int((await client.get(path)).json()["progress"][what])


def stored(url: str, columns: str) -> list[tuple[Any, ...]]:
    rows = query(url, f"select {columns} from soundings order by vehicle, time_s, beam")  # noqa: S608
    return [tuple(row) for row in rows]


@pytest.mark.slow
async def test_a_log_under_the_wrong_name_is_taken_back_and_counts_under_the_right_one(
    client: httpx.AsyncClient, path: str, content: bytes, database_url: str
) -> None:
    await client.post(f"{path}/measurements", json={"items": soundings(5)})
    wrong = await ended(client, path, await send(client, path, content, vehicle="wrong"))
    await mapped(client, path, PINGS + 5)
    raw = "vehicle, time_s, beam, lat_deg, lon_deg, range_m, raw_depth_m"
    before = stored(database_url, raw)
    tracked = (await client.get(f"{path}/tracks.geojson")).text
    assert "wrong" in tracked

    gone = await take_back(client, path, wrong)
    assert (wrong["can_be_taken_back"], gone["can_be_taken_back"]) == (True, False)
    assert (gone["state"], gone["taken_back_by"], gone["result"]) == ("taken-back", "local operator", wrong["result"])
    assert gone["taken_back_at"]
    assert await count(client, path) == 5
    await mapped(client, path, 5)
    assert "wrong" not in (await client.get(f"{path}/tracks.geojson")).text
    assert stored(database_url, raw) == before, "what was measured stays"
    verdicts = stored(database_url, "vehicle, verdict")
    assert {verdict for vehicle, verdict in verdicts if vehicle == "wrong"} == {"taken-back"}
    said = (await lines(client, path))[-1]
    assert said["message"] == f"{PINGS} soundings from Data.lsf.gz, the log of wrong, taken back by local operator"
    assert (said["data"]["actor"], said["data"]["withdrawn"]) == ("local operator", PINGS)
    points = (await client.get(f"{path}/soundings/points")).json()
    assert (points["total"], points["vehicles"]) == (5, ["rover"])
    (one,) = [row[0] for row in stored(database_url, "id, vehicle") if row[1] == "wrong"][:1]
    refused = await client.post(f"{path}/soundings/{one}/restore")
    assert (refused.status_code, refused.json()["remedy"]) == (409, "send the log again")

    right = await ended(client, path, await send(client, path, content))
    assert (right["problem"], right["vehicle"], right["result"]["soundings"]) == ("", writer.NAME, PINGS)
    await mapped(client, path, PINGS + 5)
    # Once more changes nothing.
    assert await take_back(client, path, wrong) == gone
    assert await count(client, path) == PINGS + 5
    assert [one["state"] for one in (await client.get(f"{path}/logs")).json()] == ["taken-back", "done"]


@pytest.mark.slow
async def test_a_log_that_was_taken_back_counts_again_when_it_is_sent_again(
    client: httpx.AsyncClient, path: str, content: bytes, database_url: str
) -> None:
    first = await ended(client, path, await send(client, path, content))
    rows = [row[0] for row in stored(database_url, "id")]
    assert (await client.post(f"{path}/soundings/reject", json={"ids": rows[:3]})).status_code == 200
    before = stored(database_url, "vehicle, time_s, depth_m, verdict, reason, ruling")
    track = query(database_url, "select vehicle, time_s from positions order by id")
    await mapped(client, path, PINGS - 3)
    assert (await client.get(f"{path}/map/tiles")).status_code == 200
    await take_back(client, path, first)
    assert await count(client, path) == 0
    assert (await client.get(f"{path}/map/tiles")).status_code == 404, "not the old map while the new one is made"
    # Corrected meanwhile as all others are.
    assert (await client.put(f"{path}/tide", json={"level_m": 1.0})).status_code == 200
    again = await ended(client, path, await send(client, path, gzip.decompress(content), filename="Data.lsf"))
    assert again["state"] == "done"
    assert (again["result"]["soundings"], again["result"]["duplicate"]) == (PINGS - 3, 3), "three are ruled out"
    assert not again["result"]["known"]
    await mapped(client, path, PINGS - 3)
    assert await count(client, path) == PINGS - 3
    assert (await client.put(f"{path}/tide", json={"level_m": 0.0})).status_code == 200
    assert stored(database_url, "vehicle, time_s, depth_m, verdict, reason, ruling") == before
    shown = (await client.get(f"{path}/tracks.geojson")).json()
    (feature,) = [one for one in shown["features"] if one["properties"]["vehicle"] == writer.NAME]
    assert len(feature["geometry"]["coordinates"]) <= len(track)
    assert [one["state"] for one in (await client.get(f"{path}/logs")).json()] == ["taken-back", "done"]
    assert (await take_back(client, path, again))["state"] == "taken-back"
    assert await count(client, path) == 0


@pytest.mark.slow
async def test_what_comes_from_elsewhere_counts_where_a_log_was_taken_back(
    client: httpx.AsyncClient, path: str, content: bytes
) -> None:
    whole = await ended(client, path, await send(client, path, content))
    await take_back(client, path, whole)
    # The same records in another log: they are not there, as far as anything goes.
    longer = gzip.decompress(content) + writer.announce(1.0)
    other = await ended(client, path, await send(client, path, longer, filename="longer.lsf"))
    assert (other["result"]["soundings"], other["result"]["duplicate"]) == (PINGS, 0)
    await mapped(client, path, PINGS)
    # The first comes again, is known, and taking it back leaves what the other brought.
    again = await ended(client, path, await send(client, path, content))
    assert (again["result"]["soundings"], again["result"]["duplicate"]) == (0, PINGS)
    await take_back(client, path, again)
    assert await count(client, path) == PINGS
    await mapped(client, path, PINGS)
    await take_back(client, path, other)
    assert await count(client, path) == 0


@pytest.mark.slow
async def test_which_logs_lost_records_with_one_that_is_taken_back_is_said(
    client: httpx.AsyncClient, path: str, content: bytes
) -> None:
    first = await ended(client, path, await send(client, path, content))
    longer = gzip.decompress(content) + writer.announce(1.0)
    other = await ended(client, path, await send(client, path, longer, filename="longer.lsf"))
    assert other["result"]["duplicate"] == PINGS
    await take_back(client, path, first)
    assert "What longer.lsf had of them, too, is gone with them" in (await lines(client, path))[-1]["message"]
    # As the line says: the other one brings them when it is sent once more.
    await take_back(client, path, other)
    assert "gone with them" not in (await lines(client, path))[-1]["message"]
    again = await ended(client, path, await send(client, path, longer, filename="longer.lsf"))
    assert (again["result"]["soundings"], again["result"]["duplicate"]) == (PINGS, 0)
    assert await count(client, path) == PINGS


@pytest.mark.slow
async def test_pings_of_a_log_are_taken_back_and_come_again(
    client: httpx.AsyncClient, path: str, tmp_path: Path
) -> None:
    middle = LocalFrame(*(float(value) for value in FRAME.to_geographic(28.0, 28.0)))
    file = tmp_path / "0007.gsf"
    write_gsf(file, line(middle))
    whole = file.read_bytes()
    log = await ended(client, path, await send(client, path, whole, filename=file.name, vehicle="wrong"))
    assert await count(client, path, "pings") == log["result"]["pings"] == 12
    profile = {"assumed_mps": 1500, "profile": [[0, 1490]], "source": "cast"}
    assert (await client.put(f"{path}/sound-speed", json=profile)).status_code == 422
    await take_back(client, path, log)
    progress = (await client.get(path)).json()["progress"]
    assert (progress["pings"], progress["beams"]) == (0, 0)
    assert (await client.get(f"{path}/pings")).json()["pings"] == 0
    # Nothing is corrected twice any more.
    assert (await client.put(f"{path}/sound-speed", json=profile)).status_code == 200
    assert (await client.delete(f"{path}/sound-speed")).status_code == 200
    for _ in range(2):
        log = await ended(client, path, await send(client, path, whole, filename=file.name, vehicle="wrong"))
        assert (log["result"]["pings"], log["result"]["pings_duplicate"]) == (12, 0)
        assert await count(client, path, "pings") == 12
        await take_back(client, path, log)
        assert await count(client, path, "pings") == 0


@pytest.mark.slow
async def test_a_log_that_waits_or_is_read_is_stopped(
    client: httpx.AsyncClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(log_batches, "BATCH", 50)
    spec = mission_spec(area=rectangle(0, 0, 30, 1900))
    path = f"/missions/{(await client.post('/missions', json=spec)).json()['id']}"
    content = writer.write(tmp_path / "Data.lsf", writer.survey(3000)).read_bytes()
    held = asyncio.Event()
    read = log_process.ReadingProcess.next
    processes: list[Any] = []

    async def one_then_none(process: log_process.ReadingProcess) -> Any:
        processes.append(process._process)
        if held.is_set():
            await asyncio.Event().wait()
        held.set()
        return await read(process)

    with monkeypatch.context() as patch:
        patch.setattr(log_process.ReadingProcess, "next", one_then_none)
        reading = (await send(client, path, content, filename="Data.lsf")).json()
        await until(held.is_set, "the first batch is read")

        async def begun() -> bool:
            return await count(client, path) > 0

        await until(begun, "it is stored")
        waiting = (await send(client, path, content + b"1", filename="more.lsf")).json()
        assert waiting["state"] == "waiting"
        gone = await take_back(client, path, waiting)
        assert (waiting["can_be_taken_back"], gone["can_be_taken_back"]) == (True, False)
        assert (gone["state"], gone["taken_back_by"], gone["result"]) == ("taken-back", "local operator", None)
        assert (await client.get(f"{path}/logs/{reading['id']}")).json()["state"] == "reading"
        gone = await take_back(client, path, reading)
        assert (gone["state"], gone["taken_back_by"], gone["problem"]) == ("taken-back", "local operator", "")
        assert await count(client, path) == 0, "what was stored of it counts no more"
        assert processes[-1].returncode is not None, "nothing reads it any more"
    messages = [one["message"] for one in await lines(client, path)]
    assert messages[:2] == [
        f"reading the log {name} was stopped by local operator" for name in ("more.lsf", "Data.lsf")
    ]
    assert messages[2].endswith("taken back by local operator")
    # The turn is free, and the file can come again.
    log = await ended(client, path, await send(client, path, content, filename="Data.lsf"))
    assert log["result"]["soundings"] + log["result"]["rejected"] == 3000
    assert await count(client, path) == log["result"]["soundings"]


@pytest.mark.slow
async def test_what_is_no_log_of_the_mission_cannot_be_taken_back(client: httpx.AsyncClient, path: str) -> None:
    assert (await client.delete(f"{path}/logs/nothing")).status_code == 404
    log = await ended(client, path, await send(client, path, b"no log", filename="Data.lsf"))
    assert not log["can_be_taken_back"]
    refused = await client.delete(f"{path}/logs/{log['id']}")
    assert (refused.status_code, refused.json()["detail"]) == (409, "nothing is stored of this log")


@pytest.mark.slow
@pytest.mark.parametrize("accepted", [PINGS, 0])
async def test_a_log_that_an_earlier_version_took_in_says_why_it_cannot_be_taken_back(
    client: httpx.AsyncClient, path: str, content: bytes, database_url: str, accepted: int
) -> None:
    await ended(client, path, await send(client, path, content))
    [(line, data)] = query(database_url, "select id, data from events where kind = 'import'")
    told = (json.loads(data) if isinstance(data, str) else data) | {"soundings": accepted, "rejected": 0}
    kept = {name: value for name, value in told.items() if name not in ("log", "import_id")}
    query(database_url, "update events set data = :data where id = :id", data=json.dumps(kept), id=line)
    earlier = await client.get(f"{path}/logs/line-{line}")
    assert earlier.json()["can_be_taken_back"] is False
    refused = await client.delete(f"{path}/logs/line-{line}")
    assert refused.status_code == 409
    assert ("an earlier version" in refused.json()["detail"]) is bool(accepted)


async def test_only_operators_take_logs_back(guarded: Guarded, content: bytes) -> None:
    path = await new_mission(guarded)
    client = guarded.client
    sent = await client.post(
        f"{path}/logs", content=content, params={"filename": "Data.lsf.gz"}, headers=guarded.as_("operator")
    )
    log = f"{path}/logs/{sent.json()['id']}"

    async def over() -> bool:
        return bool((await client.get(log, headers=guarded.as_("viewer"))).json()["state"] == "done")

    await until(over, "it is read")
    for role, status in (("viewer", 403), ("vehicle", 403), ("operator", 200)):
        assert (await client.delete(log, headers=guarded.as_(role))).status_code == status
    assert (await client.get(log, headers=guarded.as_("viewer"))).json()["taken_back_by"] == "the operator"
