"""Fields on a coarse grid: the same value by place and by grid."""

import numpy as np

from app.mapping.kriging.fields import Field, coarse_grid
from app.mapping.types import Grid


def test_places_and_grids_read_the_same_values() -> None:
    coarse = coarse_grid(np.array([3.0, -2.0]), np.array([23.0, 8.0]), 2.5)
    field = Field(coarse, np.random.default_rng(0).uniform(-1, 1, (2, coarse.rows, coarse.cols)))
    grid = Grid(-5.0, -10.0, 0.7, 40, 60)  # reaches beyond on all sides
    np.testing.assert_allclose(field.over(grid).reshape(2, -1), field.at(grid.centres_m), atol=1e-12)
    np.testing.assert_allclose(field.over(coarse), field.values)


def test_a_plane_is_reproduced_between_the_centres() -> None:
    coarse = Grid(0.0, 0.0, 5.0, 6, 8)
    east, north = np.meshgrid(coarse.east_m, coarse.north_m)
    places = np.random.default_rng(1).uniform(3.0, 27.0, (30, 2))
    np.testing.assert_allclose(
        Field(coarse, (2.0 * east - north)[None]).at(places)[0], 2.0 * places[:, 0] - places[:, 1]
    )
