"""What is left to ensonify depends on the cells that the depth asks for."""

import numpy as np
import pytest

from app.estimation.uncertainty import SoundingErrors
from app.exploration.core.coverage import Coverage
from app.mapping.swath.pings import Footprints, Pings, PlacedPings
from app.mapping.types import Grid
from app.missions.maps.swath_grid import SwathGrid

GRID = Grid(0.0, 0.0, 1.0, 80, 80)
MASK = np.ones((80, 80), dtype=bool)


def swept(depth_m: float, cell_of_depth: float | None) -> Coverage:
    """All but a square of 7 m, over an even floor."""
    swath = SwathGrid(GRID, MASK, SoundingErrors(), cell_of_depth)
    inside = (np.abs(GRID.centres_m - 19.5) < 4.0).all(axis=1)
    east, north = GRID.centres_m[~inside].T
    number = len(east)
    angle, range_m = np.zeros((number, 1), np.float32), np.full((number, 1), depth_m, np.float32)
    time_s, zeros = np.arange(number, dtype=float), np.zeros(number)
    pings = Pings(time_s, zeros, zeros, zeros, zeros, zeros, zeros, zeros, angle, range_m)
    depth = np.full(number, depth_m)
    beams = Footprints(np.arange(number), east, north, depth, zeros, range_m[:, 0].astype(float))
    swath.place = lambda vehicle, pings: PlacedPings(pings, beams)
    swath.add("rover", pings)
    return swath.coverage(None)


@pytest.mark.parametrize(
    ("depth_m", "cell_of_depth", "left"),
    [(15.0, None, True), (15.0, 0.05, True), (60.0, None, True), (60.0, 0.05, False)],
)
def test_a_hole_that_the_depth_does_not_ask_for_is_not_left(
    depth_m: float, cell_of_depth: float | None, left: bool
) -> None:
    coverage = swept(depth_m, cell_of_depth)
    assert (not coverage.done.all()) is left
