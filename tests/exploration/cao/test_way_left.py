"""A vehicle whose lines are all flown uses the way it has left; the lines of the others stay as they are."""

from dataclasses import replace

import numpy as np

from app.estimation import SingleBeam
from app.exploration.cao.planner import CaoPlanner
from app.exploration.planner.options import PlannerOptions
from tests.support.exploration.situations import make_belief, make_situation

LEFT_M, MORE_M = 260.0, 200.0


def test_who_has_flown_all_lines_goes_where_nothing_was_sounded_and_leaves_the_others_theirs() -> None:
    planner = CaoPlanner(PlannerOptions(search=200), SingleBeam(0.01))
    start = make_situation(belief=make_belief(known=False))
    first, second = start.vehicles
    everybody, rng = np.ones(2, dtype=np.bool_), np.random.default_rng(0)
    here = planner.propose(replace(start, moving=everybody, left_m=np.full(2, LEFT_M)), rng).positions
    others = planner.ways_ahead_m()[second]
    # The second one waits. Turns cost the first one less than was planned: it has more way left than its lines take.
    left_m, sounded = np.array([LEFT_M + MORE_M, LEFT_M]), [here[:, :2]]
    legs_m: list[float] = []
    away_m: list[float] = []
    while len(legs_m) < 4:
        through = not len(planner.ways_ahead_m()[first]) or bool(legs_m)
        now = replace(
            start, positions=here, moving=np.array([True, False]), left_m=left_m, soundings_en_m=np.vstack(sounded)
        )
        there = planner.propose(now, rng).positions
        leg_m = float(np.hypot(*(there[0] - here[0])[:2]))
        assert leg_m > 0.1, "it does not wait while it has way left"
        if through:
            legs_m.append(leg_m)
            away_m.append(float(np.hypot(*(np.vstack(sounded) - there[0, :2]).T).min()))
        sounded.append(np.linspace(here[0, :2], there[0, :2], 11))
        left_m, here = left_m - [leg_m, 0.0], there
    assert max(away_m) > 5.0, "it goes where nothing was sounded"
    np.testing.assert_array_equal(planner.ways_ahead_m()[second], others)
