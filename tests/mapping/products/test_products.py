"""Every file is opened again by a library that did not write it, or through an independent path."""

import io
import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pyproj
import pytest
from matplotlib import pyplot as plt
from PIL import Image
from rasterio.crs import CRS
from rasterio.errors import NotGeoreferencedWarning
from rasterio.io import MemoryFile
from rasterio.warp import transform

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.layers import Fit, LayerSource, file_layers
from app.mapping.products.contours import contours_geojson, find_contours
from app.mapping.products.geotiff import NODATA, geotiff
from app.mapping.products.kml import contours_kml
from app.mapping.products.pictures.colours import depth_range, palette
from app.mapping.products.pictures.overlay import overlay_corners, overlay_png
from app.mapping.products.pictures.picture import picture_png
from app.mapping.products.text import map_xyz, soundings_xyz
from app.mapping.s44 import Order
from app.mapping.swath.gridded import MODEL
from app.mapping.types import BathymetricMap, Grid, Soundings
from app.mapping.water.vertical import VerticalDatum

FRAME = LocalFrame(41.1850, -8.7040)
GRID = Grid(west_m=-10.0, south_m=20.0, cell_m=2.0, rows=30, cols=40)
DATUM = "EPSG:5861 (lowest astronomical tide)"
LAT = VerticalDatum(5861, DATUM)


@pytest.fixture
def bathymetry() -> BathymetricMap:
    east, north = np.meshgrid(GRID.east_m, GRID.north_m)
    depth = 5.0 + 0.1 * (east + 10.0) + 0.02 * north
    depth[25:, :5] = np.nan
    count = np.zeros(depth.shape, np.int64)
    count[:, 10] = 3
    return BathymetricMap(
        GRID,
        depth,
        np.where(np.isnan(depth), np.nan, 0.25),
        count,
        count > 0,
        np.ones_like(depth),
        8.0,
        "test",
    )


@pytest.fixture
def soundings() -> Soundings:
    rng = np.random.default_rng(0)
    return Soundings(rng.uniform(0, 50, 12), rng.uniform(20, 60, 12), rng.uniform(4, 9, 12), np.full(12, 0.07))


def cog(bathymetry: BathymetricMap, reference_m: np.ndarray | None = None) -> bytes:
    layers = file_layers(LayerSource(bathymetry, Order.SPECIAL, reference_m=reference_m))
    return geotiff(bathymetry, layers, FRAME, vertical_datum=LAT)


def test_geotiff_holds_all_layers_north_up(bathymetry: BathymetricMap) -> None:
    with MemoryFile(cog(bathymetry, bathymetry.depth_m - 0.5)) as memory, memory.open() as file:
        names = ("depth", "uncertainty", "count", "sounded", "slope", "tvu_fraction", "difference", "tvu")
        assert file.descriptions == names
        assert file.units[0] == "metre"
        assert file.nodata == NODATA
        assert file.tags()["VERTICAL_DATUM"] == DATUM
        assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert file.bounds == pytest.approx((-10.0, 20.0, 70.0, 80.0))
        depth = file.read(1, masked=True)
        assert depth.mask[0, 0]  # the unknown corner is north-west, so first in a north-up file
        np.testing.assert_allclose(depth[::-1].filled(np.nan), bathymetry.depth_m, rtol=1e-6)
        np.testing.assert_array_equal(file.read(3)[::-1, 10], np.full(30, 3))
        assert set(np.unique(file.read(4))) == {NODATA, 0.0, 1.0}
        np.testing.assert_allclose(
            file.read(5, masked=True).compressed(), np.degrees(np.arctan(np.hypot(0.1, 0.02))), rtol=1e-5
        )
        np.testing.assert_allclose(file.read(7, masked=True).compressed(), 0.5, rtol=1e-5)


def test_overviews_of_a_geotiff_hold_nothing_that_the_map_does_not() -> None:
    rng = np.random.default_rng(0)
    grid = Grid(0.0, 0.0, 1.0, 1100, 600)
    count = rng.poisson(2.0, (1100, 600))
    depth = np.where((rng.random(count.shape) < 0.01), 5.0, 20.0 + 0.01 * grid.east_m)
    depth[:200, :300] = np.nan
    sd = np.where(count > 0, 0.1, 0.7)
    made = BathymetricMap(grid, depth, sd, count, count > 0, np.ones_like(depth), 8.0, MODEL)
    layers = file_layers(LayerSource(made, Order.SPECIAL))
    with MemoryFile(geotiff(made, layers, FRAME, vertical_datum=LAT)) as memory:
        with memory.open() as file:
            levels = len(file.overviews(1))
            whole = {name: file.read(number) for number, name in enumerate(file.descriptions, start=1)}
        assert levels >= 2
        for level in range(levels):
            with memory.open(overview_level=level) as file:
                assert file.shape[0] == 1100 // 2 ** (level + 1)
                for number, (name, values) in enumerate(whole.items(), start=1):
                    assert np.isin(file.read(number), values).all(), name


def test_geotiff_shows_what_a_swath_survey_missed(bathymetry: BathymetricMap) -> None:
    missed = bathymetry.count == 0
    swept = replace(bathymetry, model=MODEL, depth_m=np.where(missed, np.nan, bathymetry.depth_m))
    with MemoryFile(cog(swept)) as memory, memory.open() as file:
        density = file.read(file.descriptions.index("density") + 1, masked=True)[::-1]
        depth = file.read(1, masked=True)[::-1]
    assert not density.mask.any()
    np.testing.assert_array_equal(density.data, np.where(missed, 0.0, 1.0))
    np.testing.assert_array_equal(depth.mask, missed)


def test_geotiff_lies_where_the_frame_says_below_the_stated_datum(bathymetry: BathymetricMap) -> None:
    with MemoryFile(cog(bathymetry)) as memory, memory.open() as file:
        east, north = file.xy(29, 0)  # south-western cell
        horizontal, vertical = pyproj.CRS.from_wkt(file.crs.to_wkt()).sub_crs_list
        (lon,), (lat,) = transform(CRS.from_wkt(horizontal.to_wkt()), "EPSG:4326", [east], [north])
    assert (east, north) == (pytest.approx(-9.0), pytest.approx(21.0))
    assert (lat, lon) == pytest.approx(tuple(map(float, FRAME.to_geographic(-9.0, 21.0))), abs=1e-9)
    assert vertical.to_epsg() == 5861


def test_xyz_holds_the_known_cells(bathymetry: BathymetricMap) -> None:
    text = map_xyz(bathymetry, FRAME, vertical_datum=DATUM, common_sd_m=0.0)
    rows = np.loadtxt(io.BytesIO(text), comments="#")
    known = np.isfinite(bathymetry.depth_m)
    np.testing.assert_allclose(rows[:, 2], bathymetry.depth_m[known], atol=5e-4)
    np.testing.assert_allclose(rows[:, :2], GRID.centres_m[known.ravel()], atol=5e-4)
    assert DATUM in text.decode()


def test_xyz_of_sounded_cells_only_in_degrees(bathymetry: BathymetricMap) -> None:
    text = map_xyz(bathymetry, FRAME, vertical_datum=DATUM, geographic=True, sounded_only=True, common_sd_m=0.0)
    rows = np.loadtxt(io.BytesIO(text), comments="#")
    assert len(rows) == 30
    assert np.all(rows[:, 5] == 1)
    east, north = FRAME.to_local(rows[:, 1], rows[:, 0])
    np.testing.assert_allclose(east, GRID.east_m[10], atol=2e-3)
    np.testing.assert_allclose(north, GRID.north_m, atol=2e-3)


def test_soundings_come_back_from_xyz(soundings: Soundings) -> None:
    rows = np.loadtxt(io.BytesIO(soundings_xyz(soundings, FRAME, vertical_datum=DATUM)), comments="#")
    np.testing.assert_allclose(rows[:, 0], soundings.east_m, atol=5e-4)
    np.testing.assert_allclose(rows[:, 2], soundings.depth_m, atol=5e-4)


def test_overlay_pixels_are_the_cells_north_up(bathymetry: BathymetricMap) -> None:
    image = np.asarray(Image.open(io.BytesIO(overlay_png(bathymetry.depth_m, bathymetry.sounded, (4.0, 14.0)))))
    assert image.shape == (30, 40, 4)
    assert np.all(image[:5, :5, 3] == 0)
    assert np.all(image[5:, 10, 3] == 255)
    assert 0 < image[29, 11, 3] < 255
    colour = palette(Fit.DATA)((bathymetry.depth_m[0, 20] - 4.0) / 10.0, bytes=True)
    np.testing.assert_allclose(image[29, 20, :3].astype(int), colour[:3], atol=1)


def test_overlay_opens_as_a_raster_too(bathymetry: BathymetricMap) -> None:
    png = overlay_png(bathymetry.sd_m, bathymetry.sounded, (0.0, 1.0), Fit.FROM_ZERO)
    with MemoryFile(png) as memory, pytest.warns(NotGeoreferencedWarning), memory.open() as file:
        assert (file.count, file.width, file.height) == (4, 40, 30)


@pytest.mark.parametrize("range_m", [(5.0, 5.0), (9.0, 4.0), (0.0, float("inf"))])
def test_an_empty_colour_range_is_refused(bathymetry: BathymetricMap, range_m: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="range_m"):
        overlay_png(bathymetry.depth_m, bathymetry.sounded, range_m)


def test_overlay_corners_run_clockwise_from_north_west() -> None:
    lon, lat = np.transpose(overlay_corners(GRID, FRAME))
    east, north = FRAME.to_local(lat, lon)
    np.testing.assert_allclose(east, [-10, 70, 70, -10], atol=1e-3)
    np.testing.assert_allclose(north, [80, 80, 20, 20], atol=1e-3)


def test_picture_is_a_png_and_leaves_pyplot_alone(bathymetry: BathymetricMap) -> None:
    png = picture_png(
        bathymetry,
        vertical_datum=DATUM,
        title="Leixoes",
        tracks={"lauv-1": np.array([[0.0, 30.0], [50.0, 70.0]])},
    )
    image = Image.open(io.BytesIO(png))
    image.verify()
    assert image.format == "PNG"
    assert min(image.size) > 500
    assert plt.get_fignums() == []


def test_pictures_can_be_drawn_in_threads(bathymetry: BathymetricMap) -> None:
    with ThreadPoolExecutor(3) as pool:
        pictures = list(pool.map(lambda _: picture_png(bathymetry, vertical_datum=DATUM), range(3)))
    assert pictures[0] == pictures[1] == pictures[2]


def test_a_map_without_depth_has_no_colour_range(bathymetry: BathymetricMap) -> None:
    bathymetry.depth_m[:] = np.nan
    with pytest.raises(ValueError, match="no depth"):
        depth_range(bathymetry)


def test_contours_of_a_plane_are_straight_and_at_their_depth(bathymetry: BathymetricMap) -> None:
    collection = json.loads(contours_geojson(find_contours(bathymetry, FRAME, 1.0), vertical_datum=DATUM))
    depths = [feature["properties"]["depth_m"] for feature in collection["features"]]
    assert depths == [6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0]
    for feature in collection["features"]:
        for line in feature["geometry"]["coordinates"]:
            lon, lat = np.transpose(line)
            east, north = FRAME.to_local(lat, lon)
            np.testing.assert_allclose(
                5.0 + 0.1 * (east + 10.0) + 0.02 * north, feature["properties"]["depth_m"], atol=1e-3
            )


def test_the_contour_of_the_datum_has_no_minus(bathymetry: BathymetricMap) -> None:
    dried = replace(bathymetry, depth_m=bathymetry.depth_m - 6.2)
    contours = find_contours(dried, FRAME, 1.0)
    assert str(contours[0].depth_m) == "0.0"
    assert b"<name>0 m</name>" in contours_kml(contours, title="t", vertical_datum=DATUM)


def test_too_many_contours_are_refused_with_a_suggestion(bathymetry: BathymetricMap) -> None:
    with pytest.raises(ValueError, match="choose at least"):
        find_contours(bathymetry, FRAME, 1e-4)
