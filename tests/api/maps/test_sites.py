"""Sites over REST: one map of several missions' depths, and what changed between them."""

import csv
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pyogrio
import pyproj
import pytest
import rasterio
import shapely
from PIL import Image

from app.settings import Settings
from tests.support.api.rest import Guarded, make_client, mission_spec, running
from tests.support.missions.specs import lon_lat, rectangle
from tests.support.waiting import until

SIDE_M = 24.0
SITE: dict[str, Any] = {"name": "Harbour mouth", "area": rectangle(0, 0, SIDE_M, SIDE_M), "cell_m": 2.0}
PIT_M = (6.0, 16.0)
CELLS = 12
"""Along each side."""
START_S = 1_600_000_000.0
DAY_S = 86_400.0
SD_M = 0.05


def floor(east: float, north: float, pit_m: float) -> float:
    dredged = pit_m if PIT_M[0] <= min(east, north) and max(east, north) < PIT_M[1] else 0.0
    return 12.0 + 0.03 * east - 0.02 * north + dredged


def soundings(
    start_s: float, *, pit_m: float = 0.0, seed: int = 0, north_to_m: float = SIDE_M, off_m: float = 0.0
) -> list[dict[str, Any]]:
    """One sounding in each square of two metres, to and fro."""
    rng = np.random.default_rng(seed)
    items: list[dict[str, Any]] = []
    for number, north in enumerate(np.arange(1.0, north_to_m, 2.0)):
        for east in np.arange(1.0, SIDE_M, 2.0)[:: -1 if number % 2 else 1]:
            lon, lat = lon_lat(east, north)
            depth = floor(east, north, pit_m) + off_m + SD_M * rng.standard_normal()
            place = {"lat_deg": lat, "lon_deg": lon, "depth_m": 2.0, "range_m": depth - 2.0, "range_sd_m": SD_M}
            items.append({"vehicle": "rover", "time_s": start_s + len(items), **place})
    return items


def box(west: float, south: float, east: float, north: float) -> dict[str, Any]:
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    return {"type": "Polygon", "coordinates": [ring]}


async def new_site(client: httpx.AsyncClient, **changes: Any) -> str:
    answer = await client.post("/sites", json=SITE | changes)
    assert answer.status_code == 201, answer.text
    assert answer.headers["Location"] == f"/api/v1/sites/{answer.json()['id']}"
    return str(answer.json()["id"])


async def new_mission(client: httpx.AsyncClient, site: str | None, **changes: Any) -> str:
    body = mission_spec(area=SITE["area"], cell_m=2.0, site=site) | changes
    answer = await client.post("/missions", json=body)
    assert answer.status_code == 201, answer.text
    return str(answer.json()["id"])


async def post(client: httpx.AsyncClient, mission: str, items: list[dict[str, Any]]) -> None:
    answer = await client.post(f"/missions/{mission}/measurements", json={"items": items})
    assert (answer.status_code, answer.json()["rejected"]) == (200, 0), answer.text


async def surveyed(client: httpx.AsyncClient, site: str | None, start_s: float, **floor_: Any) -> str:
    """A mission that has measured and ended."""
    mission = await new_mission(client, site, name=f"Survey of {start_s:.0f}")
    await post(client, mission, soundings(start_s, **floor_))
    assert (await client.post(f"/missions/{mission}/abort")).status_code == 200
    return mission


async def get(client: httpx.AsyncClient, path: str, **query: Any) -> Any:
    answer = await client.get(path, params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()


def array(layer: list[list[float | None]]) -> Any:
    return np.array(layer, dtype=float)


def pit() -> Any:
    """Which cells of the site were dredged."""
    centre = np.arange(1.0, SIDE_M, 2.0)
    within = (centre >= PIT_M[0]) & (centre < PIT_M[1])
    return within[:, None] & within[None, :]


@pytest.mark.slow
async def test_a_dredged_pit_is_found_and_nothing_else(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    first = await surveyed(client, site, START_S, seed=1)
    known = await get(client, f"/sites/{site}/map")
    assert known["known_pct"] == 100.0
    assert [one["mission_id"] for one in known["surveys"]] == [first]
    before = array(known["depth_m"])

    second = await new_mission(client, site)
    (prior,) = await get(client, f"/missions/{second}/imports")
    assert (prior["site"], prior["taken"]) == (site, CELLS**2)
    begins = await get(client, f"/missions/{second}/map")
    np.testing.assert_allclose(array(begins["depth_m"]), before, atol=0.1)
    assert sum(map(sum, begins["count"])) == 0

    await post(client, second, soundings(START_S + 30 * DAY_S, seed=2, pit_m=1.0))
    assert (await client.post(f"/missions/{second}/abort")).status_code == 200
    found = await get(client, f"/sites/{site}/changes")
    assert (found["earlier"]["mission_id"], found["later"]["mission_id"]) == (first, second)
    assert found["compared_m2"] == SIDE_M**2
    dug_m3 = float(pit().sum()) * 4.0
    lost = found["lost"]
    assert abs(lost["m3"] - dug_m3) < 2.0 * lost["sd_m3"]
    assert lost["m3"] == pytest.approx(dug_m3, rel=0.3)
    assert found["net"]["m3"] == pytest.approx(-dug_m3, abs=2.0 * found["net"]["sd_m3"])
    assert found["largest_m"] == pytest.approx(1.0, abs=0.4)

    said, *lines = (await client.get(f"/sites/{site}/changes.csv")).text.splitlines()
    assert said.startswith(f"# depths: positive down, from {found['vertical_datum']}; a positive difference")
    rows = list(csv.DictReader(lines))
    assert len(rows) == CELLS**2
    significant = np.array([row["significant"] == "1" for row in rows]).reshape(CELLS, CELLS)
    deeper = np.array([float(row["difference_m"]) for row in rows]).reshape(CELLS, CELLS) > 0
    assert significant[pit()].mean() > 0.9
    assert deeper[pit()].all()
    assert significant[~pit()].mean() < 0.12, "ground that did not change is hardly called changed"
    assert found["significant_pct"] == pytest.approx(100.0 * significant.mean(), abs=0.01)

    model = await get(client, f"/sites/{site}/map")
    depth, count = array(model["depth_m"]), np.array(model["count"])
    truth = np.array([[floor(e, n, 1.0) for e in np.arange(1.0, SIDE_M, 2)] for n in np.arange(1.0, SIDE_M, 2)])
    assert np.abs(depth - truth)[pit()].mean() < 0.15, "where it was dredged only the newer survey counts"
    assert (count[pit()] == 1).mean() > 0.9
    assert (count[~pit()] == 2).mean() > 0.85
    assert {number for row in model["survey"] for number in row} == {1}

    listed = await get(client, f"/sites/{site}/surveys")
    assert [(one["mission_id"], one["state"], one["share_pct"]) for one in listed] == [
        (first, "aborted", 100.0),
        (second, "aborted", 100.0),
    ]
    assert listed[0]["changed_pct"] is None
    assert listed[1]["changed_pct"] == pytest.approx(100.0 * pit().mean() + 5.0, abs=6.0)
    assert listed[1]["ended_at"].startswith("2020-10-13")
    same = await get(client, f"/sites/{site}/changes", **{"from": second, "to": first})
    assert same["gained"] == lost, "the other way round it is filled"


@pytest.mark.slow
async def test_files_hold_what_the_answers_say(client: httpx.AsyncClient) -> None:
    site = await new_site(client, yearly_change_m=0.1)
    await surveyed(client, site, START_S, north_to_m=12.0)
    await surveyed(client, site, START_S + 365.25 * DAY_S, pit_m=-0.8)
    known = await get(client, f"/sites/{site}/map")
    content = (await client.get(f"/sites/{site}/map.tif")).content
    with rasterio.MemoryFile(content) as memory, memory.open() as file:
        assert file.descriptions == ("depth", "sd", "age", "survey", "surveys")
        depth, sd, age = (np.where(file.read(i) == file.nodata, np.nan, file.read(i))[::-1] for i in (1, 2, 3))
    np.testing.assert_allclose(depth, array(known["depth_m"]), atol=2e-3)
    np.testing.assert_allclose(sd, array(known["sd_m"]), atol=2e-3)
    assert 0 < np.nanmin(age) < 366 * 20
    changes = (await client.get(f"/sites/{site}/changes.tif")).content
    with rasterio.MemoryFile(changes) as memory, memory.open() as file:
        assert file.descriptions == ("difference", "sd", "significance", "significant")
        difference = np.where(file.read(1) == file.nodata, np.nan, file.read(1))[::-1]
    assert np.isfinite(difference).sum() * 4.0 == (await get(client, f"/sites/{site}/changes"))["compared_m2"]
    assert np.nanmin(difference) == pytest.approx(-0.8, abs=0.4)
    for path, begins in (("map.png", b"\x89PNG"), ("changes.png", b"\x89PNG"), ("map.xyz", b"# east_m")):
        answer = await client.get(f"/sites/{site}/{path}")
        assert (answer.status_code, answer.content[: len(begins)]) == (200, begins)
    picture = Image.open(io.BytesIO((await client.get(f"/sites/{site}/changes.png")).content))
    assert picture.size == (CELLS, CELLS)
    found = await get(client, f"/sites/{site}/changes")
    largest = max(abs(found["least_m"]), abs(found["largest_m"]))
    assert 0.8 * largest <= found["last_colour_m"] <= largest
    missing = await client.get(f"/sites/{site}/map.shp")
    assert (missing.status_code, missing.json()["type"]) == (404, "urn:bathyfleet:problem:format-not-found")


@pytest.mark.parametrize("crs", [None, "utm"])
async def test_a_site_is_had_as_a_bag(client: httpx.AsyncClient, crs: str | None) -> None:
    site = await new_site(client)
    await surveyed(client, site, START_S)
    known = await get(client, f"/sites/{site}/map")
    answer = await client.get(f"/sites/{site}/map.bag", params={} if crs is None else {"crs": crs})
    assert answer.status_code == 200, answer.text
    with rasterio.MemoryFile(answer.content, ext=".bag") as memory, memory.open() as file:
        assert file.driver == "BAG"
        elevation, sd = (np.where(file.read(i) == file.nodata, np.nan, file.read(i))[::-1] for i in (1, 2))
        assert file.count == 2, "no numbers of soundings: a site counts surveys"
    assert np.nanmin(-elevation) >= known["min_depth_m"] - 0.01
    assert np.nanmax(-elevation) <= known["max_depth_m"] + 0.01
    if crs is None:
        np.testing.assert_allclose(-elevation, array(known["depth_m"]), atol=2e-3)
        np.testing.assert_allclose(sd, array(known["sd_m"]), atol=2e-3)


async def test_contours_of_a_site_are_at_its_depths(client: httpx.AsyncClient, tmp_path: Path) -> None:
    site = await new_site(client)
    await surveyed(client, site, START_S)
    known = await get(client, f"/sites/{site}/map")
    lines = (await get(client, f"/sites/{site}/map.geojson"))["features"]
    depths = {line["properties"]["depth_m"] for line in lines}
    assert depths
    assert known["min_depth_m"] <= min(depths) <= max(depths) <= known["max_depth_m"]
    kml = await client.get(f"/sites/{site}/map.kml")
    assert "<name>Harbour mouth</name>" in kml.text
    (path := tmp_path / "own.dxf").write_bytes((await client.get(f"/sites/{site}/map.dxf")).content)
    drawn = shapely.from_wkb(pyogrio.raw.read(path)[2])
    assert {round(-float(z), 6) for z in np.unique(shapely.get_coordinates(drawn, include_z=True)[:, 2])} == depths
    answer = await client.get(f"/sites/{site}/map.dxf", params={"crs": "utm"})
    assert answer.headers["Content-Disposition"] == 'attachment; filename="harbour-mouth-epsg32629.dxf"'
    (path := tmp_path / "utm.dxf").write_bytes(answer.content)
    west, south, east, north = pyogrio.read_info(path, force_total_bounds=True)["total_bounds"]
    corners = pyproj.Transformer.from_crs(4326, 32629).transform(*np.array(known["corners"]).T[::-1])
    assert min(corners[0]) <= west < east <= max(corners[0])
    assert min(corners[1]) <= south < north <= max(corners[1])


async def test_a_site_is_had_in_a_grid_that_others_know(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    await surveyed(client, site, START_S)
    known = await get(client, f"/sites/{site}/map")
    content = (await client.get(f"/sites/{site}/map.tif", params={"crs": "EPSG:32629"})).content
    with rasterio.MemoryFile(content) as memory, memory.open() as file:
        assert pyproj.CRS(file.crs.to_wkt()).sub_crs_list[0].to_epsg() == 32629
        depth = np.where(file.read(1) == file.nodata, np.nan, file.read(1))
    assert np.nanmin(depth) == pytest.approx(known["min_depth_m"], abs=2e-3), "the shoalest is in it"
    assert np.nanmax(depth) <= known["max_depth_m"] + 2e-3
    text = (await client.get(f"/sites/{site}/map.xyz", params={"crs": "utm"})).text
    assert "easting_m northing_m" in text.splitlines()[0]
    for file_, crs, says in (
        ("map.tif", "utm29", "'utm29' is neither utm nor EPSG: and a code"),
        ("map.tif", "EPSG:32755", "EPSG:32755"),
        ("map.png", "utm", "png is not made in utm"),
    ):
        refused = await client.get(f"/sites/{site}/{file_}", params={"crs": crs})
        assert (refused.status_code, refused.json()["type"]) == (422, "urn:bathyfleet:problem:invalid-request")
        assert says in refused.text


async def test_what_nobody_measured_stays_unknown(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    empty = await client.get(f"/sites/{site}/map")
    assert (empty.status_code, empty.json()["type"]) == (404, "urn:bathyfleet:problem:map-not-ready")
    await surveyed(client, site, START_S, north_to_m=8.0)
    known = await get(client, f"/sites/{site}/map")
    depth = array(known["depth_m"])
    assert np.isfinite(depth[:4]).all()
    assert np.isnan(depth[10:]).all()
    assert np.array_equal(np.isfinite(depth), np.isfinite(array(known["sd_m"])))
    assert known["known_pct"] == pytest.approx(100.0 * np.isfinite(depth).mean(), abs=0.01)
    assert (await client.get(f"/sites/{site}/changes")).status_code == 404


async def test_older_surveys_are_less_certain_where_the_operator_says_so(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    await surveyed(client, site, START_S)
    as_it_was = array((await get(client, f"/sites/{site}/map"))["sd_m"])
    changed = await client.patch(f"/sites/{site}", json={"yearly_change_m": 0.5, "name": "Old mouth"})
    assert (changed.status_code, changed.json()["name"], changed.json()["cell_m"]) == (200, "Old mouth", 2.0)
    known = await get(client, f"/sites/{site}/map")
    grown = array(known["sd_m"])
    age_years = (np.datetime64(known["at"][:19]) - np.datetime64("2020-09-13T12:29:03")) / np.timedelta64(1, "s")
    age_years /= 365.25 * DAY_S
    np.testing.assert_allclose(grown**2 - as_it_was**2, 0.25 * age_years, rtol=0.01)
    coarse = await client.patch(f"/sites/{site}", json={"cell_m": 4.0})
    assert coarse.status_code == 200
    known = await get(client, f"/sites/{site}/map")
    assert (known["rows"], known["known_pct"]) == (6, 100.0)
    refused = await client.patch(f"/sites/{site}", json={"cell_m": 0.001})
    assert (refused.status_code, "cells" in refused.text) == (422, True)


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"cell_m": 0.001}, "cell_m", "make cell_m larger"),
        ({"cell_m": 900.0}, "cell_m", "enlarge it"),
        ({"area": box(0.0, 0.0, 5.0, 5.0)}, "area", "choose a smaller one"),
        ({"area": box(-179.99, 0.0, 179.99, 0.01)}, "area", "the part on each side"),
    ],
)
async def test_a_site_that_cannot_be_is_refused_with_its_field(
    client: httpx.AsyncClient, changes: dict[str, Any], field: str, words: str
) -> None:
    site = await new_site(client)
    for answer in (
        await client.post("/sites", json=SITE | changes),
        await client.patch(f"/sites/{site}", json=changes),
    ):
        assert answer.status_code == 422, answer.text
        (fault,) = answer.json()["errors"]
        assert (fault["field"], words in fault["expected"]) == (field, True), fault


async def test_a_site_stays_where_its_missions_are(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    mission = await new_mission(client, site)
    elsewhere = {"area": box(10.0, 10.0, 10.001, 10.001)}
    refused = await client.patch(f"/sites/{site}", json=elsewhere)
    assert refused.status_code == 422, refused.text
    (fault,) = refused.json()["errors"]
    assert (fault["field"], mission in fault["message"]) == ("area", True)
    assert (await get(client, f"/sites/{site}"))["area"] == SITE["area"]
    assert (await client.put(f"/missions/{mission}/site", json={"site": None})).status_code == 200
    assert (await client.patch(f"/sites/{site}", json=elsewhere)).status_code == 200


async def test_a_mission_counts_once_and_as_it_is_corrected_later(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    mission = await surveyed(client, site, START_S)
    before = array((await get(client, f"/sites/{site}/map"))["depth_m"])
    answer = await client.put(f"/missions/{mission}/tide", json={"level_m": 1.5, "source": "gauge"})
    assert answer.status_code == 200, answer.text
    after = await get(client, f"/sites/{site}/map")
    np.testing.assert_allclose(array(after["depth_m"]), before - 1.5, atol=0.05)
    assert after["vertical_datum"].startswith("EPSG:5861")
    assert np.array(after["count"]).max() == 1

    (worst,) = (await get(client, f"/missions/{mission}/soundings", state="used", limit=1))["items"]
    ruled = await client.post(f"/missions/{mission}/soundings/{worst['id']}/reject")
    assert ruled.status_code == 200, ruled.text
    listed = await get(client, f"/sites/{site}/surveys")
    assert [one["soundings"] for one in listed] == [CELLS**2 - 1]


@pytest.mark.slow
async def test_surveys_below_another_datum_are_not_mixed(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    first = await surveyed(client, site, START_S)
    second = await surveyed(client, site, START_S + DAY_S)
    assert (await client.put(f"/missions/{second}/tide", json={"level_m": 1.0})).status_code == 200
    listed = await get(client, f"/sites/{site}/surveys")
    assert [("another datum" in one["left_out"]) for one in listed] == [True, False]
    known = await get(client, f"/sites/{site}/map")
    assert [one["mission_id"] for one in known["surveys"]] == [second]
    refused = await client.get(f"/sites/{site}/changes")
    assert (refused.status_code, refused.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")
    words = refused.json()["detail"]
    assert words.startswith("no two of these surveys have depths below one datum: ")
    assert words.count("below instantaneous water level") == words.count("below EPSG:5861") == 1
    assert (await client.put(f"/missions/{first}/tide", json={"level_m": 1.0})).status_code == 200
    assert (await client.get(f"/sites/{site}/changes")).status_code == 200


@pytest.mark.slow
async def test_the_newest_surveys_below_one_datum_are_compared_and_others_named(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    missions = [await surveyed(client, site, START_S + day * DAY_S) for day in range(4)]
    for corrected in (0, 2):
        answer = await client.put(f"/missions/{missions[corrected]}/tide", json={"level_m": 1.0})
        assert answer.status_code == 200, answer.text

    async def compared(**asked: str) -> tuple[list[int], list[str]]:
        found = await get(client, f"/sites/{site}/changes", **asked)
        ends = [missions.index(found[end]["mission_id"]) for end in ("earlier", "later")]
        return ends, [note for note in found["notes"] if "is left out" in note]

    ends, notes = await compared()
    assert (ends, len(notes)) == ([1, 3], 1)
    assert "its depths are below EPSG:5861" in notes[0]
    ends, notes = await compared(to=missions[2])
    assert (ends, len(notes)) == ([0, 2], 1), "what came later than the one asked for is not named"
    ends, notes = await compared(**{"from": missions[0]})
    assert (ends, len(notes)) == ([0, 2], 2)
    assert await compared(**{"from": missions[3], "to": missions[1]}) == ([3, 1], [])
    apart = {"from": missions[0], "to": missions[1]}
    assert (await client.get(f"/sites/{site}/changes", params=apart)).status_code == 409
    newest = await client.get(f"/sites/{site}/changes", params={"from": missions[3]})
    assert (newest.status_code, newest.json()["errors"][0]["field"]) == (422, "to")
    oldest = await client.get(f"/sites/{site}/changes", params={"to": missions[0]})
    assert oldest.status_code == 404


async def test_a_mission_that_begins_with_depths_below_another_datum_is_told_so(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    first = await surveyed(client, site, START_S)
    tide = {"level_m": 1.0, "source": "gauge"}
    assert (await client.put(f"/missions/{first}/tide", json=tide)).status_code == 200
    second = await new_mission(client, site)
    (prior,) = await get(client, f"/missions/{second}/imports")
    assert [note for note in prior["notes"] if "below another datum" in note and "EPSG:5861" in note]
    told = (await client.get(f"/missions/{second}/events", headers={"Accept": "application/json"})).json()
    assert [line for line in told if "below another datum" in line["message"] and line["level"] == "warning"]

    third = await new_mission(client, site, tide=tide)
    (prior,) = await get(client, f"/missions/{third}/imports")
    assert not [note for note in prior["notes"] if "datum" in note]
    assert (await client.put(f"/missions/{second}/tide", json=tide)).status_code == 200
    assert (await client.put(f"/missions/{second}/site", json={"site": site})).status_code == 200
    (prior,) = await get(client, f"/missions/{second}/imports")
    assert not [note for note in prior["notes"] if "datum" in note]


async def test_a_mission_may_begin_without_the_depths_of_its_site_or_join_it_later(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    old = await surveyed(client, None, START_S)
    assert (await get(client, f"/sites/{site}"))["missions"] == 0
    draft = await new_mission(client, site)
    plain = await new_mission(client, site, site_prior=False)
    assert await get(client, f"/missions/{draft}/imports") == []

    joined = await client.put(f"/missions/{old}/site", json={"site": site})
    assert (joined.status_code, joined.json()["spec"]["site"]) == (200, site)
    assert (await get(client, f"/sites/{site}/map"))["known_pct"] == 100.0
    assert (await get(client, f"/sites/{site}"))["surveys"] == 1
    assert await get(client, f"/missions/{draft}/imports") == [], "it takes up what is known when it starts"
    later = await new_mission(client, site)
    (prior,) = await get(client, f"/missions/{later}/imports")
    kept = await client.delete(f"/missions/{later}/imports/{prior['id']}")
    assert (kept.status_code, "site_prior" in kept.json()["remedy"]) == (409, True)
    assert await get(client, f"/missions/{plain}/imports") == []

    refused = await client.delete(f"/sites/{site}")
    assert (refused.status_code, "1 surveys" in refused.json()["detail"]) == (409, True)
    for mission in (old, draft, plain, later):
        assert (await client.put(f"/missions/{mission}/site", json={"site": None})).status_code == 200
    assert await get(client, f"/missions/{later}/imports") == []
    assert (await client.delete(f"/sites/{site}")).status_code == 204
    assert (await client.get(f"/sites/{site}")).json()["type"] == "urn:bathyfleet:problem:site-not-found"


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"site": "none"}, "site"),
        ({"area": rectangle(5000, 0, 5040, 40)}, "area"),
    ],
)
async def test_a_mission_has_to_be_of_a_site_that_is_there(
    client: httpx.AsyncClient, changes: dict[str, Any], field: str
) -> None:
    site = await new_site(client)
    body = mission_spec(area=SITE["area"], site=site) | changes
    answer = await client.post("/missions", json=body)
    assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, field)
    assert (await get(client, f"/sites/{site}"))["missions"] == 0


@pytest.mark.slow
async def test_changes_of_missions_that_are_not_there_are_refused_by_name(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    first = await surveyed(client, site, START_S, seed=1)
    running_ = await new_mission(client, site)
    await surveyed(client, site, START_S, seed=2)
    assert (await get(client, f"/sites/{site}/changes"))["compared_m2"] > 0, "though both end at the same moment"
    for query, status, word in (
        ({"from": "nobody"}, 422, "no mission of the site"),
        ({"to": running_}, 404, "no depth yet"),
        ({"from": first, "to": first}, 422, "the same survey"),
        ({"confidence": 1.0}, 422, "confidence"),
    ):
        answer = await client.get(f"/sites/{site}/changes", params=query)
        assert (answer.status_code, word in answer.text) == (status, True), answer.text


async def test_a_site_and_its_surveys_outlive_the_service(make_settings: Callable[..., Settings]) -> None:
    async with running(make_settings()) as server, make_client(server) as client:
        site = await new_site(client)
        await surveyed(client, site, START_S)
        first = await get(client, f"/sites/{site}/map")
    async with running(make_settings()) as server, make_client(server) as client:
        again = await get(client, f"/sites/{site}/map")
        assert (again["depth_m"], again["surveys"]) == (first["depth_m"], first["surveys"])


async def test_who_may_look_may_not_change(guarded: Guarded) -> None:
    client = guarded.client
    for role, statuses in (("viewer", (403, 200)), ("operator", (201, 200))):
        headers = guarded.as_(role)
        made = await client.post("/sites", json=SITE, headers=headers)
        assert (made.status_code, (await client.get("/sites", headers=headers)).status_code) == statuses
    site = made.json()["id"]
    viewer = guarded.as_("viewer")
    assert (await client.patch(f"/sites/{site}", json={"name": "x"}, headers=viewer)).status_code == 403
    assert (await client.delete(f"/sites/{site}", headers=viewer)).status_code == 403
    assert (await client.get(f"/sites/{site}/surveys", headers=viewer)).json() == []
    assert (await client.get("/sites")).status_code == 401


@pytest.mark.slow
async def test_two_processes_tell_the_same_of_a_site(make_settings: Callable[..., Settings]) -> None:
    settings = make_settings()
    async with (
        running(settings) as one,
        running(settings) as two,
        make_client(one) as at_one,
        make_client(two) as at_two,
    ):
        site = await new_site(at_one)
        mission = await surveyed(at_one, site, START_S)
        first = await get(at_one, f"/sites/{site}/map")
        other = await get(at_two, f"/sites/{site}/map")
        assert (other["depth_m"], other["surveys"]) == (first["depth_m"], first["surveys"])

        # Corrected by the other one, which sends that on.
        corrected = await at_two.put(f"/missions/{mission}/tide", json={"level_m": 2.0})
        assert corrected.status_code == 200, corrected.text

        async def corrected_there() -> bool:
            answer = await at_two.get(f"/sites/{site}/map")
            return answer.status_code == 200 and bool(
                np.allclose(array(answer.json()["depth_m"]), array(first["depth_m"]) - 2.0, atol=0.05)
            )

        # The process that has the mission maps it anew without being asked.
        await until(corrected_there, "the site's map is that of corrected depths")
        begun = await new_mission(at_two, site)
        assert len(await get(at_two, f"/missions/{begun}/imports")) == 1


async def test_soundings_that_come_after_the_end_count_as_well(client: httpx.AsyncClient) -> None:
    site = await new_site(client)
    mission = await surveyed(client, site, START_S, north_to_m=12.0)
    before = (await get(client, f"/sites/{site}/map"))["known_pct"]
    late = soundings(START_S)[len(soundings(START_S, north_to_m=12.0)) :]
    await post(client, mission, late)
    assert (await get(client, f"/sites/{site}/map"))["known_pct"] == 100.0 > before
    assert len(await get(client, f"/sites/{site}/surveys")) == 1
