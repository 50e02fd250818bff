"""The map as JSON, picture and files."""

import io
from collections.abc import Callable
from typing import Any

import httpx
import numpy as np
import pytest
import rasterio
from PIL import Image

from app.missions.views import MapView
from app.settings import Settings
from tests.api.conftest import make_client, mission_spec, running, soundings


@pytest.fixture
async def measured(client: httpx.AsyncClient, mission: dict[str, Any]) -> str:
    """Path of a mission that has a map."""
    path = f"/missions/{mission['id']}"
    answer = await client.post(f"{path}/measurements", json={"items": soundings(12)})
    assert answer.json()["accepted"] == 12
    return path


async def test_there_is_no_map_before_the_first_sounding(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    for name in ("map", "map.tif", "map.overlay.png"):
        answer = await client.get(f"/missions/{mission['id']}/{name}")
        assert (answer.status_code, answer.json()["type"]) == (404, "urn:bathyfleet:problem:map-not-ready")
        assert answer.json()["remedy"]


async def test_the_map_has_every_cell(client: httpx.AsyncClient, measured: str) -> None:
    shown = (await client.get(f"{measured}/map")).json()
    MapView.model_validate(shown)
    for layer in ("depth_m", "sd_m", "count", "sounded"):
        assert np.shape(shown[layer]) == (shown["rows"], shown["cols"])
    assert 8.0 < shown["min_depth_m"] < shown["max_depth_m"] < 16.0
    assert sum(map(sum, shown["count"])) == 12
    assert len(shown["corners"]) == 4


@pytest.mark.parametrize("name", ["map", "map.overlay.png"])
async def test_an_unchanged_map_is_not_sent_again(client: httpx.AsyncClient, measured: str, name: str) -> None:
    first = await client.get(f"{measured}/{name}")
    tag = first.headers["etag"]
    for sent in (tag, f'"other", W/{tag}', "*"):
        again = await client.get(f"{measured}/{name}", headers={"If-None-Match": sent})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    assert (await client.get(f"{measured}/{name}", headers={"If-None-Match": '"other"'})).status_code == 200

    more = soundings(3, start_s=1_795_229_000.0)
    await client.post(f"{measured}/measurements", json={"items": more})
    newer = await client.get(f"{measured}/{name}", headers={"If-None-Match": tag})
    assert newer.status_code == 200
    assert newer.headers["etag"] != tag


async def test_tags_of_another_run_of_the_process_do_not_match(make_settings: Callable[..., Settings]) -> None:
    settings = make_settings()
    tags = []
    mission_path = ""
    for _ in range(2):
        async with running(settings) as server, make_client(server) as client:
            if not mission_path:
                mission_path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
                await client.post(f"{mission_path}/measurements", json={"items": soundings(12)})
            tags.append((await client.get(f"{mission_path}/map")).headers["etag"])
    assert tags[0] != tags[1]


@pytest.mark.parametrize("layer", ["depth", "uncertainty"])
async def test_the_overlay_has_a_pixel_per_cell(client: httpx.AsyncClient, measured: str, layer: str) -> None:
    shown = (await client.get(f"{measured}/map")).json()
    answer = await client.get(f"{measured}/map.overlay.png", params={"layer": layer})
    assert answer.headers["content-type"] == "image/png"
    pixels = np.asarray(Image.open(io.BytesIO(answer.content)))
    assert pixels.shape == (shown["rows"], shown["cols"], 4)
    known = np.array([[value is not None for value in row] for row in shown["depth_m"]])[::-1]
    assert ((pixels[..., 3] > 0) == known).all()


async def test_a_fixed_range_gives_the_same_depth_the_same_colour(client: httpx.AsyncClient, measured: str) -> None:
    async def picture(**query: float) -> np.ndarray[Any, Any]:
        answer = await client.get(f"{measured}/map.overlay.png", params=query)
        assert answer.status_code == 200, answer.text
        return np.asarray(Image.open(io.BytesIO(answer.content)))

    shallow = await picture(min=100, max=200)
    assert len(np.unique(shallow[shallow[..., 3] > 0][:, :3], axis=0)) == 1
    assert len(np.unique((await picture())[..., :3].reshape(-1, 3), axis=0)) > 10
    await picture(min=100)
    await picture(max=-100)


async def test_an_empty_colour_range_is_refused(client: httpx.AsyncClient, measured: str) -> None:
    answer = await client.get(f"{measured}/map.overlay.png", params={"min": 5, "max": 5})
    assert answer.status_code == 422
    assert "above min" in answer.json()["remedy"]


FILES = {
    "tif": ("image/tiff", b"II*\0"),
    "xyz": ("text/plain", b"#"),
    "csv": ("text/csv", b"#"),
    "geojson": ("application/geo+json", b"{"),
    "png": ("image/png", b"\x89PNG"),
}


async def test_the_map_is_downloaded_as_a_file(client: httpx.AsyncClient, measured: str) -> None:
    shown = (await client.get(f"{measured}/map")).json()
    for extension, (media, begin) in FILES.items():
        answer = await client.get(f"{measured}/map.{extension}")
        assert answer.status_code == 200, answer.text
        assert answer.headers["content-type"].startswith(media)
        assert answer.headers["content-disposition"] == f'attachment; filename="harbour-basin.{extension}"'
        assert answer.content.startswith(begin)
        if extension == "tif":
            with rasterio.MemoryFile(answer.content) as file, file.open() as raster:
                assert (raster.height, raster.width) == (shown["rows"], shown["cols"])


async def test_a_format_that_is_not_made_lists_those_that_are(client: httpx.AsyncClient, measured: str) -> None:
    for extension in ("bag", "nc", "kml", "exe", "t" * 300):
        answer = await client.get(f"{measured}/map.{extension}")
        assert (answer.status_code, answer.json()["type"]) == (404, "urn:bathyfleet:problem:format-not-found")
        assert answer.json()["remedy"] == "Use one of .tif, .xyz, .csv, .geojson, .png"
