"""Programs that people have: OWSLib and GDAL read features and maps, GDAL reads tiles."""

import io
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pyogrio
import pytest
import shapely
from owslib.ogcapi.features import Features
from owslib.util import ServiceException
from owslib.wms import WebMapService
from PIL import Image
from rasterio.warp import transform_bounds

from tests.api.maps.conftest import SOUNDINGS, Gis
from tests.support.mapping.gis import picture_of
from tests.support.missions.specs import FRAME

DRIVER = "OAPIF"


def elsewhere(code: str, *arguments: str) -> Any:
    """What a program prints as JSON. GDAL holds the interpreter, in which the service runs here, while it waits."""
    clear = {name: value for name, value in os.environ.items() if not name.lower().endswith("_proxy")}
    command = [sys.executable, "-c", code, *arguments]
    found = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False, env=clear)
    assert found.returncode == 0, found.stderr
    return json.loads(found.stdout)


def keyed(gis: Gis, mission: str = "") -> str:
    """The address of a feature service, as it is typed into a program that cannot send headers."""
    return f"{gis.url}/key/{gis.key}/ogc" + (f"/missions/{mission}" if mission else "")


@pytest.mark.slow
def test_owslib_reads_everything(gis: Gis) -> None:
    service = Features(f"{gis.url}/ogc", headers={"Authorization": f"Bearer {gis.key}"})
    assert set(service.feature_collections()) >= {"areas", "tracks", "soundings", "contours", "holidays", "vehicles"}
    assert any(one.endswith("/conf/core") for one in service.conformance()["conformsTo"])
    assert service.api()["openapi"].startswith("3.0")
    page = service.collection_items("soundings", limit=10)
    assert page["numberReturned"] == 10
    lat, lon = FRAME.to_geographic([0.0, 25.0], [0.0, 25.0])
    some = service.collection_items("soundings", bbox=[lon[0], lat[0], lon[1], lat[1]], limit=1000)
    assert 5 < some["numberMatched"] < SOUNDINGS
    queryables = service.collection_queryables("tracks")
    assert set(queryables["properties"]) == {"mission", "vehicle"}
    assert service.collection_item("areas", gis.single)["properties"]["name"] == "Single beam"


READ_LAYERS = """
import json, pyogrio, sys
source, own, west, south, east, north = sys.argv[1:]
found = {}
for name, _ in pyogrio.list_layers(source):
    meta, _, geometry, _ = pyogrio.raw.read(source, layer=name, PAGE_SIZE="7")
    found[name] = [len(geometry), meta["crs"]]
box = tuple(map(float, (west, south, east, north)))
inside = len(pyogrio.raw.read(own, layer="soundings", bbox=box)[2])
meta, _, moved, _ = pyogrio.raw.read(own, layer="areas", CRS="http://www.opengis.net/def/crs/EPSG/0/32629")
print(json.dumps({"layers": found, "inside": inside, "moved": [meta["crs"], len(moved)]}))
"""


@pytest.mark.skipif(DRIVER not in pyogrio.list_drivers(), reason="this GDAL was built without OAPIF")
def test_gdal_reads_every_layer_page_by_page(gis: Gis) -> None:
    lat, lon = FRAME.to_geographic([0.0, 25.0], [0.0, 25.0])
    box = map(str, (lon[0], lat[0], lon[1], lat[1]))
    found = elsewhere(READ_LAYERS, f"{DRIVER}:{keyed(gis)}", f"{DRIVER}:{keyed(gis, gis.single)}", *box)
    names = {"areas", "tracks", "soundings", "contours", "holidays", "vehicles", "traffic"}
    assert {name: number for name, (number, _) in found["layers"].items()} == {
        name: len(gis.everything(name)) for name in names
    }
    assert 5 < found["inside"] < SOUNDINGS
    assert found["moved"] == ["EPSG:32629", 1]


@pytest.mark.parametrize("version", ["1.1.1", "1.3.0"])
def test_owslib_reads_maps(gis: Gis, version: str) -> None:
    address = f"{gis.url}/key/{gis.key}/wms/missions/{gis.single}"
    service = WebMapService(address, version=version)
    assert list(service.contents) == ["depth", "uncertainty", "density", "coverage"]
    assert {one.name for one in service.operations} >= {"GetCapabilities", "GetMap", "GetFeatureInfo"}
    layer = service["depth"]
    assert (layer.title, layer.queryable) == ("Depth", 1)
    assert {"EPSG:3857", "EPSG:4326", "EPSG:32629"} <= set(layer.crsOptions)
    (area,) = gis.items("areas", mission=gis.single)["features"]
    ends = shapely.geometry.shape(area["geometry"]).bounds
    assert layer.boundingBoxWGS84 == pytest.approx(ends)
    legend = gis.client.get(layer.styles["default"]["legend"])
    assert picture_of(legend).shape == (190, 130, 4)
    options = {"layers": ["depth"], "srs": "EPSG:4326", "bbox": ends, "size": (120, 90), "format": "image/png"}
    found = service.getmap(**options, transparent=True)
    picture = np.asarray(Image.open(io.BytesIO(found.read())))
    assert (picture[..., 3] > 0).mean() > 0.3
    said = service.getfeatureinfo(**options, query_layers=["depth"], info_format="text/plain", xy=(60, 45))
    assert b"Depth: " in said.read()
    with pytest.raises(ServiceException, match="from 1 to 4096"):
        service.getmap(**options | {"size": (9000, 10)})


def wms(gis: Gis, layer: str, folder: Path) -> Path:
    """The description with which GDAL opens a map, here with the latitude first."""
    root = ET.Element("GDAL_WMS")
    service = ET.SubElement(root, "Service", name="WMS")
    for name, value in (
        ("Version", "1.3.0"),
        ("ServerUrl", f"{gis.url}/key/{gis.key}/wms/missions/{gis.single}?"),
        *(("Layers", layer), ("CRS", "EPSG:4326"), ("BBoxOrder", "yxYX"), ("ImageFormat", "image/png")),
        ("Transparent", "TRUE"),
    ):
        ET.SubElement(service, name).text = value
    window = ET.SubElement(root, "DataWindow")
    lat, lon = FRAME.to_geographic([-30.0, 90.0], [-30.0, 90.0])
    ends = {"UpperLeftX": lon[0], "UpperLeftY": lat[1], "LowerRightX": lon[1], "LowerRightY": lat[0]}
    for name, number in ends.items():
        ET.SubElement(window, name).text = repr(float(number))
    for name in ("SizeX", "SizeY"):
        ET.SubElement(window, name).text = "1200"
    for name, value in (("Projection", "EPSG:4326"), ("BandsCount", "4")):
        ET.SubElement(root, name).text = value
    file = folder / f"{layer}.xml"
    file.write_bytes(ET.tostring(root))
    return file


def tms(gis: Gis, layer: str, folder: Path) -> Path:
    """The description with which GDAL opens tiles."""
    tilejson = gis.client.get(f"{gis.url}/key/{gis.key}/api/v1/missions/{gis.single}/tiles/{layer}.json").json()
    root = ET.Element("GDAL_WMS")
    service = ET.SubElement(root, "Service", name="TMS")
    address = tilejson["tiles"][0].replace("{", "${")
    ET.SubElement(service, "ServerUrl").text = address
    window = ET.SubElement(root, "DataWindow")
    half = "20037508.342789244"
    for name, value in (
        *(("UpperLeftX", f"-{half}"), ("UpperLeftY", half), ("LowerRightX", half), ("LowerRightY", f"-{half}")),
        *(("TileLevel", "20"), ("TileCountX", "1"), ("TileCountY", "1"), ("YOrigin", "top")),
    ):
        ET.SubElement(window, name).text = value
    for name, value in (("Projection", "EPSG:3857"), ("BlockSizeX", "256"), ("BlockSizeY", "256"), ("BandsCount", "4")):
        ET.SubElement(root, name).text = value
    file = folder / f"{layer}.xml"
    file.write_bytes(ET.tostring(root))
    return file


REPROJECT = """
import json, sys, numpy as np, rasterio
from rasterio.warp import Resampling, reproject
tiles, geotiff, output, *bounds = sys.argv[1:]
onto = rasterio.transform.from_bounds(*map(float, bounds), 200, 200)
try:
    tiles = rasterio.open(tiles)
except rasterio.errors.RasterioIOError as error:
    print(json.dumps(str(error)))
    sys.exit()
depth, colour = np.full((200, 200), np.nan), np.zeros((4, 200, 200), dtype=np.uint8)
options = {"dst_transform": onto, "dst_crs": "EPSG:32629", "resampling": Resampling.nearest}
with tiles, rasterio.open(geotiff) as file:
    reproject(rasterio.band(file, 1), depth, dst_nodata=np.nan, **options)
    reproject(rasterio.band(tiles, [1, 2, 3, 4]), colour, **options)
np.savez(output, depth=depth, colour=colour)
print(json.dumps(""))
"""


@pytest.mark.parametrize("described", [tms, wms])
def test_gdal_opens_pictures_where_the_map_lies(
    gis: Gis, tmp_path: Path, described: Callable[[Gis, str, Path], Path]
) -> None:
    """Tiles or WMS, and the GeoTIFF, put onto the same pixels, show the same ground, and what is deeper is darker."""
    file, output = tmp_path / "map.tif", tmp_path / "both.npz"
    file.write_bytes(gis.client.get(f"{gis.url}/api/v1/missions/{gis.single}/map.tif").content)
    lat, lon = FRAME.to_geographic([-20.0, 80.0], [-20.0, 80.0])
    bounds = transform_bounds("EPSG:4326", "EPSG:32629", lon[0], lat[0], lon[1], lat[1])
    problem = elsewhere(REPROJECT, str(described(gis, "depth", tmp_path)), str(file), str(output), *map(str, bounds))
    if problem:
        pytest.skip(f"this GDAL opens no pictures of the web: {problem}")
    with np.load(output) as both:
        depth, colour = both["depth"], both["colour"]
    known = np.isfinite(depth)
    assert 0.2 < known.mean() < 0.6
    assert ((colour[3] > 0) == known).mean() > 0.995
    shown = known & (colour[3] > 0)
    brightness = colour[:3].astype(float).mean(axis=0)
    # In the deep corner, which nobody sounded, guesses are held to what was sounded, and are pale.
    shown &= depth < np.quantile(depth[shown], 0.7)
    assert np.corrcoef(depth[shown], brightness[shown])[0, 1] < -0.9


def test_a_key_in_the_address_is_for_looking_only(gis: Gis, caplog: pytest.LogCaptureFixture) -> None:
    with httpx.Client() as bare:
        body = bare.get(keyed(gis)).raise_for_status().json()
        assert all(link["href"].startswith(keyed(gis)) for link in body["links"])
        page = bare.get(f"{keyed(gis)}/collections/soundings/items", params={"limit": 5}).json()
        following = next(link["href"] for link in page["links"] if link["rel"] == "next")
        assert bare.get(following).json()["numberReturned"] == 5
        tiles = f"/api/v1/missions/{gis.single}/tiles/depth"
        tilejson = bare.get(f"{gis.url}/key/{gis.key}{tiles}.json").raise_for_status().json()
        address = tilejson["tiles"][0].replace("{z}", "0").replace("{x}", "0").replace("{y}", "0")
        assert bare.get(address).headers["content-type"] == "image/png"

        assert bare.get(f"{gis.url}/ogc").status_code == httpx.codes.UNAUTHORIZED
        assert bare.get(f"{gis.url}{tiles}.json").status_code == httpx.codes.UNAUTHORIZED
        for opening in ("", f"/key/{gis.key[:-1]}_"):
            assert bare.get(f"{gis.url}{opening}{tiles}/0/0/0.png").status_code == httpx.codes.UNAUTHORIZED
        wrong = bare.get(f"{gis.url}/key/{gis.key[:-1]}_/ogc")
        assert wrong.status_code == httpx.codes.UNAUTHORIZED
        too_much = bare.get(f"{gis.url}/key/{gis.operator}/ogc")
        assert (too_much.status_code, "--role viewer" in too_much.json()["remedy"]) == (403, True)
        for path in ("/api/v1/missions", f"/api/v1/missions/{gis.single}", "/api/v1/audit", "/metrics", "", "/../ogc"):
            assert bare.get(f"{gis.url}/key/{gis.key}{path}").status_code == httpx.codes.NOT_FOUND, path
        assert bare.post(f"{gis.url}/key/{gis.key}{tiles}.json").status_code == httpx.codes.NOT_FOUND
        cookie = {"Cookie": "bathyfleet-session=none", "Authorization": f"Bearer {gis.operator}"}
        assert bare.get(f"{gis.url}/key/{gis.key[:-1]}_/ogc", headers=cookie).status_code == httpx.codes.UNAUTHORIZED
    assert gis.key not in caplog.text
    assert gis.operator not in caplog.text
