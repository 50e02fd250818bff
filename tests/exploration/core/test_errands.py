"""What takes vehicles out of the plan: targets that are about to be lost, and localization that fades."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.estimation import RangeSensor
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.errands import Errand, errand_move
from app.exploration.core.information_need import lacking
from app.exploration.core.moving_targets import FICTITIOUS_WEIGHT, Localization, Targets, dynamic_cost
from app.exploration.core.problem import Belief
from app.exploration.planner.base import PlannerBase
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import PLANNERS, create_planner
from tests.support.exploration.situations import SQUARE, make_belief, make_situation

NAMES = ("a", "b", "c")
START = np.array([[20.0, 20.0, 4.0], [30.0, 20.0, 3.0], [40.0, 20.0, 4.0]])
LIMITS = Constraints(SQUARE, max_step_m=10.0, max_depth_m=20.0)
SENSOR = RangeSensor(visibility_m=25.0)


def targets(sd: tuple[Any, ...] = (4.0,), at: tuple[Any, ...] = ((80.0, 60.0, 5.0),), accuracy: float = 2.0) -> Any:
    n = len(at)
    state = np.hstack([np.array(at, dtype=float), np.zeros((n, 3))])
    covariance = np.array([np.diag([s * s] * 3 + [0.01] * 3) for s in sd])
    return Targets(state, covariance, np.array(sd) < accuracy, accuracy, 0.1)


def localization(
    sd: tuple[Any, ...] = (1.0, 1.0, 1.0), foretold: Any = None, shared: bool = True, threshold: float = 2.0
) -> Any:
    values = np.array(sd)
    return Localization(values, values if foretold is None else np.array(foretold), threshold, 0.0, shared)


def fly(planner: PlannerBase, steps: int, *, limits: Any = LIMITS, start: Any = START, **dynamic: Any) -> Iterator[Any]:
    """Fly in closed loop with a belief that does not change; yields positions."""
    at = start
    for step in range(1, steps + 1):
        situation = replace(
            make_situation(step, vehicles=NAMES, positions=at, constraints=limits, belief=make_belief()), **dynamic
        )
        at = planner.propose(situation, np.random.default_rng([0, step])).positions
        yield situation, at


def make(name: str) -> Any:
    return create_planner(name, PlannerOptions(rollouts=10, candidates=8), SENSOR)


@pytest.mark.parametrize("name", sorted(set(PLANNERS) - {"random"}))
def test_a_lost_target_draws_one_vehicle_and_only_one(name: str) -> None:
    lost = targets()
    before = np.linalg.norm(START - lost.state[0, :3], axis=1)
    *_, (_, after) = fly(make(name), 5, targets=lost)
    nearer = before - np.linalg.norm(after - lost.state[0, :3], axis=1)
    assert nearer[np.argmin(before)] > 35.0
    assert make(name)._errands.assign(NAMES, START, targets(sd=(0.5,)), None) == []


@pytest.mark.parametrize("name", sorted(set(PLANNERS) - {"random"}))
def test_fading_localization_brings_up_the_shallowest_vehicle(name: str) -> None:
    start = START + np.array([0.0, 0.0, 8.0])
    low = Constraints(SQUARE, max_step_m=4.0, max_depth_m=20.0, min_altitude_m=0.5)
    flown = [at for _, at in fly(make(name), 3, limits=low, start=start, localization=localization((2.5, 1.0, 1.0)))]
    assert flown[-1][1, 2] == pytest.approx(0.0)


def test_no_leg_towards_a_target_leads_across_it() -> None:
    # Long steps end beyond it, as far away as asked, where the filter gains most by a look from the other side.
    there, rng = np.array([150.0, 150.0, 4.0]), np.random.default_rng(0)
    room = Constraints(3.0 * SQUARE, max_step_m=40.0, max_depth_m=20.0)
    bottom = Bottom(0.0, 0.0, 10.0, np.full((30, 30), 18.0))
    for _ in range(100):
        bearing, sd = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(2.0, 9.0, 2)
        here = there + rng.uniform(10.0, 55.0) * np.array([np.cos(bearing), np.sin(bearing), 0.0])
        origin = np.array([here, [20.0, 20.0, 3.0]])
        known = replace(targets(at=(tuple(there),), accuracy=5.0), standoff_m=10.0, relative_noise=0.01)
        known = replace(known, covariance=np.diag([*sd**2, 1.0, 0.01, 0.01, 0.01])[None])
        end = errand_move(0, Errand("a", 0), origin, origin, room, bottom, known, None, lambda options: options)
        along = here + np.linspace(0.0, 1.0, 200)[:, None] * (end - here)
        assert np.linalg.norm(along - there, axis=1).min() >= 10.0 - 1e-6


def test_it_rises_early_enough_and_not_before() -> None:
    planner = make("lawnmower")
    in_time = localization((1.0, 1.0, 1.0), (1.9, 1.9, 1.9))
    late = localization((1.0, 1.0, 1.0), (1.9, 2.1, 1.9))
    assert planner._errands.assign(NAMES, START, None, in_time) == []
    assert [e.vehicle for e in planner._errands.assign(NAMES, START, None, late)] == ["b"]
    # Whoever rises goes on although another is shallower by now, until a fix has made positions good.
    other = START + np.array([[0, 0, -3.5], [0, 0, 0], [0, 0, 0]])
    assert [e.vehicle for e in planner._errands.assign(NAMES, other, None, late)] == ["b"]
    assert planner._errands.assign(NAMES, other, None, in_time) == []


def test_each_for_itself_where_fixes_are_not_shared() -> None:
    own = localization((2.5, 1.0, 2.5), shared=False)
    assert [e.vehicle for e in make("cao")._errands.assign(NAMES, START, None, own)] == ["a", "c"]


BOTH = ((80, 60, 5), (20, 30, 5))


def test_one_vehicle_goes_from_target_to_target() -> None:
    errands = make("cao")._errands
    near = [e.vehicle for e in errands.assign(NAMES, START, targets((1.9, 1.95), BOTH), None)]
    assert near == ["a"]
    again = errands.assign(NAMES, START, targets((4.0, 0.5), BOTH), None)
    assert [(e.vehicle, e.target) for e in again] == [("a", 0)]


def test_a_second_vehicle_goes_for_a_target_that_is_lost_meanwhile_but_never_the_last() -> None:
    errands = make("cao")._errands
    assert [(e.vehicle, e.target) for e in errands.assign(NAMES, START, targets((1.9, 1.95), BOTH), None)] == [("a", 1)]
    both = errands.assign(NAMES, START, targets((2.1, 1.95), BOTH), None)
    assert [(e.vehicle, e.target) for e in both] == [("a", 1), ("c", 0)]
    assert len(make("cao")._errands.assign(NAMES[:2], START[:2], targets((4.0, 5.0), BOTH), None)) == 1


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_errands_break_no_limit(name: str) -> None:
    zone = np.array([[50.0, 10.0], [60.0, 10.0], [60.0, 60.0], [50.0, 60.0]])
    for com_range in (np.inf, 25.0):
        limits = replace(LIMITS, keep_out=(zone,), com_range_m=com_range, min_separation_m=2.0)
        belief = make_belief()
        bottom = Bottom.from_landmarks(belief.xy_m, belief.depth_m)
        flown = fly(make(name), 6, limits=limits, targets=targets(), localization=localization((1.0, 2.5, 1.0)))
        for situation, at in flown:
            assert limits.violations(NAMES, situation.positions, at, bottom) == ()


def test_errands_are_remembered() -> None:
    planner, memory = make("rollout"), b""
    for step, (situation, at) in enumerate(fly(planner, 4, targets=targets(), localization=localization())):
        if step:
            restored = make("rollout")
            restored.restore(memory)
            again = restored.propose(situation, np.random.default_rng([0, step + 1]))
            np.testing.assert_array_equal(again.positions, at)
        memory = planner.snapshot()


def test_med13_cost_counts_targets_and_the_fictitious_one() -> None:
    open_, known = targets(), targets(sd=(0.5,))
    nearest = float(((START - open_.state[0, :3]) ** 2).sum(axis=1).min())
    assert dynamic_cost(START, open_, None, 7.0) == pytest.approx(nearest)
    assert dynamic_cost(START, replace(open_, hearing_m=10.0), None, 7.0) == 7.0
    assert dynamic_cost(START, known, localization(), 7.0) == 0.0
    poor = localization((1.0, 2.5, 1.0))
    assert dynamic_cost(START, known, poor, 7.0) == pytest.approx(FICTITIOUS_WEIGHT * 3.0**2)


def test_what_is_lacking_follows_the_axes_of_the_error() -> None:
    n = 4
    covariance = np.repeat(np.diag([0.2**2, 0.05**2, 0.3**2])[None], n, axis=0)
    covariance[2] = np.inf
    sd = np.array([0.3, 0.3, np.inf, 0.3])
    accurate = np.array([False, True, False, False])
    depth = np.array([1.0, 1.0, np.nan, 1.0])
    belief = Belief(np.zeros((n, 2)), depth, sd, accurate, np.ones(n), 1.0, covariance)
    left = lacking(belief, 0.1, hedge=1.5)
    assert sorted(left.row.tolist()) == [0, 0, 2, 2, 3, 3]
    first = left.row == 0
    np.testing.assert_allclose(np.abs(left.direction[first]), [[1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(left.need[first], [100 - 25, 100 - 1 / 0.09])
    np.testing.assert_allclose(left.need[left.row == 2], 150.0)


def test_where_only_depths_are_estimated_one_figure_is_lacking() -> None:
    belief = make_belief()
    left = lacking(belief, 0.1)
    np.testing.assert_array_equal(left.row, np.flatnonzero(~belief.accurate))
    np.testing.assert_array_equal(left.direction, np.tile([0.0, 0.0, 1.0], (len(left.row), 1)))
