"""S-102 files as priors: what is exported is read again, and what is wrong with others is said."""

import io
from collections.abc import Callable
from datetime import UTC, datetime

import h5py
import numpy as np
import pytest

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.products.s102 import SurveyFacts, s102
from app.mapping.readers.georeferencing import place_soundings
from app.mapping.readers.s102 import INSTANCE, VALUES, read_s102
from app.mapping.readers.types import MapExtent, ReadError, ReadOptions
from app.mapping.types import BathymetricMap, Grid
from app.mapping.water.vertical import VerticalDatum

FRAME = LocalFrame(41.1850, -8.7040)
GRID = Grid(0.0, 0.0, 2.0, 20, 25)
LAT = VerticalDatum(5861, "EPSG:5861 LAT depth")
PLACE = MapExtent(FRAME, GRID, margin_m=6.0)


def depth_at(east_m: np.ndarray, north_m: np.ndarray) -> np.ndarray:
    return 6.0 + 0.1 * east_m + 0.05 * north_m


def exported() -> bytes:
    depth = depth_at(*np.meshgrid(GRID.east_m, GRID.north_m))
    count = np.ones(depth.shape, np.int64)
    made = BathymetricMap(GRID, depth, np.full(depth.shape, 0.2), count, count > 0, np.ones_like(depth), 8.0, "test")
    survey = SurveyFacts("test", first_time_s=0.0, last_time_s=1.0)
    return s102(
        made,
        FRAME,
        survey,
        vertical_datum=LAT,
        issued=datetime(2026, 11, 25, tzinfo=UTC),
    )


def changed(change: Callable[[h5py.File], None]) -> bytes:
    content = io.BytesIO(exported())
    with h5py.File(content, "r+") as file:
        change(file)
    return content.getvalue()


def test_what_is_exported_is_read_again_where_it_was() -> None:
    placed = place_soundings(read_s102(exported()), ReadOptions(), PLACE)
    assert len(placed.soundings) > 0.9 * GRID.rows * GRID.cols
    wrong = placed.soundings.depth_m - depth_at(placed.soundings.east_m, placed.soundings.north_m)
    # Cells of the UTM zone have the depth of the nearest of the map.
    assert np.abs(wrong).max() < 0.3
    assert abs(wrong.mean()) < 0.1
    assert placed.soundings.sd_m == pytest.approx(0.2, rel=1e-3)


def test_older_editions_number_their_system_otherwise() -> None:
    def older(file: h5py.File) -> None:
        file.attrs["horizontalDatumValue"] = file.attrs["horizontalCRS"]
        del file.attrs["horizontalCRS"]

    assert read_s102(changed(older)).crs == read_s102(exported()).crs


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda file: file.attrs.__delitem__("horizontalCRS"), "what its positions are in"),
        (lambda file: file.__delitem__(VALUES), "cannot be read as S-102"),
        (lambda file: file[INSTANCE].attrs.__setitem__("gridSpacingLatitudinal", 0.0), "no place or no spacing"),
        (lambda file: file.attrs.__setitem__("horizontalCRS", 1), "cannot be read as S-102"),
    ],
)
def test_what_is_missing_is_said(change: Callable[[h5py.File], None], said: str) -> None:
    with pytest.raises(ReadError, match=said):
        read_s102(changed(change))


def test_what_is_no_hdf5_is_refused() -> None:
    with pytest.raises(ReadError, match="HDF5"):
        read_s102(b"nothing")
