"""The files of one survey state one uncertainty: that of charted depths, the water level's included."""

import io
import re
import zipfile
from collections.abc import Callable
from datetime import UTC, datetime

import h5py
import numpy as np
import pytest
from rasterio.io import MemoryFile

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.products.bag import NODATA
from app.mapping.swath.density import DensityGrid
from app.mapping.swath.gridded import gridded_map, without_guesses
from app.mapping.types import Grid
from app.mapping.water.vertical import VerticalDatum
from app.missions.maps.builder import BuiltMap, digest_of
from app.missions.maps.products import PRODUCTS, Material, ProductOptions
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
    told = re.search(r"In (\d+) of (\d+) cells with an elevation num_soundings is 0: there it is predicted", text)
    assert told is not None
    assert [int(number) for number in told.groups()] == [4, 1600]
    assert ((numbers == 0) & (elevation != NODATA)).sum() == 4
    with h5py.File(io.BytesIO(file_of("vr.bag", material))) as file:
        assert "Every cell with an elevation was sounded." in b"".join(file["BAG_root/metadata"][:]).decode()
