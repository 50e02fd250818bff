"""Routes when a team changes: nothing of what is left is flown by nobody."""

import numpy as np
import pytest
from shapely import LineString, MultiLineString

from app.exploration.lines.handover import hand_over

LINES = np.array([[0, 0], [0, 90], [10, 90], [10, 0], [20, 0], [20, 90], [30, 90], [30, 0], [40, 0]], dtype=float)


@pytest.mark.parametrize("left", range(2, len(LINES) + 1))
@pytest.mark.parametrize("joins_at", [(0.0, -20.0), (40.0, -20.0)])
def test_who_joins_leaves_no_piece_of_a_line_out(left: int, joins_at: tuple[float, float]) -> None:
    route = LINES[-left:]
    routes = hand_over({"a": route}, ("a", "b"), np.array([LINES[-left], joins_at]))
    flown = [LineString(np.vstack([LINES[-left], routes["a"]])), LineString(routes["b"])]
    assert MultiLineString(flown).buffer(1e-6).covers(LineString(route))


def test_nobody_is_sent_to_where_the_other_one_ends() -> None:
    routes = hand_over({"a": LINES[-1:]}, ("a", "b"), LINES[:2])
    assert (len(routes["a"]), len(routes["b"])) == (1, 0)


def test_a_team_that_is_replaced_goes_on_with_what_is_left() -> None:
    left = {"a": LINES[-3:], "b": LINES[:0]}
    routes = hand_over(left, ("c", "d"), np.array([[0.0, 0.0], [30.0, 80.0]]))
    flown = [LineString(np.vstack([LINES[-3], way])) for way in (routes["d"], routes["c"])]
    assert MultiLineString(flown).buffer(1e-6).covers(LineString(LINES[-3:]))
    assert len(routes["d"]), "it is closest"
    nothing_left = hand_over({"a": LINES[:0]}, ("c",), LINES[:1])
    assert {name: len(way) for name, way in nothing_left.items()} == {"c": 0}
