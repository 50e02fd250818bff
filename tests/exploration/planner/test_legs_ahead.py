"""What surveys by CAO weigh beside their plan, for vehicles that have legs ahead of which nothing is sounded yet."""

import numpy as np

from app.arrays import FloatArray
from app.exploration.cao.regressors.survey import SurveyRegressors
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.options import PlannerOptions

SIDE_M, LEG_M, DEPTH_M = 100.0, 10.0, 2.0


def at_cruise(team: Situation, bottom: Bottom, en_m: FloatArray) -> FloatArray:
    return np.concatenate([en_m, np.full((*en_m.shape[:-1], 1), DEPTH_M)], axis=-1)


def test_off_the_plan_nobody_turns_back_over_legs_that_are_still_to_be_flown() -> None:
    east_m, north_m = np.meshgrid(np.arange(1.0, SIDE_M, 2.0), np.arange(1.0, SIDE_M, 2.0))
    xy = np.column_stack([east_m.ravel(), north_m.ravel()])
    depth_m = 12.0 + 2.0 * np.sin(xy[:, 0] / 9.0) * np.cos(xy[:, 1] / 7.0)
    belief = Belief(xy, depth_m, np.full(len(xy), 0.3), np.zeros(len(xy), bool), np.ones(len(xy)), 15.0)
    square = np.array([[0.0, 0.0], [SIDE_M, 0.0], [SIDE_M, SIDE_M], [0.0, SIDE_M]])
    limits = Constraints(square, max_step_m=LEG_M, max_depth_m=5.0, min_altitude_m=1.0)
    model = SurveyRegressors(PlannerOptions(), at_cruise)
    place, left_m, courses = (
        np.array([[3.0, 3.0, DEPTH_M], [9.0, 3.0, DEPTH_M]]),
        np.full(2, 1500.0),
        np.full(2, np.nan),
    )
    sounded, weighed = np.zeros((0, 2)), 0
    for step in range(1, 100):
        team = Situation(step, 400, ("a", "b"), place, courses, belief, sounded, limits, left_m=left_m)
        model.begin(team, Bottom.unknown(), step)
        legs = model.candidates(0.5)
        model.regressors(legs)
        ways = legs[..., :2] - place[:, :2]
        turned = np.abs((np.arctan2(ways[..., 0], ways[..., 1]) - courses + np.pi) % (2.0 * np.pi) - np.pi)
        on_plan = (np.abs(legs - legs[0]).max(axis=2) < 1e-9) | np.isnan(turned)
        assert (turned[~on_plan] <= np.deg2rad(120.0) + 1e-6).all()
        weighed += int((~on_plan).sum())
        model.chosen(legs[0])
        left_m, courses, place = left_m - np.hypot(*ways[0].T), np.arctan2(*ways[0].T), legs[0]
        sounded = np.vstack([sounded, place[:, :2]])
    assert weighed > 100, "legs beside the plan were weighed"
