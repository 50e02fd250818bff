"""What swath sonars missed, over REST."""

import io
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import h5py
import httpx
import numpy as np
import pytest
import shapely

from app.settings import Settings
from tests.support.api.rest import mission_spec, soundings
from tests.support.missions.specs import FRAME, lon_lat, rectangle

SIDE_M, CELL_M, DEPTH_M = 60.0, 2.0, 10.0
HOLE = shapely.box(10.0, 20.0, 18.0, 26.0)
"""Four by three cells."""
ROVER = [{"name": "rover", "kind": "rest", "sensor": "multibeam"}]


@pytest.fixture
def settings(make_settings: Callable[..., Settings], tmp_path: Path) -> Settings:
    return make_settings(pings_url=str(tmp_path / "pings"))


@pytest.fixture
async def path(client: httpx.AsyncClient) -> str:
    area = rectangle(0, 0, SIDE_M, SIDE_M)
    answer = await client.post("/missions", json=mission_spec(area=area, cell_m=CELL_M, vehicles=ROVER))
    assert answer.status_code == 201, answer.text
    return f"/missions/{answer.json()['id']}"


def pings(places_m: Iterable[tuple[float, float]], start_s: float) -> list[dict[str, Any]]:
    """A ping over each place, whose beams all meet the bottom within its cell."""
    items = []
    for number, (east_m, north_m) in enumerate(places_m):
        lon, lat = lon_lat(east_m, north_m)
        beams = {"angles_deg": [-5.0, 0.0, 5.0], "ranges_m": [8.03, 8.0, 8.03]}
        place = {"lat_deg": lat, "lon_deg": lon, "depth_m": DEPTH_M - 8.0, "heading_deg": 90.0}
        items.append({"vehicle": "rover", "time_s": start_s + 0.2 * number, "beams": beams} | place)
    return items


def centres() -> list[tuple[float, float]]:
    along = np.arange(CELL_M / 2, SIDE_M, CELL_M).tolist()
    return [(east, north) for north in along for east in along]


def in_hole(place_m: tuple[float, float]) -> bool:
    return bool(shapely.contains_xy(HOLE, *place_m))


async def post(client: httpx.AsyncClient, path: str, items: list[dict[str, Any]]) -> None:
    answer = await client.post(f"{path}/measurements", json={"items": items})
    assert answer.status_code == 200, answer.text
    assert answer.json()["accepted"] == len(items)


async def test_exactly_the_ground_that_was_missed_is_a_holiday_until_it_is_filled(
    client: httpx.AsyncClient, path: str
) -> None:
    await post(client, path, pings((place for place in centres() if not in_hole(place)), 1_795_225_140.0))
    answer = await client.get(f"{path}/holidays")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/geo+json")
    found = answer.json()
    (feature,) = found["features"]
    properties = feature["properties"]
    assert (properties["number"], properties["area_m2"]) == (1, pytest.approx(HOLE.area))
    assert FRAME.to_local(properties["lat_deg"], properties["lon_deg"]) == pytest.approx((14.0, 23.0), abs=0.01)
    outline = shapely.transform(
        shapely.geometry.shape(feature["geometry"]),
        lambda at: np.column_stack(FRAME.to_local(at[:, 1], at[:, 0])),
    )
    assert outline.symmetric_difference(HOLE).area < 0.05
    assert found["version"] == (await client.get(f"{path}/map")).json()["version"]
    tag = {"If-None-Match": answer.headers["etag"]}
    assert (await client.get(f"{path}/holidays", headers=tag)).status_code == 304
    mission = (await client.get(path)).json()
    assert mission["progress"]["holidays"] == 1
    assert mission["vehicles"][0]["swath_m"] == pytest.approx([0.7, 0.7], abs=0.01)

    await post(client, path, pings(filter(in_hole, centres()), 1_795_235_140.0))
    again = (await client.get(f"{path}/holidays", headers=tag)).json()
    assert (again["type"], again["features"]) == ("FeatureCollection", [])
    assert again["version"] > found["version"]
    progress = (await client.get(path)).json()["progress"]
    assert (progress["holidays"], progress["ensonified_pct"]) == (0, 100.0)


async def test_holidays_are_a_file_of_missions_with_swath_sonars(client: httpx.AsyncClient, path: str) -> None:
    await post(client, path, pings((place for place in centres() if not in_hole(place)), 1_795_225_140.0))
    listed = {product["name"]: product["href"] for product in (await client.get(f"{path}/products")).json()}
    assert listed["holidays.geojson"] == f"/api/v1{path}/holidays.geojson"
    file = await client.get(f"{path}/holidays.geojson")
    assert 'filename="harbour-basin-holidays.geojson"' in file.headers["content-disposition"]
    assert file.json() == (await client.get(f"{path}/holidays")).json()


async def test_the_density_of_swaths_is_a_layer_by_classes(client: httpx.AsyncClient, path: str) -> None:
    places = [place for place in centres() if not in_hole(place)]
    await post(client, path, [*pings(places, 1_795_225_140.0), *pings(places[:30], 1_795_235_140.0)])
    cells = np.array((await client.get(f"{path}/map", params={"layer": "density"})).json()["layers"]["density"])
    assert cells.shape == (30, 30)
    assert (cells[10:13, 5:9] == 0).all()
    assert (cells[0] == 2).all(), "six soundings each"
    assert np.bincount(cells.astype(int).ravel()).tolist() == [12, 900 - 12 - 30, 30]
    (layer,) = [one for one in (await client.get("/layers")).json() if one["name"] == "density"]
    assert len(layer["classes"]) == 3


async def test_a_mission_without_swath_sonars_says_so(client: httpx.AsyncClient, path: str) -> None:
    early = await client.get(f"{path}/holidays")
    assert (early.status_code, early.json()["type"]) == (404, "urn:bathyfleet:problem:map-not-ready")
    plain = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
    await client.post(f"{plain}/measurements", json={"items": soundings()})
    for address in (f"{plain}/holidays", f"{plain}/holidays.geojson"):
        answer = await client.get(address)
        assert (answer.status_code, answer.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")
        assert "multibeam" in answer.json()["remedy"]
    refused = await client.get(f"{plain}/map", params={"layer": "density"})
    assert (refused.status_code, "swath" in refused.json()["detail"]) == (422, True)
    products = (await client.get(f"{plain}/products")).json()
    assert "holidays.geojson" not in {product["name"] for product in products}
    assert (await client.get(plain)).json()["vehicles"][0]["swath_m"] is None


async def test_a_chart_surface_claims_full_coverage_where_nothing_was_missed(
    client: httpx.AsyncClient, path: str
) -> None:
    async def record() -> Any:
        answer = await client.get(f"{path}/map.s102")
        assert answer.status_code == 200, answer.text
        with h5py.File(io.BytesIO(answer.content)) as file:
            (found,) = file["QualityOfBathymetryCoverage/featureAttributeTable"][:]
        return found

    await client.put(f"{path}/tide", json={"level_m": 0.5, "source": "gauge"})
    twice = [place for place in centres() for _ in range(2)]
    await post(client, path, pings((place for place in twice if not in_hole(place)), 1_795_225_140.0))
    first = await record()
    assert (first["fullSeafloorCoverageAchieved"], first["bathyCoverage"]) == (0, 0)
    await post(client, path, pings((place for place in twice if in_hole(place)), 1_795_325_140.0))
    last = await record()
    assert (last["fullSeafloorCoverageAchieved"], last["bathyCoverage"]) == (1, 1)
    assert (last["surveyDateRange.dateStart"], last["surveyDateRange.dateEnd"]) == (b"20261121", b"20261122")
