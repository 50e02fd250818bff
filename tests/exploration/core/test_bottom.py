"""How deep legs may end above a bottom that rises."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints

AREA = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]])
PLACE = st.tuples(st.floats(1.0, 39.0), st.floats(1.0, 39.0))


@given(arrays(np.float64, (8, 8), elements=st.floats(6.0, 12.0)), PLACE, PLACE, st.floats(0.0, 5.0))
def test_legs_that_end_so_deep_keep_their_height(
    depth_m: FloatArray, start: tuple[float, float], end: tuple[float, float], begins_m: float
) -> None:
    bottom = Bottom(0.0, 0.0, 5.0, depth_m)
    constraints = Constraints(AREA, (), max_step_m=100.0, min_altitude_m=1.0, min_separation_m=0.0)
    origin = np.array([*start, begins_m])
    deepest_m = float(bottom.deepest_end_m(origin, np.array(end) - np.array(start), 1.0))
    assert deepest_m >= 0.0, "the vehicle is no deeper than the shoalest ground allows"
    allowed = np.array([[[*end, deepest_m]]])
    assert constraints.feasible(origin[None], allowed, bottom).all()


def test_over_unknown_ground_a_leg_may_end_anywhere() -> None:
    assert Bottom.unknown().deepest_end_m(np.zeros(3), np.array([5.0, 0.0]), 1.0) == np.inf


@given(arrays(np.float64, (8, 8), elements=st.floats(1.0, 12.0)), PLACE, PLACE, st.floats(0.0, 12.0))
def test_who_is_as_deep_as_it_may_leave_rises_over_any_leg(
    depth_m: FloatArray, start: tuple[float, float], end: tuple[float, float], wish_m: float
) -> None:
    bottom = Bottom(0.0, 0.0, 5.0, depth_m)
    constraints = Constraints(AREA, (), max_step_m=20.0, min_altitude_m=1.0, min_separation_m=0.0, climb=0.2)
    place, leg_m = np.array(start), np.array(end) - np.array(start)
    leg_m *= min(1.0, 15.0 / max(float(np.hypot(*leg_m)), 1e-9))
    begins_m = min(wish_m, bottom.deepest_to_leave_m(place, 1.0, constraints.climb, constraints.max_step_m))
    deepest_m = float(bottom.deepest_end_m(np.append(place, begins_m), leg_m, 1.0, constraints.climb))
    floor_m = min(float(bottom.at(place + part * leg_m)) for part in (0.25, 0.5, 0.75, 1.0))
    assert deepest_m >= floor_m - 1.0 - 2e-3, "it is as deep as the shoalest ground on the leg allows"
    legs = np.array([[np.append(place + leg_m, floor_m - 1.0 - 2e-3)]])
    unlimited = replace(constraints, min_depth_m=-np.inf)
    assert unlimited.feasible(np.append(place, begins_m)[None], legs, bottom).all()


def test_what_is_farther_than_a_leg_or_unknown_leaves_vehicles_as_deep_as_they_are() -> None:
    wall = Bottom(0.0, 0.0, 5.0, np.tile([20.0, 20.0, 20.0, 20.0, 2.0, np.nan], (6, 1)))
    assert wall.deepest_to_leave_m(np.array([17.5, 12.0]), 1.0, 0.2, 20.0) == pytest.approx(
        2.0 - 1.0 + 0.2 * 2.5, abs=0.01
    )
    assert wall.deepest_to_leave_m(np.array([2.5, 12.0]), 1.0, 0.2, 15.0) == pytest.approx(19.0, abs=0.01)
    assert Bottom.unknown().deepest_to_leave_m(np.array([7.0, 7.0]), 1.0, 0.2, 5.0) == np.inf
