"""Rays through a profile, beside slow integration in small steps of time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.water.sound_speed import SoundSpeedProfile

DEPTHS = np.array([0.0, 5.0, 20.0, 60.0])
SPEEDS = np.array([1520.0, 1500.0, 1490.0, 1530.0])
PROFILE = SoundSpeedProfile(DEPTHS, SPEEDS, 1500.0)


def in_small_steps(sonar_m: float, across_m: float, down_m: float, steps: int = 2000) -> tuple[float, float]:
    """Snell's law, midpoint rule."""
    dt = np.hypot(across_m, down_m) / 1500.0 / steps
    depth, across = sonar_m, 0.0
    p = np.sin(np.arctan2(across_m, down_m)) / np.interp(depth, DEPTHS, SPEEDS)
    for _ in range(steps):
        c = np.interp(depth, DEPTHS, SPEEDS)
        c = np.interp(depth + 0.5 * dt * c * np.sqrt(1 - (p * c) ** 2), DEPTHS, SPEEDS)
        depth += dt * c * np.sqrt(1 - (p * c) ** 2)
        across += dt * c * p * c
    return across, depth - sonar_m


@pytest.mark.parametrize(
    ("sonar_m", "across_m", "down_m"),
    [(2.0, 0.0, 20.0), (2.0, 10.0, 25.0), (2.0, 40.0, 45.0), (30.0, 5.0, 10.0), (70.0, 3.0, 10.0), (-1.0, 2.0, 10.0)],
)
def test_rays_are_those_of_slow_integration(sonar_m: float, across_m: float, down_m: float) -> None:
    across, down = PROFILE.trace(np.array([sonar_m]), np.array([across_m]), np.array([down_m]))
    assert (across[0], down[0]) == pytest.approx(in_small_steps(sonar_m, across_m, down_m), abs=1e-6)


@given(st.floats(1400, 1600), st.floats(0, 50), st.floats(0.1, 50), st.floats(0, 80))
def test_one_speed_stretches_every_ray(speed: float, across_m: float, down_m: float, sonar_m: float) -> None:
    profile = SoundSpeedProfile(np.array([0.0]), np.array([speed]), 1500.0)
    across, down = profile.trace(np.array([sonar_m]), np.array([across_m]), np.array([down_m]))
    assert (across[0], down[0]) == pytest.approx((across_m * speed / 1500, down_m * speed / 1500), rel=1e-9)


@given(st.floats(0, 70), st.floats(0, 3), st.floats(0.1, 50))
def test_the_ray_arrives_when_the_sonar_heard_it(sonar_m: float, slant: float, down_m: float) -> None:
    across_m = slant * down_m  # a beam that grazes may really be bent upwards again
    across, down = PROFILE.trace(np.array([sonar_m]), np.array([across_m]), np.array([down_m]))
    way = np.hypot(across[0], down[0])
    heard = np.hypot(across_m, down_m) / 1500.0
    assert way / 1531.0 <= heard <= 1.002 * way / 1489.0
    assert down[0] > 0
