"""The files of one survey state one uncertainty: that of charted depths, the water level's included."""

import io
import re
import zipfile
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np
import pyproj
import pytest
import rasterio
from rasterio.io import DatasetReader, MemoryFile
from rasterio.transform import rowcol

from app.mapping.bag_values import NODATA
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.density import DensityGrid
from app.mapping.swath.gridded import gridded_map, without_guesses
from app.mapping.types import Grid
from app.mapping.water.vertical import VerticalDatum
from app.missions.errors import InvalidRequestError
from app.missions.maps.builder import BuiltMap, digest_of
from app.missions.maps.products import PRODUCTS, Material, ProductOptions, check_options, make_product
from app.missions.maps.snapshot import MapSnapshot, MissionFacts
from tests.support.missions.specs import make_spec

TIDE_SD_M, SHARED_SD_M = 0.1, 0.05
STATED_M = float(np.hypot(TIDE_SD_M, SHARED_SD_M))


@pytest.fixture(scope="module")
def material() -> Material:
    """A flat floor, 30 m deep; so many soundings in each cell that only what they share is left, but for a hole."""
    tide = {"source": "gauge", "sd_m": TIDE_SD_M}
    spec = make_spec(coverage={"cell_of_depth": 0.05})
    spec = spec.model_copy(update={"tide": spec.tide.model_copy(update=tide)})
    grid = Grid(0.0, 0.0, 1.0, 40, 40)
    east, north = (np.tile(axis.ravel(), 200) for axis in np.meshgrid(grid.east_m, grid.north_m))
    keep = (np.abs(east - 20.0) > 1.0) | (np.abs(north - 20.0) > 1.0)
    same = np.ones(int(keep.sum()))
    density = DensityGrid(grid, np.ones((40, 40), dtype=bool))
    density.add(east[keep], north[keep], 30.0 * same, 0.01 * same, SHARED_SD_M * same, 0.0 * same)
    found = gridded_map(density)
    assert found is not None
    bathymetry = without_guesses(found)
    facts = MissionFacts("1234", spec, LocalFrame(41.1850, -8.7040), VerticalDatum(5861, "EPSG:5861 LAT depth"))
    built = BuiltMap(1, len(same), bathymetry, digest_of(bathymetry), thorough=True)
    return Material(facts, datetime(2026, 11, 28, tzinfo=UTC), map=MapSnapshot(facts, built, 0))


def file_of(name: str, material: Material) -> bytes:
    made = PRODUCTS[name].make(material, ProductOptions())
    assert isinstance(made, bytes)
    return made


def in_geotiff(content: bytes) -> np.ndarray:
    with MemoryFile(content) as memory, memory.open() as file:
        band = file.descriptions.index("uncertainty") + 1
        assert "tide, included" in file.tags(band)["MEANING"]
        return np.asarray(file.read(band, masked=True).compressed())


def in_tiers(content: bytes) -> np.ndarray:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        (name,) = archive.namelist()
        assert name.endswith("-2m.tif")
        content = archive.read(name)
    with MemoryFile(content) as memory, memory.open() as file:
        assert file.descriptions[-1] == "least_depth"
        np.testing.assert_allclose(file.read(file.count, masked=True).compressed(), 30.0)
    return in_geotiff(content)


def in_netcdf(content: bytes) -> np.ndarray:
    with h5py.File(io.BytesIO(content)) as file:
        layer = file["uncertainty"]
        assert b"tide, included" in layer.attrs["long_name"]
        return np.asarray(layer[:][layer[:] != layer.attrs["_FillValue"][0]])


def in_bag(content: bytes) -> np.ndarray:
    with h5py.File(io.BytesIO(content)) as file:
        sd = file["BAG_root/uncertainty"][:]
        assert "tide, included" in b"".join(file["BAG_root/metadata"][:]).decode()
    return np.asarray(sd[sd != NODATA])


def in_vr_bag(content: bytes) -> np.ndarray:
    with h5py.File(io.BytesIO(content)) as file:
        sd = file["BAG_root/varres_refinements"]["depth_uncrt"]
    return np.concatenate([in_bag(content), sd[sd != NODATA]])


def in_s102(content: bytes) -> np.ndarray:
    with h5py.File(io.BytesIO(content)) as file:
        sd = file["BathymetryCoverage/BathymetryCoverage.01/Group_001/values"]["uncertainty"]
    # Whole centimetres, rounded up.
    return np.asarray(sd[sd < 1000.0]) - 0.01 + STATED_M % 0.01


def in_xyz(content: bytes) -> np.ndarray:
    assert b"tide, included" in content
    return np.asarray(np.loadtxt(io.BytesIO(content), comments="#")[:, 3])


@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("tif", in_geotiff),
        ("tiers.zip", in_tiers),
        ("nc", in_netcdf),
        ("bag", in_bag),
        ("vr.bag", in_vr_bag),
        ("s102", in_s102),
        ("xyz", in_xyz),
    ],
)
def test_every_file_states_the_uncertainty_of_charted_depths(
    name: str, read: Callable[[bytes], np.ndarray], material: Material
) -> None:
    stated = read(file_of(name, material))
    assert stated.min() == pytest.approx(STATED_M, abs=1e-3)
    assert np.median(stated) == pytest.approx(STATED_M, abs=1e-3)


def test_a_bag_tells_how_many_cells_are_predicted(material: Material) -> None:
    with h5py.File(io.BytesIO(file_of("bag", material))) as file:
        text = b"".join(file["BAG_root/metadata"][:]).decode()
        numbers, elevation = file["BAG_root/num_soundings"][:], file["BAG_root/elevation"][:]
    told = re.search(r"(\d+) of (\d+) cells with an elevation hold no sounding: there it is predicted", text)
    assert told is not None
    assert [int(number) for number in told.groups()] == [4, 1600]
    assert ((numbers == 0) & (elevation != NODATA)).sum() == 4
    with h5py.File(io.BytesIO(file_of("vr.bag", material))) as file:
        assert "Every cell with an elevation was sounded." in b"".join(file["BAG_root/metadata"][:]).decode()


IN_UTM = ProductOptions(crs="utm")
"""Zone 29 north."""

PEAK_M = 12.5


@pytest.fixture(scope="module")
def peaked(material: Material) -> Material:
    """The same floor, sloping, with a rock of one cell."""
    built = material.snapshot.built
    grid = built.map.grid
    east, north = np.meshgrid(grid.east_m, grid.north_m)
    depth = 30.0 + 0.1 * east + 0.03 * north
    depth[31, 7] = PEAK_M
    bathymetry = replace(built.map, depth_m=depth)
    return replace(material, map=MapSnapshot(material.facts, replace(built, map=bathymetry), 0))


def in_utm(material: Material) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return eastings, northings and depths of the map's cells, by an independent way."""
    bathymetry = material.snapshot.built.map
    lat, lon = material.facts.frame.to_geographic(*bathymetry.grid.centres_m.T)
    easting, northing = pyproj.Transformer.from_crs(4326, 32629).transform(lat, lon)
    return easting, northing, bathymetry.depth_m.ravel()


def check_raster(file: DatasetReader, depth: np.ndarray, material: Material) -> None:
    """Hold cells, north up, against the map: the rock at its place, and no depth deeper than what lies in the cell."""
    easting, northing, expected = in_utm(material)
    row, col = rowcol(file.transform, easting, northing)
    found = depth[np.asarray(row, int), np.asarray(col, int)]
    assert (found <= expected + 1e-5).all()
    assert np.nanmin(depth) == pytest.approx(PEAK_M)
    np.testing.assert_allclose(np.median(found - expected), 0.0, atol=0.05)
    peak_row, peak_col = np.nonzero(depth == np.nanmin(depth))
    x, y = file.xy(peak_row, peak_col)
    rock = 31 * 40 + 7
    away = np.hypot(np.asarray(x) - easting[rock], np.asarray(y) - northing[rock])
    assert away.max() <= np.sqrt(0.5) * 1.01


def test_a_geotiff_and_a_bag_in_utm_have_the_code_and_every_shoal(peaked: Material, tmp_path: Path) -> None:
    product = make_product("tif", peaked, IN_UTM)
    assert product.filename == "quay-epsg32629.tif"
    with MemoryFile(product.content.whole()) as memory, memory.open() as file:
        horizontal, vertical = pyproj.CRS.from_wkt(file.crs.to_wkt()).sub_crs_list
        assert (horizontal.to_epsg(), vertical.to_epsg()) == (32629, 5861)
        assert (file.res, file.bounds.left % 1.0, "ORIGIN_LAT" in file.tags()) == ((1.0, 1.0), 0.0, False)
        assert "WGS 84 / UTM zone 29N (EPSG:32629)" in file.tags()["MODEL"]
        check_raster(file, file.read(1, masked=True).filled(np.nan), peaked)
        count = file.read(file.descriptions.index("count") + 1, masked=True).compressed()
        assert set(np.unique(count)) <= {0.0, 200.0}
    product = make_product("bag", peaked, IN_UTM)
    assert product.filename == "quay-epsg32629.bag"
    (path := tmp_path / "map.bag").write_bytes(product.content.whole())
    with rasterio.open(path) as file:
        found = pyproj.CRS.from_wkt(file.crs.to_wkt())
        assert (found.sub_crs_list[0] if found.is_compound else found).to_epsg() == 32629
        elevation = file.read(1, masked=True).filled(np.nan)
        check_raster(file, -elevation, peaked)
    with h5py.File(path) as file:
        assert file["BAG_root/num_soundings"].shape == elevation.shape


def test_text_and_netcdf_in_utm_have_eastings_and_northings(peaked: Material) -> None:
    easting, northing, depth = in_utm(peaked)
    product = make_product("xyz", peaked, IN_UTM)
    text = product.content.whole()
    assert text.startswith(b"# easting_m northing_m depth_m")
    assert b"# positions: WGS 84 / UTM zone 29N (EPSG:32629)\n" in text
    rows = np.loadtxt(io.BytesIO(text), comments="#")
    rock = rows[np.argmin(rows[:, 2])]
    assert rock[2] == PEAK_M
    assert np.hypot(rock[0] - easting[31 * 40 + 7], rock[1] - northing[31 * 40 + 7]) <= np.sqrt(0.5) * 1.01
    assert rows[:, 2].max() <= depth.max() + 5e-4
    with h5py.File(io.BytesIO(make_product("nc", peaked, IN_UTM).content.whole())) as file:
        (stated,) = np.ravel(file["crs"].attrs["crs_wkt"])
        assert pyproj.CRS.from_wkt(str(stated)).sub_crs_list[0].to_epsg() == 32629
        row, col = (int(i) for i in np.argwhere(file["depth"][:] == np.float32(PEAK_M))[0])
        x, y, lat, lon = file["x"][col], file["y"][row], file["lat"][row, col], file["lon"][row, col]
    assert pyproj.Transformer.from_crs(4326, 32629).transform(lat, lon) == pytest.approx((x, y), abs=1e-3)
    assert np.hypot(x - easting[31 * 40 + 7], y - northing[31 * 40 + 7]) <= np.sqrt(0.5) * 1.01


def test_positions_stay_as_they_are_without_a_system(peaked: Material) -> None:
    """Checksums of delivered files hold: what ``crs`` adds is nowhere without it."""
    assert make_product("xyz", peaked, ProductOptions()).content.whole().startswith(b"# lon_deg lat_deg depth_m")
    product = make_product("tif", peaked, ProductOptions())
    assert product.filename == "quay.tif"
    with MemoryFile(product.content.whole()) as memory, memory.open() as file:
        assert file.tags()["MODEL"] == peaked.snapshot.built.map.model
        assert file.tags()["ORIGIN_LAT"] == "41.185"
        assert file.bounds == (0.0, 0.0, 40.0, 40.0)


@pytest.mark.parametrize(
    ("name", "crs", "said", "remedy"),
    [
        ("tif", "EPSG:4326", "WGS 84 (EPSG:4326) is no projected system in metres", "here EPSG:32629"),
        ("vr.bag", "utm", "vr.bag is not made in utm", "tif, nc, bag, xyz, contours.dxf"),
    ],
)
def test_a_system_that_a_file_cannot_be_in_is_refused(
    name: str, crs: str, said: str, remedy: str, peaked: Material
) -> None:
    with pytest.raises(InvalidRequestError) as refused:
        check_options(name, peaked.facts, ProductOptions(crs=crs))
    assert (refused.value.field, str(refused.value)) == ("crs", said)
    assert remedy in refused.value.remedy
