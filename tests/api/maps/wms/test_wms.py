"""Maps by WMS 1.1.1 and 1.3.0: what programs ask for, and what they should not."""

import asyncio
import io
import xml.etree.ElementTree as ET
from collections.abc import AsyncIterator, Callable
from typing import Any

import httpx
import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from app.main import Server
from app.settings import Settings
from tests.api.maps.conftest import Gis, depth_m
from tests.support.api.rest import make_client, mission_spec, running, soundings
from tests.support.mapping.gis import Pixels, picture_of, tile_of
from tests.support.missions.specs import FRAME
from tests.support.storage.databases import query as rows_of

LAYERS = ("depth", "uncertainty", "density", "coverage")
ZOOM, WORLD_M = 19, 2 * np.pi * 6_378_137.0
EXCEPTION = "{http://www.opengis.net/ogc}ServiceException"


def place(east_m: float, north_m: float) -> tuple[float, float]:
    """Longitude and latitude."""
    lat, lon = FRAME.to_geographic(east_m, north_m)
    return float(lon), float(lat)


WEST, SOUTH = place(-10.0, -10.0)
EAST, NORTH = place(70.0, 60.0)
TO_MERCATOR = pyproj.Transformer.from_crs("OGC:CRS84", "EPSG:3857", always_xy=True)
TO_UTM = pyproj.Transformer.from_crs("OGC:CRS84", "EPSG:32629", always_xy=True)


def query(**changes: Any) -> dict[str, Any]:
    """A request for a map that is in order, but for the changes; None leaves a parameter out."""
    whole: dict[str, Any] = {
        "SERVICE": "WMS",
        "VERSION": "1.3.0",
        "REQUEST": "GetMap",
        "LAYERS": "depth",
        "STYLES": "",
        "CRS": "CRS:84",
        "BBOX": joined(WEST, SOUTH, EAST, NORTH),
        "WIDTH": 300,
        "HEIGHT": 200,
        "FORMAT": "image/png",
        "TRANSPARENT": "TRUE",
    }
    return {name: value for name, value in (whole | changes).items() if value is not None}


def joined(*numbers: float) -> str:
    return ",".join(repr(float(number)) for number in numbers)


def ask(gis: Gis, mission: str = "", **changes: Any) -> httpx.Response:
    address = f"{gis.url}/wms" + (f"/missions/{mission}" if mission else "")
    return gis.client.get(address, params=query(**changes))


def shown(gis: Gis, mission: str = "", **changes: Any) -> Pixels:
    return picture_of(ask(gis, mission, **changes))


# Pictures


@pytest.mark.parametrize("layer", LAYERS)
def test_a_map_shows_what_the_tiles_show(gis: Gis, layer: str) -> None:
    lon, lat = place(25.0, 22.0)
    x, y = tile_of(lat, lon, ZOOM)
    side = WORLD_M / 2**ZOOM
    left, top = x * side - WORLD_M / 2, WORLD_M / 2 - y * side
    address = f"{gis.url}/api/v1/missions/{gis.single}/tiles/{layer}/{ZOOM}"
    tiles = [picture_of(gis.client.get(f"{address}/{x + i}/{y}.png")) for i in (0, 1)]
    one = {"LAYERS": layer, "CRS": "EPSG:3857", "WIDTH": 256, "HEIGHT": 256}
    found = shown(gis, gis.single, **one, BBOX=joined(left, top - side, left + side, top))
    assert found.any()
    assert (found == tiles[0]).all()
    wide = shown(gis, gis.single, **one | {"WIDTH": 512}, BBOX=joined(left, top - side, left + 2 * side, top))
    assert (wide == np.hstack(tiles)).all(axis=-1).mean() > 0.998, "but for the edges of cells"


def test_axes_are_in_the_order_of_system_and_version(gis: Gis) -> None:
    answers = [
        ask(gis, gis.single),
        ask(gis, gis.single, CRS="EPSG:4326", BBOX=joined(SOUTH, WEST, NORTH, EAST)),
        ask(gis, gis.single, VERSION="1.1.1", CRS=None, SRS="EPSG:4326"),
        ask(gis, gis.single, VERSION=None, CRS=None, SRS="epsg:4326", STYLES="default", FORMAT=None),
    ]
    assert picture_of(answers[0]).any()
    assert len({answer.content for answer in answers}) == 1
    turned = shown(gis, gis.single, CRS="EPSG:4326")
    assert not turned.any()


@pytest.mark.parametrize(
    ("crs", "project"),
    [("CRS:84", lambda lon, lat: (lon, lat)), ("EPSG:3857", TO_MERCATOR.transform), ("EPSG:32629", TO_UTM.transform)],
)
def test_soundings_are_where_they_were_taken(gis: Gis, crs: str, project: Callable[..., Any]) -> None:
    """The classes of the density, in every system, at the places of the soundings and beside them."""
    (west, south), (east, north) = project(WEST, SOUTH), project(EAST, NORTH)
    picture = shown(gis, gis.single, LAYERS="density", CRS=crs, BBOX=joined(west, south, east, north))
    for feature in gis.everything("soundings", mission=gis.single):
        x, y = project(*feature["geometry"]["coordinates"][:2])
        column, row = int((x - west) / (east - west) * 300), int((north - y) / (north - south) * 200)
        # They lie on the edges of cells: it may be the pixel beside.
        assert picture[row - 2 : row + 3, column - 2 : column + 3, 3].max() == 255
    x, y = project(*place(60.0, 50.0))
    assert picture[int((north - y) / (north - south) * 200), int((x - west) / (east - west) * 300), 3] == 0


def test_layers_lie_over_each_other_on_a_ground(gis: Gis) -> None:
    depth, coverage = (shown(gis, gis.single, LAYERS=layer) for layer in ("depth", "coverage"))
    both = shown(gis, gis.single, LAYERS="depth,coverage")
    covered = coverage[..., 3] == 255
    assert (both[covered] == coverage[covered]).all()
    only = ~covered & (depth[..., 3] > 0)
    assert (both[only] == depth[only]).all()
    assert (shown(gis, gis.single, LAYERS="coverage,depth")[covered] != coverage[covered]).any()
    ground = shown(gis, gis.single, TRANSPARENT="FALSE", BGCOLOR="0x102030")
    assert ground.shape == (200, 300, 3)
    assert (ground[depth[..., 3] == 0] == (0x10, 0x20, 0x30)).all()
    assert (shown(gis, gis.single, TRANSPARENT=None)[depth[..., 3] == 0] == 255).all()


def test_all_missions_are_in_one_map(gis: Gis) -> None:
    (west, south), (east, north) = place(-10.0, -10.0), place(270.0, 70.0)
    box = joined(west, south, east, north)
    around: dict[str, Any] = {"LAYERS": "density", "BBOX": box, "WIDTH": 560, "HEIGHT": 160}
    single, swath = (shown(gis, mission, **around) for mission in (gis.single, gis.swath))
    both = shown(gis, **around)
    assert single.any()
    assert swath.any()
    assert not (single[..., 3] & swath[..., 3]).any()
    assert (both == np.maximum(single, swath)).all()


def test_colours_of_ones_own_are_in_maps_and_what_leads_to_them(gis: Gis) -> None:
    usual, own = shown(gis, gis.single), shown(gis, gis.single, COLORSCALERANGE="0,60")
    seen = usual[..., 3] > 0
    assert own[seen][:, :3].mean() > usual[seen][:, :3].mean() + 10, "shallow of sixty metres"
    assert (
        shown(gis, gis.single, LAYERS="density", COLORSCALERANGE="0,60") == shown(gis, gis.single, LAYERS="density")
    ).all()
    address = f"{gis.url}/wms/missions/{gis.single}?COLORSCALERANGE=0,60&SERVICE=WMS&REQUEST=GetCapabilities"
    links = online_resources(gis.client.get(address).text)
    assert all("?COLORSCALERANGE=0.0%2C60.0&" in link for link in links)


def test_the_older_version_declares_names_where_its_document_type_does(gis: Gis) -> None:
    """WMS_MS_Capabilities.dtd gives OnlineResource the declaration of xlink, and no other element."""
    begin = {"SERVICE": "WMS", "REQUEST": "GetCapabilities", "VERSION": "1.1.1"}
    text = gis.client.get(f"{gis.url}/wms/missions/{gis.single}", params=begin).text
    assert text.count("<OnlineResource ") > 4
    assert text.count('<OnlineResource xmlns:xlink="http://www.w3.org/1999/xlink"') == text.count("xmlns:")


def online_resources(capabilities: str) -> set[str]:
    found = [one for one in ET.fromstring(capabilities).iter() if one.tag.endswith("OnlineResource")]  # noqa: S314 - ours
    return {one.attrib["{http://www.w3.org/1999/xlink}href"] for one in found}


def test_an_unchanged_map_is_not_sent_again(gis: Gis) -> None:
    for changes in ({}, {"LAYERS": "depth,coverage"}, {"TRANSPARENT": "FALSE"}):
        first = ask(gis, gis.single, **changes)
        assert first.headers["cache-control"] == "private, no-cache"
        address = f"{gis.url}/wms/missions/{gis.single}"
        again = gis.client.get(address, params=query(**changes), headers={"If-None-Match": first.headers["etag"]})
        assert (again.status_code, again.content) == (304, b"")
        other = gis.client.get(address, params=query(**changes), headers={"If-None-Match": '"other"'})
        assert (other.status_code, other.content) == (200, first.content)
    tags = [ask(gis, gis.single, **changes).headers["etag"] for changes in ({}, {"WIDTH": 301}, {"LAYERS": "coverage"})]
    assert len(set(tags)) == 3


def test_the_largest_picture_is_made_and_a_larger_one_refused(gis: Gis) -> None:
    assert shown(gis, gis.single, WIDTH=4096, HEIGHT=1100).shape == (1100, 4096, 4)
    assert "from 1 to 4096" in problem(ask(gis, gis.single, WIDTH=4097))[1]


def test_views_of_the_whole_earth_and_of_a_hair_are_answered(gis: Gis) -> None:
    for crs, box in (
        ("EPSG:3857", (-3e8, -3e8, 3e8, 3e8)),
        ("CRS:84", (-1000, -900, 1000, 900)),
        ("EPSG:32629", (-1e9, -1e9, 1e9, 1e9)),
    ):
        assert (shown(gis, CRS=crs, BBOX=joined(*box))[..., 3] > 0).sum() <= 4, crs
    lon, lat = place(25.0, 22.0)
    assert shown(gis, BBOX=joined(lon, lat, lon + 1e-8, lat + 1e-8)).all(axis=-1).any()


# What is known of a place


@pytest.mark.parametrize("version", ["1.1.1", "1.3.0"])
def test_a_place_tells_its_depth(gis: Gis, version: str) -> None:
    names = ("I", "J") if version == "1.3.0" else ("X", "Y")
    row, column = np.argwhere(shown(gis, gis.single, LAYERS="density")[..., 3] == 255)[0].tolist()
    lon, lat = WEST + (column + 0.5) / 300 * (EAST - WEST), NORTH - (row + 0.5) / 200 * (NORTH - SOUTH)
    (east,), (north,) = FRAME.to_local([lat], [lon])
    crs = {"CRS": "CRS:84"} if version == "1.3.0" else {"CRS": None, "SRS": "EPSG:4326"}
    asked: dict[str, Any] = {"VERSION": version, "REQUEST": "GetFeatureInfo", "QUERY_LAYERS": "depth", **crs}
    asked |= {names[0]: column, names[1]: row}
    (feature,) = ask(gis, **asked, INFO_FORMAT="application/json").json()["features"]
    assert feature["geometry"]["coordinates"] == pytest.approx([lon, lat], abs=2e-8)
    found = feature["properties"]
    assert (found["mission"], found["name"]) == (gis.single, "Single beam")
    assert found["depth_m"] == pytest.approx(depth_m(east, north), abs=0.3)
    assert found["soundings"] == 1
    assert 0 < found["sd_m"] < 0.5
    text = ask(gis, **asked)
    assert text.headers["content-type"].startswith("text/plain")
    assert f"Depth: {found['depth_m']:.2f} m" in text.text
    page = ask(gis, **asked, INFO_FORMAT="text/html")
    assert f"<td>{found['depth_m']:.2f} m</td>" in page.text
    nothing = asked | {names[0]: 299, names[1]: 0}
    assert ask(gis, **nothing, INFO_FORMAT="application/geo+json").json()["features"] == []
    assert ask(gis, **nothing).text == "nothing is known here"


@pytest.mark.parametrize("layer", LAYERS)
def test_each_layer_has_a_legend(gis: Gis, layer: str) -> None:
    answer = gis.client.get(f"{gis.url}/wms", params={"REQUEST": "GetLegendGraphic", "LAYER": layer})
    colours = len(np.unique(picture_of(answer).reshape(-1, 4), axis=0))
    assert colours > (100 if layer in ("depth", "uncertainty") else 3)


# What is refused


def problem(answer: httpx.Response) -> tuple[str, str]:
    """Code and words of a report of exceptions."""
    assert answer.status_code == httpx.codes.OK
    assert answer.headers["content-type"].startswith("text/xml")
    assert answer.headers["cache-control"] == "no-store"
    (found,) = ET.fromstring(answer.content)  # noqa: S314 - ours
    assert found.tag == EXCEPTION
    assert found.text is not None
    return found.attrib["code"], found.text


@pytest.mark.parametrize(
    ("changes", "code", "words"),
    [
        ({"REQUEST": None}, "MissingParameterValue", "GetCapabilities"),
        ({"REQUEST": "GetTile"}, "OperationNotSupported", "'GetTile'"),
        ({"SERVICE": "WFS"}, "InvalidParameterValue", "it has to be WMS"),
        ({"LAYERS": None}, "MissingParameterValue", "name one of depth"),
        ({"LAYERS": "depth,bogus"}, "LayerNotDefined", "'bogus'"),
        ({"LAYERS": "depth," * 5 + "depth"}, "InvalidParameterValue", "at most 4"),
        ({"STYLES": "rainbow"}, "StyleNotDefined", "'rainbow'"),
        ({"CRS": None}, "MissingParameterValue", "EPSG:3857, EPSG:4326, EPSG:32629, CRS:84"),
        ({"CRS": "EPSG:27700"}, "InvalidCRS", "'EPSG:27700'"),
        ({"BBOX": None}, "MissingParameterValue", "west,south,east,north"),
        ({"BBOX": "1,2,3"}, "InvalidParameterValue", "four numbers"),
        ({"BBOX": "1,2,nan,4"}, "InvalidParameterValue", "four numbers"),
        ({"BBOX": "1,2,1e300,4"}, "InvalidParameterValue", "four numbers"),
        ({"BBOX": "1,2,1,4"}, "InvalidParameterValue", "above the first"),
        ({"BBOX": "5,2,1,4", "CRS": "EPSG:4326"}, "InvalidParameterValue", "south,west,north,east"),
        ({"WIDTH": "0"}, "InvalidParameterValue", "from 1 to 4096"),
        ({"WIDTH": "٣"}, "InvalidParameterValue", "from 1 to 4096"),
        ({"HEIGHT": "-5"}, "InvalidParameterValue", "from 1 to 4096"),
        ({"HEIGHT": None}, "MissingParameterValue", "from 1 to 4096"),
        ({"FORMAT": "image/jpeg"}, "InvalidFormat", "image/png"),
        ({"TRANSPARENT": "perhaps"}, "InvalidParameterValue", "TRUE or FALSE"),
        ({"BGCOLOR": "blue"}, "InvalidParameterValue", "0xFFFFFF"),
        ({"COLORSCALERANGE": "9,3"}, "InvalidParameterValue", "the smaller one first"),
        ({"width": "301"}, "InvalidParameterValue", "given twice"),
        ({"REQUEST": "GetFeatureInfo", "QUERY_LAYERS": "depth", "I": 300, "J": 0}, "InvalidPoint", "from 0 to 299"),
        ({"REQUEST": "GetFeatureInfo", "QUERY_LAYERS": "depth", "I": 0}, "MissingParameterValue", "from 0 to 199"),
        ({"REQUEST": "GetFeatureInfo", "I": 0, "J": 0}, "MissingParameterValue", "QUERY_LAYERS"),
        (
            {"REQUEST": "GetFeatureInfo", "QUERY_LAYERS": "depth", "I": 0, "J": 0, "INFO_FORMAT": "image/png"},
            "InvalidFormat",
            "text/html",
        ),
        ({"REQUEST": "GetLegendGraphic"}, "MissingParameterValue", "LAYER is missing"),
        ({"REQUEST": "GetLegendGraphic", "LAYER": "<&>\x00"}, "LayerNotDefined", "<&>"),
    ],
)
def test_what_is_wrong_is_said_with_what_would_be_right(
    gis: Gis, changes: dict[str, Any], code: str, words: str
) -> None:
    found, text = problem(ask(gis, gis.single, **changes))
    assert (found, words in text) == (code, True), text


def test_old_programs_are_refused_in_their_own_words(gis: Gis) -> None:
    answer = ask(gis, VERSION="1.1.1", CRS=None, SRS="EPSG:1")
    assert answer.headers["content-type"] == "application/vnd.ogc.se_xml"
    root = ET.fromstring(answer.content)  # noqa: S314 - ours
    assert (root.tag, root.attrib["version"]) == ("ServiceExceptionReport", "1.1.1")
    assert root[0].attrib["code"] == "InvalidSRS"


WORDS = """0 1 256 4096 -1 1e9 nan depth coverage,depth EPSG:3857 EPSG:4326 CRS:84 GetMap GetFeatureInfo
GetLegendGraphic GetCapabilities 1.1.1 1.3.0 0,0,1,1 -9,41,-8,42 text/html application/json TRUE 0xFF0000 0,60
-1e9,-1e9,1e9,1e9 -8.7049,41.185,-8.704,41.1855"""
NAMES = """REQUEST VERSION LAYERS QUERY_LAYERS STYLES CRS SRS BBOX WIDTH HEIGHT I J X Y FORMAT INFO_FORMAT TRANSPARENT
BGCOLOR COLORSCALERANGE LAYER SERVICE EXCEPTIONS bogus"""
VALUES = st.sampled_from(["", *WORDS.split()]) | st.text(max_size=12).filter(str.isprintable)


@given(changes=st.dictionaries(st.sampled_from(NAMES.split()), VALUES | st.none(), max_size=5))
@settings(max_examples=60, deadline=None)
def test_whatever_is_asked_is_answered_as_the_standard_has_it(gis: Gis, changes: dict[str, str | None]) -> None:
    small = {"WIDTH": 30, "HEIGHT": 20} | changes
    answer = gis.client.get(f"{gis.url}/wms", params=query(**small))
    assert answer.status_code == httpx.codes.OK, answer.text
    kind = answer.headers["content-type"].partition(";")[0]
    if kind == "image/png":
        Image.open(io.BytesIO(answer.content)).load()
    elif kind.endswith("xml"):
        ET.fromstring(answer.content)  # noqa: S314 - ours
    else:
        assert kind in ("text/html", "text/plain", "application/json")


# Who may look, and who has the mission


def test_a_key_in_the_address_opens_maps_and_is_in_what_leads_on(gis: Gis, caplog: pytest.LogCaptureFixture) -> None:
    path = f"/wms/missions/{gis.single}"
    begin = {"SERVICE": "WMS", "REQUEST": "GetCapabilities"}
    with httpx.Client() as bare:
        keyed = f"{gis.url}/key/{gis.key}{path}"
        for version in ("1.1.1", "1.3.0"):
            text = bare.get(keyed, params=begin | {"VERSION": version}).raise_for_status().text
            links = online_resources(text)
            assert links
            assert all(link.startswith(f"{keyed}?") for link in links)
        assert picture_of(bare.get(keyed, params=query())).any()
        for request in (begin, query(), query(REQUEST="GetFeatureInfo")):
            assert bare.get(f"{gis.url}{path}", params=request).status_code == httpx.codes.UNAUTHORIZED
            refused = bare.get(f"{gis.url}/key/{gis.key[:-1]}_{path}", params=request)
            assert refused.status_code == httpx.codes.UNAUTHORIZED
            assert bare.get(f"{gis.url}/key/{gis.operator}{path}", params=request).status_code == httpx.codes.FORBIDDEN
        assert bare.post(keyed).status_code == httpx.codes.NOT_FOUND
        assert bare.get(f"{gis.url}/wms/missions/none").status_code == httpx.codes.UNAUTHORIZED
    assert gis.client.get(f"{gis.url}/wms/missions/none").status_code == httpx.codes.NOT_FOUND
    assert gis.client.post(f"{gis.url}{path}").status_code == httpx.codes.METHOD_NOT_ALLOWED
    assert gis.client.head(f"{gis.url}{path}", params=query()).status_code == httpx.codes.OK
    assert gis.key not in caplog.text
    assert gis.operator not in caplog.text


@pytest.fixture
async def two(make_settings: Callable[..., Settings]) -> AsyncIterator[tuple[Server, Server]]:
    """Two services on one database."""
    async with running(make_settings()) as first, running(make_settings()) as second:
        yield first, second


async def test_another_process_shows_the_same_map(two: tuple[Server, Server]) -> None:
    first, second = two
    async with make_client(first) as at_first, make_client(second) as at_second:
        mission = (await at_first.post("/missions", json=mission_spec())).json()["id"]
        await at_first.post(f"/missions/{mission}/measurements", json={"items": soundings(12)})
        await at_first.get(f"/missions/{mission}/map", timeout=200)
        async with asyncio.timeout(60):
            while (await at_second.get(f"/missions/{mission}")).status_code != httpx.codes.OK:  # noqa: ASYNC110 - as clients do
                await asyncio.sleep(0.05)
        lat, lon = FRAME.to_geographic([0.0, 60.0], [0.0, 60.0])
        box = joined(lon[0], lat[0], lon[1], lat[1])
        for path in ("/wms", f"/wms/missions/{mission}"):
            for changes in ({}, {"LAYERS": "depth,density", "TRANSPARENT": "FALSE"}):
                asked = query(BBOX=box, **changes)
                answers = [
                    await client.get(f"{one.url}{path}", params=asked)
                    for client, one in ((at_first, first), (at_second, second))
                ]
                assert picture_of(answers[0]).any()
                assert answers[0].content == answers[1].content
                assert answers[0].headers["etag"] == answers[1].headers["etag"]
                again = {"If-None-Match": answers[0].headers["etag"]}
                assert (await at_second.get(f"{second.url}{path}", params=asked, headers=again)).status_code == 304
            place_ = soundings(1)[0]
            around = joined(
                place_["lon_deg"] - 1e-6, place_["lat_deg"] - 1e-6, place_["lon_deg"] + 1e-6, place_["lat_deg"] + 1e-6
            )
            info = query(REQUEST="GetFeatureInfo", QUERY_LAYERS="depth", BBOX=around, I=150, J=100)
            texts = [
                (await client.get(f"{one.url}{path}", params=info)).text
                for client, one in ((at_first, first), (at_second, second))
            ]
            assert "Depth: " in texts[0]
            assert texts[0] == texts[1]


async def test_a_mission_that_cannot_be_read_is_left_out_of_the_map_of_all(server: Server, database_url: str) -> None:
    async with make_client(server) as client:
        ids = [(await client.post("/missions", json=mission_spec())).json()["id"] for _ in range(2)]
        # As if its description had been allowed by an earlier version.
        renamed = """update missions set spec = replace(spec, '"max_depth_m"', '"deepest"') where id = :id"""
        await asyncio.to_thread(rows_of, database_url, renamed, id=ids[0])
        wms = server.url + "/wms"
        everything = await client.get(wms, params=query())
        assert (everything.status_code, everything.headers["content-type"]) == (200, "image/png")
        legend = {"REQUEST": "GetLegendGraphic", "LAYER": "depth", "FORMAT": "image/png"}
        assert (await client.get(wms, params=legend)).content == (
            await client.get(f"{wms}/missions/{ids[1]}", params=legend)
        ).content
