"""Vehicles' own logs over REST: as the command takes them, beside a mission that runs, once."""

import asyncio
import gzip
from collections.abc import AsyncIterator, Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.live.mission import LiveMission
from app.missions.operations.imports import log_process, log_uploads
from app.missions.operations.imports.log_import import import_log
from app.missions.running.final_maps import FinalMaps
from app.missions.service import MissionService
from app.settings import Settings
from app.storage.database import Database
from tests.support.api.rest import Guarded, make_client, mission_spec, new_mission, prior_text, running, soundings
from tests.support.imc import log_writer as writer
from tests.support.mapping.multibeam import line, write_gsf, write_kmall
from tests.support.missions.specs import FRAME, rectangle
from tests.support.waiting import until

ENDED = ("done", "failed")
PINGS = 150
"""45 m of track, all of it in the area."""


@pytest.fixture
async def path(client: httpx.AsyncClient, mission: dict[str, Any]) -> str:
    return f"/missions/{mission['id']}"


@pytest.fixture
def content(tmp_path: Path) -> bytes:
    return writer.write(tmp_path / "Data.lsf.gz", writer.survey(PINGS)).read_bytes()


async def send(client: httpx.AsyncClient, path: str, content: Any, **query: Any) -> httpx.Response:
    return await client.post(f"{path}/logs", content=content, params={"filename": "Data.lsf.gz"} | query)


async def ended(client: httpx.AsyncClient, path: str, sent: httpx.Response) -> dict[str, Any]:
    """What became of a log that was sent."""
    assert sent.status_code == 202, sent.text
    found = sent.json()

    async def over() -> bool:
        found.update((await client.get(f"{path}/logs/{found['id']}")).json())
        return found["state"] in ENDED

    await until(over, "the log is read")
    return dict(found)


async def mapped(client: httpx.AsyncClient, path: str, soundings: int) -> None:
    """Wait until the map has so many soundings."""

    async def there() -> bool:
        answer = await client.get(f"{path}/map")
        return answer.status_code == 200 and sum(map(sum, answer.json()["count"])) == soundings

    await until(there, f"the map has {soundings} soundings")


async def lines(client: httpx.AsyncClient, path: str) -> list[dict[str, Any]]:
    events = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
    return [one for one in events if one["kind"] == "import"]


async def test_a_log_becomes_soundings_and_a_map_as_by_the_command(
    client: httpx.AsyncClient,
    path: str,
    content: bytes,
    tmp_path: Path,
    make_settings: Callable[..., Settings],
    database_url: str,
) -> None:
    log = await ended(client, path, await send(client, path, content))
    assert (log["state"], log["problem"], log["vehicle"], log["file"]) == ("done", "", writer.NAME, "Data.lsf.gz")
    assert log["read_bytes"] == log["size_bytes"] == len(content)
    assert (log["result"]["soundings"], log["result"]["rejected"], log["result"]["known"]) == (PINGS, 0, False)
    assert (await client.get(path)).json()["progress"]["soundings"] == PINGS
    await mapped(client, path, PINGS)
    shown = (await client.get(f"{path}/map")).json()
    assert 9.9 < shown["min_depth_m"] < shown["max_depth_m"] < 14.1
    (line_,) = await lines(client, path)
    assert line_["message"] == f"{PINGS} soundings from Data.lsf.gz, the log of {writer.NAME}"
    assert line_["data"]["sha256"] == log["sha256"]

    # The command gives another mission the same.
    other = (await client.post("/missions", json=mission_spec())).json()["id"]
    store = Database(database_url)
    beside = MissionService(make_settings(), store)
    file = tmp_path / "Data.lsf.gz"
    view = await import_log(await beside.get(other), beside.settings, file, actor="somebody at the console")
    await beside.shutdown()
    await store.close()
    assert view.model_dump(mode="json") == log["result"]
    (listed,) = (await client.get(f"/missions/{other}/logs")).json()
    assert (listed["result"], listed["actor"]) == (log["result"], "somebody at the console")
    assert (listed["read_bytes"], listed["size_bytes"]) == (None, None)
    assert (await client.get(f"/missions/{other}/logs/{listed['id']}")).json() == listed


async def test_the_casts_in_a_log_are_offered_and_count_when_they_are_added(
    client: httpx.AsyncClient, path: str, tmp_path: Path
) -> None:
    begin_s = writer.START_S + 60.0
    packets = [*writer.survey(PINGS), *writer.dive(begin_s, 12.0, 400)]
    content = writer.write(tmp_path / "Dive.lsf", packets).read_bytes()
    assert (await client.get(f"{path}/sound-speed/measured")).json() == []
    log = await ended(client, path, await send(client, path, content, filename="Dive.lsf"))
    assert log["state"] == "done", log
    (cast,) = (await client.get(f"{path}/sound-speed/measured")).json()
    assert (cast["vehicle"], cast["file"]) == (writer.NAME, "Dive.lsf")
    assert log["result"]["casts"] == [{name: cast[name] for name in cast if name not in ("vehicle", "file", "probe")}]
    depths, speeds = zip(*cast["profile"], strict=True)
    assert depths[0] < 1.0
    assert depths[-1] > 11.0
    assert speeds == pytest.approx([writer.sound_speed_mps(depth) for depth in depths], abs=0.05)
    assert cast["samples"] == pytest.approx(390, abs=10)
    assert datetime.fromisoformat(cast["time"]).timestamp() == pytest.approx(begin_s + 200.0, abs=20.0)
    assert cast["position"] == pytest.approx([-8.705, 41.185], abs=1e-3)
    assert (await client.get(f"{path}/corrections")).json()["sound_speed"] is None, "none counts by itself"
    added = {name: cast[name] for name in ("profile", "time", "position")} | {"name": "of the vehicle"}
    answer = await client.post(f"{path}/sound-speed/casts", json={"casts": [added]})
    assert answer.status_code == 200, answer.text
    # Who sends it again is told the same, and taken back it is offered no more.
    await ended(client, path, await send(client, path, content, filename="Dive.lsf"))
    assert len((await client.get(f"{path}/sound-speed/measured")).json()) == 1
    assert (await client.delete(f"{path}/logs/{log['id']}")).status_code == 200
    assert (await client.get(f"{path}/sound-speed/measured")).json() == []


@pytest.mark.slow
async def test_the_same_file_again_stores_nothing_and_another_run_lists_what_was_imported(
    make_settings: Callable[..., Settings], content: bytes
) -> None:
    settings = make_settings()
    async with running(settings) as server, make_client(server) as client:
        path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
        first = await ended(client, path, await send(client, path, content))
        again = await ended(client, path, await send(client, path, content))
        assert again["result"] == first["result"] | {"known": True}
        assert (await client.get(path)).json()["progress"]["soundings"] == PINGS
        assert len(await lines(client, path)) == 1
        # It is the same log unpacked.
        unpacked = gzip.decompress(content)
        plain = await ended(client, path, await send(client, path, unpacked, filename="Data.lsf"))
        assert plain["result"] == again["result"] | {"file": "Data.lsf"}
        # The same records in another file are known one by one.
        longer = unpacked + writer.announce(1.0)
        other = await ended(client, path, await send(client, path, longer, filename="longer.lsf"))
        assert (other["result"]["soundings"], other["result"]["duplicate"]) == (0, PINGS)
        assert [one["id"] for one in (await client.get(f"{path}/logs")).json()] == [
            one["id"] for one in (first, again, plain, other)
        ]
    async with running(settings) as server, make_client(server) as client:
        listed = (await client.get(f"{path}/logs")).json()
        assert [(one["id"], one["result"]) for one in listed] == [(one["id"], one["result"]) for one in (first, other)]


@pytest.mark.slow
async def test_a_real_log_of_dune_maps_the_relief_it_flew_over(client: httpx.AsyncClient, captures: Path) -> None:
    west, south, east, north = -8.7075, 41.1835, -8.7035, 41.1865
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    spec = mission_spec(area={"type": "Polygon", "coordinates": [ring]}, cell_m=5.0)
    path = f"/missions/{(await client.post('/missions', json=spec)).json()['id']}"
    content = (captures / "lauv-xplore-1.lsf.gz").read_bytes()
    log = await ended(client, path, await send(client, path, content))
    assert (log["vehicle"], log["result"]["soundings"], log["result"]["rejected"]) == ("lauv-xplore-1", 958, 0)
    assert log["result"]["refused"] == {}
    (cast,) = log["result"]["casts"]
    depths, speeds = zip(*cast["profile"], strict=True)
    assert depths[-1] > 16.0
    assert all(1490.0 < speed < 1515.0 for speed in speeds), "its simulated probe is as noisy as that"
    assert (await client.get(f"{path}/map")).json()["max_depth_m"] > 2.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gsf", "kmall"])
async def test_a_multibeams_file_gives_pings_of_the_vehicle_that_is_named(
    client: httpx.AsyncClient, path: str, tmp_path: Path, kind: str
) -> None:
    middle = LocalFrame(*(float(value) for value in FRAME.to_geographic(28.0, 28.0)))
    file = tmp_path / f"0007.{kind}"
    (write_kmall if kind == "kmall" else write_gsf)(file, line(middle))
    whole = file.read_bytes()
    unnamed = await send(client, path, whole, filename=file.name)
    assert unnamed.status_code == 422
    (error,) = unnamed.json()["errors"]
    assert (error["field"], error["message"]) == ("vehicle", f"0007.{kind} does not tell its vehicle's name")
    log = await ended(client, path, await send(client, path, whole, filename=file.name, vehicle="wam-v"))
    assert (log["problem"], log["vehicle"], log["result"]["pings"]) == ("", "wam-v", 12)
    assert (await client.get(path)).json()["progress"]["pings"] == 12
    # Of one that is cut off nothing is taken.
    cut = await ended(client, path, await send(client, path, whole[:-40], filename=file.name, vehicle="other"))
    assert (cut["state"], cut["result"]) == ("failed", None)
    assert cut["problem"]
    assert cut["remedy"]
    assert (await client.get(path)).json()["progress"]["pings"] == 12


@pytest.mark.slow
async def test_a_log_that_is_cut_off_is_used_up_to_there(client: httpx.AsyncClient, path: str, content: bytes) -> None:
    log = await ended(client, path, await send(client, path, content[: len(content) // 2]))
    assert log["state"] == "done"
    assert log["result"]["cut_off"]
    assert 0 < log["result"]["soundings"] < PINGS
    whole = await ended(client, path, await send(client, path, content))
    assert whole["result"]["soundings"] + whole["result"]["duplicate"] == PINGS


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "name", "words"),
    [
        (b"no log at all", "Data.lsf", "Data.lsf holds no IMC packet"),
        (gzip.compress(bytes(2**26)), "Data.lsf.gz", "Data.lsf.gz holds no IMC packet"),
        (b"\x1f\x8b" + bytes(100), "Data.lsf.gz", "Data.lsf.gz holds no IMC packet"),
        (b"".join([writer.entities(1.0), writer.announce(1.0)]), "Data.lsf", "Data.lsf holds no EstimatedState"),
        (b"\xfe\x54" * 500, "Data.lsf", "Data.lsf holds no"),
        (bytes(200), "a.gsf", ""),
        (b"\x18\0\0\0#MRZ" + bytes(200), "a.kmall", ""),
    ],
    ids=["text", "bomb", "broken gzip", "no states", "only sync words", "zeros", "no pings"],
)
async def test_what_is_no_log_is_refused_and_said_also_in_the_missions_log(
    client: httpx.AsyncClient, path: str, wrong: bytes, name: str, words: str
) -> None:
    vehicle = {} if "lsf" in name else {"vehicle": "a"}
    log = await ended(client, path, await send(client, path, wrong, filename=name, **vehicle))
    assert (log["state"], log["result"]) == ("failed", None)
    assert log["problem"].startswith(words)
    assert log["remedy"]
    assert (await client.get(path)).json()["progress"]["soundings"] == 0
    (said,) = await lines(client, path)
    assert (said["level"], said["message"]) == ("warning", f"the log {name} could not be imported: {log['problem']}")
    assert (await client.get(f"{path}/logs")).json() == [log]


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ({"filename": "a/b.lsf"}, "filename"),
        ({"vehicle": "two words"}, "vehicle"),
        ({"crs": "EPSG:4326"}, "crs"),
        ({}, "file"),
    ],
)
async def test_what_cannot_be_right_is_refused_at_once(
    client: httpx.AsyncClient, path: str, query: dict[str, str], field: str
) -> None:
    refused = await send(client, path, b"", **query)
    assert refused.status_code == 422, refused.text
    assert field in refused.json()["errors"][0]["field"]
    assert (await client.get(f"{path}/logs")).json() == []


async def test_pings_would_be_corrected_twice_in_a_mission_with_a_sound_speed(
    client: httpx.AsyncClient, path: str
) -> None:
    profile = {"assumed_mps": 1500, "profile": [[0, 1490]], "source": "cast"}
    assert (await client.put(f"{path}/sound-speed", json=profile)).status_code == 200
    refused = await send(client, path, b"x", filename="a.kmall", vehicle="a")
    assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, "sound_speed")
    assert (await client.get(f"{path}/logs/nothing")).status_code == 404


@pytest.mark.slow
async def test_a_running_mission_and_one_that_ended_take_what_was_recorded_on_board(
    client: httpx.AsyncClient, path: str, content: bytes, tmp_path: Path
) -> None:
    assert (await client.post(f"{path}/start")).status_code == 200
    await client.post(f"{path}/measurements", json={"items": soundings(5)})
    log = await ended(client, path, await send(client, path, content))
    assert (log["result"]["soundings"], (await client.get(path)).json()["state"]) == (PINGS, "running")
    await mapped(client, path, PINGS + 5)
    assert (await client.get(path)).json()["progress"]["soundings"] == PINGS + 5
    assert (await client.post(f"{path}/abort")).status_code == 200
    late = writer.write(tmp_path / "late.lsf", writer.survey(PINGS + 20)).read_bytes()
    log = await ended(client, path, await send(client, path, late, filename="late.lsf"))
    assert (log["result"]["soundings"], log["result"]["duplicate"]) == (20, PINGS)
    await mapped(client, path, PINGS + 25)


@pytest.mark.slow
async def test_a_connection_that_breaks_leaves_nothing(client: httpx.AsyncClient, path: str, content: bytes) -> None:
    async def half() -> AsyncIterator[bytes]:
        yield content[: len(content) // 2]
        raise httpx.WriteError("the cable is out")

    for _ in range(log_uploads.MAX_UNDER_WAY + 10):
        with pytest.raises(httpx.WriteError):
            await send(client, path, half())
    assert (await client.get(f"{path}/logs")).json() == []
    log = await ended(client, path, await send(client, path, content))
    assert log["result"]["soundings"] == PINGS


@pytest.mark.slow
async def test_a_process_that_breaks_off_leaves_what_can_be_gone_on_with(
    client: httpx.AsyncClient, path: str, content: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(log_process, "MAX_ITEM_BYTES", 1000)
        log = await ended(client, path, await send(client, path, content))
        assert log["state"] == "failed"
        assert log["problem"].startswith("the process that reads it broke off")
    log = await ended(client, path, await send(client, path, content))
    assert log["result"]["soundings"] == PINGS


@pytest.mark.slow
async def test_what_a_log_gave_before_its_reading_broke_off_is_on_the_map_of_a_mission_that_ended(
    client: httpx.AsyncClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = mission_spec(area=rectangle(0, 0, 30, 1900))
    path = f"/missions/{(await client.post('/missions', json=spec)).json()['id']}"
    assert (await client.post(f"{path}/start")).status_code == 200
    assert (await client.post(f"{path}/abort")).status_code == 200
    content = writer.write(tmp_path / "Data.lsf", writer.survey(2000)).read_bytes()
    read = log_process.ReadingProcess.next
    given: list[Any] = []

    async def one_only(process: log_process.ReadingProcess) -> Any:
        if given:
            raise log_process._broken_off()
        given.append(await read(process))
        return given[0]

    monkeypatch.setattr(log_process.ReadingProcess, "next", one_only)
    made: list[str] = []
    take_up = FinalMaps.take_up

    def noted(maps: FinalMaps, live: LiveMission) -> None:
        made.append(live.id)
        take_up(maps, live)

    monkeypatch.setattr(FinalMaps, "take_up", noted)
    log = await ended(client, path, await send(client, path, content, filename="Data.lsf"))
    assert log["state"] == "failed"
    stored = (await client.get(path)).json()["progress"]["soundings"]
    assert stored > 100
    assert made, "nobody has to ask for the map"
    await mapped(client, path, stored)


@pytest.mark.slow
async def test_a_log_is_not_taken_as_two_vehicles(client: httpx.AsyncClient, path: str, content: bytes) -> None:
    log = await ended(client, path, await send(client, path, content, vehicle="wrong"))
    assert (log["vehicle"], log["result"]["soundings"]) == ("wrong", PINGS)
    again = await ended(client, path, await send(client, path, content))
    assert (again["state"], again["result"]) == ("failed", None)
    assert again["problem"] == "the same file is in the mission as the log of wrong: its soundings would count twice"
    assert again["remedy"]
    assert (await client.get(path)).json()["progress"]["soundings"] == PINGS
    # Nor unpacked, nor packed otherwise.
    for other in (gzip.decompress(content), gzip.compress(gzip.decompress(content), 1)):
        refused = await ended(client, path, await send(client, path, other, vehicle="another"))
        assert refused["problem"] == again["problem"]
    same = await ended(client, path, await send(client, path, content, vehicle="wrong"))
    assert same["result"]["known"]


@pytest.mark.slow
async def test_a_vehicle_may_be_called_as_the_keys_of_pings_are(
    client: httpx.AsyncClient, path: str, content: bytes
) -> None:
    names = [f"{writer.NAME}-pings", f"{writer.NAME}-pings-0", "0"]
    other = gzip.decompress(content)
    for count, name in enumerate(names):
        # Each has a file of its own.
        file = other + writer.announce(1.0 + count)
        log = await ended(client, path, await send(client, path, file, vehicle=name))
        assert (log["state"], log["result"]["soundings"]) == ("done", PINGS)
        again = await ended(client, path, await send(client, path, file, vehicle=name))
        assert (again["problem"], again["result"]) == ("", log["result"] | {"known": True})


@pytest.mark.slow
async def test_a_service_that_ends_meanwhile_goes_on_with_the_file_when_it_comes_again(
    make_settings: Callable[..., Settings], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = writer.write(tmp_path / "Data.lsf", writer.survey(6000)).read_bytes()
    settings = make_settings()
    spec = mission_spec(area=rectangle(0, 0, 30, 1900))
    held = asyncio.Event()
    async with running(settings) as server, make_client(server) as client:
        path = f"/missions/{(await client.post('/missions', json=spec)).json()['id']}"
        read = log_process.ReadingProcess.next

        async def one_then_none(process: log_process.ReadingProcess) -> Any:
            if held.is_set():
                await asyncio.Event().wait()
            held.set()
            return await read(process)

        with monkeypatch.context() as patch:
            patch.setattr(log_process.ReadingProcess, "next", one_then_none)
            sent = await send(client, path, content, filename="Data.lsf")
            await until(held.is_set, "the first batch is read")

            async def stored() -> bool:
                return bool((await client.get(path)).json()["progress"]["soundings"])

            await until(stored, "it is stored")
            log = (await client.get(f"{path}/logs/{sent.json()['id']}")).json()
            assert log["state"] == "reading"
            assert 0 < log["read_bytes"] <= log["size_bytes"]
            twin = await send(client, path, content, filename="Data.lsf")
            assert twin.json()["id"] == log["id"], "it is under way already"
            server.stop()
    async with running(settings) as server, make_client(server) as client:
        assert (await client.get(f"{path}/logs")).json() == []
        log = await ended(client, path, await send(client, path, content, filename="Data.lsf"))
        assert log["result"]["soundings"] + log["result"]["rejected"] == 6000
        assert not log["result"]["known"]
        assert (await client.get(path)).json()["progress"]["soundings"] == log["result"]["soundings"]


@pytest.mark.slow
async def test_only_so_many_logs_wait_and_each_is_read_in_its_turn(
    client: httpx.AsyncClient, path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on = asyncio.Event()
    read = log_process.ReadingProcess.next

    async def wait_first(process: log_process.ReadingProcess) -> Any:
        await go_on.wait()
        return await read(process)

    monkeypatch.setattr(log_process.ReadingProcess, "next", wait_first)
    sent = []
    for count in range(1, log_uploads.MAX_UNDER_WAY + 1):
        file = writer.write(tmp_path / f"{count}.lsf", writer.survey(10 * count)).read_bytes()
        sent.append(await send(client, path, file, filename=f"{count}.lsf"))
    assert sent[-1].json()["state"] == "waiting"
    # One of them sent once more is answered as it was: it is under way.
    twin = await send(client, path, (tmp_path / "2.lsf").read_bytes(), filename="2.lsf")
    assert (twin.status_code, twin.json()["id"]) == (202, sent[1].json()["id"])
    like = (tmp_path / "2.lsf").read_bytes()
    other = await send(client, path, like[:-1] + bytes([like[-1] ^ 1]), filename="2.lsf")
    assert other.status_code == 503, "it is as large, and another one"
    refused = await send(client, path, b"x", filename="more.lsf")
    assert (refused.status_code, refused.json()["type"]) == (503, "urn:bathyfleet:problem:import-unavailable")
    assert refused.headers["Retry-After"]
    assert (await client.post(f"{path}/imports", content=prior_text(), params={"filename": "a.csv"})).status_code == 201
    go_on.set()
    found = [(await ended(client, path, one))["result"]["soundings"] for one in sent]
    assert found == [10] * len(sent), "each has ten more than the one before"


async def test_operators_send_logs_and_viewers_see_them(guarded: Guarded, content: bytes) -> None:
    path = await new_mission(guarded)
    client = guarded.client
    for role, status in (("viewer", 403), ("vehicle", 403), ("operator", 202)):
        headers = guarded.as_(role)
        asked = {"filename": "Data.lsf.gz"}
        sent = await client.post(f"{path}/logs", content=content, params=asked, headers=headers)
        assert sent.status_code == status, sent.text

    async def over() -> bool:
        listed = (await client.get(f"{path}/logs", headers=guarded.as_("viewer"))).json()
        return [one["state"] for one in listed] == ["done"]

    await until(over, "a viewer sees what came of it")
    entries = (await client.get("/audit", headers=guarded.as_("admin"))).json()
    assert [(one["actor"], one["result"]) for one in entries if one["action"] == "importLog"] == [
        ("the operator", "done"),
        ("the vehicle", "refused"),
        ("the viewer", "refused"),
    ]


async def test_a_file_that_is_too_large_is_refused(make_settings: Callable[..., Settings]) -> None:
    async with running(make_settings(max_import_bytes=2000)) as server, make_client(server) as client:
        path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
        answer = await send(client, path, b"1" * 2001)
        assert (answer.status_code, answer.json()["type"]) == (413, "urn:bathyfleet:problem:body-too-large")
        assert "max_import_bytes" in answer.json()["remedy"]


@pytest.mark.slow
async def test_other_requests_are_answered_while_a_log_is_read(client: httpx.AsyncClient, captures: Path) -> None:
    path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
    sent = await send(client, path, (captures / "lauv-xplore-1.lsf.gz").read_bytes())
    states: set[str] = set()
    while not states & set(ENDED):
        states.add((await client.get(f"{path}/logs/{sent.json()['id']}")).json()["state"])
        assert (await client.get("/health/live")).status_code == 200
    assert "reading" in states
