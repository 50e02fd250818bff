"""A tilted and bent swath is found by beams beside what was sounded straight down."""

import numpy as np
import pytest

from app.estimation.systematic import SwathTilt, TiltErrors

SPEED_MPS = 1500.0


def compared(
    seed: int, roll_offset_deg: float = 0.0, speed_error_mps: float = 0.0, blocks: int = 12, rolling_deg: float = 3.0
) -> TiltErrors:
    """Beams over a bottom 10 m below, placed as the vehicle believes, beside its true depth."""
    rng = np.random.default_rng(seed)
    tilt = SwathTilt()
    angle = np.radians(np.linspace(-60.0, 60.0, 121))
    for block in range(blocks):
        for _ in range(20):
            roll = np.radians(rng.normal(0.0, rolling_deg))
            steered = np.arcsin(np.sin(angle) * (1.0 + speed_error_mps / SPEED_MPS))
            truly = steered + np.radians(roll_offset_deg) - roll
            height = 10.0 + 0.3 * block
            slant = height / np.cos(truly) * (1.0 + 0.005 * rng.standard_normal(len(angle)))
            down = slant * np.cos(angle - roll)
            shared = 0.05 * np.sin(7.0 * block)
            tilt.add("a", np.full(len(angle), block), angle, np.full(len(angle), roll), down, down - height + shared)
    return tilt.errors()["a"]


@pytest.mark.parametrize("roll_deg", [-1.0, 0.3])
@pytest.mark.parametrize("speed_mps", [-6.0, 4.0])
def test_roll_and_sound_speed_are_found_together(roll_deg: float, speed_mps: float) -> None:
    found = compared(1, roll_deg, speed_mps)
    assert np.degrees(found.roll_offset_rad.value) == pytest.approx(roll_deg, abs=0.05 + 0.05 * abs(roll_deg))
    assert SPEED_MPS * found.sound_speed.value == pytest.approx(speed_mps, abs=0.3 + 0.05 * abs(speed_mps))
    assert found.roll_offset_rad.significance > 3.0
    assert found.sound_speed.significance > 3.0
    assert found.rms_after_m < found.rms_before_m


def test_a_right_sonar_is_left_alone() -> None:
    found = [compared(seed) for seed in range(10)]
    assert np.mean([one.roll_offset_rad.significance < 3.0 for one in found]) >= 0.9
    assert max(abs(np.degrees(one.roll_offset_rad.value)) for one in found) < 0.03


def test_too_little_ground_tells_nothing() -> None:
    tilt = SwathTilt()
    assert tilt.errors() == {}
    one = np.zeros(5)
    tilt.add("a", np.zeros(5, int), np.linspace(-1, 1, 5), one, one + 10.0, one)
    assert tilt.errors() == {}


def test_beams_where_nobody_sounded_and_spikes_do_not_count() -> None:
    tilt = SwathTilt()
    angle, one = np.linspace(-1, 1, 6), np.ones(6)
    for block in range(5):
        off = np.array([np.nan, 5.0, 0.0, 0.0, 0.0, 0.0])
        tilt.add("a", np.full(6, block), angle, 0.0 * one, 10.0 * one, off)
    found = tilt.errors()["a"]
    assert found.roll_offset_rad.observations == 20
    assert found.rms_before_m == 0.0
