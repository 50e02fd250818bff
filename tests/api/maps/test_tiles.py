"""The map as tiles, over REST."""

import asyncio
from typing import Any

import httpx
import numpy as np
import pytest

from tests.support.api.rest import mission_spec, soundings
from tests.support.mapping.gis import mosaic, picture_of, tile_of

LAYERS = ("depth", "uncertainty", "density", "coverage")
LAT, LON = 41.18515, -8.70480


@pytest.fixture
async def tiles(client: httpx.AsyncClient, mission: dict[str, Any]) -> str:
    """Path of the tiles of a mission that has a map."""
    path = f"/missions/{mission['id']}"
    await client.post(f"{path}/measurements", json={"items": soundings(12)})
    await client.get(f"{path}/map", timeout=200)
    return f"{path}/tiles"


def address(layer: str, zoom: int = 19, lat: float = LAT, lon: float = LON, suffix: str = "") -> str:
    x, y = tile_of(lat, lon, zoom)
    return f"/{layer}/{zoom}/{x}/{y}{suffix}.png"


@pytest.mark.parametrize("layer", LAYERS)
async def test_tilejson_leads_to_tiles_that_fit_each_other(client: httpx.AsyncClient, tiles: str, layer: str) -> None:
    tilejson = (await client.get(f"{tiles}/{layer}.json")).json()
    assert (tilejson["tilejson"], tilejson["scheme"]) == ("3.0.0", "xyz")
    whole, (x, y) = await mosaic(client, tilejson, 19)
    for zoom in (20, 21):
        finer, (fine_x, fine_y) = await mosaic(client, tilejson, zoom)
        scale = 2 ** (zoom - 19)
        left, top = 256 * (fine_x - x * scale), 256 * (fine_y - y * scale)
        rows, cols = (np.arange(256 * n) for n in (finer.shape[0] // 256, finer.shape[1] // 256))
        same = whole[np.ix_((rows + top) // scale, (cols + left) // scale)]
        assert (same == finer).all(axis=-1).mean() > 0.95, "but for the edges of cells"
    double, _ = await mosaic(client, tilejson, 19, "@2x")
    assert double.shape == (2 * whole.shape[0], 2 * whole.shape[1], 4)
    assert (double[::2, ::2] == whole).all(axis=-1).mean() > 0.97
    assert 0 < (whole[..., 3] > 0).mean() < 1


async def test_coarse_tiles_show_the_mission_as_a_dot(client: httpx.AsyncClient, tiles: str) -> None:
    for zoom, most in ((0, 4), (5, 4), (13, 40), (15, 500)):
        picture = picture_of(await client.get(tiles + address("depth", zoom)))
        assert (zoom >= 13) <= (picture[..., 3] > 0).sum() <= most
    beside = picture_of(await client.get(tiles + address("depth", 19, LAT + 1.0)))
    assert not beside.any()


async def test_colours_stay_while_the_map_grows(client: httpx.AsyncClient, tiles: str) -> None:
    path = tiles.removesuffix("/tiles")
    before = (await client.get(f"{tiles}/depth.json")).json()
    first = await client.get(tiles + address("density", 19))
    for header in ({"If-None-Match": first.headers["etag"]}, {"If-None-Match": "*"}):
        again = await client.get(tiles + address("density", 19), headers=header)
        assert (again.status_code, again.content) == (304, b"")
    assert first.headers["cache-control"].startswith("private, max-age=")
    more = [item | {"lon_deg": item["lon_deg"] + 0.0001} for item in soundings(5, start_s=1_795_229_000.0)]
    await client.post(f"{path}/measurements", json={"items": more})
    async with asyncio.timeout(30):
        while True:
            later = await client.get(tiles + address("density", 19), headers={"If-None-Match": first.headers["etag"]})
            if later.status_code == httpx.codes.OK:
                break
            await asyncio.sleep(0.1)
    old, new = picture_of(first), picture_of(later)
    assert (new[old[..., 3] > 0] == old[old[..., 3] > 0]).all()
    assert (new[..., 3] > 0).sum() > (old[..., 3] > 0).sum()
    assert (await client.get(f"{tiles}/depth.json")).json() == before


async def test_a_range_of_ones_own_colours(client: httpx.AsyncClient, tiles: str) -> None:
    tilejson = (await client.get(f"{tiles}/uncertainty.json", params={"min": 100, "max": 200})).json()
    assert tilejson["range"] == [100.0, 200.0]
    picture, _ = await mosaic(client, tilejson, 19)
    shown = picture[picture[..., 3] > 0]
    assert len(np.unique(shown, axis=0)) == 1
    deeper = picture_of(await client.get(tiles + address("depth"), params={"max": 10}))
    usual = picture_of(await client.get(tiles + address("depth")))
    assert deeper[..., :3].mean() < usual[..., :3].mean()


@pytest.mark.parametrize(
    ("path", "field"),
    [
        ("/depth/25/0/0.png", "z"),
        ("/depth/2/4/0.png", "x"),
        ("/depth/2/0/4.png", "y"),
        ("/depth/2/0/-1.png", "y"),
        ("/depth/2/0/1@3x.png", "y"),
        ("/bogus/2/0/1.png", "layer"),
        ("/bogus.json", "layer"),
        ("/depth.json?min=5&max=5", "max"),
        ("/density.json?min=1", "min"),
        ("/depth/2/0/1.png?max=-3", "max"),
    ],
)
async def test_what_there_is_not_is_refused(
    client: httpx.AsyncClient, mission: dict[str, Any], path: str, field: str
) -> None:
    answer = await client.get(f"/missions/{mission['id']}/tiles{path}")
    assert (answer.status_code, answer.json()["type"]) == (422, "urn:bathyfleet:problem:invalid-request")
    assert [fault["field"] for fault in answer.json()["errors"]] == [field]


async def test_before_the_first_sounding_everything_is_transparent(
    client: httpx.AsyncClient, mission: dict[str, Any]
) -> None:
    for layer in LAYERS:
        assert not picture_of(await client.get(f"/missions/{mission['id']}/tiles{address(layer)}")).any()
    assert (await client.get("/missions/none/tiles/depth/0/0/0.png")).status_code == httpx.codes.NOT_FOUND


@pytest.mark.slow
async def test_soundings_of_a_running_mission_show_within_seconds(client: httpx.AsyncClient) -> None:
    answer = await client.post("/missions", json=mission_spec(vehicles=[{"name": "rover", "kind": "rest"}], steps=5))
    path = f"/missions/{answer.json()['id']}"
    await client.post(f"{path}/measurements", json={"items": [soundings(1)[0] | {"time_s": 1_795_225_000.0}]})
    assert (await client.post(f"{path}/start")).status_code == httpx.codes.OK
    await client.post(f"{path}/measurements", json={"items": soundings(12)})
    began = asyncio.get_running_loop().time()
    async with asyncio.timeout(60):
        while not picture_of(await client.get(f"{path}/tiles{address('density', 19)}")).any():  # noqa: ASYNC110 - as GIS do
            await asyncio.sleep(0.1)
    assert asyncio.get_running_loop().time() - began < 30
    await client.post(f"{path}/abort")
