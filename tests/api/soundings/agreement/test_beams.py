"""Beams of a multibeam, taken out of the map by an operator over REST and let in again."""

import asyncio
import io
import math
from typing import Any

import httpx
import laspy
import numpy as np
import pytest

from app.settings import Settings
from tests.support.api.rest import make_client, running
from tests.support.api.surveys import START_S, new_mission, post
from tests.support.mapping.school import (
    ANGLES,
    BOTTOM_M,
    FISH_AT,
    FISH_M,
    PINGS,
    SPIKE_BEAM,
    SPIKE_PING,
    surveyed,
)
from tests.support.missions.specs import lon_lat, rectangle


async def mission(client: httpx.AsyncClient, **more: Any) -> str:
    path = await new_mission(client, "rover", sensor="multibeam")
    await post(client, path, surveyed("rover", START_S, **more))
    return path


async def the_map(client: httpx.AsyncClient, path: str) -> list[Any]:
    found: list[Any] = (await client.get(f"{path}/map")).json()["depth_m"]
    return found


async def shoalest_m(client: httpx.AsyncClient, path: str) -> float:
    return float(np.nanmin(np.array(await the_map(client, path), dtype=float)))


async def points(client: httpx.AsyncClient, path: str, **selection: Any) -> dict[str, Any]:
    answer = await client.post(f"{path}/beams/points", json=selection)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def states(found: dict[str, Any]) -> dict[str, int]:
    names = [found["states"][k] for k in found["state"]]
    return {name: names.count(name) for name in set(names)}


async def ruled(client: httpx.AsyncClient, path: str, ruling: str, **body: Any) -> dict[str, Any]:
    answer = await client.post(f"{path}/beams/{ruling}", json=body)
    assert answer.status_code == 200, answer.text
    edit: dict[str, Any] = answer.json()
    return edit


IN_SCHOOL = {"area": rectangle(FISH_AT[0] - 1, FISH_AT[1] - 1, FISH_AT[2] + 1, FISH_AT[3] + 1), "most_depth_m": 9.0}


async def test_a_school_of_fish_is_taken_out_of_the_map_and_comes_back(settings: Settings) -> None:
    async with running(settings) as server, make_client(server) as client:
        path = await mission(client)
        before = await the_map(client, path)
        assert np.nanmin(np.array(before, dtype=float)) == pytest.approx(FISH_M, abs=0.05)
        edit = await ruled(client, path, "reject", selection=IN_SCHOOL, note="a school of fish")
        found = await points(client, path, **IN_SCHOOL)
        assert edit["beams"] == found["total"] > 20
        assert states(found) == {"withdrawn": edit["beams"]}
        assert (edit["vehicles"], edit["note"], edit["actor"]) == (["rover"], "a school of fish", "local operator")
        after = await the_map(client, path)
        assert await shoalest_m(client, path) == pytest.approx(BOTTOM_M, abs=0.05)
        log = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
        assert f"{edit['beams']} beams of rover rejected by local operator: a school of fish" in [
            line["message"] for line in log
        ]
    async with running(settings) as server, make_client(server) as client:
        listed = (await client.get(f"{path}/beams/edits")).json()
        assert listed == {"rejected": edit["beams"], "restored": 0, "edits": [edit]}, "it is kept"
        assert listed["edits"][0]["selection"]["most_depth_m"] == 9.0
        assert await the_map(client, path) == after
        undone = await client.delete(f"{path}/beams/edits/{edit['id']}")
        assert (undone.status_code, undone.json()) == (200, {"rejected": 0, "restored": 0, "edits": []})
        assert await the_map(client, path) == before, "bit for bit"
        again = await client.delete(f"{path}/beams/edits/{edit['id']}")
        assert (again.status_code, again.json()["type"]) == (404, "urn:bathyfleet:problem:beam-edit-not-found")


async def test_a_spike_that_is_a_mast_is_let_in_and_of_each_beam_the_last_word_counts(
    client: httpx.AsyncClient,
) -> None:
    path = await mission(client)
    shoal = await points(client, path, most_depth_m=5.0)
    assert states(shoal) == {"doubted": 1}
    assert (shoal["time_s"], shoal["beam"], shoal["vehicles"]) == ([START_S + SPIKE_PING], [SPIKE_BEAM], ["rover"])
    mast = {"vehicle": "rover", "time_s": shoal["time_s"][0], "beams": shoal["beam"]}
    without = np.array(await the_map(client, path), dtype=float)
    first = await ruled(client, path, "restore", pings=[mast])
    assert (first["beams"], first["selection"]) == (1, None)
    assert np.nanmax(without - np.array(await the_map(client, path), dtype=float)) > 0.5, "its cell is shoaler"
    assert states(await points(client, path, most_depth_m=5.0)) == {"restored": 1}
    second = await ruled(client, path, "reject", selection={"most_depth_m": 9.0})
    assert states(await points(client, path, most_depth_m=5.0)) == {"withdrawn": 1}
    listed = (await client.get(f"{path}/beams/edits")).json()
    assert (listed["rejected"], listed["restored"]) == (second["beams"], 0)
    await client.delete(f"{path}/beams/edits/{second['id']}")
    assert states(await points(client, path, most_depth_m=5.0)) == {"restored": 1}, "what was said before counts again"


async def test_a_word_is_of_beams_not_of_places_and_not_of_what_comes_later(client: httpx.AsyncClient) -> None:
    path = await mission(client)
    edit = await ruled(client, path, "reject", selection=IN_SCHOOL)
    assert (await client.put(f"{path}/tide", json={"level_m": 3.0})).status_code == 200
    assert await shoalest_m(client, path) == pytest.approx(BOTTOM_M - 3.0, abs=0.05), "the same beams are out"
    assert states(await points(client, path, most_depth_m=6.0)) == {"withdrawn": edit["beams"], "doubted": 1}
    await post(client, path, surveyed("rover", START_S, first=PINGS, pings=5))
    outer = await ruled(client, path, "reject", selection={"least_angle_deg": 44.9, "vehicle": "rover"})
    assert outer["beams"] == 4 * (PINGS + 5)
    await post(client, path, surveyed("rover", START_S, first=PINGS + 5, pings=5))
    late = await points(client, path, from_s=START_S + PINGS + 5, least_angle_deg=44.9)
    assert states(late) == {"used": 20}


async def test_no_file_and_no_figure_has_beams_that_were_taken_out(client: httpx.AsyncClient) -> None:
    path = await mission(client)

    async def shoal_points() -> int:
        answer = await client.get(f"{path}/soundings.laz")
        assert answer.status_code == 200, answer.text
        cloud = await asyncio.to_thread(laspy.read, io.BytesIO(answer.content))
        return int((np.array(cloud.z) > -9.0).sum())

    async def ensonified_pct() -> float:
        await the_map(client, path)
        return float((await client.get(path)).json()["progress"]["ensonified_pct"])

    assert await shoal_points() > 20
    before = await ensonified_pct()
    await ruled(client, path, "reject", selection=IN_SCHOOL)
    assert await shoal_points() == 0
    assert (await client.get(f"{path}/corrections")).json()["rejected_beams"] > 20
    # Behind the fish nobody has seen the bottom.
    assert await ensonified_pct() < before


async def test_of_many_beams_those_of_some_pings_are_shown(client: httpx.AsyncClient) -> None:
    path = await mission(client)
    every = await points(client, path)
    assert (every["total"], every["every"], len(every["lon_deg"])) == (PINGS * len(ANGLES), 1, PINGS * len(ANGLES))
    assert len(every["time_s"]) == len(every["vehicle"]) == PINGS
    some = await points(client, path, limit=250)
    assert (some["total"], some["every"]) == (PINGS * len(ANGLES), 4)
    assert len(some["depth_m"]) == 10 * len(ANGLES)
    assert some["time_s"] == every["time_s"][::4]
    few = await points(client, path, limit=3)
    assert (few["total"], few["beam"]) == (PINGS * len(ANGLES), [0, (len(ANGLES) - 1) // 2, len(ANGLES) - 1])
    assert few["time_s"] == every["time_s"][:1]
    middle = [k for k, beam in enumerate(every["beam"]) if beam == 10 and every["ping"][k] == 3]
    lon, lat = lon_lat(8.0, 30.0)
    assert every["lon_deg"][middle[0]] == pytest.approx(lon, abs=1e-7)
    assert every["lat_deg"][middle[0]] == pytest.approx(lat, abs=1e-7)
    assert math.isclose(every["depth_m"][middle[0]], BOTTOM_M, abs_tol=0.002)


PING = {"vehicle": "rover", "time_s": START_S, "beams": [0]}
SWAPPED = {"type": "Polygon", "coordinates": [[[y, x] for x, y in rectangle(0, 0, 9, 9)["coordinates"][0]]]}


@pytest.mark.parametrize(
    ("body", "status", "words"),
    [
        ({}, 422, "either by a selection or by pings"),
        ({"selection": {}}, 422, "states nothing"),
        ({"selection": IN_SCHOOL, "pings": [PING]}, 422, "give one of the two"),
        ({"selection": {"least_depth_m": 9.0, "most_depth_m": 3.0}}, 422, "swap them"),
        ({"selection": {"depth_m": 9.0}}, 422, "selection.depth_m"),
        ({"selection": {"area": SWAPPED}}, 422, "latitude and longitude look exchanged"),
        ({"selection": {"least_depth_m": 900.0}}, 409, "no beam is there"),
        ({"selection": {"vehicle": "stranger"}}, 409, "no beam is there"),
        ({"pings": [PING | {"beams": [len(ANGLES)]}]}, 409, "1 of 1 beams of rover are not there"),
        ({"pings": [PING, PING | {"time_s": START_S + 0.5}]}, 409, "1 of 2 beams of rover are not there"),
    ],
)
async def test_what_cannot_be_meant_is_refused_and_nothing_changes(
    client: httpx.AsyncClient, body: dict[str, Any], status: int, words: str
) -> None:
    path = await mission(client)
    answer = await client.post(f"{path}/beams/reject", json=body)
    assert answer.status_code == status, answer.text
    assert words in answer.text
    assert (await client.get(f"{path}/beams/edits")).json()["edits"] == []


async def test_points_of_an_area_that_is_far_away_are_refused_with_its_field(client: httpx.AsyncClient) -> None:
    path = await mission(client)
    answer = await client.post(f"{path}/beams/points", json={"area": SWAPPED})
    assert answer.status_code == 422, answer.text
    (fault,) = answer.json()["errors"]
    assert fault["field"] == "area"
    assert fault["expected"].startswith("latitude and longitude look exchanged, give latitude 41.1")


async def test_without_a_swath_sonar_there_are_no_beams(client: httpx.AsyncClient) -> None:
    path = await new_mission(client, "rover")
    answer = await client.post(f"{path}/beams/points", json={})
    assert answer.status_code == 409, answer.text
    assert "no swath sonar" in answer.text
