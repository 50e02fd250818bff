"""Unseen sea floors: the same ones for everybody, vehicles can pass over them, no two alike."""

import numpy as np
import pytest

from simulator.floors.relief import fractal
from simulator.floors.seafloors import FAMILIES
from simulator.floors.terrain import TerrainError
from simulator.floors.unseen_floors import SHOALEST_M, UNSEEN, floor_names, unseen_floor


@pytest.mark.parametrize("family", sorted(UNSEEN))
@pytest.mark.parametrize("seed", [0, 1, 2, 30])
def test_every_floor_can_be_surveyed(family: str, seed: int) -> None:
    floor = unseen_floor(family, seed, width_m=60.0, height_m=45.0)
    assert (floor.rows, floor.cols) == (45, 60)
    assert np.isfinite(floor.z_m).all()
    assert floor.min_depth_m >= SHOALEST_M
    assert 1.0 < floor.max_depth_m - floor.min_depth_m < 60.0
    assert floor.name == f"{family}:{seed}"


@pytest.mark.parametrize("family", sorted(UNSEEN))
def test_a_floor_is_the_same_whenever_it_is_drawn_and_no_other_seeds(family: str) -> None:
    first, again, other = (unseen_floor(family, seed, width_m=40.0, height_m=40.0) for seed in (5, 5, 7))
    np.testing.assert_array_equal(first.z_m, again.z_m)
    assert np.abs(first.z_m - other.z_m).max() > 0.1


def test_families_are_none_of_those_that_planners_are_developed_on() -> None:
    assert not set(UNSEEN) & set(FAMILIES)


def test_floors_are_counted_family_by_family() -> None:
    names = list(floor_names([1, 3], 12))
    assert len(set(names)) == 12
    assert {family for family, _ in names[:10]} == set(UNSEEN)
    assert [seed for _, seed in names] == [1] * 10 + [3] * 2


@pytest.mark.parametrize(
    ("change", "says"),
    [({"family": "lagoon"}, "lagoon"), ({"cell_m": 0.0}, "cell_m"), ({"width_m": 1.0}, "at least two cells")],
)
def test_a_floor_that_cannot_be_drawn_is_refused(change: dict[str, object], says: str) -> None:
    arguments: dict[str, object] = {"family": "dunes", "seed": 0, **change}
    with pytest.raises(TerrainError, match=says):
        unseen_floor(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("direction", [0.0, 0.9])
def test_stretched_relief_is_longer_in_its_direction(direction: float) -> None:
    z = fractal((200, 200), 1.8, np.random.default_rng(3), 4.0, direction)
    north, east = np.gradient(z)
    along = np.abs(east * np.sin(direction) + north * np.cos(direction)).mean()
    across = np.abs(east * np.cos(direction) - north * np.sin(direction)).mean()
    assert along < 0.6 * across
