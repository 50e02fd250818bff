"""A sonar's mounting, corrected after the survey over REST: everything is placed anew, and back bit for bit."""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.operations.imports import log_uploads
from app.missions.operations.imports.log_process import reading
from app.settings import Settings
from simulator.floors.terrain import Terrain
from simulator.sonars.mounting import SonarMounting
from simulator.sonars.swath import EXACT, SwathSonar, SwathSounder
from simulator.vehicles.vehicle import Motion
from tests.support.api.rest import make_client, running
from tests.support.api.surveys import CELL_M, SIDE_M, START_S, new_mission, post
from tests.support.mapping.multibeam import line, write_gsf
from tests.support.mapping.tracks import flown, lawnmower, measured
from tests.support.missions.specs import FRAME, lon_lat
from tests.support.waiting import until

WRONG = {"roll_deg": 2.0, "pitch_deg": -3.0, "heading_deg": 4.0, "latency_s": 0.4, "offset_m": [1.5, 0.5, 0.2]}
ALOFT_M = 20.0
"""The floor reaches so far beyond the area."""


def bumpy() -> Terrain:
    """A floor that slopes, with hills that no wrong angle leaves where they are."""
    at = np.arange(0.25, SIDE_M + 2 * ALOFT_M, 0.5) - ALOFT_M
    east, north = np.meshgrid(at, at)
    depth = 14.0 + 0.05 * east + 1.2 * np.sin(north / 5.0) * np.cos(east / 6.0)
    lon, lat = lon_lat(-ALOFT_M, -ALOFT_M)
    return Terrain(depth, 0.5, lat, lon)


def surveyed(vehicle: str, mounting: dict[str, Any]) -> list[dict[str, Any]]:
    """Pings along lines there and back, of a sonar that is really mounted so."""
    terrain = bumpy()
    real = SonarMounting(**mounting)
    sounder = SwathSounder(SwathSonar(aperture_deg=110.0, beams=41), EXACT, np.random.default_rng(0), real)
    corners = [(east + 4.0, north + 2.0) for east, north in lawnmower(SIDE_M - 8.0, SIDE_M - 4.0, 8.0)]
    way = flown(corners, spacing_m=0.5, start_s=START_S)
    time_s = way[:, 0]
    course = np.arctan2(np.gradient(way[:, 1]), np.gradient(way[:, 2]))
    late = [np.interp(time_s - real.latency_s, time_s, way[:, column]) for column in (1, 2)]
    items = []
    for number, heading in enumerate(course.tolist()):
        motion = Motion(way[number, 1] + ALOFT_M, way[number, 2] + ALOFT_M, 2.0, heading)
        ranges = sounder.ping(terrain, motion)
        lon, lat = lon_lat(float(late[0][number]), float(late[1][number]))
        place = {"lat_deg": lat, "lon_deg": lon, "depth_m": 2.0, "heading_deg": math.degrees(heading) % 360.0}
        beams = {
            "angles_deg": np.degrees(sounder.angles_rad).tolist(),
            "ranges_m": [None if math.isnan(one) else one for one in ranges.tolist()],
        }
        items.append({"vehicle": vehicle, "time_s": float(time_s[number]), "beams": beams} | place)
    return items


async def errors(client: httpx.AsyncClient, path: str) -> FloatArray:
    """Depths of the map's sounded cells minus those of the floor."""
    found = (await client.get(f"{path}/map")).json()
    depth = np.array(found["depth_m"], dtype=float)
    side = depth.shape[0]
    at = (np.arange(side) + 0.5) * CELL_M
    east, north = np.meshgrid(at, at)
    true = 14.0 + 0.05 * east + 1.2 * np.sin(north / 5.0) * np.cos(east / 6.0)
    off = depth - true
    return off[np.isfinite(off)]


async def the_map(client: httpx.AsyncClient, path: str) -> list[Any]:
    found: list[Any] = (await client.get(f"{path}/map")).json()["depth_m"]
    return found


async def corrections(client: httpx.AsyncClient, path: str) -> dict[str, Any]:
    found: dict[str, Any] = (await client.get(f"{path}/corrections")).json()
    return found


def rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean()))


@pytest.mark.slow
async def test_a_wrong_mounting_spoils_the_map_and_is_corrected_after_the_survey(settings: Settings) -> None:
    async with running(settings) as server, make_client(server) as client:
        path = await new_mission(client, "rover", sensor="multibeam")
        items = surveyed("rover", WRONG)
        for start in range(0, len(items), 200):
            await post(client, path, items[start : start + 200])
        before, spoiled = await the_map(client, path), rms(await errors(client, path))
        answer = await client.put(f"{path}/mountings/rover", json=WRONG | {"source": "patch test"})
        assert answer.status_code == 200, answer.text
        listed = answer.json()["mountings"]
        assert [one["vehicle"] for one in listed] == ["rover"]
        assert listed[0]["corrected"] == WRONG | {"source": "patch test"}
        assert listed[0]["stated"]["roll_deg"] == 0.0
        corrected, right = await the_map(client, path), rms(await errors(client, path))
        assert right < 0.12, "what is left is that of means over cells on slopes"
        assert spoiled > 3.0 * right, (spoiled, right)
        statement = (await corrections(client, path))["vertical_datum"]
        assert "mounting of rover: roll +2.00 degrees, pitch -3.00 degrees" in statement
        log = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
        lines = [line["message"] for line in log if line["kind"] == "corrections"]
        assert any("mounting of rover's sonar: roll +2.00" in line for line in lines)
    async with running(settings) as server, make_client(server) as client:
        assert (await corrections(client, path))["mountings"][0]["corrected"]["roll_deg"] == 2.0, "it is kept"
        np.testing.assert_allclose(np.array(await the_map(client, path), float), np.array(corrected, float), atol=0.02)
        undone = await client.delete(f"{path}/mountings/rover")
        assert undone.status_code == 200
        assert undone.json()["mountings"][0]["corrected"] is None
        assert await the_map(client, path) == before, "bit for bit"
        assert "mounting" not in undone.json()["vertical_datum"]


async def test_what_the_vehicle_states_counts_until_it_is_corrected(client: httpx.AsyncClient) -> None:
    path = await new_mission(client, "rover", mounting={"offset_m": [0.0, 0.0, 0.5]})
    await post(client, path, measured("rover", flown([(5, 5), (50, 50)], start_s=START_S)))
    assert await depths(client, path) == {10.0 + 2.5}
    assert (await client.put(f"{path}/mountings/rover", json={})).status_code == 200
    assert await depths(client, path) == {12.0}, "nothing is corrected: it was stated wrongly"
    assert (await client.delete(f"{path}/mountings/rover")).status_code == 200
    assert await depths(client, path) == {12.5}


async def depths(client: httpx.AsyncClient, path: str) -> set[float]:
    text = (await client.get(f"{path}/soundings.csv")).text
    head, *rows = text.partition("\n")[2].splitlines()
    at = head.split(",").index("depth_m")
    return {round(float(row.split(",")[at]), 6) for row in rows}


async def test_slanted_beams_and_late_positions_of_a_dvl_are_put_right_and_back(client: httpx.AsyncClient) -> None:
    path = await new_mission(client, "rover", sensor="dvl")
    items = []
    for item in measured("rover", flown([(5, 30), (50, 30)], start_s=START_S)):
        for beam, azimuth in enumerate((0.0, 90.0, 180.0, 270.0)):
            beams = {"beam": beam, "beam_off_nadir_deg": 22.5, "beam_azimuth_deg": azimuth, "heading_deg": 90.0}
            items.append(item | beams | {"range_m": 10.0})
    await post(client, path, items)
    before = (await client.get(f"{path}/soundings.csv")).text
    answer = await client.put(f"{path}/mountings/rover", json={"pitch_deg": 5.0, "latency_s": 0.5})
    assert answer.status_code == 200, answer.text
    rows = (await client.get(f"{path}/soundings.csv")).text.partition("\n")[2].splitlines()
    names, first = rows[0].split(","), rows[9].split(",")
    found = dict(zip(names, first, strict=True))
    assert found["beam"] == "0"
    assert float(found["depth_m"]) == pytest.approx(2.0 + 10.0 * math.cos(math.radians(27.5)), abs=1e-3)
    assert (await client.delete(f"{path}/mountings/rover")).status_code == 200
    assert (await client.get(f"{path}/soundings.csv")).text == before, "bit for bit"


@pytest.mark.parametrize(
    ("name", "body", "field"),
    [
        ("rover", {"roll_deg": 90.0}, "roll_deg"),
        ("rover", {"offset_m": [0.0, 0.0]}, "offset_m"),
        ("rover", {"yaw_deg": 1.0}, "yaw_deg"),
        ("stranger", {"roll_deg": 1.0}, "these do: rover"),
    ],
)
async def test_what_cannot_be_is_refused_and_nothing_changes(
    client: httpx.AsyncClient, name: str, body: dict[str, Any], field: str
) -> None:
    path = await new_mission(client, "rover")
    refused = await client.put(f"{path}/mountings/{name}", json=body)
    assert refused.status_code == (404 if name == "stranger" else 422), refused.text
    assert field in refused.text
    assert (await corrections(client, path))["mountings"][0]["corrected"] is None


async def test_a_vehicle_that_joins_brings_its_mounting(client: httpx.AsyncClient) -> None:
    path = await new_mission(client, "rover")
    late = {"name": "late", "kind": "rest", "mounting": {"offset_m": [0.0, 0.0, 1.0]}}
    answer = await client.post(f"{path}/vehicles", json=late)
    assert answer.status_code in (200, 201), answer.text
    await post(client, path, measured("late", flown([(5, 5), (50, 50)], start_s=START_S)))
    assert await depths(client, path) == {13.0}
    assert (await client.delete(f"{path}/vehicles/late")).status_code == 200
    changed = await client.post(f"{path}/vehicles", json=late | {"mounting": {}})
    assert changed.status_code == 409, changed.text
    assert "mountings/late" in changed.text
    assert (await client.post(f"{path}/vehicles", json=late)).status_code in (200, 201)


async def sent(client: httpx.AsyncClient, path: str, content: bytes, vehicle: str) -> dict[str, Any]:
    """What became of a GSF file."""
    answer = await client.post(f"{path}/logs", content=content, params={"filename": "a.gsf", "vehicle": vehicle})
    assert answer.status_code == 202, answer.text
    found: dict[str, Any] = answer.json()

    async def over() -> bool:
        found.update((await client.get(f"{path}/logs/{found['id']}")).json())
        return found["state"] in ("done", "failed")

    await until(over, "the file is read")
    return found


async def test_beams_that_came_placed_are_not_placed_again(client: httpx.AsyncClient, tmp_path: Path) -> None:
    path = await new_mission(client, "rover", "other", sensor="multibeam")
    lat, lon = FRAME.to_geographic(30.0, 30.0)
    pings = line(LocalFrame(float(lat), float(lon)))
    content = await asyncio.to_thread(write_gsf, tmp_path / "a.gsf", pings)
    assert (await client.put(f"{path}/mountings/rover", json={"roll_deg": 1.0})).status_code == 200
    refused = await client.post(f"{path}/logs", content=content, params={"filename": "a.gsf", "vehicle": "rover"})
    assert refused.status_code == 422, refused.text
    assert "mountings/rover" in refused.text
    assert (await client.put(f"{path}/mountings/rover", json={})).status_code == 200
    assert (await sent(client, path, content, "rover"))["state"] == "done"
    refused = await client.put(f"{path}/mountings/rover", json={"roll_deg": 1.0})
    assert refused.status_code == 422, refused.text
    assert "a.gsf" in refused.text
    assert (await client.delete(f"{path}/mountings/rover")).status_code == 200, "nothing is stated: nothing to apply"
    assert (await client.put(f"{path}/mountings/other", json={"roll_deg": 1.0})).status_code == 200


async def test_a_mounting_is_refused_while_a_file_is_read_whose_beams_come_placed(
    client: httpx.AsyncClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, go_on = asyncio.Event(), asyncio.Event()

    @asynccontextmanager
    async def late(*arguments: Any) -> AsyncIterator[Any]:
        begun.set()
        await go_on.wait()
        async with reading(*arguments) as process:
            yield process

    monkeypatch.setattr(log_uploads, "reading", late)
    path = await new_mission(client, "rover", "other", sensor="multibeam")
    lat, lon = FRAME.to_geographic(30.0, 30.0)
    content = await asyncio.to_thread(write_gsf, tmp_path / "a.gsf", line(LocalFrame(float(lat), float(lon))))
    sending = asyncio.create_task(sent(client, path, content, "rover"))
    await begun.wait()
    refused = await client.put(f"{path}/mountings/rover", json={"roll_deg": 1.0})
    assert refused.status_code == 422, refused.text
    assert "a.gsf" in refused.text
    assert (await client.post(f"{path}/mountings/rover/estimate")).status_code == 409
    assert (await client.put(f"{path}/mountings/other", json={"roll_deg": 1.0})).status_code == 200
    go_on.set()
    assert (await sending)["state"] == "done"
