"""Vehicles with swath sonars over REST: pings in, and files of them out."""

import asyncio
import io
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import laspy
import numpy as np
import pyarrow.parquet as pq
import pytest

from app.main import Server
from app.missions.operations import measurements
from app.missions.pings import store
from app.settings import Settings
from app.storage.ping_files import PingFiles
from app.storage.upkeep.backup import back_up, restore_to
from tests.support.api.rest import make_client, mission_spec, running, soundings
from tests.support.missions.pings import posted_ping
from tests.support.storage.databases import Databases

VEHICLES = [{"name": "rover", "kind": "rest", "sensor": "multibeam"}, {"name": "plain", "kind": "rest"}]


@pytest.fixture
def settings(make_settings: Callable[..., Settings], tmp_path: Path) -> Settings:
    return make_settings(pings_url=str(tmp_path / "pings"))


@pytest.fixture
async def server(settings: Settings) -> AsyncIterator[Server]:
    async with running(settings) as server:
        yield server


@pytest.fixture
async def path(client: httpx.AsyncClient) -> str:
    answer = await client.post("/missions", json=mission_spec(vehicles=VEHICLES))
    assert answer.status_code == 201, answer.text
    return f"/missions/{answer.json()['id']}"


async def post(client: httpx.AsyncClient, path: str, items: list[Any], **headers: str) -> Any:
    answer = await client.post(f"{path}/measurements", json={"items": items}, headers=headers)
    assert answer.status_code == 200, answer.text
    return answer.json()


async def test_pings_are_accepted_beside_soundings_and_stored_once(client: httpx.AsyncClient, path: str) -> None:
    items = [posted_ping(0), soundings(1, "plain")[0], posted_ping(1, position_sd_m=0.5, roll_deg=2.0), posted_ping(0)]
    batch = await post(client, path, items)
    assert [item["verdict"] for item in batch["items"]] == ["accepted", "accepted", "accepted", "duplicate"]
    progress = (await client.get(path)).json()["progress"]
    assert (progress["pings"], progress["beams"], progress["soundings"]) == (2, 16, 1)
    again = await post(client, path, items)
    assert (again["accepted"], again["duplicate"], again["replayed"]) == (0, 4, False)
    metrics = (await client.get(str(client.base_url).replace("api/v1/", "metrics"))).text
    assert 'bathyfleet_pings_total{verdict="accepted"}' in metrics
    assert "bathyfleet_beams_total" in metrics


async def test_files_of_soundings_say_that_beams_are_elsewhere(client: httpx.AsyncClient, path: str) -> None:
    await post(client, path, [soundings(1, "plain")[0]])
    for file in ("csv", "xyz"):
        assert "pings" not in (await client.get(f"{path}/soundings.{file}")).text
    await post(client, path, [posted_ping(0), posted_ping(1)])
    for file in ("csv", "xyz"):
        lines = (await client.get(f"{path}/soundings.{file}")).text.splitlines()
        [told] = [line for line in lines if "pings" in line]
        assert told.startswith("#")
        assert "the beams of 2 pings of swath sonars are not among these: see pings" in told
        assert len([line for line in lines if not line.startswith("#")]) == (2 if file == "csv" else 1)


async def test_a_point_cloud_has_soundings_and_beams_as_they_are_corrected(
    client: httpx.AsyncClient, path: str
) -> None:
    async def cloud() -> laspy.LasData:
        answer = await client.get(f"{path}/soundings.laz")
        assert answer.status_code == 200, answer.text
        return laspy.read(io.BytesIO(answer.content))

    assert len((await cloud()).points) == 0
    [single] = soundings(1, "plain")
    await post(client, path, [single, posted_ping(0), posted_ping(1)])
    points = await cloud()
    source, z = np.asarray(points.point_source_id), np.asarray(points.z)
    assert [int((source == number).sum()) for number in (1, 2)] == [1, 16], "plain, rover"
    assert np.ptp(np.asarray(points.scan_angle)[source == 2]) > 0
    assert z[source == 1] == pytest.approx(-(single["depth_m"] + single["range_m"]), abs=0.002)
    assert (z[source == 2] < -1.0).all()
    tide = await client.put(f"{path}/tide", json={"level_m": 0.5, "source": "gauge"})
    assert tide.status_code == 200, tide.text
    assert np.asarray((await cloud()).z) == pytest.approx(z + 0.5, abs=0.002)


async def test_a_batch_whose_answer_was_lost_is_answered_again(client: httpx.AsyncClient, path: str) -> None:
    items = [posted_ping(number) for number in range(20)]
    key = {"Idempotency-Key": "line-1"}
    first = await post(client, path, items, **key)
    assert (first["accepted"], first["replayed"]) == (20, False)
    assert (await post(client, path, items, **key)) == first | {"replayed": True}
    items[3]["beams"]["ranges_m"][2] = 1.0
    other = await client.post(f"{path}/measurements", json={"items": items}, headers=key)
    assert other.status_code == 409
    assert (await client.get(path)).json()["progress"]["pings"] == 20


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"beams": {"angles_deg": [0.0, 1.0], "ranges_m": [5.0]}}, "angles_deg has 2 entries and ranges_m 1"),
        ({"beams": {"angles_deg": [], "ranges_m": []}}, "beams.angles_deg: List should have at least 1 item"),
        ({"beams": {"angles_deg": [0.0] * 1025, "ranges_m": [1.0] * 1025}}, "at most 1024"),
        (
            {"beams": {"angles_deg": [0.0, 90.0], "ranges_m": [1.0, 1.0]}},
            "beams.angles_deg.1: Input should be less th",
        ),
        ({"beams": {"angles_deg": [0.0], "ranges_m": ["far"]}}, "beams.ranges_m.0"),
        ({"beams": {"angles_deg": [0.0], "range_m": [1.0]}}, "did you mean ranges_m?"),
        ({"beams": [1.0, 2.0]}, "beams: "),
        ({"heading_deg": None}, "beams is given but heading_deg is not; expected both"),
        ({"range_m": 8.0}, "beams and range_m are given; expected beams without range_m"),
        ({"beam_off_nadir_deg": 8.0}, "beams and beam_off_nadir_deg are given"),
        ({"target": "tag", "target_range_m": 8.0}, "beams and target_range_m are given"),
        ({"vehicle": "plain"}, "beams: 'plain' has sensor single_beam; only vehicles with sensor multibeam send pings"),
        ({"vehicle": "stranger"}, "vehicle: 'stranger' takes no part in this mission"),
        ({"lat_deg": 41.2}, "outside the area"),
        ({"depth_m": -40.0}, "vehicle_depth_m: -40 is not between -2 and 11100"),
    ],
)
async def test_what_is_wrong_with_a_ping_is_said_and_spoils_no_other(
    client: httpx.AsyncClient, path: str, changes: dict[str, Any], said: str
) -> None:
    batch = await post(client, path, [posted_ping(0), posted_ping(1) | changes, posted_ping(2)])
    assert [item["verdict"] for item in batch["items"]] == ["accepted", "rejected", "accepted"]
    assert said in batch["items"][1]["reason"]
    assert (await client.get(path)).json()["progress"]["pings"] == 2


async def test_beams_without_a_range_are_no_beams(client: httpx.AsyncClient, path: str) -> None:
    beams = {"angles_deg": [-30.0, 0.0, 30.0, 45.0, 60.0], "ranges_m": [None, 0.0, 9.5, -1.0, 1e300]}
    batch = await post(client, path, [posted_ping() | {"beams": beams}])
    assert batch["accepted"] == 1
    progress = (await client.get(path)).json()["progress"]
    assert (progress["pings"], progress["beams"]) == (1, 1)


async def test_a_batch_of_many_beams_is_taken_and_of_too_many_refused_whole(
    client: httpx.AsyncClient, path: str
) -> None:
    many = [posted_ping(number, beams=1000) for number in range(300)]
    assert (await post(client, path, many))["accepted"] == 300
    answer = await client.post(f"{path}/measurements", json={"items": [*many, posted_ping(300)]})
    assert answer.status_code == 422
    problem = answer.json()["errors"][0]
    assert (problem["field"], problem["message"]) == ("items", "300008 beams are too many")
    assert str(measurements.MAX_BATCH_BEAMS) in problem["expected"]
    assert (await client.get(path)).json()["progress"]["beams"] == 300_000


async def test_files_of_pings_are_listed_and_sent(
    client: httpx.AsyncClient, path: str, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    empty = {"pings": 0, "beams": 0, "rejected": 0, "parts": []}
    assert (await client.get(f"{path}/pings")).json() == empty
    await post(client, path, [posted_ping(number) for number in range(6)])
    (part,) = (await client.get(f"{path}/pings")).json()["parts"]
    assert (part["number"], part["vehicle"], part["pings"], part["sha256"]) == (None, "rover", 6, None)
    monkeypatch.setattr(store, "CHUNK_PINGS", 8)
    far = posted_ping(7) | {"lat_deg": 41.2}
    await post(client, path, [posted_ping(6), far])
    for _ in range(200):
        listed = (await client.get(f"{path}/pings")).json()
        if listed["parts"][0]["number"] is not None:
            break
        await asyncio.sleep(0.02)
    (part,) = listed["parts"]
    assert (part["pings"], part["beams"], part["rejected"]) == (7, 56, 1)
    answer = await client.get(f"{path}/pings/{part['number']}")
    assert answer.headers["content-type"] == "application/vnd.apache.parquet"
    assert len(answer.content) == part["size_bytes"]
    table = pq.read_table(io.BytesIO(answer.content))
    assert table.num_rows == 8
    assert [bool(reason) for reason in table["reason"].to_pylist()] == [False] * 7 + [True]
    tag = {"If-None-Match": answer.headers["etag"]}
    assert (await client.get(f"{path}/pings/{part['number']}", headers=tag)).status_code == 304

    absent = await client.get(f"{path}/pings/99")
    assert (absent.status_code, absent.json()["type"]) == (404, "urn:bathyfleet:problem:pings-not-found")
    files = PingFiles(settings.pings_url)
    (name,) = files.names()
    files.write(name, answer.content[:-1])
    damaged = await client.get(f"{path}/pings/{part['number']}")
    assert (damaged.status_code, damaged.json()["type"]) == (500, "urn:bathyfleet:problem:pings-unreadable")
    assert name in damaged.json()["detail"]


async def test_pings_are_there_after_a_restart(settings: Settings) -> None:
    async with running(settings) as server, make_client(server) as client:
        mission = (await client.post("/missions", json=mission_spec(vehicles=VEHICLES))).json()
        path = f"/missions/{mission['id']}"
        await post(client, path, [posted_ping(number) for number in range(10)])
    async with running(settings) as server, make_client(server) as client:
        progress = (await client.get(path)).json()["progress"]
        assert (progress["pings"], progress["beams"]) == (10, 80)
        batch = await post(client, path, [posted_ping(number) for number in range(12)])
        assert (batch["duplicate"], batch["accepted"]) == (10, 2)
        parts = (await client.get(f"{path}/pings")).json()["parts"]
        assert [(part["pings"], part["number"] is None) for part in parts] == [(10, False), (2, True)]


@pytest.mark.slow
async def test_what_came_after_a_backup_is_still_in_the_database_that_a_restore_moved_aside(
    make_settings: Callable[..., Settings], databases: Databases, tmp_path: Path
) -> None:
    settings = make_settings(database_url=databases.fresh("sqlite"), pings_url=f"memory://{tmp_path.name}/pings")
    files, mission_path = PingFiles(settings.pings_url), ""

    async def pings(settings: Settings, *numbers: int) -> int:
        async with running(settings) as server, make_client(server) as client:
            await post(client, mission_path, [posted_ping(number) for number in numbers])
            listed = (await client.get(f"{mission_path}/pings")).json()
            for part in listed["parts"]:
                if part["number"] is not None:
                    assert (await client.get(f"{mission_path}/pings/{part['number']}")).status_code == 200
            return int(listed["pings"])

    async with running(settings) as server, make_client(server) as client:
        mission_path = (
            f"/missions/{(await client.post('/missions', json=mission_spec(vehicles=VEHICLES))).json()['id']}"
        )
        await post(client, mission_path, [posted_ping(0), posted_ping(1)])
    copy, _ = await asyncio.to_thread(back_up, settings.database_url, tmp_path / "copy.db", files)
    assert await pings(settings, 2, 3, 4) == 5
    _, aside = await asyncio.to_thread(restore_to, settings.database_url, copy, replace=True, pings=files)
    assert await pings(settings, 1) == 2
    before = settings.model_copy(update={"database_url": f"sqlite+aiosqlite:///{aside}"})
    assert await pings(before, 4) == 5
    assert await pings(settings, 1) == 2
