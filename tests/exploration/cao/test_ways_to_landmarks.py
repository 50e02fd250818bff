"""Teams that see landmarks from afar come to those behind walls and zones: of small changes none leads there."""

import numpy as np
import pytest

from app.arrays import FloatArray
from app.estimation import RangeSensor
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
STEP, CLEARANCE = 0.05, 0.1


def fly(depth_m: FloatArray, xy_m: FloatArray, keep_out: tuple[FloatArray, ...] = (), steps: int = 90) -> FloatArray:
    """Positions (steps, 2, 3) of two vehicles west of the middle; landmarks east of 0.5 are to be found."""
    accurate = xy_m[:, 0] < 0.5
    sd = np.where(accurate, 0.01, 0.5)
    belief = Belief(xy_m, depth_m, sd, accurate, np.ones(len(xy_m)), 0.2)
    constraints = Constraints(
        SQUARE, keep_out, STEP, 0.0, 1.0, min_altitude_m=CLEARANCE, com_range_m=0.4, min_separation_m=0.05
    )
    planner = create_planner("cao", PlannerOptions(regressors="map"), RangeSensor(0.3, 0.05))
    at, rng, places = np.array([[-0.4, 0.05, 0.8], [-0.4, -0.15, 0.8]]), np.random.default_rng(1), []
    for step in range(1, steps + 1):
        situation = Situation(
            step, steps, ("a", "b"), at, np.full(2, np.nan), belief, np.zeros((0, 2)), constraints
        )  # fmt: skip
        at = planner.propose(situation, rng).positions
        places.append(at)
    return np.array(places)


@pytest.fixture
def xy_m() -> FloatArray:
    along = np.linspace(-0.95, 0.95, 20)
    return np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)


def test_a_wall_between_is_climbed(xy_m: FloatArray) -> None:
    places = fly(np.where(abs(xy_m[:, 0]) < 0.12, 0.3, 1.0), xy_m)
    assert places[-1, :, 0].min() > 0.2
    above = places[abs(places[:, :, 0]) < 0.1]
    assert len(above)
    assert above[:, 2].max() < 0.3 - CLEARANCE + 1e-6


def test_a_zone_between_is_gone_round(xy_m: FloatArray) -> None:
    zone = np.array([[-0.1, -0.6], [0.1, -0.6], [0.1, 0.7], [-0.1, 0.7]])
    places = fly(np.full(len(xy_m), 1.0), xy_m, (zone,))
    assert places[-1, :, 0].min() > 0.2
