"""The map as JSON, picture and files."""

import errno
import io
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import httpx
import numpy as np
import pyogrio
import pyproj
import pytest
import rasterio
from PIL import Image

from app.missions.maps import file_content
from app.missions.settings import ProviderSettings
from app.missions.views.maps.map import MapView
from app.settings import Settings
from tests.support.api.rest import make_client, mission_spec, running, soundings


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


@pytest.mark.parametrize("layer", ["depth", "uncertainty", "slope", "tvu_fraction", "count"])
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
    (fault,) = answer.json()["errors"]
    assert (fault["location"], fault["field"], fault["expected"]) == ("query", "max", "Give a max above min")


FILES = {
    "report.pdf": ("application/pdf", b"%PDF-"),
    "report.html": ("text/html; charset=utf-8", b"<!doctype html>"),
    "map.tif": ("image/tiff", b"II*\0"),
    "map.nc": ("application/x-netcdf", b"\x89HDF"),
    "map.bag": ("application/x-bag", b"\x89HDF"),
    "map.xyz": ("text/plain", b"#"),
    "map.csv": ("text/csv", b"#"),
    "map.geojson": ("application/geo+json", b"{"),
    "map.kml": ("application/vnd.google-earth.kml+xml", b"<?xml"),
    "contours.dxf": ("image/vnd.dxf", b"999"),
    "map.png": ("image/png", b"\x89PNG"),
    "soundings.csv": ("text/csv", b"#"),
    "soundings.xyz": ("text/plain", b"#"),
    "tracks.geojson": ("application/geo+json", b"{"),
    "tracks.kml": ("application/vnd.google-earth.kml+xml", b"<?xml"),
    "tracks.gpx": ("application/gpx+xml", b"<?xml"),
    "soundings.laz": ("application/vnd.laszip", b"LASF"),
    "crossovers.csv": ("text/csv", b"#"),
    "lines.csv": ("text/csv", b"#"),
}


@pytest.mark.slow
async def test_every_file_is_downloaded_under_its_name(client: httpx.AsyncClient, measured: str) -> None:
    shown = (await client.get(f"{measured}/map")).json()
    for name, (media, begin) in FILES.items():
        answer = await client.get(f"{measured}/{name}")
        assert answer.status_code == 200, answer.text
        assert answer.headers["content-type"].startswith(media)
        resource, _, extension = name.partition(".")
        saved = f"harbour-basin.{extension}" if resource == "map" else f"harbour-basin-{resource}.{extension}"
        saved = saved.replace(".laz", "-epsg32629.laz")
        assert answer.headers["content-disposition"] == f'attachment; filename="{saved}"'
        assert answer.content.startswith(begin)
        if extension == "tif":
            with rasterio.MemoryFile(answer.content) as file, file.open() as raster:
                assert (raster.height, raster.width) == (shown["rows"], shown["cols"])


async def test_files_that_do_not_fit_into_memory_are_the_same(
    client: httpx.AsyncClient, measured: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("soundings.csv", "soundings.xyz", "map.tif"):
        kept = await client.get(f"{measured}/{name}")
        with monkeypatch.context() as patch:
            patch.setattr(file_content, "MEMORY_BYTES", 50)
            patch.setattr(file_content, "PIECE_BYTES", 11)
            spooled = await client.get(f"{measured}/{name}")
        assert spooled.content == kept.content
        assert int(spooled.headers["content-length"]) == len(spooled.content) > 50


async def test_a_file_that_the_disk_has_no_room_for_is_refused_whole(
    client: httpx.AsyncClient, measured: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(file_content, "MEMORY_BYTES", 50)
    monkeypatch.setattr(file_content, "unnamed_file", full)
    answer = await client.get(f"{measured}/soundings.csv")
    assert answer.status_code == 503
    assert "No space left on device" in answer.json()["detail"]


@pytest.mark.slow
async def test_the_list_of_files_is_complete_and_every_path_answers(client: httpx.AsyncClient, measured: str) -> None:
    listed = {entry["href"].rpartition("/")[2]: entry for entry in (await client.get(f"{measured}/products")).json()}
    assert set(FILES) | {"map.overlay.png", "map.s102", "soundings.geojson"} == set(listed)
    refused = {"soundings.geojson": 422, "s102": 409}
    for entry in listed.values():
        answer = await client.get(entry["href"].removeprefix("/api/v1"))
        assert answer.status_code == refused.get(entry["name"], 200)


@pytest.mark.slow
async def test_files_come_in_another_projected_system(client: httpx.AsyncClient, measured: str, tmp_path: Path) -> None:
    zone, utm = {"crs": "EPSG:32629"}, {"crs": "utm"}
    for name in ("map.tif", "map.bag"):
        answer = await client.get(f"{measured}/{name}", params=utm)
        saved = name.replace("map", "harbour-basin-epsg32629")
        assert answer.headers["content-disposition"] == f'attachment; filename="{saved}"'
        (path := tmp_path / name).write_bytes(answer.content)
        with rasterio.open(path) as file:
            found = pyproj.CRS.from_wkt(file.crs.to_wkt())
            assert (found.sub_crs_list[0] if found.is_compound else found).to_epsg() == 32629
    for name in ("map.xyz", "soundings.xyz"):
        answer = await client.get(f"{measured}/{name}", params=utm)
        assert answer.text == (await client.get(f"{measured}/{name}", params=zone)).text
        assert "positions: WGS 84 / UTM zone 29N (EPSG:32629)" in answer.text
        degrees = np.loadtxt(io.StringIO((await client.get(f"{measured}/{name}")).text))
        metres = np.loadtxt(io.StringIO(answer.text))
        easting, northing = pyproj.Transformer.from_crs(4326, 32629).transform(degrees[:, 1], degrees[:, 0])
        if name == "soundings.xyz":
            np.testing.assert_allclose(metres[:, :2].T, (easting, northing), atol=2e-3)
        assert metres[:, 2].min() == degrees[:, 2].min()
        imported = await client.post(
            f"{measured}/imports",
            params={"filename": "map.xyz", "crs": "EPSG:32629", "sd_m": 0.2},
            content=answer.content,
        )
        assert imported.status_code == 201, imported.text


@pytest.mark.parametrize(
    ("name", "crs", "detail", "remedy"),
    [
        ("map.tif", "EPSG:4326", "WGS 84 (EPSG:4326) is no projected system in metres", "give utm (here EPSG:32629)"),
        ("map.xyz", "utm29", "'utm29' is neither utm nor EPSG: and a code", "give utm (here EPSG:32629)"),
        ("map.kml", "utm", "kml is not made in utm", "leave it out, or ask for tif, nc, bag"),
        ("tracks.gpx", "utm", "tracks.gpx is not made in utm", "leave it out"),
    ],
)
async def test_a_system_that_cannot_be_is_refused_by_name(
    client: httpx.AsyncClient, measured: str, name: str, crs: str, detail: str, remedy: str
) -> None:
    answer = await client.get(f"{measured}/{name}", params={"crs": crs})
    assert (answer.status_code, answer.json()["detail"]) == (422, detail)
    (error,) = answer.json()["errors"]
    assert (error["field"], error["value"]) == ("crs", crs)
    assert remedy in error["expected"]


async def test_the_list_of_files_says_what_may_be_asked_of_each(client: httpx.AsyncClient, measured: str) -> None:
    listed = {entry["name"]: entry["options"] for entry in (await client.get(f"{measured}/products")).json()}
    assert listed["tif"] == ["order", "crs"]
    assert listed["contours.dxf"] == ["interval_m", "crs"]
    assert listed["soundings.geojson"] == ["vehicle"]
    assert listed["report.pdf"] == ["order", "lang"]
    assert listed["csv"] == listed["s102"] == []
    takes_crs = {name for name, options in listed.items() if "crs" in options}
    assert takes_crs == {"tif", "nc", "bag", "xyz", "soundings.xyz", "soundings.laz", "contours.dxf"}


async def test_contours_come_as_a_drawing(client: httpx.AsyncClient, measured: str, tmp_path: Path) -> None:
    answer = await client.get(f"{measured}/contours.dxf", params={"crs": "utm", "interval_m": 0.2})
    assert answer.headers["content-disposition"] == 'attachment; filename="harbour-basin-contours-epsg32629.dxf"'
    (path := tmp_path / "contours.dxf").write_bytes(answer.content)
    west, south, east, north = pyogrio.read_info(path, force_total_bounds=True)["total_bounds"]
    shown = (await client.get(f"{measured}/map")).json()
    corners = pyproj.Transformer.from_crs(4326, 32629).transform(*np.array(shown["corners"]).T[::-1])
    assert min(corners[0]) < west < east < max(corners[0])
    assert min(corners[1]) < south < north < max(corners[1])
    own = await client.get(f"{measured}/contours.dxf")
    assert "positions: transverse Mercator k=1, lat 41.18" in own.text
    refused = await client.get(f"{measured}/contours.dxf", params={"interval_m": 1e-5})
    assert [error["field"] for error in refused.json()["errors"]] == ["interval_m"]


async def test_a_chart_surface_asks_for_a_chart_datum(client: httpx.AsyncClient, measured: str) -> None:
    answer = await client.get(f"{measured}/map.s102")
    assert (answer.status_code, answer.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")
    assert "instantaneous water level" in answer.json()["detail"]
    assert "5861" in answer.json()["remedy"]

    await client.put(f"{measured}/tide", json={"level_m": 1.2, "source": "gauge"})
    answer = await client.get(f"{measured}/map.s102")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/x-hdf5")
    identity = measured.rpartition("/")[2][:4].upper()
    assert answer.headers["content-disposition"] == f'attachment; filename="102BF00HARBOUR_{identity}.h5"'
    with h5py.File(io.BytesIO(answer.content)) as file:
        (record,) = file["QualityOfBathymetryCoverage/featureAttributeTable"][:]
        depths = file["BathymetryCoverage/BathymetryCoverage.01/Group_001/values"]["depth"]
        assert file.attrs["verticalDatum"] == 23
    assert record["surveyDateRange.dateStart"] == record["surveyDateRange.dateEnd"] == b"20261121"
    shown = (await client.get(f"{measured}/map")).json()
    sounded = np.array(shown["depth_m"], float)[np.array(shown["sounded"])]
    np.testing.assert_allclose(np.unique(depths[depths < 1e6]), np.unique(np.round(sounded, 2)), atol=0.011)


async def test_cells_by_depth_are_files_of_missions_that_ask_for_them(client: httpx.AsyncClient, measured: str) -> None:
    for name in ("map.vr.bag", "map.tiers.zip"):
        answer = await client.get(f"{measured}/{name}")
        assert (answer.status_code, answer.json()["type"]) == (409, "urn:bathyfleet:problem:conflict")
        assert "cell_of_depth" in answer.json()["remedy"]

    spec = mission_spec(cell_m=0.5, coverage={"cell_of_depth": 0.05})
    path = f"/missions/{(await client.post('/missions', json=spec)).json()['id']}"
    assert (await client.get(path)).json()["spec"]["coverage"]["cell_of_depth"] == 0.05
    items = [item | {"depth_m": 1.5} for item in soundings(12)]  # from 9.5 to 10.6 m
    await client.post(f"{path}/measurements", json={"items": items})
    listed = {one["name"]: one["href"] for one in (await client.get(f"{path}/products")).json()}
    bag = await client.get(listed["vr.bag"].removeprefix("/api/v1"))
    assert bag.headers["content-disposition"] == 'attachment; filename="harbour-basin.vr.bag"'
    with h5py.File(io.BytesIO(bag.content)) as file:
        assert np.isin(file["BAG_root/varres_metadata"]["resolution_x"], (-1.0, 0.5, 1.0)).all()
    archive = await client.get(listed["tiers.zip"].removeprefix("/api/v1"))
    with zipfile.ZipFile(io.BytesIO(archive.content)) as file:
        assert file.namelist() == ["harbour-basin-0.5m.tif", "harbour-basin-1m.tif"]
        for name, cell_m in zip(file.namelist(), (0.5, 1.0), strict=True):
            with rasterio.MemoryFile(file.read(name)) as memory, memory.open() as raster:
                assert raster.res == (cell_m, cell_m)
                count = raster.read(raster.descriptions.index("count") + 1, masked=True)
                assert (count.compressed() > 0).all()
                assert (raster.read(1, masked=True).mask == count.mask).all()


async def test_tracks_and_soundings_need_no_map(client: httpx.AsyncClient, mission: dict[str, Any]) -> None:
    for name in FILES:
        answer = await client.get(f"/missions/{mission['id']}/{name}")
        assert answer.status_code == (200 if name.startswith(("tracks", "soundings", "map.csv")) else 404), name


async def test_crowdsourced_soundings_name_their_provider(make_settings: Callable[..., Settings]) -> None:
    named = make_settings(provider=ProviderSettings(organization="Harbour office", email="map@example.org"))
    async with running(named) as server, make_client(server) as client:
        vehicles = [{"name": name, "kind": "rest"} for name in ("rover", "diver")]
        path = f"/missions/{(await client.post('/missions', json=mission_spec(vehicles=vehicles))).json()['id']}"
        await client.post(f"{path}/measurements", json={"items": soundings(3) + soundings(2, vehicle="diver")})
        unclear = await client.get(f"{path}/soundings.geojson")
        assert (unclear.status_code, unclear.json()["remedy"]) == (422, "name one of diver, rover")
        answer = await client.get(f"{path}/soundings.geojson", params={"vehicle": "diver"})
        assert answer.headers["content-disposition"] == 'attachment; filename="harbour-basin-diver.geojson"'
        collection = answer.json()
    assert len(collection["features"]) == 2
    assert collection["properties"]["trustedNode"]["providerOrganizationName"] == "Harbour office"


async def test_further_layers_come_when_asked_for(client: httpx.AsyncClient, measured: str) -> None:
    shown = (await client.get(f"{measured}/map", params={"layer": ["slope", "tvu_fraction"], "order": "2"})).json()
    assert sorted(shown["layers"]) == ["slope", "tvu_fraction"]
    stricter = (await client.get(f"{measured}/map", params={"layer": "tvu_fraction", "order": "exclusive"})).json()
    shape = (shown["rows"], shown["cols"])
    lax, strict = (np.array(m["layers"]["tvu_fraction"], float) for m in (shown, stricter))
    assert lax.shape == strict.shape == shape
    assert np.all(lax[np.isfinite(lax)] < strict[np.isfinite(strict)])
    answer = await client.get(f"{measured}/map", params={"layer": "difference"})
    assert (answer.status_code, answer.json()["detail"]) == (422, "the mission has no reference grid to differ from")


async def test_quality_counts_cells_and_claims_no_order(client: httpx.AsyncClient, measured: str) -> None:
    shown = (await client.get(f"{measured}/quality")).json()
    assert [one["order"] for one in shown["tvu"]] == ["exclusive", "special", "1a", "1b", "2"]
    shares = [one["cells_pct"] for one in shown["tvu"]]
    assert shares == sorted(shares)
    assert all(one["statement"].startswith("TVU estimate meets ") for one in shown["tvu"])
    assert shown["difference"] is None


async def test_a_format_that_is_not_made_lists_those_that_are(client: httpx.AsyncClient, measured: str) -> None:
    for extension in ("shp", "exe", "t" * 300):
        answer = await client.get(f"{measured}/map.{extension}")
        assert (answer.status_code, answer.json()["type"]) == (404, "urn:bathyfleet:problem:format-not-found")
        assert (
            answer.json()["remedy"]
            == "Use one of .tif, .nc, .bag, .vr.bag, .tiers.zip, .s102, .xyz, .csv, .geojson, .kml, .png"
        )


async def test_the_chance_of_shoal_water_is_a_layer_where_the_mission_says_what_is_shoal(
    client: httpx.AsyncClient,
) -> None:
    paths = []
    for fields in ({}, {"shoal_depth_m": 8.0}):
        answer = await client.post("/missions", json=mission_spec(**fields))
        assert answer.json()["spec"]["shoal_depth_m"] == fields.get("shoal_depth_m")
        paths.append(f"/missions/{answer.json()['id']}")
        await client.post(f"{paths[-1]}/measurements", json={"items": soundings()})
    without, path = paths
    refused = await client.get(f"{without}/map", params={"layer": "shoal_pct"})
    assert (refused.status_code, "shoal_depth_m" in refused.json()["remedy"]) == (422, True)
    shown = (await client.get(f"{path}/map", params={"layer": "shoal_pct"})).json()
    chance = np.array(shown["layers"]["shoal_pct"], float)
    told = chance[np.isfinite(chance)]
    assert told.size
    assert ((told >= 0.0) & (told <= 100.0)).all()
    picture = await client.get(f"{path}/map.overlay.png", params={"layer": "shoal_pct"})
    assert picture.status_code == 200
    with rasterio.MemoryFile((await client.get(f"{path}/map.tif")).content) as memory, memory.open() as file:
        assert file.units[file.descriptions.index("shoal_pct")] == "percent"
    wrong = await client.post("/missions", json=mission_spec(shoal_depth_m=1e6))
    assert [error["field"] for error in wrong.json()["errors"]] == ["shoal_depth_m"]
