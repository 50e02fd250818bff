"""What is left of a vehicle's energy: never less sure than it says, and learned where the battery is not as told."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.missions.recovery.energy import HOTEL, Energy


def used_up(energy: Energy, capacity_s: float, part: float, period_s: float = 10.0) -> None:
    """Fly at the usual speed until so much of a battery is used that lasts for ``capacity_s``."""
    passed_s = 0.0
    while passed_s < part * capacity_s:
        passed_s += period_s
        energy.pass_time(period_s, energy.speed_mps)
        energy.take_level(round(100.0 * (1.0 - passed_s / capacity_s)))


def test_nothing_told_is_nothing_known() -> None:
    energy = Energy(1.3)
    energy.pass_time(100.0, 1.3)
    assert energy.left is None
    energy.take_level(80.0)
    assert energy.left is None, "nobody knows how long 80 % last"


def test_without_a_battery_the_clock_counts() -> None:
    energy = Energy(1.0, endurance_s=1200.0)
    energy.pass_time(300.0, 1.0)
    left = energy.left
    assert left is not None
    assert (left.pct, left.time_s) == (pytest.approx(75.0), pytest.approx(900.0))
    assert 0.0 < left.safe_s < left.time_s


def test_lying_still_takes_the_hotel_load_and_speed_its_cube() -> None:
    for speed_mps, share in [(0.0, HOTEL), (1.0, 1.0), (2.0, HOTEL + (1 - HOTEL) * 8), (None, 1.0)]:
        energy = Energy(1.0, endurance_s=10_000.0)
        energy.pass_time(100.0, speed_mps)
        assert energy.used_s == pytest.approx(100.0 * share)


@given(factor=st.floats(0.6, 1.6), part=st.floats(0.25, 0.9), endurance_s=st.floats(1200.0, 20_000.0))
def test_a_battery_that_is_not_as_told_is_learned(factor: float, part: float, endurance_s: float) -> None:
    """What is counted on lies below what is really left, and comes close to it."""
    really_s = endurance_s / factor
    energy = Energy(1.0, endurance_s)
    energy.take_level(100.0)
    used_up(energy, really_s, part)
    left = energy.left
    assert left is not None
    truth_s = (1.0 - part) * really_s
    assert left.time_s == pytest.approx(truth_s, rel=0.15, abs=0.02 * really_s)
    assert left.safe_s <= truth_s + 0.02 * really_s


def test_a_level_that_nobody_trusts_is_not_used() -> None:
    energy = Energy(1.0, 1000.0)
    energy.take_level(5.0, confidence_pct=30.0)
    assert energy.level_pct is None
    energy.take_level(95.0, confidence_pct=80.0)
    assert energy.level_pct == 95.0


def test_a_charged_battery_lasts_as_the_last_one_did() -> None:
    energy = Energy(1.0, 1000.0)
    energy.take_level(100.0)
    used_up(energy, 700.0, 0.6)
    energy.take_level(100.0)
    left = energy.left
    assert left is not None
    assert left.time_s == pytest.approx(700.0, rel=0.05)


@pytest.mark.parametrize("step_pct", [0.1, 0.5, 2.9])
def test_a_battery_that_is_charged_slowly_lasts_no_longer_than_one_that_is_exchanged(step_pct: float) -> None:
    energy = Energy(1.0, 10_000.0)
    energy.take_level(100.0)
    used_up(energy, 10_000.0, 0.8)
    level_pct = 20.0
    while level_pct < 100.0:  # on a cable, two hours long
        level_pct = min(level_pct + step_pct, 100.0)
        energy.pass_time(7200.0 * step_pct / 80.0, 0.0)
        energy.take_level(level_pct)
    energy.pass_time(3600.0, 0.0)
    energy.take_level(100.0)
    energy.renew()
    left = energy.left
    assert left is not None
    assert left.time_s == pytest.approx(10_000.0, rel=0.05)
    used_up(energy, 10_000.0, 0.7)
    left = energy.left
    assert left is not None
    assert left.safe_s <= 3000.0


def test_only_a_vehicle_that_tells_no_level_is_taken_to_be_charged() -> None:
    told, silent = Energy(1.0, 1000.0), Energy(1.0, 1000.0)
    told.take_level(40.0)
    for energy in (told, silent):
        energy.pass_time(900.0, 1.0)
        energy.renew()
    assert (told.used_s, silent.used_s) == (900.0, 0.0)
