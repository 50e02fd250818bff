"""BAGs of variable resolution, read back by GDAL supergrid by supergrid and resampled."""

import io
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
import rasterio

from app.arrays import FloatArray
from app.mapping.bag_values import NODATA
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.products.vr_bag import REFINED_CELLS, vr_bag
from app.mapping.readers.georeferencing import place_reference, place_soundings
from app.mapping.readers.reader_choice import read_file
from app.mapping.readers.types import MapExtent, ReadError, ReadOptions
from app.mapping.swath.density import DensityGrid
from app.mapping.swath.gridded import gridded_map
from app.mapping.tiers import coarsened, doublings
from app.mapping.types import BathymetricMap, Grid
from app.mapping.water.vertical import VerticalDatum

FRAME = LocalFrame(41.1850, -8.7040)
LAT = VerticalDatum(5861, "EPSG:5861 LAT depth")
SHARE = 0.05
COLS, ROWS = 150, 90


@pytest.fixture(scope="module")
def bathymetry() -> BathymetricMap:
    """A slope from 10 to 100 m; its north-eastern third nobody sounded."""
    rng = np.random.default_rng(0)
    east, north = rng.uniform(0.0, COLS, 60_000), rng.uniform(0.0, ROWS, 60_000)
    seen = (east < 100.0) | (north < 30.0)
    east, north = east[seen], north[seen]
    density = DensityGrid(Grid(5.0, -7.0, 1.0, ROWS, COLS), np.ones((ROWS, COLS), dtype=bool))
    depth = 10.0 + 0.6 * east + 0.2 * rng.standard_normal(len(east))
    density.add(east + 5.0, north - 7.0, depth, np.full(len(east), 0.2))
    found = gridded_map(density)
    assert found is not None
    return found


@pytest.fixture
def path(bathymetry: BathymetricMap, tmp_path: Path) -> Path:
    made = tmp_path / "map.bag"
    made.write_bytes(vr_bag(bathymetry, SHARE, FRAME, vertical_datum=LAT, title="Slope", common_sd_m=0.0))
    return made


def layers_of(bathymetry: BathymetricMap, times: int, west_m: float, south_m: float, side: int) -> FloatArray:
    """Return elevation and deviation of a tier within a square, (2, side, side), row 0 south."""
    tier = coarsened(bathymetry, times)
    rows, cols = -(-ROWS // REFINED_CELLS) * side, -(-COLS // REFINED_CELLS) * side
    whole = np.full((2, rows, cols), NODATA)
    for layer, values in zip(whole, (-tier.depth_m, tier.sd_m), strict=True):
        layer[: tier.grid.rows, : tier.grid.cols] = np.where(tier.sounded, values, NODATA)
    row, col = round((south_m + 7.0) / times), round((west_m - 5.0) / times)
    return whole[:, row : row + side, col : col + side]


def test_every_supergrid_has_the_cells_of_its_shoalest_depth(path: Path, bathymetry: BathymetricMap) -> None:
    with rasterio.open(path, MODE="LIST_SUPERGRIDS") as file:
        names = file.subdatasets
    assert len(names) == 5 * 3 - 2 * 1, "two coarse cells without any sounding are not refined"
    cells = set()
    for name in names:
        with rasterio.open(name) as file:
            west, south, east, _ = file.bounds
            assert (east - west, file.nodata) == (REFINED_CELLS, NODATA)
            times = round(file.res[0])
            rows, cols = (slice(round(at), round(at) + REFINED_CELLS) for at in (south + 7.0, west - 5.0))
            depth = np.where(bathymetry.sounded, bathymetry.depth_m, np.nan)[rows, cols]
            assert times == 2 ** doublings(np.array([np.nanmin(depth)]), 1.0, SHARE)[0]
            expected = layers_of(bathymetry, times, west, south, file.height)
            np.testing.assert_allclose(file.read()[:, ::-1], expected, rtol=1e-6)
            cells.add(times)
    assert cells == {1, 2, 4, 8}


def test_resampled_to_the_largest_cell_nothing_is_invented(path: Path, bathymetry: BathymetricMap) -> None:
    with rasterio.open(path, MODE="RESAMPLED_GRID", RESX="8", RESY="8", VALUE_POPULATION="MEAN") as file:
        elevation = file.read(1, masked=True)[::-1]
        assert file.bounds == (5.0, -7.0, 165.0, 89.0)
    tier = coarsened(bathymetry, 8)
    shown = ~np.ma.getmaskarray(elevation)[: tier.grid.rows, : tier.grid.cols]
    assert (shown == tier.sounded).all()
    apart = np.abs(elevation[: tier.grid.rows, : tier.grid.cols] + tier.depth_m)[shown]
    assert apart.max() < 0.6, "means of cells, not weighted by their soundings"


def test_the_coarse_grid_and_the_samples_are_there_for_other_readers(path: Path, bathymetry: BathymetricMap) -> None:
    coarse = coarsened(bathymetry, REFINED_CELLS)
    with rasterio.open(path) as file:
        np.testing.assert_allclose(file.read(1, masked=True)[::-1].filled(np.nan), -coarse.depth_m, rtol=1e-6)
    with h5py.File(path) as file:
        root = file["BAG_root"]
        assert re.match(rb"1\.[6-9]|[2-9]", root.attrs["Bag Version"])
        refinements, nodes, samples = (root[f"varres_{name}"][:] for name in ("metadata", "refinements", "nodes"))
        assert len(root["varres_tracking_list"]) == 0
    assert (refinements["index"] == 0xFFFFFFFF).tolist() == (~coarse.sounded).tolist()
    assert (refinements["dimensions_x"].astype(int) ** 2).sum() == nodes.shape[1] == samples.shape[1]
    known = nodes["depth"] != NODATA
    assert (known == (samples["n_samples"] > 0)).all()
    assert samples["n_samples"].sum() == bathymetry.count.sum()


def test_a_map_smaller_than_a_coarse_cell_is_one_supergrid() -> None:
    density = DensityGrid(Grid(0.0, 0.0, 2.0, 3, 4), np.ones((3, 4), dtype=bool))
    density.add(np.array([1.0]), np.array([1.0]), np.array([12.5]), np.array([0.1]))
    small = gridded_map(density)
    assert small is not None
    with h5py.File(io.BytesIO(vr_bag(small, SHARE, FRAME, vertical_datum=LAT, title="x", common_sd_m=0.0))) as file:
        nodes = file["BAG_root/varres_refinements"]["depth"][0]
    assert (len(nodes), nodes[0], np.unique(nodes[1:]).tolist()) == (REFINED_CELLS**2, -12.5, [NODATA])


def test_a_map_without_soundings_is_refused(bathymetry: BathymetricMap) -> None:
    density = DensityGrid(bathymetry.grid, np.ones((ROWS, COLS), dtype=bool))
    density.add(np.array([6.0]), np.array([0.0]), np.array([12.5]), np.array([0.1]))
    alone = gridded_map(density)
    assert alone is not None
    alone.sounded[:] = False
    with pytest.raises(ValueError, match="sounded"):
        vr_bag(alone, SHARE, FRAME, vertical_datum=LAT, title="x", common_sd_m=0.0)


def test_what_is_exported_is_imported_again_cell_by_cell(path: Path, bathymetry: BathymetricMap) -> None:
    place = MapExtent(FRAME, bathymetry.grid, margin_m=10.0)
    content = read_file(io.BytesIO(path.read_bytes()), ".bag", place)
    found = place_soundings(content, ReadOptions(), place)
    s = found.soundings
    with h5py.File(path) as file:
        assert len(s) == found.found == (file["BAG_root/varres_refinements"]["depth"] != NODATA).sum()
    [note] = found.notes
    assert note.startswith("vertical datum: the file states LAT height, the mission none")
    slope = 10.0 + 0.6 * (s.east_m - 5.0)
    # A cell of up to 8 m at the border of what was sounded holds the mean of a part of it.
    assert np.percentile(np.abs(s.depth_m - slope), 95) < 0.6
    fine = np.isclose((s.east_m - 5.0) % 1.0, 0.5, atol=1e-3) & (s.depth_m < 20.0)
    row, col = (s.north_m + 7.0).astype(int)[fine], (s.east_m - 5.0).astype(int)[fine]
    np.testing.assert_allclose(s.depth_m[fine], bathymetry.depth_m[row, col], atol=1e-4)
    np.testing.assert_allclose(s.sd_m[fine], bathymetry.sd_m[row, col], atol=1e-4)
    sampled, _ = place_reference(content, ReadOptions(), place)
    np.testing.assert_allclose(sampled[row, col], bathymetry.depth_m[row, col], atol=1e-4)


def test_refinements_that_lie_beyond_the_end_are_refused(path: Path, bathymetry: BathymetricMap) -> None:
    with h5py.File(path, "r+") as file:
        table = file["BAG_root/varres_metadata"][:]
        table["index"][table["index"] < 1000] += 10_000_000
        file["BAG_root/varres_metadata"][:] = table
    place = MapExtent(FRAME, bathymetry.grid, margin_m=10.0)
    with pytest.raises(ReadError, match="cannot be read as BAG"):
        read_file(io.BytesIO(path.read_bytes()), ".bag", place)
