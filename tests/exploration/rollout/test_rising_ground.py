"""Moves where the sea floor may be shoaler than estimated: limits hold whoever is lifted, and by however much."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints, Limit
from app.exploration.core.problem import Belief, Situation
from app.exploration.rollout.rising_ground import excess_if_lifted, presumed_tops_m, safest
from tests.support.situations import make_situation

CUBE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
LIMITS = Constraints(CUBE, (), 0.05, -1.0, 1.0, 0.05, 0.3)
SIGHT = 0.4
NONE_FELT = np.zeros((0, 3))


def team_over(landmarks: Any, positions: Any) -> Situation:
    """A team whose landmarks (n, 3) are all known."""
    xyz = np.asarray(landmarks, dtype=np.float64)
    n = len(xyz)
    belief = Belief(xyz[:, :2], xyz[:, 2], np.full(n, 0.01), np.zeros(n, dtype=bool), np.ones(n), 0.2)
    at = np.asarray(positions, dtype=np.float64)
    return make_situation(vehicles=("a", "b", "c")[: len(at)], positions=at, belief=belief, constraints=LIMITS)


@pytest.mark.parametrize("vehicles", [1, 2, 3])
@given(seed=st.integers(0, 10_000))
def test_no_lift_breaks_more_than_is_told(vehicles: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    here = np.column_stack([0.2 * np.arange(vehicles), np.zeros(vehicles), rng.uniform(0.3, 0.5, vehicles)])
    team = team_over([[0.0, 0.0, 0.9]], here)
    move = here + rng.uniform(-0.03, 0.03, (vehicles, 3))
    tops = rng.uniform(0.2, 0.9, vehicles)
    told = excess_if_lifted(team, move[None], tops[None])[0]
    lifted = move.copy()
    lifted[:, 2] -= rng.random(vehicles) * np.maximum(0.0, move[:, 2] + LIMITS.min_altitude_m - tops)
    excess = LIMITS.excess(here, lifted[None], Bottom.unknown())[0]
    now = LIMITS.excess(here, here[None], Bottom.unknown())[0, :, Limit.COM_RANGE].max()
    assert excess[:, Limit.STEP].max() <= max(0.0, told) + 1e-9
    assert excess[:, Limit.COM_RANGE].max() <= max(0.0, told) + now + 1e-9


def test_the_floor_may_be_as_shoal_as_a_landmark_close_by_and_not_as_one_far_off() -> None:
    landmarks = [[0.0, 0.0, 0.9], [0.04, 0.0, 0.85], [0.3, 0.0, 0.2]]
    team = team_over(landmarks, [[0.0, 0.0, 0.6]])
    ends = np.array([[[0.02, 0.0]]])
    assert presumed_tops_m(team, ends, NONE_FELT, SIGHT)[0, 0] == pytest.approx(0.85)


def test_under_a_vehicle_that_stays_the_floor_is_as_it_was() -> None:
    team = team_over([[0.0, 0.0, 0.9], [0.04, 0.0, 0.3]], [[0.0, 0.0, 0.6]])
    stays = np.array([[[0.0, 0.0]]])
    assert presumed_tops_m(team, stays, NONE_FELT, SIGHT)[0, 0] >= 0.6 + LIMITS.min_altitude_m - 1e-12


def test_what_was_felt_is_believed_more_than_landmarks() -> None:
    team = team_over([[0.01, 0.0, 0.9], [0.0, 0.05, 0.9]], [[0.0, 0.0, 0.4]])
    felt = np.array([[0.0, 0.0, 0.45]])
    tops = presumed_tops_m(team, np.array([[[0.0, 0.0]]]), felt, SIGHT)
    assert tops[0, 0] == pytest.approx(0.45)


def test_nobody_goes_down_where_one_of_the_team_will_be_lifted_out_of_range() -> None:
    landmarks = [[0.0, 0.0, 0.6], [0.2, 0.0, 0.95]]
    here = [[0.0, 0.0, 0.4], [0.2, 0.0, 0.61]]
    team = team_over(landmarks, here)
    felt = np.array([[0.0, 0.0, 0.45]])
    down = team.positions + np.array([0.0, 0.0, 0.05])
    stays = team.positions.copy()
    bottom = Bottom.from_landmarks(team.belief.xy_m, team.belief.depth_m)
    assert team.constraints.feasible(team.positions, down[None], bottom)[0]
    chosen = safest(team, bottom, np.array([down, stays]), felt, SIGHT)
    assert chosen is not None
    move, wish = chosen
    assert wish == 1
    np.testing.assert_allclose(move, stays)


def test_a_move_over_even_ground_is_flown_as_wished() -> None:
    rng = np.random.default_rng(1)
    xy = rng.uniform(-1.0, 1.0, (1000, 2))
    team = team_over(np.column_stack([xy, np.full(1000, 0.9)]), [[0.0, 0.0, 0.7], [0.2, 0.0, 0.7]])
    bottom = Bottom.from_landmarks(team.belief.xy_m, team.belief.depth_m)
    wish = team.positions + np.array([0.045, 0.0, 0.01])
    chosen = safest(team, bottom, wish[None], NONE_FELT, SIGHT)
    assert chosen is not None
    np.testing.assert_allclose(chosen[0], wish)


def test_no_wish_is_taken_that_is_not_feasible() -> None:
    team = team_over([[0.0, 0.0, 0.9]], [[0.0, 0.0, 0.6]])
    far = team.positions + np.array([0.2, 0.0, 0.0])
    assert safest(team, Bottom.unknown(), far[None], NONE_FELT, SIGHT) is None
