"""How close planned motions come, against slow and simple reckoning."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.exploration.motion.timeline import Timeline, closest_approach

SEED = st.integers(0, 10_000)


def wandering(rng: np.random.Generator) -> Timeline:
    n = int(rng.integers(1, 6))
    times = np.cumsum(rng.uniform(0.5, 20.0, n)) + rng.uniform(-10.0, 10.0)
    return Timeline(times, rng.uniform([-30.0, -30.0, 0.0], [30.0, 30.0, 6.0], (n, 3)))


@given(SEED, st.sampled_from([np.inf, 2.0, 0.5]))
def test_no_moment_is_closer_than_the_closest_approach(seed: int, vertical_m: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = wandering(rng), wandering(rng)
    found = closest_approach(a, b, vertical_m)
    begin, end = max(a.time_s[0], b.time_s[0]), max(a.time_s[-1], b.time_s[-1])
    times = np.linspace(begin, max(begin, end), 5000)
    apart = a.at(times) - b.at(times)
    close = np.abs(apart[:, 2]) < vertical_m
    distance = np.hypot(apart[:, 0], apart[:, 1])[close]
    if len(distance):
        assert found.distance_m <= distance.min() + 1e-6
    if np.isfinite(found.distance_m):
        there = a.at(np.array([found.time_s])) - b.at(np.array([found.time_s]))
        assert np.hypot(there[0, 0], there[0, 1]) == pytest.approx(found.distance_m, abs=1e-6)
        assert abs(there[0, 2]) <= vertical_m + 1e-6


def test_who_passes_the_same_place_at_another_time_keeps_apart() -> None:
    first = Timeline(np.array([0.0, 10.0]), np.array([[0.0, 0.0, 1.0], [100.0, 0.0, 1.0]]))
    second = Timeline(np.array([0.0, 10.0]), np.array([[50.0, -100.0, 1.0], [50.0, 0.0, 1.0]]))
    # Their difference begins at (-50, 100) and ends at (50, 0): it passes the origin at 50 / sqrt(2).
    assert closest_approach(first, second).distance_m == pytest.approx(50.0 / np.sqrt(2.0))
