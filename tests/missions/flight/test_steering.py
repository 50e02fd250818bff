"""Motion of a vehicle that cannot turn on the spot."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.missions.flight.steering import STEP_M, steered_motion
from imc_bridge.control.orders import PASSED_WITHIN_M

SPEED_MPS, RADIUS_M = 1.5, 5.0
AWAY = st.floats(20.0, 60.0)
ANGLE = st.floats(-math.pi, math.pi)


def place(away_m: float, bearing_rad: float, depth_m: float = 3.0) -> np.ndarray:
    return np.array([away_m * math.sin(bearing_rad), away_m * math.cos(bearing_rad), depth_m])


@given(AWAY, ANGLE, ANGLE, st.floats(0.0, 0.7), ANGLE)
def test_it_comes_to_its_place_in_whatever_current_and_turns_no_tighter_than_it_can(
    away_m: float, bearing_rad: float, heading_rad: float, current_mps: float, set_rad: float
) -> None:
    current = (current_mps * math.sin(set_rad), current_mps * math.cos(set_rad))
    end = place(away_m, bearing_rad, 5.0)
    motion = steered_motion([np.array([0.0, 0.0, 1.0]), end], heading_rad, SPEED_MPS, RADIUS_M, current, 400.0)
    assert math.dist(motion.place_m[-1, :2], end[:2]) <= PASSED_WITHIN_M
    assert np.all((motion.place_m[:, 2] >= 1.0) & (motion.place_m[:, 2] <= 5.0 + 1e-9))
    through_m = np.diff(motion.place_m[:, :2], axis=0) - np.diff(motion.time_s)[:, None] * np.array(current)
    assert np.hypot(*through_m.T) == pytest.approx(SPEED_MPS * np.diff(motion.time_s))
    headings_rad = np.arctan2(*through_m.T)
    turned_rad = np.abs(np.angle(np.exp(1j * np.diff(headings_rad))))
    assert np.all(turned_rad <= STEP_M / RADIUS_M + 1e-6)


@given(AWAY, ANGLE)
def test_straight_ahead_it_takes_as_long_as_its_speed_says(away_m: float, bearing_rad: float) -> None:
    motion = steered_motion(
        [np.zeros(3), place(away_m, bearing_rad)], bearing_rad, SPEED_MPS, RADIUS_M, (0.0, 0.0), 100.0
    )
    left_m = math.dist(motion.place_m[-1, :2], place(away_m, bearing_rad)[:2])
    assert motion.time_s[-1] == pytest.approx((away_m - left_m) / SPEED_MPS)


def test_who_turns_right_round_swings_out_by_the_radius_of_its_turn() -> None:
    places = [np.zeros(3), np.array([0.0, 30.0, 0.0]), np.array([0.0, -30.0, 0.0])]
    motion = steered_motion(places, 0.0, SPEED_MPS, RADIUS_M, (0.0, 0.0), 100.0)
    assert 30.0 + 0.5 * RADIUS_M < motion.place_m[:, 1].max() < 30.0 + 2.0 * RADIUS_M


def test_it_looks_no_farther_ahead_than_asked() -> None:
    motion = steered_motion([np.zeros(3), np.array([900.0, 0.0, 0.0])], math.nan, SPEED_MPS, RADIUS_M, (0.0, 0.0), 20.0)
    assert 20.0 <= motion.time_s[-1] <= 20.0 + STEP_M / SPEED_MPS
    assert motion.place_m[-1, 0] == pytest.approx(SPEED_MPS * motion.time_s[-1])
