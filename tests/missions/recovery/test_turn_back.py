"""Where along its planned legs a vehicle has to turn back at the latest."""

import numpy as np
import pytest

from app.arrays import FloatArray
from app.missions.recovery.failsafes import LOW_RATIO, LOW_RESERVE_S, UNHEARD_S, drift_reserve_s
from app.missions.recovery.turn_back import STEP_M, turn_back_place

HERE = np.zeros(2)
OUTWARD = np.array([[0.0, 200.0], [0.0, 1000.0]])


def straight_home(place: FloatArray) -> float:
    """Home is where the vehicle is now, at 1 m/s."""
    return float(np.hypot(*place))


def found(left_s: float, legs: FloatArray = OUTWARD, current: tuple[float, float] = (0.0, 0.0)) -> FloatArray | None:
    return turn_back_place(HERE, legs, left_s, straight_home, 1.0, current)


@pytest.mark.parametrize("out_m", [50.0, 200.0, 640.0])
def test_beyond_it_the_energy_does_not_last_for_the_way_home_and_its_reserve(out_m: float) -> None:
    place = found(out_m + LOW_RATIO * out_m + LOW_RESERVE_S)
    assert place is not None
    assert out_m - STEP_M <= place[1] <= out_m + 1e-6
    assert place[0] == 0.0


def test_energy_that_lasts_for_all_legs_asks_for_no_turning_back() -> None:
    assert found(10_000.0) is None
    assert found(1.0, np.zeros((0, 2))) is None


def test_who_has_too_little_turns_back_where_it_is() -> None:
    assert found(LOW_RESERVE_S - 1.0) == pytest.approx(HERE)


def test_a_current_against_the_legs_brings_it_nearer_and_one_that_helps_counts_as_a_drift_only() -> None:
    drift_s = drift_reserve_s(1.0, (0.0, 0.4))
    assert drift_s == pytest.approx(UNHEARD_S * 0.4 / 0.6), "as far as it went at 0.4 m/s, back at 0.6 m/s"
    assert drift_reserve_s(1.0, (0.0, 0.0)) == 0.0
    left_s = 900.0 + drift_s
    still, against, with_it = found(900.0), found(left_s, current=(0.0, -0.4)), found(left_s, current=(0.0, 0.4))
    assert still is not None
    assert against is not None
    assert with_it is not None
    assert against[1] < still[1] - 50.0
    assert with_it == pytest.approx(still)


def test_a_leg_that_cannot_be_flown_against_the_current_is_not_begun() -> None:
    assert found(900.0, current=(0.0, -1.0)) == pytest.approx(HERE)
