"""Lines and areas from files of plans, written by programs that did not read them."""

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyogrio
import pyogrio.raw
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from app.mapping.readers.drawings import MAX_LAYERS, MAX_UNPACKED_BYTES, MOST_CORNERS, Drawing, read_drawings
from app.mapping.readers.file_extensions import DRAWINGS, drawing_ending
from app.mapping.readers.types import MAX_DRAWINGS, ReadError
from tests.support.mapping import line_files
from tests.support.mapping.line_files import UTM, zipped

PLAN = {
    "101": [(-8.7049, 41.1851), (-8.7049, 41.1859)],
    "102 São João": [(-8.7047, 41.1851), (-8.7046, 41.1854), (-8.7047, 41.1859)],
    "X-1": [(-8.7049, 41.1852), (-8.7045, 41.1853), (-8.7041, 41.1852), (-8.7039, 41.1853)],
}
RING = [(-8.705, 41.185), (-8.7038, 41.185), (-8.7038, 41.1859), (-8.705, 41.1859)]

WRITERS: dict[str, tuple[Callable[..., bytes], str | None]] = {
    ".geojson": (line_files.geojson, None),
    ".kml": (line_files.kml, None),
    ".kmz": (line_files.kmz, None),
    ".gpx": (line_files.gpx, None),
    ".dxf": (line_files.dxf, UTM),
    ".csv": (line_files.table, None),
    ".lnw": (line_files.lnw, UTM),
}


def same_plan(found: list[Drawing]) -> None:
    assert [(one.kind, one.name) for one in found] == [("line", name) for name in PLAN]
    for one, line in zip(found, PLAN.values(), strict=True):
        assert one.places == pytest.approx(np.array(line), abs=2e-9)


@pytest.mark.parametrize("kind", WRITERS)
def test_a_line_plan_is_read_with_its_names(kind: str) -> None:
    write, crs = WRITERS[kind]
    found, notes = read_drawings(write(PLAN), kind, crs)
    same_plan(found)
    assert notes == []


def test_a_shapefile_says_by_itself_what_it_is_in(tmp_path: Path) -> None:
    content = line_files.shapefile(PLAN, tmp_path)
    same_plan(read_drawings(content, ".zip", None)[0])
    _, notes = read_drawings(content, ".zip", "EPSG:4326")
    assert notes == ["the file states its own coordinate reference system; crs is not used"]


def test_a_shapefile_without_a_system_has_to_be_told_it(tmp_path: Path) -> None:
    content = line_files.shapefile(PLAN, tmp_path, crs=None)
    with pytest.raises(ReadError, match="does not say what its positions are in") as caught:
        read_drawings(content, ".zip", None)
    assert caught.value.field == "crs"
    same_plan(read_drawings(content, ".zip", UTM)[0])


@pytest.mark.parametrize("kind", [".dxf", ".lnw"])
def test_plane_positions_have_to_be_told_what_they_are_in(kind: str) -> None:
    content = WRITERS[kind][0](PLAN)
    for crs, words in ((None, "does not say"), ("EPSG:4326", "nowhere on earth"), ("EPSG:9999999", "no coordinate")):
        with pytest.raises(ReadError, match=words) as caught:
            read_drawings(content, kind, crs)
        assert caught.value.field == "crs"


def test_polygons_and_closed_polylines_are_areas() -> None:
    found, _ = read_drawings(line_files.kml(PLAN, {"Basin": RING}), ".kml", None)
    assert [(one.kind, one.name) for one in found if one.kind == "area"] == [("area", "Basin")]
    closed, _ = read_drawings(line_files.dxf({"BASIN": RING, "B2": RING}, closed=True), ".dxf", UTM)
    assert [(one.kind, one.name) for one in closed] == [("area", "BASIN"), ("area", "B2")]
    for one in closed:
        assert one.places == pytest.approx(np.array(RING), abs=2e-9)


def test_parts_and_lines_of_the_same_name_are_told_apart_and_nameless_ones_numbered() -> None:
    several = {"type": "MultiLineString", "coordinates": [PLAN["101"], PLAN["X-1"]]}
    features = [
        {"type": "Feature", "properties": {"name": name}, "geometry": geometry}
        for name, geometry in (
            ("7", several),
            ("7", {"type": "LineString", "coordinates": PLAN["101"]}),
            ("7-2", {"type": "LineString", "coordinates": PLAN["101"]}),
            (None, {"type": "LineString", "coordinates": PLAN["101"]}),
            ("p", {"type": "Point", "coordinates": [-8.7, 41.18]}),
            ("h", {"type": "Polygon", "coordinates": [[*RING, RING[0]], [RING[0], PLAN["101"][0], RING[1], RING[0]]]}),
        )
    ]
    content = json.dumps({"type": "FeatureCollection", "features": features}).encode()
    found, notes = read_drawings(content, ".geojson", None)
    assert [one.name for one in found] == ["7", "7-3", "7-4", "7-2", "5", "h"]
    assert len({one.name for one in found}) == len(found)
    assert notes == ["1 points are left out", "1 holes in areas are left out"]


@pytest.mark.parametrize(
    ("text", "crs"),
    [
        ("a,-8.7,41.1,-8.6,41.1\nb,-8.7,41.2,-8.6,41.2\n", "EPSG:4326"),
        ("a;-8,7;41,1\na;-8,6;41,1\nb;-8,7;41,2\nb;-8,6;41,2\n", "EPSG:4326"),
        ("# plan\nlongitude\tlatitude\tline\n-8.7\t41.1\ta\n-8.6\t41.1\ta\n-8.7\t41.2\tb\n-8.6\t41.2\tb\n", None),
        ("a -8.7 41.1\na -8.6 41.1\nb -8.7 41.2\nb -8.6 41.2\n", "EPSG:4326"),
    ],
)
def test_tables_come_with_and_without_a_header(text: str, crs: str | None) -> None:
    found, _ = read_drawings(text.encode(), ".txt", crs)
    assert [one.name for one in found] == ["a", "b"]
    assert found[1].places == pytest.approx(np.array([[-8.7, 41.2], [-8.6, 41.2]]))


def test_old_text_and_long_lines_are_read_too() -> None:
    latin = "name,lon,lat\nSão,-8.7,41.1\nSão,-8.6,41.1\n".encode("latin-1")
    assert read_drawings(latin, ".csv", None)[0][0].name == "São"
    track = [(-8.7 + 1e-6 * k, 41.1) for k in range(5000)]
    [one] = read_drawings(line_files.geojson({"track": track}), ".json", None)[0]
    assert one.places == pytest.approx(np.array([track[0], track[-1]]))
    wild = [(-8.7 + 1e-4 * k, 41.1 + 1e-4 * (k % 2)) for k in range(1500)]
    with pytest.raises(ReadError, match="1500 positions"):
        read_drawings(line_files.geojson({"wild": wild}), ".json", None)


def bomb() -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("doc.kml", "w") as member:
        for _ in range(MAX_UNPACKED_BYTES // 2**20 + 1):
            member.write(bytes(2**20))
    return packed.getvalue()


@pytest.mark.parametrize(
    ("content", "kind", "words"),
    [
        (b"", ".geojson", "no GEOJSON file"),
        (b"{}", ".geojson", "cannot be read|neither lines"),
        (b'{"type": "FeatureCollection", "features": []}', ".json", "neither lines nor areas"),
        (b"<kml><Placemark>", ".kml", "cannot be read|neither lines"),
        (b"<gpx></gpx>", ".kml", "no KML file"),
        (b'<!DOCTYPE kml [<!ENTITY a "b">]><kml>&a;</kml>', ".kml", "no KML file"),
        (b"<OGRVRTDataSource><!-- <kml --></OGRVRTDataSource>", ".kml", "no KML file"),
        (b"AutoCAD Binary DXF\r\n\x1a\x00SEC", ".dxf", "no DXF file"),
        (b"PK\x03\x04", ".zip", "no .zip archive"),
        (zipped({"readme.txt": b"x"}), ".zip", "holds no .shp"),
        (zipped({"a.shp": b"x"}), ".zip", "without its .shx"),
        (zipped({"a.shp": b"x", "a.shx": b"x"}), ".zip", "cannot be read|neither lines"),
        (zipped({"a.txt": b"x"}), ".kmz", "holds no .kml"),
        (zipped({f"{k}": b"" for k in range(1001)}), ".kmz", "more than 1000 members"),
        (b"name,lon,lat\na,1\n", ".csv", "column 3 is no number"),
        (b"name,lon,lat\na,inf,2\n", ".csv", "column 2 is no number"),
        (b"a,b\n", ".csv", "2 columns"),
        (b"\n", ".csv", "no rows"),
        (b"hello", ".lnw", "no line file of Hypack"),
        (b"LIN 2\nPTS 1 x\n", ".lnw", "column 2 is no number"),
        (line_files.geojson({str(k): PLAN["101"] for k in range(MAX_DRAWINGS + 1)}), ".json", "2101 lines"),
    ],
)
def test_what_cannot_be_used_is_said(content: bytes, kind: str, words: str) -> None:
    with pytest.raises(ReadError, match=words) as caught:
        read_drawings(content, kind, "EPSG:4326" if kind == ".lnw" else None)
    assert caught.value.remedy


def test_an_archive_that_unpacks_to_very_much_is_not_unpacked() -> None:
    with pytest.raises(ReadError, match="unpacks to more than 100 MB"):
        read_drawings(bomb(), ".kmz", None)


@given(content=st.binary(max_size=200), kind=st.sampled_from(DRAWINGS), begin=st.sampled_from([*WRITERS, ""]))
@settings(max_examples=60, deadline=None)
def test_whatever_a_file_holds_it_is_read_or_refused(content: bytes, kind: str, begin: str) -> None:
    head = WRITERS[begin][0](PLAN)[: 7 * len(content)] if begin else b""
    try:
        found, _ = read_drawings(head + content, kind, UTM)
    except ReadError:
        return
    assert all(np.isfinite(one.places).all() for one in found)


def test_endings_are_told_by_name() -> None:
    assert drawing_ending("Plan.LNW") == ".lnw"
    with pytest.raises(ReadError, match="no ending that is read"):
        drawing_ending("plan.dwg")


def test_what_macos_packs_beside_a_document_is_passed_over() -> None:
    beside = {"__MACOSX/._doc.kml": b"\0\5\x16\7" + bytes(60)}
    found, notes = read_drawings(zipped(beside | {"doc.kml": line_files.kml(PLAN)}), ".kmz", None)
    assert notes == []
    same_plan(found)


def test_a_file_of_more_folders_than_are_read_is_refused_rather_than_cut() -> None:
    lines = "".join(
        f"<Folder><name>f{k}</name><Placemark><LineString><coordinates>1,2 1.1,2</coordinates></LineString></Placemark>"
        "</Folder>"
        for k in range(MAX_LAYERS + 1)
    )
    with pytest.raises(ReadError, match=f"{MAX_LAYERS + 1} layers or folders"):
        read_drawings(f"<kml><Document>{lines}</Document></kml>".encode(), ".kml", None)


def test_what_is_left_out_of_many_shapefiles_is_said_once(tmp_path: Path) -> None:
    files: dict[str, bytes] = {}
    for k in range(15):
        folder = tmp_path / str(k)
        folder.mkdir()
        with zipfile.ZipFile(io.BytesIO(line_files.shapefile({f"{k}": PLAN["101"]}, folder))) as packed:
            files |= {f"{k}_{name}": packed.read(name) for name in packed.namelist()}
        pyogrio_points(folder / "points.shp")
        files |= {f"p{k}{one.suffix}": one.read_bytes() for one in folder.glob("points.*")}
    found, notes = read_drawings(zipped(files), ".zip", None)
    assert len(found) == 15
    assert notes == ["15 points are left out"]


def pyogrio_points(path: Path) -> None:
    points = shapely.to_wkb(np.array([shapely.Point(-8.7, 41.2)]))
    pyogrio.raw.write(path, points, [], [], geometry_type="Point", crs="EPSG:4326", driver="ESRI Shapefile")


def test_metres_in_geojson_that_says_nothing_are_in_the_system_that_is_given() -> None:
    places = [line_files.in_utm(line) for line in PLAN.values()]
    features = [
        {
            "type": "Feature",
            "properties": {"name": name},
            "geometry": {"type": "LineString", "coordinates": [list(place) for place in line]},
        }
        for name, line in zip(PLAN, places, strict=True)
    ]
    content = json.dumps({"type": "FeatureCollection", "features": features}).encode()
    with pytest.raises(ReadError, match="nowhere on earth"):
        read_drawings(content, ".geojson", None)
    found, notes = read_drawings(content, ".geojson", UTM)
    same_plan(found)
    assert notes == []


@pytest.mark.parametrize("text", ["1 -8.7 41.1 \n1 -8.7 41.2 \n", "1,-8.7,41.1,,\n1,-8.7,41.2,,\n"])
def test_nothing_at_the_ends_of_rows_is_no_column(text: str) -> None:
    [one], _ = read_drawings(text.encode(), ".csv", "EPSG:4326")
    assert one.places == pytest.approx(np.array([(-8.7, 41.1), (-8.7, 41.2)]))


def test_a_table_with_a_cell_beyond_all_measure_is_refused() -> None:
    with pytest.raises(ReadError, match="no table"):
        read_drawings(b"name,lon,lat\n" + 200_000 * b"a" + b",1,2\n", ".csv", None)


def test_degrees_are_not_taken_for_metres() -> None:
    with pytest.raises(ReadError, match="degrees") as refused:
        read_drawings(line_files.table(PLAN), ".csv", UTM)
    assert refused.value.field == "crs"
    found, _ = read_drawings(line_files.table(PLAN), ".csv", "EPSG:4258")
    same_plan(found)


def test_an_outline_has_as_many_corners_as_an_area_takes() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, MOST_CORNERS + 1)
    away = np.where(np.arange(MOST_CORNERS) % 2, 0.1, 0.101)
    ring = [(1.0 + r * np.cos(a), 2.0 + r * np.sin(a)) for a, r in zip(turn[:-1], away, strict=True)]
    content = json.dumps({"type": "LineString", "coordinates": [*ring, ring[0]]}).encode()
    with pytest.raises(ReadError, match="one area has"):
        read_drawings(content, ".json", None)
