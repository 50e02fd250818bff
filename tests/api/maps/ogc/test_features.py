"""Requirements of OGC API – Features parts 1, 2 and 3, as its abstract test suites put them, of the classes claimed."""

from datetime import UTC, datetime
from typing import Any

import httpx
import pyproj
import pytest
import shapely

from tests.api.maps.conftest import SOUNDINGS, START_S, Gis
from tests.support.missions.specs import FRAME

COLLECTIONS = ("areas", "tracks", "soundings", "contours", "holidays", "vehicles", "traffic")
CRS84 = "http://www.opengis.net/def/crs/OGC/1.3/CRS84"
EPSG = "http://www.opengis.net/def/crs/EPSG/0/"
UTM29 = f"{EPSG}32629"
JSON, GEOJSON = "application/json", "application/geo+json"


def links(body: dict[str, Any]) -> dict[str, dict[str, str]]:
    return {link["rel"]: link for link in body["links"]}


def utc(time_s: float) -> str:
    return datetime.fromtimestamp(time_s, UTC).isoformat().replace("+00:00", "Z")


def joined(*numbers: float) -> str:
    return ",".join(repr(float(number)) for number in numbers)


# Part 1, Core


@pytest.mark.parametrize("slash", ["", "/"])
@pytest.mark.parametrize("of_one", [False, True])
def test_the_landing_page_leads_to_everything(gis: Gis, slash: str, of_one: bool) -> None:
    answer = gis.get((f"/missions/{gis.single}" if of_one else "") + slash)
    assert (answer.status_code, answer.headers["content-type"]) == (200, JSON)
    found = links(answer.json())
    assert {"self", "service-desc", "conformance", "data"} <= found.keys()
    for link in found.values():
        followed = gis.get(link["href"])
        assert followed.status_code == httpx.codes.OK
        assert followed.headers["content-type"] == link["type"]
    assert gis.client.head(found["self"]["href"]).status_code == httpx.codes.OK


def test_only_classes_that_hold_are_claimed(gis: Gis) -> None:
    claimed = gis.json("/conformance")["conformsTo"]
    part = "http://www.opengis.net/spec/ogcapi-features-"
    assert {f"{part}1/1.0/conf/core", f"{part}1/1.0/conf/geojson", f"{part}1/1.0/conf/oas30"} <= set(claimed)
    assert f"{part}2/1.0/conf/crs" in claimed
    assert not [one for one in claimed if one.endswith(("html", "gmlsf0", "filter"))]


def test_every_collection_is_described_in_the_list_and_by_itself(gis: Gis) -> None:
    body = gis.json("/collections")
    assert links(body)["self"]["type"] == JSON
    assert [collection["id"] for collection in body["collections"]] == list(COLLECTIONS)
    for listed in body["collections"]:
        alone = gis.json(f"/collections/{listed['id']}")
        assert {**alone, "crs": ["#/crs"]} == listed
        found = links(alone)
        assert found["items"]["type"] == GEOJSON
        assert gis.get(found["items"]["href"]).status_code == httpx.codes.OK
        west, south, east, north = alone["extent"]["spatial"]["bbox"][0]
        for feature in gis.everything(listed["id"]):
            extent = shapely.box(west, south, east, north).buffer(1e-6)
            assert extent.covers(shapely.geometry.shape(feature["geometry"])), listed["id"]


@pytest.mark.parametrize("collection", COLLECTIONS)
def test_a_page_of_features_says_what_it_is(gis: Gis, collection: str) -> None:
    answer = gis.get(f"/collections/{collection}/items", limit=2)
    assert answer.headers["content-type"] == GEOJSON
    body = answer.json()
    assert body["type"] == "FeatureCollection"
    assert body["numberReturned"] == len(body["features"]) <= 2
    assert body["features"], collection
    assert abs(datetime.fromisoformat(body["timeStamp"]) - datetime.now(UTC)).total_seconds() < 60
    assert {"self", "collection"} <= links(body).keys()
    for feature in body["features"]:
        assert feature["type"] == "Feature"
        assert feature["properties"]["mission"] in (gis.single, gis.swath)
        shapely.geometry.shape(feature["geometry"])
        alone = gis.get(f"/collections/{collection}/items/{feature['id']}")
        assert alone.headers["content-type"] == GEOJSON
        assert {"self", "collection"} <= links(alone.json()).keys()
        same = {key: value for key, value in alone.json().items() if key != "links"}
        if collection == "vehicles":  # their age grows
            del same["properties"]["age_s"], feature["properties"]["age_s"]
        assert same == feature


@pytest.mark.parametrize("collection", COLLECTIONS)
@pytest.mark.parametrize("limit", [1, 7])
def test_pages_have_every_feature_once(gis: Gis, collection: str, limit: int) -> None:
    whole = gis.items(collection, limit=5000)
    assert "next" not in links(whole)
    assert whole["numberMatched"] == whole["numberReturned"]
    ids = [feature["id"] for feature in gis.everything(collection, limit=limit)]
    assert ids == [feature["id"] for feature in whole["features"]]
    assert len(set(ids)) == len(ids)


def test_more_than_the_most_is_the_most(gis: Gis) -> None:
    assert gis.items("soundings", limit=1_000_000)["numberReturned"] == SOUNDINGS


@pytest.mark.parametrize(
    "query",
    [
        {"limit": "0"},
        {"limit": "-1"},
        {"limit": "many"},
        {"limit": "10000000000000000"},
        {"bbox": "1,2,3"},
        {"bbox": "1,2,3,4,5"},
        {"bbox": "a,b,c,d"},
        {"bbox": "0,nan,1,2"},
        {"bbox": "0,5,1,2"},
        {"bbox": ""},
        {"datetime": "yesterday"},
        {"datetime": "2026-11-23T10:00:00"},
        {"datetime": "2026-13-23T10:00:00Z"},
        {"datetime": "2026-11-23T10:00:00Z/2025-11-23T10:00:00Z"},
        {"datetime": "2026-11-23T10:00:00Z/2026-11-24T10:00:00Z/.."},
        {"crs": "EPSG:4326"},
        {"crs": f"{EPSG}27700"},
        {"bbox": "0,0,1,1", "bbox-crs": "none"},
        {"bogus": "1"},
        {"depth_m": "3"},
        {"f": "html"},
    ],
)
def test_what_cannot_be_taken_is_answered_400(gis: Gis, query: dict[str, str]) -> None:
    answer = gis.get("/collections/tracks/items", **query)
    assert (answer.status_code, answer.headers["content-type"]) == (400, "application/problem+json")
    assert answer.json()["type"] == "urn:bathyfleet:problem:invalid-parameter"
    assert answer.json()["remedy"]


@pytest.mark.parametrize(
    "path", ["", "/conformance", "/api", "/collections", "/collections/areas", "/collections/areas/queryables"]
)
def test_unknown_parameters_are_refused_everywhere(gis: Gis, path: str) -> None:
    assert gis.get(path, bogus="1").status_code == httpx.codes.BAD_REQUEST
    assert gis.get(path, f="json").status_code == httpx.codes.OK


@pytest.mark.parametrize(
    "path",
    [
        "/collections/nothing",
        "/collections/nothing/items",
        "/collections/areas/items/nothing",
        "/collections/soundings/items/999999999",
        "/collections/soundings/items/x",
        "/missions/none",
        "/missions/none/collections",
    ],
)
def test_what_there_is_not_is_answered_404(gis: Gis, path: str) -> None:
    answer = gis.get(path)
    assert (answer.status_code, answer.headers["content-type"]) == (404, "application/problem+json")


@pytest.mark.parametrize("collection", COLLECTIONS)
def test_a_box_selects_what_touches_it(gis: Gis, collection: str) -> None:
    features = gis.everything(collection)
    for west_m, south_m, east_m, north_m in ((0, 0, 30, 30), (190, -10, 280, 80), (500, 500, 900, 900)):
        lat, lon = FRAME.to_geographic([west_m, east_m], [south_m, north_m])
        box = shapely.box(lon[0], lat[0], lon[1], lat[1])
        wanted = [one["id"] for one in features if shapely.geometry.shape(one["geometry"]).intersects(box)]
        text = joined(*box.bounds)
        body = gis.items(collection, bbox=text)
        assert [feature["id"] for feature in body["features"]] == wanted
        assert body["numberMatched"] == len(wanted)
        high = joined(lon[0], lat[0], -100.0, lon[1], lat[1], 100.0)
        assert [one["id"] for one in gis.everything(collection, bbox=high, limit=3)] == wanted
    over_the_antimeridian = gis.items(collection, bbox="170,-90,-8,90")
    assert over_the_antimeridian["numberReturned"] == len(features)
    assert gis.items(collection, bbox="170,-90,-170,90")["numberReturned"] == 0


def test_times_select_soundings(gis: Gis) -> None:
    def number(text: str) -> int:
        return int(gis.items("soundings", datetime=text)["numberReturned"])

    first, tenth, last = utc(START_S), utc(START_S + 40), utc(START_S + 4 * (SOUNDINGS - 1))
    assert number(tenth) == 1
    assert number(utc(START_S + 2)) == 0
    assert number(f"{first}/{tenth}") == 11
    assert number(f"../{tenth}") == number(f"/{tenth}") == 11
    assert number(f"{tenth}/..") == number(f"{tenth}/") == SOUNDINGS - 10
    assert number(f"{first}/{last}") == number("../..") == number("2026-11-21") == SOUNDINGS
    assert number("1999-01-01") == 0


def test_times_select_tracks_areas_and_vehicles(gis: Gis) -> None:
    for collection in ("tracks", "vehicles"):
        assert gis.items(collection, datetime=f"{utc(START_S)}/..")["numberReturned"] == 2
        assert gis.items(collection, datetime=f"../{utc(START_S - 1)}")["numberReturned"] == 0
    (track,) = gis.items("tracks", mission=gis.single)["features"]
    assert track["properties"]["start_datetime"].startswith(utc(START_S)[:-1])
    now = utc(datetime.now(UTC).timestamp())
    for collection in ("areas", "contours", "holidays"):
        some = gis.items(collection)["numberReturned"]
        assert gis.items(collection, datetime=now)["numberReturned"] == some > 0
        assert gis.items(collection, datetime="../1999-01-01T00:00:00Z")["numberReturned"] == 0


# Part 1, OpenAPI 3.0


def test_the_description_names_what_is_taken(gis: Gis) -> None:
    answer = gis.get("/api")
    assert answer.headers["content-type"] == "application/vnd.oai.openapi+json;version=3.0"
    body = answer.json()
    assert body["openapi"].startswith("3.0")
    ids = [methods["get"]["operationId"] for methods in body["paths"].values()]
    assert len(set(ids)) == len(ids)
    for name in COLLECTIONS:
        operation = body["paths"][f"/collections/{name}/items"]["get"]
        parameters = {parameter["name"]: parameter for parameter in operation["parameters"]}
        assert {"limit", "bbox", "datetime", "crs", "bbox-crs", "mission"} <= parameters.keys()
        assert parameters["limit"]["schema"] == {"type": "integer", "minimum": 1, "maximum": 5000, "default": 500}
        schema = operation["responses"]["200"]["content"][GEOJSON]["schema"]
        declared = schema["properties"]["features"]["items"]["properties"]["properties"]["properties"]
        for feature in gis.everything(name):
            assert feature["properties"].keys() == declared.keys()


# Part 2, coordinate reference systems


def test_systems_are_offered_where_they_fit(gis: Gis) -> None:
    body = gis.json("/collections")
    assert body["crs"] == [CRS84, f"{EPSG}4326", f"{EPSG}3857", UTM29]
    assert {collection["storageCrs"] for collection in body["collections"]} == {CRS84}


@pytest.mark.parametrize("collection", COLLECTIONS)
@pytest.mark.parametrize("code", [4326, 3857, 32629])
def test_features_come_in_the_system_that_is_asked_for(gis: Gis, collection: str, code: int) -> None:
    crs = f"{EPSG}{code}"
    plain = gis.get(f"/collections/{collection}/items")
    assert plain.headers["content-crs"] == f"<{CRS84}>"
    answer = gis.get(f"/collections/{collection}/items", crs=crs)
    assert answer.headers["content-crs"] == f"<{crs}>"
    transformer = pyproj.Transformer.from_crs("OGC:CRS84", f"EPSG:{code}")
    for here, there in zip(plain.json()["features"], answer.json()["features"], strict=True):
        wanted = shapely.transform(
            shapely.geometry.shape(here["geometry"]), lambda at: shapely_columns(*transformer.transform(*at.T))
        )
        found = shapely.geometry.shape(there["geometry"])
        assert shapely.equals_exact(found, wanted, 1e-2 if code != 4326 else 1e-7), here["id"]
    alone = gis.get(f"/collections/{collection}/items/{answer.json()['features'][0]['id']}", crs=crs)
    assert alone.headers["content-crs"] == f"<{crs}>"
    assert alone.json()["geometry"] == answer.json()["features"][0]["geometry"]


def shapely_columns(first: Any, second: Any) -> Any:
    return shapely.get_coordinates(shapely.points(first, second))


@pytest.mark.parametrize("code", [4326, 3857, 32629])
def test_boxes_are_taken_in_every_system(gis: Gis, code: int) -> None:
    lat, lon = FRAME.to_geographic([0.0, 25.0], [0.0, 25.0])
    wanted = gis.items("soundings", bbox=f"{lon[0]},{lat[0]},{lon[1]},{lat[1]}")
    first, second = pyproj.Transformer.from_crs("OGC:CRS84", f"EPSG:{code}").transform(lon, lat)
    box = joined(first[0], second[0], first[1], second[1])
    found = gis.items("soundings", **{"bbox": box, "bbox-crs": f"{EPSG}{code}"})
    assert 5 < found["numberMatched"] < SOUNDINGS
    assert abs(found["numberMatched"] - wanted["numberMatched"]) <= (0 if code != 32629 else 3), "UTM is turned"


# Part 3, queryables


@pytest.mark.parametrize("collection", COLLECTIONS)
def test_features_are_asked_for_by_what_is_queryable(gis: Gis, collection: str) -> None:
    described = gis.json(f"/collections/{collection}")
    link = links(described)["http://www.opengis.net/def/rel/ogc/1.0/queryables"]
    answer = gis.get(link["href"])
    assert answer.headers["content-type"] == "application/schema+json"
    schema = answer.json()
    assert schema["$id"] == link["href"]
    assert (schema["type"], schema["additionalProperties"]) == ("object", False)
    features = gis.everything(collection)
    for name in schema["properties"]:
        for value in {feature["properties"][name] for feature in features}:
            wanted = [feature["id"] for feature in features if feature["properties"][name] == value]
            assert [one["id"] for one in gis.everything(collection, **{name: value, "limit": 5})] == wanted
        assert gis.items(collection, **{name: "nobody"})["numberMatched"] == 0


# What is ours


def test_a_mission_has_a_service_of_its_own(gis: Gis) -> None:
    for mission in (gis.single, gis.swath):
        for collection in COLLECTIONS:
            own = gis.json(f"/missions/{mission}/collections/{collection}/items")
            among_all = gis.items(collection, mission=mission)
            assert [one["id"] for one in own["features"]] == [one["id"] for one in among_all["features"]]
            assert f"/ogc/missions/{mission}/" in links(own)["self"]["href"]
    missing = gis.json(f"/missions/{gis.swath}/collections/soundings/items")
    assert (missing["features"], missing["numberMatched"]) == ([], 0)


def test_features_are_what_was_measured(gis: Gis) -> None:
    sounding = gis.items("soundings", limit=1)["features"][0]
    east, north = FRAME.to_local(*sounding["geometry"]["coordinates"][::-1])
    assert sounding["properties"]["depth_m"] == pytest.approx(6.0 + 0.08 * east + 0.02 * north, abs=0.01)
    depths = [one["properties"]["depth_m"] for one in gis.everything("contours", mission=gis.single)]
    assert depths == sorted(depths)
    assert len(depths) > 3
    (holiday,) = gis.everything("holidays")
    assert (holiday["properties"]["mission"], holiday["properties"]["area_m2"]) == (gis.swath, pytest.approx(64.0))
    assert holiday["id"] == f"{gis.swath}.1"


def test_paging_goes_on_where_it_was_while_soundings_come(gis: Gis) -> None:
    page = gis.items("soundings", limit=40)
    headers = {"Authorization": f"Bearer {gis.operator}"}
    later = [{"vehicle": "rover", "time_s": START_S + 1e4, "lat_deg": 41.1852, "lon_deg": -8.7047, "depth_m": 2.0}]
    address = f"{gis.url}/api/v1/missions/{gis.single}/measurements"
    gis.client.post(address, json={"items": [later[0] | {"range_m": 6.0}]}, headers=headers).raise_for_status()
    following = gis.json(links(page)["next"]["href"])
    ids = [one["id"] for one in page["features"] + following["features"]]
    assert ids == sorted(set(ids))
    assert len(ids) == SOUNDINGS + 1


def test_after_a_number_that_no_sounding_has_there_are_none(gis: Gis) -> None:
    assert gis.items("soundings", after="9" * 30)["features"] == []
