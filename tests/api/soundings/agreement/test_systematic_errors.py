"""What is always wrong is found, proposed, taken out by one call and put back by another, over REST."""

from typing import Any

import httpx
import numpy as np
import pytest

from app.settings import Settings
from tests.support.api.rest import make_client, running
from tests.support.api.surveys import START_S, new_mission, post
from tests.support.mapping.tracks import DEPTH_M, flown, lawnmower, measured, pinged

OFF_M = 0.3


async def found_in(client: httpx.AsyncClient, path: str) -> dict[str, Any]:
    answer = await client.get(f"{path}/systematic-errors")
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


async def depths(client: httpx.AsyncClient, path: str) -> np.ndarray:
    found = (await client.get(f"{path}/map")).json()
    known = np.array(found["sounded"], dtype=float) > 0 if "sounded" in found else None
    depth_m = np.array(found["depth_m"], dtype=float)
    return depth_m[known] if known is not None else depth_m[np.isfinite(depth_m)]


async def survey_with_an_offset(client: httpx.AsyncClient) -> str:
    path = await new_mission(client, "rover", "scout")
    main = flown([(east + 2, north + 2) for east, north in lawnmower(56, 56, 8)], spacing_m=1.5, start_s=START_S)
    for number, north in enumerate((10.3, 25.3, 40.3)):
        across = flown([(-2, north), (62, north + 0.4)], spacing_m=1.5, start_s=START_S + 1000.0 + 100.0 * number)
        await post(client, path, measured("scout", across, DEPTH_M + OFF_M))
    await post(client, path, measured("rover", main))
    return path


@pytest.mark.slow
async def test_a_vehicle_that_measures_too_deep_is_found_and_corrected_by_one_call(settings: Settings) -> None:
    async with running(settings) as server, make_client(server) as client:
        path = await survey_with_an_offset(client)
        found = await found_in(client, path)
        depth = {one["vehicle"]: one for one in found["errors"] if one["kind"] == "depth"}
        assert depth["scout"]["found"] == pytest.approx(OFF_M / 2, abs=0.02)
        assert depth["rover"]["found"] == pytest.approx(-OFF_M / 2, abs=0.02)
        assert all(one["proposed"] for one in depth.values())
        assert found["applied"] == {"vehicles": {}, "water_level": [], "source": ""}
        assert any("water level" in why for why in found["unknown"])

        corrected = await client.put(f"{path}/systematic-errors", json=found["proposal"])
        assert corrected.status_code == 200, corrected.text
        assert corrected.json()["systematic_errors"] == found["proposal"]
        statistics = (await client.get(f"{path}/crosslines")).json()["statistics"]
        assert statistics["max_m"] < 0.05
        assert (await found_in(client, path))["proposal"] is None
        log = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
        assert any("scout +0.1" in line["message"] for line in log if line["kind"] == "corrections")
    async with running(settings) as server, make_client(server) as client:
        assert (await found_in(client, path))["applied"] == found["proposal"], "it outlives the service"
        assert (await client.get(f"{path}/crosslines")).json()["statistics"]["max_m"] < 0.05
        undone = await client.delete(f"{path}/systematic-errors")
        assert undone.json()["systematic_errors"]["vehicles"] == {}
        again = (await client.get(f"{path}/crosslines")).json()["statistics"]
        assert again["mean_m"] == pytest.approx(-OFF_M, abs=1e-6)


async def test_a_sonar_that_is_mounted_askew_is_found_and_its_swaths_are_laid_flat(client: httpx.AsyncClient) -> None:
    path = await new_mission(client, "rover", sensor="multibeam")
    main = [(east + 4, north + 2) for east, north in lawnmower(52, 56, 4)]
    across = flown([(1, 30.3), (59, 30.7), (59, 12.7), (1, 12.3)], spacing_m=0.5, start_s=START_S + 2000.0)
    for way in (flown(main, spacing_m=0.5, start_s=START_S), across):
        await post(client, path, pinged("rover", way, wrong_roll_deg=1.0))
    found = await found_in(client, path)
    roll = next(one for one in found["errors"] if one["kind"] == "roll_offset")
    assert roll["proposed"], roll
    assert roll["found"] == pytest.approx(1.0, abs=0.15)
    assert not any(one["proposed"] for one in found["errors"] if one["kind"] == "sound_speed")
    before = np.abs(await depths(client, path) - DEPTH_M).max()
    assert (await client.put(f"{path}/systematic-errors", json=found["proposal"])).status_code == 200
    after = np.abs(await depths(client, path) - DEPTH_M).max()
    assert after < 0.25 * before


async def test_what_cannot_be_is_refused_and_nothing_changes(client: httpx.AsyncClient) -> None:
    path = await survey_with_an_offset(client)
    for body, field in (
        ({"vehicles": {"stranger": {"depth_m": 0.1}}}, "vehicles"),
        ({"vehicles": {"rover": {"depth_m": 100}}}, "vehicles.rover.depth_m"),
        ({"water_level": [[100.0, 0.1], [50.0, 0.1]]}, ""),
        ({"water_level": [[100.0, 99.0]]}, ""),
    ):
        refused = await client.put(f"{path}/systematic-errors", json=body)
        assert refused.status_code in (400, 422), refused.text
        assert field in refused.text
    assert (await found_in(client, path))["applied"]["vehicles"] == {}


async def test_a_level_that_is_given_is_taken_out_of_the_soundings_of_its_time(client: httpx.AsyncClient) -> None:
    path = await survey_with_an_offset(client)
    level = [[START_S, 0.0], [START_S + 500.0, 0.5]]
    answer = await client.put(f"{path}/systematic-errors", json={"water_level": level, "source": "gauge"})
    assert answer.status_code == 200, answer.text
    scout = (await client.get(f"{path}/crosslines")).json()["features"]["features"][0]["properties"]
    assert max(scout["depths_m"]) <= DEPTH_M
