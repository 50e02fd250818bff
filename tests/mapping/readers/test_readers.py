"""Soundings and maps from elsewhere: every format, what files do not say, and what is wrong with them."""

import gzip
import io
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pyproj
import pytest
import rasterio
from affine import Affine
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyproj.crs import CompoundCRS

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.layers import LayerSource, file_layers
from app.mapping.products.bag import bag
from app.mapping.products.geotiff import geotiff
from app.mapping.products.netcdf import netcdf
from app.mapping.products.text import map_xyz, soundings_xyz
from app.mapping.readers import raster
from app.mapping.readers.file_extensions import ending
from app.mapping.readers.georeferencing import place_reference, place_soundings
from app.mapping.readers.reader_choice import read_file
from app.mapping.readers.text import read_text
from app.mapping.readers.types import MapExtent, Points, Raster, ReadError, ReadOptions
from app.mapping.s44 import NORMAL_95, Order
from app.mapping.types import BathymetricMap, Grid, Soundings
from app.mapping.water.vertical import VerticalDatum

FRAME = LocalFrame(41.1850, -8.7040)
GRID = Grid(0.0, 0.0, 2.0, 20, 25)
PLACE = MapExtent(FRAME, GRID, margin_m=6.0)
UTM = pyproj.CRS.from_epsg(32629)
SD = ReadOptions(sd_m=0.3)


def read_path(path: Path) -> Points | Raster:
    with path.open("rb") as file:
        return read_file(file, ending(path.name), PLACE)


def read_words(text: str) -> Points:
    return read_text(io.BytesIO(text.encode(errors="surrogatepass")))


def depth_at(east_m: np.ndarray, north_m: np.ndarray) -> np.ndarray:
    return 6.0 + 0.1 * east_m + 0.05 * north_m


def make_map() -> BathymetricMap:
    depth = depth_at(*np.meshgrid(GRID.east_m, GRID.north_m))
    depth[15:, :3] = np.nan
    sd = np.where(np.isnan(depth), np.nan, 0.2)
    none = np.zeros(depth.shape, np.int64)
    return BathymetricMap(GRID, depth, sd, none, none > 0, np.ones_like(depth), 8.0, "test")


def own_product(kind: str) -> bytes:
    bathymetry, datum = make_map(), VerticalDatum(5861, "LAT")
    layers = file_layers(LayerSource(bathymetry, Order.ORDER_2))
    if kind == "tif":
        return geotiff(bathymetry, layers, FRAME, vertical_datum=datum)
    if kind == "nc":
        created = __import__("datetime").datetime(2026, 1, 1)
        return netcdf(bathymetry, layers, FRAME, vertical_datum=datum, title="t", created=created)
    if kind == "bag":
        return bag(bathymetry, FRAME, vertical_datum=datum, title="t", common_sd_m=0.0)
    return map_xyz(bathymetry, FRAME, vertical_datum="LAT", geographic=True, common_sd_m=0.0)


@pytest.mark.parametrize("kind", ["tif", "nc", "bag", "xyz"])
def test_our_own_maps_come_back_in_their_place(kind: str, tmp_path: Path) -> None:
    (path := tmp_path / f"map.{kind}").write_bytes(own_product(kind))
    content = read_path(path)
    found = place_soundings(content, ReadOptions(), PLACE)
    s = found.soundings
    assert len(s) == found.found == np.isfinite(make_map().depth_m).sum()
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m), atol=2e-3)
    np.testing.assert_allclose(s.sd_m, 0.2, atol=1e-6)
    stated = {"tif": "EPSG:5861 LAT depth", "nc": "EPSG:5861 LAT depth", "bag": "LAT height"}.get(kind)
    expected = [] if stated is None else [f"vertical datum: the file states {stated}, the mission none; "]
    assert [note.partition("they are")[0] for note in found.notes] == expected
    for datum_epsg in (5861, 9287):
        below = replace(PLACE, datum_epsg=datum_epsg)
        assert not place_soundings(content, ReadOptions(), below).notes or stated is None
    if stated is not None:
        for place in (place_soundings, place_reference):
            with pytest.raises(ReadError, match=r"its values count from .*LAT.* from EPSG:5715 MSL depth") as refused:
                place(content, ReadOptions(), replace(PLACE, datum_epsg=5715))
            assert refused.value.field == "datum_offset_m"
    sampled, _ = place_reference(content, ReadOptions(), PLACE)
    np.testing.assert_allclose(sampled, make_map().depth_m, atol=2e-3)


def write_grid(path: Path, cell_m: float, crs: pyproj.CRS | None, *, up: bool = False, sd: float | None = None) -> None:
    """A grid in UTM over the mission's area with a border."""
    to_utm = pyproj.Transformer.from_crs(FRAME.crs, UTM, always_xy=True)
    west, south = (np.floor(v) - 20.0 for v in to_utm.transform(0.0, 0.0))
    n = int(100 / cell_m)
    x = west + (np.arange(n) + 0.5) * cell_m
    y = south + (np.arange(n) + 0.5) * cell_m
    utm_east, utm_north = np.meshgrid(x, y[::-1])
    east, north = to_utm.transform(utm_east, utm_north, direction="INVERSE")
    z = depth_at(east, north) * (-1.0 if up else 1.0)
    layers = [z] if sd is None else [z, np.full(z.shape, sd)]
    transform = Affine(cell_m, 0, west, 0, -cell_m, south + n * cell_m)
    with rasterio.open(
        path, "w", driver="GTiff" if path.suffix == ".tif" else "AAIGrid", width=n, height=n, count=len(layers),
        dtype="float64" if path.suffix == ".tif" else "float32", transform=transform, nodata=-9999.0,
        crs=None if crs is None else crs.to_wkt(),
    ) as file:  # fmt: skip
        for number, layer in enumerate(layers, 1):
            file.write(layer, number)
            if sd is not None:
                file.set_band_description(number, ["elevation" if up else "depth", "uncertainty"][number - 1])


@pytest.mark.parametrize("cell_m", [0.5, 5.0], ids=["finer", "coarser"])
def test_a_grid_in_another_projection_is_placed_whatever_its_cells(cell_m: float, tmp_path: Path) -> None:
    write_grid(path := tmp_path / "a.tif", cell_m, UTM, up=True, sd=0.15)
    found = place_soundings(read_path(path), ReadOptions(), PLACE)
    s = found.soundings
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m), atol=0.02)
    np.testing.assert_allclose(s.sd_m, 0.15, rtol=1e-6)
    assert s.east_m.min() >= -6.0
    assert s.east_m.max() <= 56.0
    expected = (50 + 12) * (40 + 12) / max(cell_m, 2.0) ** 2
    assert 0.8 * expected <= len(s) <= 1.1 * expected
    assert any("averaged" in note for note in found.notes) == (cell_m < 2.0)


@pytest.mark.parametrize("epsg", [20790, 4803], ids=["Portuguese National Grid", "degrees"])
def test_a_grid_whose_longitudes_begin_at_lisbon_lies_where_it_should(epsg: int) -> None:
    crs = pyproj.CRS.from_epsg(epsg)
    to_file = pyproj.Transformer.from_crs(FRAME.crs, crs, always_xy=True)
    west, south = to_file.transform(-20.0, -20.0)
    cell = 0.5 if crs.is_projected else 5e-6
    x, y = west + cell * (np.arange(400) + 0.5), south + cell * (np.arange(400) + 0.5)
    across, up = np.meshgrid(x, y)
    z = depth_at(*to_file.transform(across, up, direction="INVERSE"))
    grid = Raster(z, np.full(z.shape, 0.1), Affine(cell, 0, west, 0, cell, south), crs, "down")
    s = place_soundings(grid, ReadOptions(), PLACE).soundings
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m), atol=0.05)
    sampled, _ = place_reference(grid, ReadOptions(), PLACE)
    np.testing.assert_allclose(sampled, depth_at(*np.meshgrid(GRID.east_m, GRID.north_m)), atol=0.05)


@pytest.mark.parametrize("around", ["EPSG:32629", "degrees", "degrees from 0 to 360"])
def test_hills_beside_the_area_keep_no_grid_from_being_read(around: str) -> None:
    crs = UTM if around == "EPSG:32629" else pyproj.CRS.from_epsg(4326)
    to_file = pyproj.Transformer.from_crs(FRAME.crs, crs, always_xy=True)
    cell = 5.0 if crs == UTM else 5e-5
    x, y = (at + cell * (np.arange(120) - 60) for at in to_file.transform(25.0, 20.0))
    across, up = np.meshgrid(x, y)
    east, north = to_file.transform(across, up, direction="INVERSE")
    z = -depth_at(east, north)
    z[north > 100.0] = 250.0
    west = x[0] + (360.0 if "360" in around else 0.0)
    grid = Raster(z, np.full(z.shape, 0.1), Affine(cell, 0, west - cell / 2, 0, cell, y[0] - cell / 2), crs, "up")
    found = place_soundings(grid, ReadOptions(), PLACE)
    s = found.soundings
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m), atol=0.05)
    assert any("above the water" in note for note in found.notes)
    sampled, _ = place_reference(grid, ReadOptions(), PLACE)
    np.testing.assert_allclose(sampled, depth_at(*np.meshgrid(GRID.east_m, GRID.north_m)), atol=0.1)
    z[(north > 30.0) & (north < 40.0)] = 250.0
    for place in (place_soundings, place_reference):
        with pytest.raises(ReadError, match="its depth is not between"):
            place(grid, ReadOptions(), PLACE)


def test_a_grid_whose_cells_have_no_size_is_refused() -> None:
    grid = Raster(np.full((3, 3), 9.0), np.full((3, 3), 0.1), Affine(0.0, 0, 0, 0, 5.0, 0), UTM, "down")
    with pytest.raises(ReadError, match="no size"):
        place_soundings(grid, ReadOptions(), PLACE)


def test_hills_beside_the_area_keep_no_list_from_being_read() -> None:
    words = "east_m,north_m,elevation,sd\n5,8,-6,0.1\n20,30,-9,0.1\n20,{north},250,0.1"
    found = place_soundings(read_words(words.format(north=3000)), ReadOptions(), PLACE)
    assert found.soundings.depth_m.tolist() == [6.0, 9.0]
    assert any("above the water" in note for note in found.notes)
    with pytest.raises(ReadError, match="its depth is not between"):
        place_soundings(read_words(words.format(north=30)), ReadOptions(), PLACE)


def test_a_grid_too_coarse_for_the_area_is_told_from_one_elsewhere(tmp_path: Path) -> None:
    to_utm = pyproj.Transformer.from_crs(FRAME.crs, UTM, always_xy=True)
    west, south = to_utm.transform(25.0, 20.0)
    z, sd = np.full((4, 4), 9.0), np.full((4, 4), 0.5)
    # The area lies about a corner of its cells, whose middles are 325 m away.
    coarse = Raster(z, sd, Affine(460.0, 0, west - 920.0, 0, 460.0, south - 920.0), UTM, "down")
    with pytest.raises(ReadError, match=r"cells of 460 m.*none has its middle near") as caught:
        place_soundings(coarse, ReadOptions(), PLACE)
    assert "finer" in caught.value.remedy
    elsewhere = Raster(z, sd, Affine(460.0, 0, west + 5000.0, 0, 460.0, south), UTM, "down")
    with pytest.raises(ReadError, match="none of its depths lies near"):
        place_soundings(elsewhere, ReadOptions(), PLACE)


def test_what_a_file_does_not_say_has_to_be_said(tmp_path: Path) -> None:
    write_grid(path := tmp_path / "a.asc", 4.0, None)
    path.with_suffix(".prj").unlink(missing_ok=True)
    content = read_path(path)
    for options, field in ((ReadOptions(), "crs"), (ReadOptions(crs="EPSG:32629"), "sd_m")):
        with pytest.raises(ReadError) as caught:
            place_soundings(content, options, PLACE)
        assert caught.value.field == field
    found = place_soundings(content, ReadOptions(crs="EPSG:32629", order="special", datum_offset_m=-1.0), PLACE)
    s = found.soundings
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m) - 1.0, atol=0.02)
    np.testing.assert_allclose(s.sd_m, np.hypot(0.25, 0.0075 * s.depth_m) / NORMAL_95)
    assert len(found.notes) == 2
    assert "positive down, from their sign" in found.notes[0]


HEADER = "ncols 20\nnrows 20\nxllcorner 0\nyllcorner 0\ncellsize 2\n"


@pytest.mark.parametrize("header", [HEADER, HEADER + "NODATA_value -9999\n", HEADER.upper() + "nodata_value nan\n"])
@pytest.mark.parametrize("value", ["9.5", "9,5", "nan"])
@pytest.mark.parametrize("end", ["", "\n", "\r\n \x1a"])
def test_an_ascii_grid_has_one_value_for_each_cell(header: str, value: str, end: str, tmp_path: Path) -> None:
    path = tmp_path / "a.asc"

    def of(*counts: int) -> FloatArray:
        rows = [" ".join([value] * (n - 1) + ["7"]) for n in counts]
        path.write_text(header + "\n".join(rows) + end)
        content = read_path(path)
        assert isinstance(content, Raster)
        return content.z

    z = of(*20 * [20])
    assert z.shape == (20, 20)
    np.testing.assert_array_equal(z[:, 0], np.nan if value == "nan" else 9.5)
    assert of(400).shape == of(*10 * [40]).shape == (20, 20), "rows may be broken elsewhere"
    path.write_text(header + 399 * f"{value} " + "x" + end)
    with pytest.raises(ReadError, match="some of its values are no numbers"):
        read_path(path)
    for counts, found in ([*19 * [20], 19], 399), ([*20 * [20], 1], 401), ([3], 3), (19 * [20], 380):
        with pytest.raises(ReadError, match=f"20 x 20 = 400, and {found} values follow"):
            of(*counts)


def test_values_of_an_ascii_grid_are_counted_across_the_parts_that_are_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (path := tmp_path / "a.asc").write_text(HEADER + 400 * "12.25\n")
    for size in range(1, 9):
        monkeypatch.setattr(raster, "BYTES_AT_ONCE", size)
        assert isinstance(read_path(path), Raster)


def test_netcdf_with_latitude_and_longitude_and_heights(tmp_path: Path) -> None:
    with netCDF4.Dataset(path := tmp_path / "topo.nc", "w") as file:
        lat, lon = 41.1849 + 2e-5 * np.arange(30), -8.7042 + 3e-5 * np.arange(30)
        for name, values in (("lat", lat), ("lon", lon)):
            file.createDimension(name, 30)
            file.createVariable(name, "f8", (name,))[:] = values
        east, north = FRAME.to_local(*np.meshgrid(lat, lon, indexing="ij"))
        file.createVariable("elevation", "f4", ("lat", "lon"))[:] = -depth_at(east, north)
    s = place_soundings(read_path(path), SD, PLACE).soundings
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m), atol=0.01)


@pytest.mark.parametrize(
    ("dtype", "unit", "vertical", "scale", "offset"),
    [
        ("int16", "", None, 0.01, 0.0),
        ("int16", "m", None, 0.01, 2.0),
        ("float64", "ft", None, 1.0, 0.0),
        ("float64", "", 6360, 1.0, 0.0),
        ("float64", "", 8053, 1.0, 0.0),
    ],
    ids=["whole centimetres", "whole centimetres from 2 m", "feet", "a vertical system in US survey feet", "depths"],
)
def test_what_a_raster_says_of_its_numbers_is_heeded(
    dtype: str, unit: str, vertical: int | None, scale: float, offset: float, tmp_path: Path
) -> None:
    metres = {"ft": 0.3048, "m": 1.0, "": 1.0 if vertical is None else 1200 / 3937}[unit]
    numbers = (depth_at(*np.meshgrid(GRID.east_m, GRID.north_m)) / metres - offset) / scale
    crs = UTM if vertical is None else pyproj.CRS.from_user_input(f"EPSG:32629+{vertical}")
    west, south = pyproj.Transformer.from_crs(FRAME.crs, UTM, always_xy=True).transform(0.0, 0.0)
    with rasterio.open(
        path := tmp_path / "a.tif", "w", driver="GTiff", width=GRID.cols, height=GRID.rows, count=1, dtype=dtype,
        transform=Affine(2.0, 0.0, west, 0.0, 2.0, south), crs=crs.to_wkt(),
    ) as file:  # fmt: skip
        file.write(np.round(numbers).astype(dtype) if dtype == "int16" else numbers, 1)
        file.scales, file.offsets = [scale], [offset]
        if unit:
            file.set_band_unit(1, unit)
    content = read_path(path)
    assert isinstance(content, Raster)
    np.testing.assert_allclose(content.z, depth_at(*np.meshgrid(GRID.east_m, GRID.north_m)), atol=0.006)


def write_netcdf(path: Path, name: str, unit: str, metres: float, *, east_first: bool = False) -> None:
    with netCDF4.Dataset(path, "w") as file:
        for axis, values in (("x", GRID.east_m), ("y", GRID.north_m)):
            file.createDimension(axis, len(values))
            file.createVariable(axis, "f8", (axis,))[:] = values
        z = depth_at(*np.meshgrid(GRID.east_m, GRID.north_m)) / metres
        for layer, values in ((name, z), ("uncertainty", 0.01 * z)):
            variable = file.createVariable(layer, "f8", ("x", "y") if east_first else ("y", "x"))
            variable.units = unit
            variable[:] = values.T if east_first else values


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("Metres", 1.0), ("cm", 0.01), ("feet", 0.3048)])
def test_depths_in_netcdf_have_the_unit_that_they_state(unit: str, metres: float, tmp_path: Path) -> None:
    write_netcdf(path := tmp_path / "a.nc", "depth", unit, metres)
    s = place_soundings(read_path(path), ReadOptions(crs="local"), PLACE).soundings
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m))
    np.testing.assert_allclose(s.sd_m, 0.01 * s.depth_m)


@pytest.mark.parametrize(
    ("unit", "crs", "metres"),
    [
        ("km", UTM, 1000.0),
        ("km", None, 1000.0),
        ("m", UTM, 1.0),
        ("feet", UTM, 0.3048),
        ("km", pyproj.CRS.from_epsg(2264), 1000.0),
        ("feet", pyproj.CRS.from_epsg(2264), 1200 / 3937),
        ("none that is known", UTM, 1.0),
    ],
)
@pytest.mark.parametrize("cell_m", [0.5, 5.0])
def test_axes_in_netcdf_have_the_unit_that_they_state(
    unit: str, crs: pyproj.CRS | None, metres: float, cell_m: float, tmp_path: Path
) -> None:
    frame = FRAME if crs is None or crs == UTM else LocalFrame(34.2, -77.9)
    to_file = pyproj.Transformer.from_crs(frame.crs, crs or UTM, always_xy=True)
    factor = (crs or UTM).axis_info[0].unit_conversion_factor
    west, south = to_file.transform(-20.0, -20.0)
    number = cell_m * np.arange(int(100 / cell_m)) / factor
    x, y = west + number, south + number
    across, up = np.meshgrid(x, y)
    east, north = to_file.transform(across, up, direction="INVERSE")
    with netCDF4.Dataset(path := tmp_path / "a.nc", "w") as file:
        for name, values in (("y", y), ("x", x)):
            file.createDimension(name, len(values))
            axis = file.createVariable(name, "f8", (name,))
            axis.units = unit
            axis[:] = values * factor / metres
        depth = file.createVariable("depth", "f8", ("y", "x"))
        depth[:] = depth_at(east, north)
        if crs is not None:
            depth.grid_mapping = "crs"
            file.createVariable("crs", "i4").crs_wkt = crs.to_wkt()
    place = MapExtent(frame, GRID, margin_m=6.0)
    options = ReadOptions(sd_m=0.3, crs=None if crs else "EPSG:32629")
    s = place_soundings(read_path(path), options, place).soundings
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m), atol=0.05)
    sampled, _ = place_reference(read_path(path), options, place)
    np.testing.assert_allclose(sampled, depth_at(*np.meshgrid(GRID.east_m, GRID.north_m)), atol=0.05)


def test_a_unit_that_is_none_of_length_is_refused(tmp_path: Path) -> None:
    write_netcdf(path := tmp_path / "a.nc", "depth", "dbar", 1.0)
    with pytest.raises(ReadError, match="its unit is no known one of length") as caught:
        read_path(path)
    assert caught.value.field == "variable depth"


def test_a_grid_whose_first_axis_leads_east_lies_where_it_should(tmp_path: Path) -> None:
    write_netcdf(path := tmp_path / "a.nc", "depth", "m", 1.0, east_first=True)
    s = place_soundings(read_path(path), ReadOptions(crs="local"), PLACE).soundings
    assert len(s) == GRID.rows * GRID.cols
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m))
    np.testing.assert_allclose(s.sd_m, 0.01 * s.depth_m)


@pytest.mark.parametrize(("name", "sign"), [("depth", -1.0), ("elevation", 1.0)])
def test_names_that_contradict_the_signs_are_not_believed(name: str, sign: float) -> None:
    rows = [f"{east},{north},{sign * (6.0 + 0.1 * east + 0.05 * north)}" for east in (5, 20) for north in (8, 30)]
    content = read_words("\n".join([f"east_m,north_m,{name}", *rows]))
    for place in (place_soundings, place_reference):
        with pytest.raises(ReadError, match="lie above the water") as caught:
            place(content, SD, PLACE)
        assert caught.value.field == "positive"
    s = place_soundings(content, ReadOptions(sd_m=0.3, positive="up" if sign < 0 else "down"), PLACE).soundings
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m))
    said = ReadOptions(sd_m=0.3, positive="down" if sign < 0 else "up")
    np.testing.assert_allclose(place_soundings(content, said, PLACE).soundings.depth_m, -s.depth_m)


def test_ground_that_dries_beside_ground_that_does_not_is_taken() -> None:
    content = read_words("east_m,north_m,depth\n5,8,-1.5\n20,8,0.5\n20,30,-0.2")
    assert place_soundings(content, SD, PLACE).soundings.depth_m.tolist() == [-1.5, 0.5, -0.2]


def test_text_in_every_usual_shape(tmp_path: Path) -> None:
    east, north = np.array([5.0, 20.0]), np.array([8.0, 30.0])
    (lat, lon), depth = FRAME.to_geographic(east, north), depth_at(east, north)
    shapes = {
        "a.xyz": "\n".join(f"{x} {y} {z}" for x, y, z in zip(lon, lat, depth, strict=True)),
        "b.csv": "Latitude;Longitude;Depth;SD\n"
        + "\n".join(f"{y};{x};{z};0.3" for x, y, z in zip(lon, lat, depth, strict=True)),
        "c.txt": "# lon lat elevation\n"
        + "\n".join(f"{x}\t{y}\t{-z}" for x, y, z in zip(lon, lat, depth, strict=True)),
        "d.csv": "id,east_m,north_m,depth_m\n"
        + "\n".join(f"7,{x},{y},{z}" for x, y, z in zip(east, north, depth, strict=True)),
    }
    for name, text in shapes.items():
        (path := tmp_path / f"{name}.gz").write_bytes(gzip.compress(text.encode()))
        s = place_soundings(
            read_path(path), ReadOptions(crs="EPSG:4326" if name == "a.xyz" else None, sd_m=0.3), PLACE
        ).soundings
        np.testing.assert_allclose(np.column_stack([s.east_m, s.north_m]), np.column_stack([east, north]), atol=1e-3)
        np.testing.assert_allclose(s.depth_m, depth)
        np.testing.assert_allclose(s.sd_m, 0.3)


def test_soundings_of_another_mission_come_in_without_the_rejected_ones(tmp_path: Path) -> None:
    s = Soundings(*(np.array(v, float) for v in ([5, 9], [6, 7], [8, 9], [0.1, 0.2])))
    again = place_soundings(
        read_words(soundings_xyz(s, FRAME, vertical_datum="LAT", geographic=True).decode()), ReadOptions(), PLACE
    ).soundings
    np.testing.assert_allclose(again.depth_m, s.depth_m)
    np.testing.assert_allclose(again.sd_m, s.sd_m)
    text = "# depth_m: positive down\nlat_deg,lon_deg,depth_m,sd_m,verdict\n"
    text += "41.1851,-8.7039,7,0.1,accepted\n0,0,,,rejected\n"
    assert len(place_soundings(read_words(text), ReadOptions(), PLACE).soundings) == 1


@pytest.mark.parametrize(
    ("text", "field", "message"),
    [
        ("lon,lat,depth\n-8.7,41.1,5\n-8.7,41.1,deep", "line 3, column 3 (depth)", "it is not a number"),
        ("lon,lat,depth\n-8.7,41.1", "line 2, column 3 (depth)", "only 2 columns"),
        ("lon,lat,depth\n-8.7,nan,4", "line 2, column 2 (lat)", "it is not a number"),
        ("lon,lat,depth\n# x\n-8.7,41.1,99999", "line 3", "its depth is not between"),
        ("lon,lat,depth\n-500,41.1,5", "position 1", "is no longitude and latitude"),
        ("lon,lat,depth\n8.7,41.1,5", "file", "none of its depths lies near"),
        ("lon,lat,z\n-8.7039,41.1851,5\n-8.7039,41.1851,-5", "positive", "both signs"),
        ("lon,lat,depth\n-8.7039,41.1851,5", "sd_m", "state no uncertainty"),
        ("1 2 3", "crs", "does not say"),
        ("lon,lat,depth,sd\n-8.7039,41.1851,5,5000", "uncertainty", "is above 1000 m"),
        ("", "file", "no sounding"),
        ("\x00\x01\x02", "line 1", "is not a number"),
        ("lat,lon,depth_ft\n41.1,-8.7,5", "line 1", "column depth_ft is not known"),
        ("Breite Laenge Tiefe\n41.1 -8.7 5", "line 1", "column Breite, Laenge, Tiefe is not known"),
        ("lat,lon\n41.1,-8.7", "line 1", "no position, or no depth"),
        ("lon,lat,depth\n-8,7039,41,1851,5,2", "line 2", "decimal commas"),
        ("-8,7039,41,1851,5,2", "line 1", "decimal commas"),
        ("-8,7039;41,1851;5,2", "line 1, column 1", "decimal commas"),
        ("-8,7039 41,1851 5,2", "line 1", "decimal commas"),
    ],
)
def test_wrong_text_is_refused_by_line_and_column(text: str, field: str, message: str) -> None:
    with pytest.raises(ReadError, match=message) as caught:
        place_soundings(read_words(text), ReadOptions(), PLACE)
    assert caught.value.field.startswith(field)
    assert caught.value.remedy


@pytest.mark.parametrize("crs", ["EPSG:0", "somewhere", "EPSG:5861"])
def test_a_reference_system_that_is_none_is_refused(crs: str) -> None:
    with pytest.raises(ReadError) as caught:
        place_soundings(read_words("1 2 3"), ReadOptions(crs=crs, sd_m=1.0), PLACE)
    assert caught.value.field == "crs"


@pytest.mark.parametrize("name", ["a.tif", "a.nc", "a.bag", "a.asc", "a.xyz.gz"])
def test_a_file_that_is_not_what_it_is_called_is_refused(name: str, tmp_path: Path) -> None:
    for content in (b"not that at all", b"", b"\x89HDF\r\n\x1a\n" + bytes(200), b"II*\0" + b"\xff" * 99):
        (path := tmp_path / name).write_bytes(content)
        with pytest.raises(ReadError):
            read_path(path)


def test_a_grid_without_any_value_names_its_band(tmp_path: Path) -> None:
    with rasterio.open(tmp_path / "a.tif", "w", driver="GTiff", width=2, height=2, count=1, dtype="float32",
                       nodata=0.0, transform=Affine(2, 0, 9, 0, -2, 9)) as file:  # fmt: skip
        file.write(np.zeros((2, 2), np.float32), 1)
    with pytest.raises(ReadError, match="no cell of it has a value") as caught:
        read_path(tmp_path / "a.tif")
    assert caught.value.field == "band 1"


@pytest.mark.parametrize("name", ["a.exe", "a", "a.tif.gz", ".gz", "map.png"])
def test_other_endings_are_refused(name: str) -> None:
    with pytest.raises(ReadError, match="has no ending that is read"):
        ending(name)


@pytest.mark.parametrize("step_deg", [1 / 3600, 1 / 10_800])
def test_axes_of_single_precision_are_even_but_for_their_rounding(step_deg: float, tmp_path: Path) -> None:
    lat, lon = FRAME.origin_lat_deg + step_deg * np.arange(-9, 30), FRAME.origin_lon_deg + step_deg * np.arange(-9, 30)
    east, north = FRAME.to_local(*np.meshgrid(lat, lon, indexing="ij"))
    with netCDF4.Dataset(path := tmp_path / "a.nc", "w") as file:
        for name, values in (("lat", lat), ("lon", lon)):
            file.createDimension(name, len(values))
            file.createVariable(name, "f4", (name,))[:] = values
        file.createVariable("depth", "f4", ("lat", "lon"))[:] = depth_at(east, north)
    s = place_soundings(read_path(path), SD, PLACE).soundings
    np.testing.assert_allclose(s.depth_m, depth_at(s.east_m, s.north_m), atol=0.05)


def test_uneven_axes_are_refused_by_name(tmp_path: Path) -> None:
    with netCDF4.Dataset(path := tmp_path / "a.nc", "w") as file:
        for name in ("y", "x"):
            file.createDimension(name, 3)
            file.createVariable(name, "f8", (name,))[:] = [0, 1, 5]
        file.createVariable("depth", "f4", ("y", "x"))[:] = 5.0
    with pytest.raises(ReadError, match="not evenly spaced") as caught:
        read_path(path)
    assert caught.value.field == "variable y"


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
@given(st.text() | st.text(alphabet="0123456789.,;- \n#xyzlatdepth"))
def test_whatever_text_comes_it_is_read_or_refused(text: str) -> None:
    with suppress(ReadError):
        assert len(place_soundings(read_words(text), ReadOptions(crs="local", sd_m=1.0), PLACE).soundings) > 0


@pytest.mark.terrains
def test_real_soundings_of_a_harbour_are_read(terrains: Path) -> None:
    content = read_path(terrains / "leixoes_west_soundings.csv.gz")
    wide = MapExtent(FRAME, Grid(-5000.0, -5000.0, 10.0, 1000, 1000), margin_m=0.0)
    found = place_soundings(content, SD, wide)
    assert found.found == 6354
    assert len(found.soundings) > 1000


@pytest.mark.parametrize(
    ("vertical", "words"),
    [
        ("EPSG:5714", "EPSG:5714 MSL height"),
        ("EPSG:5703", "EPSG:5703 NAVD88 height"),
        ('VERT_CS["a",VERT_DATUM["of some harbour",2005],UNIT["metre",1],AXIS["Up",UP]]', "EPSG does not list"),
    ],
)
def test_a_vertical_system_of_heights_is_held_against_the_missions_depths(vertical: str, words: str) -> None:
    crs = CompoundCRS("both", [FRAME.crs, pyproj.CRS.from_user_input(vertical)])
    local = Raster(np.full((40, 40), -5.0), np.full((40, 40), 0.1), Affine(2, 0, -10, 0, -2, 70), crs, "up")
    with pytest.raises(ReadError, match=words):
        place_soundings(local, ReadOptions(), replace(PLACE, datum_epsg=5861))
    for offset_m in (0.0, 1.5):
        found = place_soundings(local, ReadOptions(datum_offset_m=offset_m), replace(PLACE, datum_epsg=5861))
        assert found.soundings.depth_m == pytest.approx(5.0 + offset_m)
    if "MSL" in words:
        assert place_soundings(local, ReadOptions(), replace(PLACE, datum_epsg=5715)).notes == []


def with_vertical(words: str) -> pyproj.CRS:
    """WKT 1 of the mission's frame and a vertical system."""
    horizontal = pyproj.CRS.from_epsg(32629).to_wkt("WKT1_GDAL")
    return pyproj.CRS.from_wkt(f'COMPD_CS["x",{horizontal},VERT_CS["h",{words},UNIT["metre",1],AXIS["Up",UP]]]')


def in_utm(crs: pyproj.CRS) -> Raster:
    west, north = pyproj.Transformer.from_crs(FRAME.crs, UTM, always_xy=True).transform(-10.0, 70.0)
    values = np.full((40, 40), -5.0)
    return Raster(values, np.full((40, 40), 0.1), Affine(2, 0, west, 0, -2, north), crs, "up")


def test_a_grid_of_a_geoid_beside_a_datum_does_not_hide_it() -> None:
    crs = with_vertical(
        'VERT_DATUM["EGM96 geoid",2005,EXTENSION["PROJ4_GRIDS","egm96_15.gtx"],AUTHORITY["EPSG","5171"]]'
    )
    with pytest.raises(ReadError, match="count from"):
        place_soundings(in_utm(crs), ReadOptions(), replace(PLACE, datum_epsg=5861))


@pytest.mark.parametrize(
    ("name", "epsg"),
    [("MLLW", 5866), ("MSL", 5715), ("LAT", 5861), ("D_Mean_Sea_Level", 5715), ("Mean Lower Low Water (MLLW)", 5866)],
)
def test_datums_are_known_by_their_usual_names(name: str, epsg: int) -> None:
    grid = in_utm(with_vertical(f'VERT_DATUM["{name}",2005]'))
    assert place_soundings(grid, ReadOptions(), replace(PLACE, datum_epsg=epsg)).notes == []
    with pytest.raises(ReadError, match=r"count from (?!a vertical datum that)"):
        place_soundings(grid, ReadOptions(), replace(PLACE, datum_epsg=5862))


@pytest.mark.parametrize("name", ["none", "Local", "unknown", "Chart Datum"])
def test_what_names_no_datum_states_none(name: str) -> None:
    grid = in_utm(with_vertical(f'VERT_DATUM["{name}",2005]'))
    (note,) = place_soundings(grid, ReadOptions(), replace(PLACE, datum_epsg=5861)).notes
    assert "the file none" in note


def test_a_vertical_unit_alone_states_no_datum() -> None:
    grid = in_utm(pyproj.CRS.from_user_input("+proj=utm +zone=29 +datum=WGS84 +vunits=m +type=crs"))
    (note,) = place_soundings(grid, ReadOptions(), replace(PLACE, datum_epsg=5861)).notes
    assert "the file none" in note


def test_depths_without_a_unit_are_not_taken_for_those_of_a_system_in_feet(tmp_path: Path) -> None:
    x, y = pyproj.Transformer.from_crs(FRAME.crs, UTM, always_xy=True).transform(0.0, 0.0)
    points = read_words(f"{x} {y} 30.0\n")
    with pytest.raises(ReadError, match="US survey foot"):
        place_soundings(points, ReadOptions(crs="EPSG:32629+8053", sd_m=0.1), replace(PLACE, datum_epsg=5715))
    write_netcdf(path := tmp_path / "a.nc", "depth", "", 1200 / 3937)
    with netCDF4.Dataset(path, "a") as file:
        file.createVariable("crs", "i4").crs_wkt = pyproj.CRS.from_user_input("EPSG:32629+8053").to_wkt()
        file["depth"].grid_mapping = "crs"
    content = read_path(path)
    np.testing.assert_allclose(content.z, depth_at(*np.meshgrid(GRID.east_m, GRID.north_m)))


def test_heights_above_the_ellipsoid_are_no_depths_below_a_datum() -> None:
    values = np.full((40, 40), -5.0)
    crs = pyproj.CRS.from_epsg(4979)
    at = Affine(1e-5, 0, FRAME.origin_lon_deg - 1e-4, 0, -1e-5, FRAME.origin_lat_deg + 3e-4)
    grid = Raster(values, np.full((40, 40), 0.1), at, crs, "up")
    with pytest.raises(ReadError, match="count from EPSG:4979 WGS 84, above the ellipsoid, the mission"):
        place_soundings(grid, ReadOptions(), replace(PLACE, datum_epsg=5861))
