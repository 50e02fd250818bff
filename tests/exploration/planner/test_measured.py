"""What CAO measures after a step, against the objective evaluated once per vehicle left behind."""

from typing import Any

import numpy as np
import pytest

from app.arrays import FloatArray
from app.estimation import LandmarkSets, RangeSensor
from app.exploration.core.constraints import Constraints
from app.exploration.core.objective import ObjectiveWeights, med13_objective, objective
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.measured import MeasuredObjective
from app.exploration.planner.options import PlannerOptions

SENSOR = RangeSensor()
AREA = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def situation(positions: FloatArray, accurate: Any, names: tuple[Any, ...] = ("a", "b")) -> Any:
    rng = np.random.default_rng(0)
    xy = rng.uniform(-1, 1, (200, 2))
    depth = np.where(rng.random(200) < 0.7, 0.6, np.nan)
    belief = Belief(xy, depth, np.full(200, 0.1), accurate, np.ones(200), 0.2)
    return Situation(1, 9, names, positions, np.full(2, np.nan), belief, np.zeros((0, 2)), Constraints(AREA))


def value(team: Any, positions: FloatArray, gained: Any, terms: Any) -> Any:
    belief = team.belief
    points = np.column_stack([belief.xy_m, np.where(np.isnan(belief.depth_m), 0.6, belief.depth_m)])
    seen = SENSOR.visible(positions, points) & np.isfinite(belief.depth_m)
    hidden = ~seen.any(axis=0) & ~belief.accurate
    past = hidden & np.isfinite(belief.depth_m)
    sets = LandmarkSets(belief.accurate, np.zeros(2, np.int64), seen, past if past.any() else hidden)
    if terms == "med13":
        return med13_objective(positions, points, sets).total
    weights = ObjectiveWeights.of(terms, switched=False)
    return objective(positions, points, sets, int(belief.accurate.sum()) - gained, weights=weights).total


@pytest.mark.parametrize("terms", ["J", "full", "med13"])
def test_a_contribution_is_the_difference_that_the_last_move_made(terms: Any) -> None:
    measured = MeasuredObjective(SENSOR, PlannerOptions(objective=terms, contribution="vehicle"))
    before = np.array([[-0.3, 0.0, 0.3], [0.3, 0.0, 0.3]])
    nothing = np.zeros(200, dtype=bool)
    assert np.isnan(measured.update(situation(before, nothing))).all()
    after = before + np.array([[0.04, 0.0, 0.0], [0.0, -0.03, 0.02]])
    team = situation(after, nothing)
    fresh = np.hypot(team.belief.xy_m[:, 0] - 0.3, team.belief.xy_m[:, 1]) < 0.2
    team = situation(after, fresh)
    result = measured.update(team)
    gained = int(fresh.sum())
    together = value(team, after, gained, terms)
    for j, own in ((0, 0), (1, gained)):
        left_behind = after.copy()
        left_behind[j] = before[j]
        assert result[j] == pytest.approx(together - value(team, left_behind, gained - own, terms))


def test_a_team_that_changed_has_no_contributions() -> None:
    measured = MeasuredObjective(SENSOR, PlannerOptions(contribution="vehicle"))
    positions, nothing = np.array([[-0.3, 0.0, 0.3], [0.3, 0.0, 0.3]]), np.zeros(200, dtype=bool)
    measured.update(situation(positions, nothing))
    assert np.isnan(measured.update(situation(positions, nothing, ("a", "c")))).all()
