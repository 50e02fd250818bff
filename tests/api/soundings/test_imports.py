"""Files from elsewhere: all of one or nothing, once, and apart from the mission's own soundings."""

import asyncio
import gzip
import io
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import rasterio
from affine import Affine

from app.mapping.coordinates.georeference import LocalFrame
from app.settings import Settings
from tests.support.api.rest import make_client, mission_spec, prior_text, running, soundings
from tests.support.faults.hostile import sparse_tif
from tests.support.mapping.multibeam import line, write_gsf, write_kmall
from tests.support.missions.specs import AREA

FRAME = LocalFrame(AREA["coordinates"][0][0][1], AREA["coordinates"][0][0][0])


def reference_tif(depth_m: float = 10.0) -> bytes:
    with rasterio.MemoryFile() as memory:
        with memory.open(
            driver="GTiff", width=40, height=40, count=1, dtype="float32", crs=FRAME.crs.to_wkt(),
            transform=Affine(2, 0, -10, 0, -2, 70),
        ) as file:  # fmt: skip
            file.write(np.full((40, 40), depth_m, np.float32), 1)
        return bytes(memory.read())


@pytest.fixture
async def path(client: httpx.AsyncClient, mission: dict[str, Any]) -> str:
    return f"/missions/{mission['id']}"


async def send(client: httpx.AsyncClient, path: str, content: bytes, **query: Any) -> httpx.Response:
    return await client.post(f"{path}/imports", content=content, params={"filename": "old.csv"} | query)


async def test_of_another_datum_that_imported_depths_do_not_follow_the_log_warns(
    client: httpx.AsyncClient, path: str
) -> None:
    async def warnings() -> list[str]:
        events = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
        return [one["message"] for one in events if one["level"] == "warning" and one["kind"] == "corrections"]

    await client.put(f"{path}/tide", json={"level_m": 0.5, "datum_epsg": 5861, "source": "gauge"})
    await send(client, path, prior_text())
    before = (await client.get(f"{path}/map")).json()["min_depth_m"]
    await client.put(f"{path}/tide", json={"level_m": 0.7, "datum_epsg": 5861, "source": "gauge"})
    assert await warnings() == []
    await client.put(f"{path}/tide", json={"level_m": 0.7, "datum_epsg": 5861, "datum_offset_m": 2.0})
    (words,) = await warnings()
    assert words.startswith("imported depths (old.csv) stay as they are. Soundings were below EPSG:5861 LAT depth, by")
    assert "datum offset +2.000 m" in words
    assert (await client.get(f"{path}/map")).json()["min_depth_m"] == pytest.approx(before)


async def mission_below(client: httpx.AsyncClient, datum_epsg: int | None) -> str:
    path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
    if datum_epsg is not None:
        answer = await client.put(f"{path}/tide", json={"level_m": 0.5, "datum_epsg": datum_epsg, "source": "gauge"})
        assert answer.status_code == 200, answer.text
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("product", "filename"), [("map.tif", "t.tif"), ("map.nc", "t.nc"), ("map.bag", "t.bag"), ("map.s102", "t.h5")]
)
async def test_a_file_below_another_datum_is_taken_only_with_the_offset(
    client: httpx.AsyncClient, product: str, filename: str
) -> None:
    source = await mission_below(client, 5861)
    await client.post(f"{source}/measurements", json={"items": soundings(40)})
    exported = await client.get(f"{source}/{product}")
    assert exported.status_code == 200, exported.text
    path = await mission_below(client, 5715)
    query: dict[str, str | float] = {"filename": filename, "sd_m": 0.3}
    for method, kind in (("POST", "imports"), ("PUT", "reference")):
        refused = await client.request(method, f"{path}/{kind}", content=exported.content, params=query)
        assert refused.status_code == 422, refused.text
        (error,) = refused.json()["errors"]
        assert "datum_offset_m" in error["field"]
        assert "its values count from " in error["message"]
        assert "LAT" in error["message"]
        assert "the mission's depths from EPSG:5715 MSL depth" in error["message"]
    assert (await client.get(f"{path}/imports")).json() == []
    given = await client.post(f"{path}/imports", content=exported.content, params=query | {"datum_offset_m": 0.0})
    assert given.status_code == 201, given.text
    assert not any(note.startswith("vertical datum") for note in given.json()["notes"])

    same = await client.post(f"{source}/imports", content=exported.content, params=query)
    assert same.status_code == 201, same.text
    assert not any(note.startswith("vertical datum") for note in same.json()["notes"])


@pytest.mark.slow
async def test_where_only_one_of_file_and_mission_states_a_datum_answer_and_log_say_so(
    client: httpx.AsyncClient,
) -> None:
    tidal, plain = await mission_below(client, 5861), await mission_below(client, None)
    await client.post(f"{tidal}/measurements", json={"items": soundings(40)})
    exported = (await client.get(f"{tidal}/map.tif")).content
    stated = await send(client, plain, exported, filename="t.tif", sd_m=0.3)
    unstated = await send(client, tidal, prior_text())
    for answer, words in (
        (stated, "vertical datum: the file states EPSG:5861 LAT depth, the mission none"),
        (unstated, "vertical datum: the mission states EPSG:5861 LAT depth, the file none"),
    ):
        assert answer.status_code == 201, answer.text
        assert [note for note in answer.json()["notes"] if note.startswith(words)], answer.json()["notes"]
    for path in (tidal, plain):
        events = (await client.get(f"{path}/events", headers={"Accept": "application/json"})).json()
        assert [one for one in events if one["level"] == "warning" and "vertical datum: " in one["message"]]


@pytest.mark.slow
async def test_an_import_that_is_off_from_what_was_sounded_says_by_how_much(
    client: httpx.AsyncClient, path: str
) -> None:
    await client.post(f"{path}/measurements", json={"items": soundings(40)})
    exported = (await client.get(f"{path}/map.tif")).content
    fits = await send(client, path, exported, filename="t.tif", datum_offset_m=0.0, sd_m=0.3)
    assert fits.status_code == 201, fits.text
    assert not [note for note in fits.json()["notes"] if "median" in note]
    await client.delete(f"{path}/imports/{fits.json()['id']}")
    off = await send(client, path, exported, filename="t.tif", datum_offset_m=5.0, sd_m=0.3)
    (note,) = [note for note in off.json()["notes"] if "median" in note]
    assert "its depths are +5.0" in note


async def test_a_map_begins_with_what_was_imported_and_tells_it_apart(client: httpx.AsyncClient, path: str) -> None:
    answer = await send(client, path, prior_text(), source="survey of 2019")
    assert answer.status_code == 201, answer.text
    taken = answer.json()
    assert (taken["found"], taken["taken"], taken["median_sd_m"], taken["notes"]) == (30, 30, 0.4, [])
    shown = (await client.get(f"{path}/map", params={"layer": "sounded"})).json()
    assert shown["min_depth_m"] == pytest.approx(9.0, abs=0.2)
    assert sum(map(sum, shown["count"])) == 0
    flags = np.array(shown["layers"]["sounded"], float)
    assert set(np.unique(flags[np.isfinite(flags)])) == {0.0, 2.0}
    assert (await client.get(path)).json()["progress"]["soundings"] == 0

    await client.post(f"{path}/measurements", json={"items": soundings(5)})
    shown = (await client.get(f"{path}/map", params={"layer": "sounded"})).json()
    assert sum(map(sum, shown["count"])) == 5
    assert 1.0 in np.array(shown["layers"]["sounded"], float)
    lines = (await client.get(f"{path}/soundings.csv")).text.splitlines()
    assert len(lines) == 2 + 5

    (listed,) = (await client.get(f"{path}/imports")).json()
    assert (listed["source"], listed["id"]) == ("survey of 2019", taken["id"])
    assert (await client.delete(f"{path}/imports/{taken['id']}")).status_code == 204
    assert (await client.get(f"{path}/imports")).json() == []
    gone = await client.delete(f"{path}/imports/{taken['id']}")
    assert (gone.status_code, gone.json()["type"]) == (404, "urn:bathyfleet:problem:import-not-found")


async def test_the_same_file_counts_once_however_often_it_is_sent(client: httpx.AsyncClient, path: str) -> None:
    answers = await asyncio.gather(*(send(client, path, prior_text()) for _ in range(3)))
    assert sorted(answer.status_code for answer in answers) == [200, 200, 201]
    assert len({answer.json()["id"] for answer in answers}) == 1
    assert len((await client.get(f"{path}/imports")).json()) == 1
    otherwise = await send(client, path, prior_text(), datum_offset_m=1.0)
    assert otherwise.status_code == 409
    assert "with other options" in otherwise.json()["detail"]


@pytest.mark.slow
async def test_an_import_survives_a_restart(make_settings: Any) -> None:
    path = ""
    first: dict[str, Any] = {}
    for run in range(2):
        async with running(make_settings()) as server, make_client(server) as client:
            if run == 0:
                path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
                await send(client, path, prior_text())
                await client.put(f"{path}/reference", content=reference_tif(), params={"filename": "r.tif"})
            quality = (await client.get(f"{path}/quality")).json()
            quality.pop("version")  # counts how often the map was made since the service began
            first = first or quality
            assert quality == first


@pytest.mark.slow
async def test_a_mission_begins_with_the_soundings_of_multibeam_files(
    client: httpx.AsyncClient, path: str, tmp_path: Path
) -> None:
    middle = LocalFrame(*map(float, FRAME.to_geographic(30.0, 28.0)))
    pings = line(middle, error_95_m=np.full(21, 0.392), flags=np.arange(21) == 3)
    content = await asyncio.to_thread(write_gsf, tmp_path / "a.gsf", pings, {"TIDE_COMPENSATED": "YES"})
    cut_off = await send(client, path, content[:-4], filename="line_7.GSF")
    assert cut_off.status_code == 422
    assert cut_off.json()["errors"][0]["field"] == "record 14"
    assert (await client.get(f"{path}/imports")).json() == []
    answer = await send(client, path, content, filename="line_7.GSF", datum_offset_m=0.5)
    assert answer.status_code == 201, answer.text
    taken = answer.json()
    assert (taken["found"], taken["taken"]) == (240, 240)
    assert taken["median_sd_m"] == pytest.approx(0.2, rel=0.01)
    assert taken["min_depth_m"] == pytest.approx(0.5 + min(ping.depth_m.min() for ping in pings), abs=0.001)
    assert "12 of 252 soundings are rejected in the file and left out" in taken["notes"][0]
    assert "reduced for the tide" in taken["notes"][1]
    reference = await client.put(f"{path}/reference", content=content, params={"filename": "line_7.gsf"})
    assert reference.status_code == 200, reference.text
    assert reference.json()["cells"] > 50

    content = await asyncio.to_thread(write_kmall, tmp_path / "a.kmall", line(middle))
    unsaid = await send(client, path, content, filename="a.kmall")
    assert unsaid.json()["errors"][0]["field"] == "sd_m", unsaid.text
    answer = await send(client, path, content, filename="a.kmall", sd_m=0.3)
    assert (answer.status_code, answer.json()["taken"]) == (201, 252), answer.text


@pytest.mark.parametrize(
    ("content", "query", "field"),
    [
        (b"lon,lat,depth\n-8.7,41.1,deep", {}, "line 2, column 3 (depth)"),
        (b"lon,lat,depth\n-8.7048,41.1851,7", {}, "sd_m"),
        (b"", {}, "file"),
        (b"x", {"filename": "old.docx"}, "filename"),
        (b"x", {"filename": "../old.tif"}, "filename"),
        (b"II*\0broken", {"filename": "old.tif"}, "file"),
        (b"lon,lat,depth\n8.7,41.1,7", {"sd_m": 0.5}, "file"),
        (b"lon,lat,depth\n-8.7048,41.1851,7", {"sd_m": -1}, "sd_m"),
        (b"1 2 7", {"sd_m": 1, "crs": "EPSG:1"}, "crs"),
    ],
)
async def test_a_wrong_file_is_refused_by_what_is_wrong_and_nothing_is_stored(
    client: httpx.AsyncClient, path: str, content: bytes, query: dict[str, Any], field: str
) -> None:
    answer = await send(client, path, content, **query)
    assert answer.status_code == 422, answer.text
    assert answer.json()["errors"][0]["field"] == field
    assert (await client.get(f"{path}/imports")).json() == []
    assert (await client.get(f"{path}/map")).status_code == 404


@pytest.mark.slow
async def test_a_bomb_and_a_grid_of_a_million_millions_of_cells_are_refused(
    client: httpx.AsyncClient, path: str
) -> None:
    for name, content in (("bomb.xyz.gz", gzip.compress(bytes(2**20)) * 600), ("huge.tif", sparse_tif())):
        refused = await send(client, path, content, filename=name, crs="local")
        assert refused.status_code == 422, refused.text
        assert refused.json()["errors"][0]["expected"]
    assert (await client.get(f"{path}/imports")).json() == []


async def test_a_file_that_is_too_large_is_refused(make_settings: Any) -> None:
    settings: Settings = make_settings(max_import_bytes=2000)
    async with running(settings) as server, make_client(server) as client:
        path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
        answer = await send(client, path, b"1" * 2001)
        assert (answer.status_code, answer.json()["type"]) == (413, "urn:bathyfleet:problem:body-too-large")
        assert "max_import_bytes" in answer.json()["remedy"]
        assert (await send(client, path, prior_text(20))).status_code == 201


@pytest.mark.slow
async def test_a_reference_grid_tells_how_far_the_map_is_off(client: httpx.AsyncClient, path: str) -> None:
    await send(client, path, prior_text(300))
    assert (await client.get(f"{path}/reference")).status_code == 404
    tag = (await client.get(f"{path}/map")).headers["etag"]
    answer = await client.put(f"{path}/reference", content=reference_tif(), params={"filename": "truth.tif"})
    assert answer.status_code == 200, answer.text
    assert (await client.get(path)).json()["has_reference"] is True
    found = (await client.get(f"{path}/quality")).json()["difference"]
    assert found["bias_m"] == pytest.approx(-1.0, abs=0.1)
    assert found["rmse_m"] == pytest.approx(1.0, abs=0.1)
    assert found["l2_norm"] == pytest.approx(found["rmse_m"] * np.sqrt(found["cells"]))
    assert (await client.get(f"{path}/map", headers={"If-None-Match": tag})).status_code == 200
    shown = (await client.get(f"{path}/map", params={"layer": "difference"})).json()
    layer = np.array(shown["layers"]["difference"], float)
    assert np.nanmean(layer) == pytest.approx(found["bias_m"], abs=1e-3)
    with rasterio.open(io.BytesIO((await client.get(f"{path}/map.tif")).content)) as file:
        band = file.descriptions.index("difference") + 1
        assert file.read(band, masked=True).mean() == pytest.approx(found["bias_m"], abs=1e-3)
    overlay = await client.get(f"{path}/map.overlay.png", params={"layer": "difference", "min": -2, "max": 2})
    assert overlay.status_code == 200
    assert (await client.delete(f"{path}/reference")).status_code == 204
    assert (await client.get(f"{path}/quality")).json()["difference"] is None
    assert (await client.get(path)).json()["has_reference"] is False


async def test_only_operators_import(make_settings: Any) -> None:
    async with running(make_settings()) as server, make_client(server) as client:
        path = f"/missions/{(await client.post('/missions', json=mission_spec())).json()['id']}"
        answer = await client.post(
            f"{path}/imports", params={"filename": "a.xyz"}, content=b"", headers={"Origin": "http://elsewhere.example"}
        )
    assert answer.status_code == 403
