"""A team is too slow where it would leave more than it may, going on as it did; then another planner leads."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.estimation import RangeSensor, SingleBeam
from app.evaluation.explore.run import run_explore
from app.evaluation.explore.world import ExploreScenario
from app.exploration.core.constraints import Constraints
from app.exploration.pcao.pace import MAY_BE_LEFT, WINDOW, Pace
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import create_planner
from simulator.floors.unseen_floors import unseen_floor
from tests.support.exploration.situations import SQUARE, make_belief, make_situation

LINKED = Constraints(SQUARE, max_step_m=5.0, max_depth_m=20.0, com_range_m=20.0)


def paced(first: int, gain: int, steps: int = WINDOW + 1) -> Pace:
    pace = Pace()
    for step in range(steps):
        pace.note(first - gain * step)
    return pace


def test_nothing_is_told_of_a_team_that_has_hardly_begun() -> None:
    assert not paced(1000, 0, WINDOW).is_too_slow(1000, 10)
    assert paced(1000, 0, WINDOW + 1).is_too_slow(1000, 10)


@given(st.integers(1, 20), st.integers(0, 500))
def test_what_a_steady_team_leaves_decides(gain: int, steps_left: int) -> None:
    pace = paced(1000, gain)
    in_the_end = 1000 - gain * WINDOW - gain * steps_left
    assert pace.is_too_slow(1000, steps_left) == (in_the_end > MAY_BE_LEFT * 1000)


def test_only_the_last_steps_count() -> None:
    pace = paced(1000, 5)
    for _ in range(WINDOW):
        pace.note(800)
    assert pace.is_too_slow(1000, 400)
    assert len(pace.left) == WINDOW + 1
    assert Pace(pace.left).is_too_slow(1000, 400), "its memory holds all of it"


@pytest.mark.slow
def test_a_team_that_would_not_be_done_in_time_falls_back_on_another_planner() -> None:
    run = run_explore(ExploreScenario(unseen_floor("dunes", 18), seed=18), "pcao", PlannerOptions())
    assert 50 < run.fallback_steps < 450
    assert run.remaining_pct <= 3.0, "7.8 without"


def test_a_team_that_learns_nothing_falls_back_and_goes_on_so_from_its_memory() -> None:
    situation = make_situation(belief=make_belief(known=False), constraints=LINKED)
    one, other = (create_planner("pcao", PlannerOptions(rollouts=8), RangeSensor(10.0)) for _ in range(2))
    fallen = ["fallback" in one.propose(situation, np.random.default_rng(0)).terms for _ in range(WINDOW + 2)]
    assert fallen == [False] * WINDOW + [True] * 2
    other.restore(one.snapshot())
    for _ in range(2):
        a, b = (p.propose(situation, np.random.default_rng(0)) for p in (one, other))
        assert b.terms == a.terms
        np.testing.assert_array_equal(a.positions, b.positions)
        assert "fallback" in b.terms


def test_a_survey_never_falls_back() -> None:
    situation = make_situation(belief=make_belief(known=False), constraints=LINKED)
    planner = create_planner("pcao", PlannerOptions(), SingleBeam())
    terms = [planner.propose(situation, np.random.default_rng(0)).terms for _ in range(WINDOW + 2)]
    assert not any("fallback" in each for each in terms)
