"""How the bottom goes on where it is unknown: by the slope of what is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.exploration.core.coverage import Coverage
from app.exploration.swath.raster import Beyond, raster_of, slope_of


def known_band(rows: slice, cols: slice) -> Coverage:
    """Return a slope of 0.1 east and 0.05 north, of which a part is known."""
    wanted = np.ones((200, 200), bool)
    north, east = np.indices(wanted.shape) + 0.5
    depth = np.full(wanted.shape, np.nan)
    depth[rows, cols] = (10.0 + 0.1 * east + 0.05 * north)[rows, cols]
    return Coverage(0.0, 0.0, 1.0, wanted, np.isfinite(depth), depth)


def test_a_slope_is_known_where_much_of_it_is() -> None:
    assert slope_of(known_band(slice(200), slice(200))) == pytest.approx([0.1, 0.05], abs=0.003)


def test_across_what_is_narrow_the_bottom_is_rather_level() -> None:
    east, north = slope_of(known_band(slice(0, 40), slice(200)))
    assert east == pytest.approx(0.1, abs=0.005)
    assert 0.02 < north < 0.05


@given(st.floats(-0.3, 0.3), st.floats(-3.0, 3.0))
def test_unknown_ground_goes_on_from_what_is_closest(slope: float, direction_rad: float) -> None:
    depth = np.full((40, 60), np.nan)
    depth[:, :20] = 12.0
    wanted = np.ones(depth.shape, bool)
    coverage = Coverage(0.0, 0.0, 1.0, wanted, ~wanted, depth)
    raster = raster_of(coverage, direction_rad, 1.0, 5.0, Beyond(np.array([slope, 0.0]), 0.1))
    along, across = np.meshgrid(raster.along_m, raster.across_m, indexing="ij")
    places = raster.axes.to_en(np.stack([along, across], axis=-1))
    away_m = places[..., 0] - 20.0
    inside = raster.wanted & (away_m > 2.0) & (places[..., 1] > 2.0) & (places[..., 1] < 38.0)
    assert np.allclose(raster.likely_m[inside], np.clip(12.0 + slope * away_m, 6.0, 24.0)[inside], atol=0.8)
    assert (raster.depth_m[inside] <= np.maximum(12.0 - 0.1 * (away_m - 1.5), 6.0)[inside]).all()
