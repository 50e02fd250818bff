"""ENC cells: depths with the chart's quality, and what to keep out of."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.enc import HAZARDS, NO_ZONE_POSITION_M, ZONES_OF_CONFIDENCE, Zone, read_enc, read_zones
from app.mapping.readers.georeferencing import place_soundings
from app.mapping.readers.reader_choice import read_file
from app.mapping.readers.types import MapExtent, ReadError, ReadOptions
from app.mapping.readers.warm_up import SMALL_CELL, SMALL_CELL_AT
from app.mapping.s44 import NORMAL_95
from app.mapping.types import Grid
from app.missions.operations.imports.imports import REASONS
from tests.support.mapping.enc import Cell

LAT, LON = 41.18, -8.70
FRAME = LocalFrame(LAT, LON)
PLACE = MapExtent(FRAME, Grid(-500.0, -500.0, 1.0, 1000, 1000), 0.0)


def at(east_m: float, north_m: float) -> tuple[float, float]:
    lat, lon = FRAME.to_geographic(east_m, north_m)
    return round(float(lon), 7), round(float(lat), 7)


def square(east_m: float, north_m: float, side_m: float) -> list[tuple[float, float]]:
    return [at(east_m + e * side_m, north_m + n * side_m) for e, n in ((0, 0), (1, 0), (1, 1), (0, 1))]


def deep(*places: tuple[float, float, float]) -> list[tuple[float, float, float]]:
    return [(*at(east, north), depth) for east, north, depth in places]


def local(zone: Zone) -> shapely.Polygon:
    east, north = FRAME.to_local(zone.ring[:, 1], zone.ring[:, 0])
    return shapely.Polygon(np.column_stack([east, north]))


def test_soundings_and_contours_have_the_accuracy_of_their_zone(tmp_path: Path) -> None:
    cell = Cell()
    cell.area("M_QUAL", square(-500, -500, 500), CATZOC=1)
    cell.area("M_QUAL", square(0, -500, 500), CATZOC=4)
    cell.soundings(deep((-100, -100, 10.0), (100, -100, 20.0)))
    cell.line("DEPCNT", [at(-200, -200), at(-150, -200)], VALDCO=5.0)
    found = read_enc(cell.write(tmp_path / "cell.000"))
    assert found.positive == "down"
    by_depth = {float(depth): float(sd) for depth, sd in zip(found.z, found.sd_m, strict=True)}
    assert by_depth == pytest.approx(
        {
            10.0: (0.5 + 0.01 * 10) / NORMAL_95,
            20.0: (2.0 + 0.05 * 20) / NORMAL_95,
            5.0: (0.5 + 0.01 * 5) / NORMAL_95,
        }
    )
    assert len(found.z) == 4
    east, north = FRAME.to_local(found.y, found.x)
    assert sorted(zip(np.round(east), np.round(north), strict=True))[0] == (-200.0, -200.0)


@pytest.mark.parametrize("quality", [{}, {"CATZOC": 5}, {"CATZOC": 6}])
def test_what_nobody_stated_has_to_be_said(tmp_path: Path, quality: dict[str, int]) -> None:
    cell = Cell()
    if quality:
        cell.area("M_QUAL", square(-500, -500, 1000), **quality)
    cell.soundings(deep((0, 0, 10.0)))
    found = read_enc(cell.write(tmp_path / "cell.000"))
    assert np.isnan(found.sd_m).all()
    with pytest.raises(ReadError, match="state no uncertainty"):
        place_soundings(found, ReadOptions(), PLACE)
    assert place_soundings(found, ReadOptions(sd_m=1.5), PLACE).soundings.sd_m == pytest.approx([1.5])


@pytest.mark.parametrize(
    ("quality", "found_m", "stated"),
    [
        ([5], [], 0),
        ([2], [], 0),
        ([7], [], 0),
        ([8, 3], [50.0], 0),
        ([4], [50.0], 0),
        ([9], [50.0], 0),
        ([6], [50.0], 1),
    ],
)
def test_soundings_that_met_no_bottom_are_none_and_doubtful_ones_state_no_quality(
    quality: list[int], found_m: list[float], stated: int, tmp_path: Path
) -> None:
    cell = Cell()
    cell.area("M_QUAL", square(-500, -500, 1000), CATZOC=2)
    cell.soundings(deep((0, 0, 10.0)))
    cell.soundings(deep((100, 0, 50.0)), QUASOU=quality)
    found = read_enc(cell.write(tmp_path / "cell.000"))
    assert sorted(found.z.tolist()) == [10.0, *found_m]
    assert np.isfinite(found.sd_m).sum() == 1 + stated
    assert [note.split()[0] for note in found.notes] == ([] if found_m else ["1"])


def test_depth_areas_are_no_soundings(tmp_path: Path) -> None:
    cell = Cell()
    cell.area("DEPARE", square(-100, -100, 200), DRVAL1=5.0, DRVAL2=10.0)
    with pytest.raises(ReadError, match="neither soundings"):
        read_enc(cell.write(tmp_path / "cell.000"))


def test_dangers_are_proposed_as_large_as_their_place_is_uncertain(tmp_path: Path) -> None:
    cell = Cell()
    cell.area("M_QUAL", square(-500, -500, 1000), CATZOC=2)
    cell.point("WRECKS", at(100, 50), VALSOU=3.5, OBJNAM="Old Tom")
    cell.area("LNDARE", square(-300, -300, 100), OBJNAM="Rock island")
    cell.area("RESARE", square(200, 200, 100), OBJNAM="Cable")
    cell.point("UWTROC", at(3000, 0))
    zones, notes = read_zones(cell.write(tmp_path / "cell.000"), PLACE, 10.0)
    assert notes == []
    named = {zone.kind: zone for zone in zones}
    assert set(named) == {"WRECKS", "LNDARE", "RESARE"}, "the rock lies elsewhere"
    wreck = named["WRECKS"]
    assert (wreck.name, wreck.depth_m, wreck.position_m) == ("Old Tom", 3.5, 20.0)
    shape = local(wreck)
    assert shape.centroid.distance(shapely.Point(100, 50)) < 1.0
    assert shape.area == pytest.approx(np.pi * 30.0**2, rel=0.08)
    land = local(named["LNDARE"])
    assert land.bounds == pytest.approx((-310, -310, -190, -190), abs=1.5)
    assert named["LNDARE"].depth_m is None
    assert local(named["RESARE"]).bounds == pytest.approx((190, 190, 310, 310), abs=1.5)
    assert zones[0].kind == "WRECKS", "the nearest first"


def test_what_people_built_or_moored_is_proposed_where_it_is_charted(tmp_path: Path) -> None:
    cell = Cell()
    cell.area("M_QUAL", square(-500, -500, 1000), CATZOC=4)
    cell.area("MARCUL", square(-400, -400, 50), OBJNAM="Mussel farm")
    cell.area("PONTON", square(-200, -400, 50))
    cell.line("SLCONS", [at(0, -400), at(60, -400)], OBJNAM="Jetty")
    cell.line("FSHFAC", [at(0, -200), at(60, -200)])
    for east, kind in enumerate(("OFSPLF", "PILPNT", "MORFAC")):
        cell.point(kind, at(100 * east, 100))
    zones, _ = read_zones(cell.write(tmp_path / "cell.000"), PLACE, 10.0)
    named = {zone.kind: zone for zone in zones}
    assert set(named) == {"MARCUL", "PONTON", "SLCONS", "FSHFAC", "OFSPLF", "PILPNT", "MORFAC"}
    assert {zone.position_m for zone in zones} == {0.0}
    assert local(named["MARCUL"]).bounds == pytest.approx((-410, -410, -340, -340), abs=1.5)
    assert local(named["SLCONS"]).bounds == pytest.approx((-10, -410, 70, -390), abs=1.5)
    assert set(REASONS) == set(HAZARDS)


def test_what_is_built_along_the_shore_makes_no_zone_of_its_own(tmp_path: Path) -> None:
    cell = Cell()
    cell.area("LNDARE", square(-400, -400, 300))
    cell.line("SLCONS", [at(-400, -100), at(-100, -100), at(-100, -400)], OBJNAM="Quay wall")
    cell.line("SLCONS", [at(-100, -200), at(0, -200)], OBJNAM="Jetty")
    cell.point("WRECKS", at(-105, -300))
    zones, _ = read_zones(cell.write(tmp_path / "cell.000"), PLACE, 10.0)
    assert {(zone.kind, zone.name) for zone in zones} == {("LNDARE", ""), ("SLCONS", "Jetty"), ("WRECKS", "")}


def test_water_that_land_encloses_stays_free(tmp_path: Path) -> None:
    cell = Cell()
    around = square(-450, -450, 900)
    slit = [(-450, 1), (-100, 1), (-100, 100), (100, 100), (100, -100), (-100, -100), (-100, -1), (-450, -1)]
    cell.area("LNDARE", [*around, *(at(*place) for place in slit)])
    zones, _ = read_zones(cell.write(tmp_path / "cell.000"), PLACE, 10.0)
    land = shapely.union_all([local(zone) for zone in zones])
    assert land.symmetric_difference(shapely.box(-460, -460, 460, 460) - shapely.box(-90, -90, 90, 90)).area < 2000.0
    assert not land.contains(shapely.Point(0, 0))


def test_a_chart_that_states_no_quality_says_so(tmp_path: Path) -> None:
    cell = Cell()
    cell.point("OBSTRN", at(0, 0))
    [zone], notes = read_zones(cell.write(tmp_path / "cell.000"), PLACE, 0.0)
    assert zone.position_m == NO_ZONE_POSITION_M
    assert "nothing states the chart's quality" in notes[0]


def test_zones_end_where_the_area_does(tmp_path: Path) -> None:
    cell = Cell()
    cell.area("LNDARE", square(400, -2000, 4000))
    [zone], _ = read_zones(cell.write(tmp_path / "cell.000"), PLACE, 0.0)
    assert local(zone).bounds == pytest.approx((400, -500, 500, 500), abs=1.5)


def test_the_small_cell_has_all_that_is_read() -> None:
    content = SMALL_CELL.read_bytes()
    place = MapExtent(LocalFrame(*SMALL_CELL_AT), PLACE.grid, 2000.0)
    zones, _ = read_zones(content, place, 0.0)
    assert {zone.kind for zone in zones} == {"LNDARE", "RESARE", "WRECKS", "UWTROC", "OBSTRN"}
    assert np.isfinite(read_enc(content).sd_m).all()


@pytest.mark.parametrize("content", [b"", b"000263LE1 0900201   " + b"0" * 60, b"\x89HDF\r\n\x1a\n" * 10])
def test_what_is_no_cell_is_refused(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "a.000"
    file.write_bytes(content)
    with file.open("rb") as opened, pytest.raises(ReadError, match="ENC cell"):
        read_file(opened, ".000", PLACE)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.tuples(st.integers(24, 4700), st.integers(0, 255)), min_size=1, max_size=6), st.integers(100, 4749))
def test_a_damaged_cell_is_read_or_refused(changes: list[tuple[int, int]], length: int) -> None:
    content = bytearray(SMALL_CELL.read_bytes())
    for place, value in changes:
        content[place] = value
    for damaged in (bytes(content), bytes(content[:length])):
        for read in (read_enc, lambda cell: read_zones(cell, PLACE, 1.0)):
            with contextlib.suppress(ReadError):
                read(damaged)


def test_zones_of_confidence_grow_worse() -> None:
    table = np.array(list(ZONES_OF_CONFIDENCE.values()))
    assert (np.diff(table, axis=0) >= 0).all()
