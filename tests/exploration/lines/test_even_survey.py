from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.routes import Turns, Vehicles, flown_m
from app.exploration.lines.even_survey import EvenSurvey, Pattern, even_survey, fullest_surveys
from app.exploration.lines.lattice import Sweep
from app.exploration.lines.lawnmower import lawnmower_routes

WIDTH, HEIGHT = 120.0, 300.0
AREA = np.array([[0.0, 0.0], [WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT]])
ZONE = np.array([[40.0, 100.0], [70.0, 100.0], [70.0, 150.0], [40.0, 150.0]])
STARTS = np.array([[2.0, 2.0], [7.0, 2.0], [12.0, 2.0]])


WHOLE = Pattern()


def survey(left_m: FloatArray, pattern: Pattern = WHOLE, radius_m: float = 0.0) -> EvenSurvey | None:
    constraints = Constraints(AREA)
    sweep = Sweep(constraints, FreeSpace(constraints, 0.5), np.pi / 2)
    vehicles = Vehicles(STARTS[: len(left_m)], np.full(len(left_m), np.nan), left_m)
    return even_survey(sweep, vehicles, Turns(radius_m, 0.0), pattern)


def lines_of(routes: list[FloatArray]) -> list[tuple[float, float, float]]:
    """Return where the legs along the lines lie and from where to where they go."""
    legs = [leg for route in routes for leg in pairwise(route)]
    return sorted(
        (float(a[0]), float(min(a[1], b[1])), float(max(a[1], b[1]))) for a, b in legs if abs(a[0] - b[0]) < 1e-6
    )


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(320.0, 4000.0), min_size=1, max_size=3), st.floats(0.0, 8.0))
def test_whole_lines_are_even_and_nobody_flies_farther_than_it_can(left: list[float], radius: float) -> None:
    left_m = np.array(left)
    found = survey(left_m, radius_m=radius)
    if found is None:
        return
    lines = lines_of(found.routes)
    at = np.array([line[0] for line in lines])
    np.testing.assert_allclose(at, (np.arange(len(at)) + 0.5) * found.spacing_m, atol=1e-6)
    np.testing.assert_allclose([line[1:] for line in lines], [[0.5, HEIGHT - 0.5]] * len(lines), atol=1e-6)
    for start, route, most in zip(STARTS, found.routes, left_m, strict=False):
        assert flown_m(start[0], start[1], np.nan, route, Turns(radius, 0.0)) <= most


def test_vehicles_that_share_lines_fly_more_of_them_between_them() -> None:
    left_m = np.array([950.0, 950.0, 950.0])
    whole, shared = survey(left_m), survey(left_m, Pattern(parts=8))
    assert whole is not None
    assert shared is not None
    assert shared.spacing_m < whole.spacing_m
    covered = sum(high - low for _, low, high in lines_of(shared.routes))
    assert covered == pytest.approx((HEIGHT - 1.0) * round(WIDTH / shared.spacing_m))


def test_a_faster_vehicle_flies_more_lines() -> None:
    found = survey(np.array([800.0, 2400.0]))
    assert found is not None
    assert len(lines_of([found.routes[1]])) >= 2 * len(lines_of([found.routes[0]]))


def test_lines_go_round_zones_and_are_fewer_where_turns_cost_more() -> None:
    constraints = replace(Constraints(AREA), keep_out=(ZONE,))
    sweep = Sweep(constraints, FreeSpace(constraints, 0.5), np.pi / 2)
    vehicles = Vehicles(STARTS[:2], np.full(2, np.nan), np.full(2, 3000.0))
    near, wide = (even_survey(sweep, vehicles, Turns(radius, 0.0), Pattern()) for radius in (0.0, 15.0))
    assert near is not None
    assert wide is not None
    assert near.spacing_m < wide.spacing_m
    for route in near.routes:
        for a, b in pairwise(route):
            along = a + np.linspace(0.0, 1.0, 50)[:, None] * (b - a)
            assert not ((along > ZONE[0]) & (along < ZONE[2])).all(axis=1).any()


def test_none_fits_where_nobody_can_fly_one_line() -> None:
    assert survey(np.array([100.0, 200.0])) is None


def test_lawnmowers_strips_are_in_proportion_to_what_vehicles_can_fly() -> None:
    slow, fast = lawnmower_routes(Constraints(AREA), STARTS[:2], np.array([800.0, 2400.0]))
    assert np.ptp(fast[:, 0]) > 2.0 * np.ptp(slow[:, 0])
    for start, route, most in zip(STARTS, (slow, fast), (800.0, 2400.0), strict=False):
        assert flown_m(start[0], start[1], np.nan, route, Turns(0.0, 0.0)) <= most


def fullest(left_m: FloatArray, radius_m: float, *, along: bool) -> list[EvenSurvey]:
    constraints = Constraints(AREA)
    sweep = Sweep(constraints, FreeSpace(constraints, 0.5), np.pi / 2 if along else 0.0)
    vehicles = Vehicles(STARTS[: len(left_m)], np.full(len(left_m), np.nan), left_m)
    return fullest_surveys(sweep, vehicles, [Turns(radius_m, 0.0)] * len(left_m), Pattern(parts=8))


@pytest.mark.slow
@given(left_m=st.lists(st.floats(900.0, 4000.0), min_size=1, max_size=3), radius_m=st.floats(0.0, 6.0))
@settings(max_examples=10, deadline=None)
def test_where_lines_end_makes_up_for_what_a_whole_line_would_cost(left_m: list[float], radius_m: float) -> None:
    most_m, turns = np.array(left_m), Turns(radius_m, 0.0)
    best = 0.0
    for found in fullest(most_m, radius_m, along=False):
        starts = STARTS[: len(most_m)]
        way_m = [flown_m(at[0], at[1], np.nan, route, turns) for at, route in zip(starts, found.routes, strict=True)]
        assert (np.array(way_m) <= most_m).all()
        best = max(best, float(np.sum(way_m)))
    assert best > 0.88 * most_m.sum()


def test_no_lines_are_told_where_the_team_can_fly_none() -> None:
    assert fullest(np.array([40.0, 50.0]), 0.0, along=True) == []
