"""What a vehicle passes over while it turns, against a simulated one that flies there."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.exploration.motion.turning import ahead_of_end, disc, turned_over
from simulator.vehicles.vehicle import Motion, SteeringTarget, Vehicle

SPEED_MPS = 1.2
RADIUS_M = SPEED_MPS / 0.35
APART_M = 2.5
"""A vehicle needs a moment to begin a turn and to end it, and places on an arc are a metre apart."""


def flown(heading_rad: float, target: np.ndarray, most_s: float = 300.0) -> np.ndarray:
    """Return the places (n, 2) on the way of a vehicle from the origin until it is near its target."""
    vehicle = Vehicle(Motion(heading_rad=heading_rad, surge_mps=SPEED_MPS))
    vehicle.goto(SteeringTarget(float(target[0]), float(target[1]), 0.0, SPEED_MPS))
    places = []
    for _ in range(int(most_s / 0.1)):
        vehicle.step((0.0, 0.0), 100.0)
        places.append((vehicle.motion.east_m, vehicle.motion.north_m))
        if math.hypot(places[-1][0] - target[0], places[-1][1] - target[1]) < 2.0:
            return np.array(places)
    raise AssertionError("it never arrived")


@settings(deadline=None, max_examples=60)
@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi), st.floats(3.0, 40.0))
@pytest.mark.slow
def test_a_vehicle_flies_over_its_leg_and_what_it_is_said_to_turn_over(
    heading_rad: float, bearing_rad: float, away_m: float
) -> None:
    target = away_m * np.array([math.sin(bearing_rad), math.cos(bearing_rad)])
    way = flown(heading_rad, target)
    straight = np.linspace(0.0, 1.0, 60)[:, None] * target
    told = np.vstack([straight, turned_over(np.zeros(2), heading_rad, target, RADIUS_M)])
    apart = np.hypot(*(way[:, None] - told).transpose(2, 0, 1)).min(axis=1)
    assert apart.max() < APART_M


def test_who_goes_straight_on_turns_over_nothing_else() -> None:
    target = np.array([0.0, 30.0])
    assert np.abs(turned_over(np.zeros(2), 0.0, target, 4.0)[:, 0]).max() < 1e-9
    assert len(turned_over(np.zeros(2), 0.0, np.zeros(2), 4.0)) == 0


def test_a_vehicle_of_unknown_heading_may_turn_anywhere() -> None:
    told = turned_over(np.zeros(2), math.nan, np.array([0.0, 30.0]), 4.0)
    assert np.hypot(*told.T).max() == 8.0
    assert set(np.sign(told[:, 0].round(6))) == {-1.0, 0.0, 1.0}


def test_what_lies_ahead_of_an_end_lies_within_two_radii_and_not_behind() -> None:
    places, away_m = ahead_of_end(np.array([10.0, 20.0]), math.pi / 2, 3.0)
    np.testing.assert_allclose(np.hypot(*(places - [10.0, 20.0]).T), away_m)
    assert away_m.max() == 6.0
    assert places[:, 0].min() >= 10.0 - 1e-9


def test_a_disc_has_places_up_to_its_border() -> None:
    np.testing.assert_allclose(np.unique(np.hypot(*(disc(np.ones(2), 6.0) - 1.0).T).round(9)), [0.0, 3.0, 6.0])
