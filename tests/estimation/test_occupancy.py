"""What scans make of a partly known site."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from app.estimation import Cell, OccupancyGrid, Scanner
from simulator.obstacles.obstacles import ObstacleWorld

SIDE = 20


def world(seed: int, share: float = 0.15) -> ObstacleWorld:
    rng = np.random.default_rng(seed)
    solid = rng.random((SIDE, SIDE)) < share
    known = solid & (rng.random((SIDE, SIDE)) < 0.3)
    corner = np.array([0.5, 0.5])
    return ObstacleWorld("noise", solid, known, 1.0, corner, corner, corner)


def free_place(world: ObstacleWorld, seed: int) -> np.ndarray:
    rng = np.random.default_rng([seed, 1])
    free = np.argwhere(~world.solid)
    row, col = free[rng.integers(len(free))]
    return np.array([col, row]) + rng.uniform(0.05, 0.95, 2)


def first_hit(world: ObstacleWorld, start: np.ndarray, bearing: float, reach: float) -> float:
    """Slow reference: walk along the beam in small steps."""
    for along in np.arange(0.0, reach, 0.001):
        east, north = start + along * np.array([np.sin(bearing), np.cos(bearing)])
        if not (0 <= east < SIDE and 0 <= north < SIDE):
            return np.inf
        if world.solid[int(north), int(east)]:
            return float(along)
    return np.inf


@given(st.integers(0, 10_000))
@settings(max_examples=8, deadline=None)
def test_a_scan_hears_the_first_obstacle(seed: int) -> None:
    site = world(seed)
    place = free_place(site, seed)
    bearings = np.random.default_rng([seed, 2]).uniform(0.0, 2.0 * np.pi, 8)
    ranges = site.scan(place, bearings, 6.0)
    for bearing, found in zip(bearings, ranges, strict=True):
        truth = first_hit(site, place, bearing, 6.0)
        # The walk may step over a corner that the beam only grazes.
        assert found == pytest.approx(truth, abs=0.002) or (found < truth and np.isfinite(found))


@given(st.integers(0, 10_000))
@example(1147)  # a beam that touches an obstacle by a hundred-thousandth of a cell
@settings(max_examples=20, deadline=None)
def test_what_was_seen_is_true(seed: int) -> None:
    site, scanner = world(seed), Scanner(6.0, 1.0)
    grid = OccupancyGrid.from_blueprint(site.known, 1.0)
    for k in range(5):
        place = free_place(site, 10 * seed + k)
        grid = grid.seen_from(place, scanner.bearings_rad, site.scan(place, scanner.bearings_rad, 6.0), 6.0)
        row, col = (int(x) for x in place[::-1])
        assert grid.states[row, col] == Cell.EXPLORED
    states = grid.states
    assert not (site.solid & (states == Cell.EXPLORED)).any()
    assert not (~site.solid & (states == Cell.FOUND)).any()
    assert (states[site.known] == Cell.KNOWN).all()


def test_nothing_is_known_behind_an_obstacle_or_beyond_the_reach() -> None:
    solid = np.zeros((SIDE, SIDE), dtype=bool)
    solid[:, 12] = True
    corner = np.array([0.5, 0.5])
    site = ObstacleWorld("wall", solid, np.zeros_like(solid), 1.0, corner, corner, corner)
    scanner, place = Scanner(8.0, 0.5), np.array([8.5, 10.5])
    ranges = site.scan(place, scanner.bearings_rad, 8.0)
    states = OccupancyGrid.from_blueprint(site.known, 1.0).seen_from(place, scanner.bearings_rad, ranges, 8.0).states
    assert (states[:, 13:] == Cell.UNEXPLORED).all()
    assert (states[10, 1:12] == Cell.EXPLORED).all()
    assert states[10, 12] == Cell.FOUND
    assert states[10, 0] == Cell.UNEXPLORED  # 8.5 m away


def test_an_obstacle_that_left_is_unlearned_and_a_beam_without_a_value_says_nothing() -> None:
    nothing = OccupancyGrid.from_blueprint(np.zeros((5, 5), dtype=bool), 1.0)
    east = np.array([np.pi / 2])
    grid = nothing.seen_from(np.array([0.5, 2.5]), east, np.array([2.5]), 5.0)
    assert grid.states[2, 3] == Cell.FOUND
    for _ in range(4):
        grid = grid.seen_from(np.array([0.5, 2.5]), east, np.array([np.inf]), 5.0)
    assert grid.states[2, 3] == Cell.EXPLORED
    silent = nothing.seen_from(np.array([0.5, 2.5]), east, np.array([np.nan]), 5.0)
    assert (silent.states == Cell.UNEXPLORED).all()


def test_what_comes_up_in_water_that_was_often_seen_free_is_an_obstacle_at_its_first_echo() -> None:
    grid = OccupancyGrid.from_blueprint(np.zeros((5, 9), dtype=bool), 1.0)
    place, east = np.array([0.5, 2.5]), np.array([np.pi / 2])

    def seen(grid: OccupancyGrid, range_m: float, times: int = 1) -> OccupancyGrid:
        for _ in range(times):
            grid = grid.seen_from(place, east, np.array([range_m]), 8.0)
        return grid

    came = seen(seen(grid, np.inf, times=20), 4.0)
    assert came.states[2, 4] == Cell.FOUND
    assert (came.states[2, :4] == Cell.EXPLORED).all()
    # Beside an obstacle an echo may come from that one: it takes two.
    beside = seen(came, 3.0)
    assert beside.states[2, 3] == Cell.EXPLORED
    assert seen(beside, 3.0).states[2, 3] == Cell.FOUND


@pytest.mark.parametrize("range_m", [0.1, 0.3, 0.499, 0.501])
def test_an_obstacle_close_by_is_never_in_the_cell_that_the_vehicle_is_in(range_m: float) -> None:
    nothing = OccupancyGrid.from_blueprint(np.zeros((5, 5), dtype=bool), 1.0)
    place, bearings = np.array([2.5, 2.5]), np.array([0.0, np.pi / 2, np.pi])
    states = nothing.seen_from(place, bearings, np.array([range_m, np.inf, np.inf]), 5.0).states
    assert states[2, 2] == Cell.EXPLORED
    assert states[3, 2] == Cell.FOUND
    assert states[4, 2] == Cell.UNEXPLORED


def test_an_echo_just_in_front_of_a_known_obstacle_is_that_obstacle() -> None:
    blueprint = np.zeros((SIDE, SIDE), dtype=np.bool_)
    blueprint[12] = True
    grid = OccupancyGrid.from_blueprint(blueprint, 1.0)
    north = np.zeros(1)
    for short, found in ((0.6, False), (1.6, True)):
        seen = grid.seen_from(np.array([5.5, 5.5]), north, np.array([12.0 - 5.5 - short]), 10.0, doubt_m=1.0)
        assert (seen.states == Cell.FOUND).any() == found
        assert (seen.states[5:10, 5] == Cell.EXPLORED).all()
        np.testing.assert_array_equal(seen.states == Cell.KNOWN, blueprint)
