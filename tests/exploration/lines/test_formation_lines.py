from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Polygon

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.lines.formation_lines import RowSpace, lines_over

AREA = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
START = np.array([-0.8, -0.8, 0.1])


def box(west: float, south: float, east: float, north: float) -> Any:
    return np.array([[west, south], [east, south], [east, north], [west, north]])


def space(*zones: Any, n: int = 3, direction: Any = np.pi / 2) -> Any:
    return RowSpace(Constraints(AREA, zones), direction, n, 0.1, 0.004)


def places(*zones: Any) -> Any:
    axis = np.linspace(-0.98, 0.98, 40)
    points = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return points[[not any(Polygon(z).buffer(1e-9).covers(LineString([p, p])) for z in zones) for p in points]]


def tracks(rows: Any, route: Any) -> Any:
    """The line that each vehicle flies, when the row follows the route."""
    return [LineString(line) for line in np.swapaxes(rows.slots(np.vstack([START, route])), 0, 1)]


def farthest(points: FloatArray, lines: Any) -> Any:
    x = np.array([min(line.distance(LineString([p, p])) for line in lines) for p in points])
    return float(x.max())


@pytest.mark.parametrize("direction", [0.0, np.pi / 2])
@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_lines_come_close_to_every_place_of_an_open_area(n: int, direction: Any) -> None:
    rows = space(n=n, direction=direction)
    route = lines_over(rows, START, places(), 0.24, 0.15)
    assert farthest(places(), tracks(rows, route)) <= np.hypot(0.12, 0.17) + 0.02


ZONES = [
    (box(-0.3, -0.2, 0.1, 0.3),),
    (box(-0.4, -1.0, 0.2, -0.5), box(0.3, 0.1, 1.0, 0.5)),
    (box(-0.5, -0.5, -0.1, -0.1), box(0.3, -0.4, 0.6, 0.4), box(-0.5, 0.5, 0.6, 0.8)),
]


@pytest.mark.parametrize("zones", ZONES, ids=["one", "borders", "three"])
@pytest.mark.parametrize("direction", [0.0, np.pi / 2])
def test_no_vehicle_of_a_row_enters_a_zone_or_leaves_the_area(zones: Any, direction: Any) -> None:
    rows = space(*zones, direction=direction)
    route = lines_over(rows, START, places(*zones), 0.24, 0.15)
    for track in tracks(rows, route):
        assert Polygon(AREA).buffer(1e-6).covers(track)
        assert not any(Polygon(zone).buffer(-1e-6).intersects(track) for zone in zones)
    # What a line leaves beside a zone is little: the row closes up and goes by.
    distance = np.array([min(t.distance(LineString([p, p])) for t in tracks(rows, route)) for p in places(*zones)])
    assert np.mean(distance < 0.25) > 0.9


@given(
    distances=st.lists(st.floats(0.001, 0.3), min_size=1, max_size=30),
    seed=st.integers(0, 100),
)
@settings(max_examples=30, deadline=None)
def test_following_a_route_piece_by_piece_is_following_it_at_once(distances: Any, seed: int) -> None:
    rows, rng = space(), np.random.default_rng(seed)
    route = np.column_stack([rng.uniform(-0.8, 0.8, (5, 2)), rng.uniform(0.0, 0.2, 5)])
    here, rest = START, route
    for distance in distances:
        before = here
        here, passed = rows.along(here, rest, distance)
        rest = rest[passed:]
        assert np.linalg.norm(rows.slots(here) - rows.slots(before), axis=1).max() <= distance + 1e-9
    at_once, passed = rows.along(START, route, sum(distances))
    np.testing.assert_allclose(here, at_once, atol=1e-9)


def test_only_what_is_unfinished_is_swept() -> None:
    rows = space()
    corner = places()[(places() > 0.3).all(axis=1)]
    route = lines_over(rows, START, corner, 0.24, 0.15)
    assert (route[:, :2] > 0.2).all()
    assert farthest(corner, tracks(rows, route)) < 0.25
