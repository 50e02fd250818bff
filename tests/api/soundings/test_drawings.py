"""Lines and areas of files over REST: read locked in, and as missions take them."""

from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import shapely

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.spec.survey_lines import MOST_LINES
from tests.support.api.rest import mission_spec
from tests.support.mapping import line_files
from tests.support.mapping.line_files import UTM

PLAN = {
    "101": [(-8.7049, 41.1851), (-8.7049, 41.1854)],
    "bent": [(-8.7047, 41.1851), (-8.7046, 41.1853), (-8.7047, 41.1854)],
}
RING = [(-8.705, 41.185), (-8.7043, 41.185), (-8.7043, 41.1855), (-8.705, 41.1855)]


async def read(client: httpx.AsyncClient, content: bytes, filename: str, **more: str) -> httpx.Response:
    return await client.post("/drawings", content=content, params={"filename": filename, **more})


@pytest.mark.slow
async def test_a_mission_is_made_of_what_a_file_holds(client: httpx.AsyncClient) -> None:
    answer = await read(client, line_files.kml(PLAN, {"Basin": RING}), "plan.kml")
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert [one["name"] for one in found["lines"]] == ["101", "bent"]
    assert found["lines"][0]["length_m"] == pytest.approx(33.3, abs=0.1)
    [basin] = found["areas"]
    assert basin["area_m2"] == pytest.approx(58.7 * 55.5, rel=0.01)
    assert (await client.get("/missions")).json() == []
    lines = [{key: one[key] for key in ("name", "coordinates")} for one in found["lines"]]
    spec = mission_spec(area=basin["area"], survey_lines=lines, planner={"name": "lawnmower"})
    made = await client.post("/missions", json=spec)
    assert made.status_code == 201, made.text
    assert [one["name"] for one in made.json()["spec"]["survey_lines"]] == ["101", "bent"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [".geojson", ".kmz", ".gpx", ".dxf", ".zip", ".csv", ".lnw"])
async def test_each_format_is_read_where_the_reader_is_locked_in(
    client: httpx.AsyncClient, tmp_path: Path, kind: str
) -> None:
    write: dict[str, Any] = {
        ".geojson": line_files.geojson,
        ".kmz": line_files.kmz,
        ".gpx": line_files.gpx,
        ".dxf": line_files.dxf,
        ".zip": lambda plan: line_files.shapefile(plan, tmp_path),
        ".csv": line_files.table,
        ".lnw": line_files.lnw,
    }
    stated = {"crs": UTM} if kind in (".dxf", ".lnw") else {}
    answer = await read(client, write[kind](PLAN), f"Plan 1{kind.upper()}", **stated)
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert {one["name"]: len(one["coordinates"]) for one in found["lines"]} == {"101": 2, "bent": 3}
    for one in found["lines"]:
        for place, given in zip(one["coordinates"], PLAN[one["name"]], strict=True):
            assert place == pytest.approx(given, abs=2e-8)
    assert found["notes"] == []


@pytest.mark.slow
async def test_the_area_around_the_lines_has_few_corners_and_room_beyond_all_of_them(client: httpx.AsyncClient) -> None:
    side_by_side = {str(k): [(-8.705 + 2e-4 * k, 41.1851), (-8.705 + 2e-4 * k, 41.1863)] for k in range(12)}
    frame = LocalFrame(41.186, -8.704)
    for margin_m in (50.0, 8.0):
        stated = {} if margin_m == 50.0 else {"margin_m": str(margin_m)}
        found = (await read(client, line_files.kml(side_by_side), "a.kml", **stated)).json()
        [ring] = found["around"]["coordinates"]
        assert 4 <= len(ring) - 1 <= 8
        lons, lats = np.array(ring).T
        around = shapely.Polygon(np.column_stack(frame.to_local(lats, lons)))
        for line in side_by_side.values():
            lons, lats = np.array(line).T
            east, north = frame.to_local(lats, lons)
            for place in shapely.points(east, north):
                assert around.contains(place)
                assert around.exterior.distance(place) >= margin_m - 1.0
    far = {"here": [(-8.7, 41.1), (-8.7, 41.2)], "there": [(8.7, 51.1), (8.7, 51.2)]}
    assert (await read(client, line_files.kml(far), "a.kml")).json()["around"] is None
    only_area = await read(client, line_files.kml({}, {"Basin": RING}), "a.kml")
    assert only_area.json()["around"] is None


@pytest.mark.slow
async def test_as_many_lines_as_a_mission_takes_may_have_names_in_any_script(client: httpx.AsyncClient) -> None:
    lines = {f"測線 {k} " + 40 * "海": [(-8.705, 41.185), (-8.704, 41.185)] for k in range(MOST_LINES)}
    answer = await read(client, line_files.geojson(lines), "plan.geojson")
    assert answer.status_code == 200, answer.text
    assert [one["name"] for one in answer.json()["lines"]] == list(lines)


@pytest.mark.slow
async def test_an_area_that_crosses_itself_is_left_out(client: httpx.AsyncClient) -> None:
    crossed = [RING[0], RING[2], RING[1], RING[3]]
    found = (await read(client, line_files.kml(PLAN, {"8": crossed}), "a.kml")).json()
    assert found["areas"] == []
    assert found["notes"] == ["area 8 is left out: its outline crosses or touches itself"]


@pytest.mark.parametrize(
    ("content", "params", "field", "said"),
    [
        (b"x", {"filename": "plan.dwg"}, "filename", "no ending that is read"),
        (b"", {"filename": "plan.kml"}, "file", "empty"),
        (b"hunter2 is no plan", {"filename": "plan.kml"}, "file", "no KML file"),
        (line_files.lnw(PLAN), {"filename": "plan.lnw"}, "crs", "does not say what its positions are in"),
        (line_files.lnw(PLAN), {"filename": "plan.lnw", "crs": "hunter3"}, "crs", "no coordinate reference system"),
    ],
)
async def test_what_cannot_be_read_is_said(
    client: httpx.AsyncClient, content: bytes, params: dict[str, str], field: str, said: str
) -> None:
    answer = await client.post("/drawings", content=content, params=params)
    assert answer.status_code == 422
    [problem] = answer.json()["errors"]
    assert problem["field"].endswith(field)
    assert said in answer.text
    assert "hunter2" not in answer.text
