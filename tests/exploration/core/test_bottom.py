"""How deep legs may end above a bottom that rises."""

import numpy as np
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
