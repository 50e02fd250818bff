"""Which leg brings most ground nearer to where vehicles were."""

import numpy as np
import pytest

from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.routes import Turns, flown_m
from app.exploration.lines.ground import Ground

SIDE = 100.0
AREA = np.array([[0.0, 0.0], [SIDE, 0.0], [SIDE, SIDE], [0.0, SIDE]])
LINES = [np.array([[east, 0.0], [east, SIDE]]) for east in (5.0, 15.0, 25.0, 35.0, 75.0, 85.0, 95.0)]
"""Nobody was between 35 and 75 m east."""
HERE, NORTH = np.array([35.0, 100.0]), 0.0


def end_of(budget_m: float, *zones: np.ndarray, radius_m: float = 0.0) -> np.ndarray | None:
    constraints = Constraints(AREA, zones)
    ground, free = Ground.of(constraints), FreeSpace(constraints, 0.0)
    return ground.best_end(free, ground.away_m(LINES), HERE, NORTH, budget_m, radius_m)


def test_nodes_are_as_far_away_as_the_closest_line() -> None:
    ground = Ground.of(Constraints(AREA))
    away_m = ground.away_m(LINES)
    nearest = np.min([np.abs(ground.en_m[:, 0] - line[0, 0]) for line in LINES], axis=0)
    assert away_m == pytest.approx(nearest, abs=0.2)
    assert np.isinf(ground.away_m([])).all()


def test_it_leads_into_the_gap() -> None:
    end = end_of(80.0)
    assert end is not None
    assert 45.0 < end[0] < 70.0


@pytest.mark.parametrize("radius_m", [0.0, 5.0])
@pytest.mark.parametrize("budget_m", [8.0, 30.0, 80.0])
def test_it_is_no_longer_than_a_vehicle_can_fly(budget_m: float, radius_m: float) -> None:
    end = end_of(budget_m, radius_m=radius_m)
    if end is not None:
        assert flown_m(HERE[0], HERE[1], NORTH, end[None], Turns(radius_m, 0.0)) <= budget_m + 1e-6
    assert end is not None or budget_m < 20.0, "there is room for a turn"


def test_it_enters_no_zone() -> None:
    zone = np.array([[40.0, 30.0], [70.0, 30.0], [70.0, 80.0], [40.0, 80.0]])
    end = end_of(120.0, zone)
    assert end is not None
    assert len(FreeSpace(Constraints(AREA, (zone,)), 0.0).way(HERE, end)) == 1


def test_there_is_none_where_everything_was_seen() -> None:
    ground, free = Ground.of(Constraints(AREA)), FreeSpace(Constraints(AREA), 0.0)
    assert ground.best_end(free, np.zeros(len(ground.en_m)), HERE, NORTH, 50.0, 0.0) is None
