"""How well a survey agrees with itself, over REST: soundings and pings, corrected, from storage."""

import csv
import io

import httpx
import numpy as np
import pytest

from tests.support.api.rest import mission_spec, soundings
from tests.support.api.surveys import START_S, new_mission, post
from tests.support.mapping.tracks import DEPTH_M, flown, lawnmower, measured, pinged
from tests.support.missions.specs import FRAME

OFF_M = 0.3
"""How much too deep the second vehicle measures."""


@pytest.fixture
async def path(client: httpx.AsyncClient) -> str:
    """Main lines of one vehicle and a crossline of another one that measures too deep."""
    path = await new_mission(client, "rover", "scout")
    main = flown([(east + 2, north + 2) for east, north in lawnmower(56, 56, 8)], spacing_m=1.5, start_s=START_S)
    across = flown([(-2, 25.3), (62, 25.7)], spacing_m=1.5, start_s=START_S + 5000.0)
    await post(client, path, measured("rover", main) + measured("scout", across, DEPTH_M + OFF_M))
    return path


async def test_crossings_tell_which_vehicle_measures_too_deep(client: httpx.AsyncClient, path: str) -> None:
    answer = await client.get(f"{path}/crosslines")
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert (found["order"], found["version"]) == ("1a", (await client.get(f"{path}/map")).json()["version"])
    assert found["statistics"]["count"] == 8
    assert found["statistics"]["mean_m"] == pytest.approx(-OFF_M, abs=1e-6)
    assert found["statistics"]["within_pct"] == 100.0
    assert found["at_crosslines"] == found["statistics"]
    (pair,) = found["by_vehicles"]
    assert (pair["vehicles"], pair["count"]) == (["rover", "scout"], 8)
    (crossline,) = [line for line in found["by_line"] if line["crossline"]]
    assert (crossline["vehicle"], crossline["count"]) == ("scout", 8)
    assert crossline["mean_m"] == pytest.approx(OFF_M, abs=1e-6)
    assert found["crosslines"] == 1
    assert found["crosslines_km"] == pytest.approx(0.063, abs=0.001)
    assert found["crosslines_pct"] == pytest.approx(100 * 0.063 / found["length_km"], abs=0.2)
    assert sum(found["histogram"]["counts"]) == 8
    assert (found["beams"], found["by_angle"]) == (None, [])
    assert (found["left_off"], found["lines_left_off"], found["outliers"]) == (0, 0, 0)
    features = found["features"]["features"]
    assert len(features) == 8
    for feature in features:
        lon, lat = feature["geometry"]["coordinates"]
        assert (lat, lon) == (feature["properties"]["lat_deg"], feature["properties"]["lon_deg"])
        assert float(FRAME.to_local(lat, lon)[1]) == pytest.approx(25.5, abs=0.3)


async def test_an_order_that_asks_for_more_finds_outliers(client: httpx.AsyncClient, path: str) -> None:
    found = (await client.get(f"{path}/crosslines", params={"order": "special"})).json()
    assert (found["order"], found["outliers"]) == ("special", 8)
    assert found["statistics"]["within_pct"] == 0.0
    assert not found["features"]["features"][0]["properties"]["within"]


@pytest.mark.slow
async def test_an_answer_holds_until_something_is_measured_or_corrected(client: httpx.AsyncClient, path: str) -> None:
    answer = await client.get(f"{path}/crosslines")
    tag = {"If-None-Match": answer.headers["etag"]}
    assert (await client.get(f"{path}/crosslines", headers=tag)).status_code == 304
    assert (await client.get(f"{path}/crosslines", headers=tag, params={"order": "2"})).status_code == 200
    again = flown([(-2, 40.3), (62, 40.7)], spacing_m=1.5, start_s=START_S + 9000.0)
    await post(client, path, measured("scout", again, DEPTH_M))
    second = await client.get(f"{path}/crosslines", headers=tag)
    assert second.json()["statistics"]["count"] == 16
    before = second.json()["features"]["features"][0]["properties"]["depths_m"]
    tide = await client.put(f"{path}/tide", json={"level_m": 0.75, "source": "gauge", "datum_epsg": 5715})
    assert tide.status_code == 200, tide.text
    third = await client.get(f"{path}/crosslines", headers={"If-None-Match": second.headers["etag"]})
    after = third.json()["features"]["features"][0]["properties"]["depths_m"]
    assert after == pytest.approx([depth - 0.75 for depth in before])


@pytest.mark.slow
async def test_crossings_are_a_file(client: httpx.AsyncClient, path: str) -> None:
    listed = {product["name"]: product["href"] for product in (await client.get(f"{path}/products")).json()}
    assert listed["crossovers.csv"] == f"/api/v1{path}/crossovers.csv"
    file = await client.get(f"{path}/crossovers.csv", params={"order": "special"})
    assert 'filename="harbour-basin-crossovers.csv"' in file.headers["content-disposition"]
    rows = list(csv.DictReader(io.StringIO(file.text.partition("\n")[2])))
    assert len(rows) == 8
    assert {row["vehicle_2"] for row in rows} == {"scout"}
    assert all(float(row["difference_m"]) == pytest.approx(-OFF_M, abs=1e-3) for row in rows)


async def test_lines_are_a_file(client: httpx.AsyncClient, path: str) -> None:
    listed = {product["name"]: product["href"] for product in (await client.get(f"{path}/products")).json()}
    file = await client.get(listed["lines.csv"].removeprefix("/api/v1"), params={"order": "exclusive"})
    rows = list(csv.DictReader(io.StringIO(file.text.partition("\n")[2])))
    [cross] = [row for row in rows if row["kind"] == "cross"]
    assert (cross["vehicle"], cross["crossings"], cross["within_pct"]) == ("scout", "8", "0.0")
    assert float(cross["mean_difference_m"]) == pytest.approx(OFF_M, abs=1e-3)
    assert sum(row["kind"] == "main" and float(row["length_m"]) > 40.0 for row in rows) >= 8


async def test_beams_of_crosslines_tell_of_a_wrong_roll(client: httpx.AsyncClient) -> None:
    path = await new_mission(client, "rover", sensor="multibeam")
    main = [(east + 4, north + 2) for east, north in lawnmower(52, 56, 4)]
    await post(client, path, pinged("rover", flown(main, spacing_m=0.5, start_s=START_S)))
    across = flown([(1, 30.3), (59, 30.7)], spacing_m=0.5, start_s=START_S + 50_000.0)
    await post(client, path, pinged("rover", across, wrong_roll_deg=1.0))
    found = (await client.get(f"{path}/crosslines")).json()
    assert found["crosslines"] == 1
    assert found["statistics"]["count"] == 14
    assert found["statistics"]["max_m"] < 0.1
    by_angle = {(one["from_deg"] + one["to_deg"]) / 2: one for one in found["by_angle"]}
    port, middle, starboard = (by_angle[angle] for angle in (-40.0, 0.0, 40.0))
    assert abs(middle["mean_m"]) < 0.05
    expected_m = (DEPTH_M - 2.0) * np.tan(np.radians(40.0)) * np.radians(1.0)
    assert port["mean_m"] == pytest.approx(-expected_m, rel=0.35)
    assert starboard["mean_m"] == pytest.approx(expected_m, rel=0.35)
    assert found["beams"]["count"] == sum(one["count"] for one in found["by_angle"])
    assert found["beams"]["count"] > 500
    assert found["beams"]["within_pct"] == 100.0


async def test_a_mission_without_crossings_says_so(client: httpx.AsyncClient) -> None:
    path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
    early = await client.get(f"{path}/crosslines")
    assert (early.status_code, early.json()["type"]) == (404, "urn:bathyfleet:problem:map-not-ready")
    await post(client, path, soundings())
    found = (await client.get(f"{path}/crosslines")).json()
    assert (found["statistics"], found["normalised_rms"], found["by_vehicles"]) == (None, None, [])
    assert (found["lines"], found["crosslines"], found["crosslines_pct"]) == (1, 0, 0.0)
    file = await client.get(f"{path}/crossovers.csv")
    assert len(file.text.splitlines()) == 2
