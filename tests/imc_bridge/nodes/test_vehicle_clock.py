"""Clocks of vehicles that run ahead, run fast, leap forward and are set back."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imc_bridge.nodes.vehicle_clock import CONFIRMATIONS, QUIET_S, Tick, VehicleClock

T = 1.7e9


def running(seconds: int = 20, rate: float = 1.0, offset: float = 0.0, step: float = 0.5) -> tuple[VehicleClock, float]:
    """A clock that was heard for a while, and the bridge's time."""
    clock, now = VehicleClock(), 100.0
    for _ in range(round(seconds / step)):
        now += step
        assert clock.take(T + offset + rate * now, now, T + now) is Tick.GOOD
    return clock, now


@pytest.mark.parametrize("offset", [0.0, 3 * 3600.0, -86400.0])
def test_offset_is_told(offset: float) -> None:
    clock, _ = running(offset=offset)
    assert clock.offset_s == pytest.approx(offset, abs=0.01)
    assert clock.rate(1.0) == pytest.approx(1.0)


@pytest.mark.parametrize("rate", [0.5, 1.0, 5.0, 10.0])
def test_rate_is_told_by_the_wall_clock(rate: float) -> None:
    clock, _ = running(rate=rate)
    assert clock.rate(1.0) == pytest.approx(rate, rel=0.01)
    # A bridge whose clock runs as fast as the vehicles' says so too.
    assert clock.rate(10.0) == pytest.approx(10.0 * rate, rel=0.01)


def test_rate_is_unknown_at_first() -> None:
    assert running(seconds=2)[0].rate(1.0) is None


def test_single_packet_from_the_future_changes_nothing() -> None:
    clock, now = running()
    before = clock.time_s
    assert clock.take(T + 1e6, now + 0.1, T + now) is Tick.DOUBTFUL
    assert clock.time_s == before
    assert clock.take(T + now + 0.2, now + 0.2, T + now) is Tick.GOOD
    assert clock.jumps == 0


@pytest.mark.parametrize("leap", [3600.0, -3600.0, -30.0])
def test_clock_that_was_set_is_followed_once_it_is_confirmed(leap: float) -> None:
    clock, now = running()
    later = [QUIET_S / 2 * k for k in range(1, CONFIRMATIONS + 2)]
    ticks = [clock.take(T + now + leap + dt, now + dt, T + now + dt) for dt in later]
    assert ticks[: CONFIRMATIONS - 1] == [Tick.DOUBTFUL] * (CONFIRMATIONS - 1)
    assert ticks[CONFIRMATIONS - 1] is Tick.JUMPED
    assert ticks[-1] is Tick.GOOD
    assert clock.offset_s == pytest.approx(leap, abs=1.0)


@pytest.mark.parametrize("leap", [3600.0, -3600.0, -30.0])
def test_recording_that_is_played_beside_the_vehicle_sets_no_clock(leap: float) -> None:
    clock, now = running()
    for k in range(200):
        now += 0.1
        assert clock.take(T + now, now, T + now) is Tick.GOOD
        recorded = [clock.take(T + now + leap + 0.001 * j, now, T + now) for j in range(10)]
        assert recorded == [Tick.DOUBTFUL] * 10, k
    assert (clock.jumps, clock.time_s) == (0, T + now)


def test_late_packets_are_no_jump() -> None:
    clock, now = running()
    for late in (0.5, 2.0, 4.9, 1.0, 3.0):
        assert clock.take(T + now - late, now + 0.1, T + now) is Tick.GOOD
    assert clock.jumps == 0
    assert clock.time_s == T + now


def test_long_silence_is_no_leap() -> None:
    clock, now = running(rate=10.0)
    assert clock.take(T + 10.0 * (now + 300.0), now + 300.0, T + now) is Tick.GOOD


@given(st.lists(st.floats(0.0, 4e9), max_size=200))
def test_whatever_comes_the_clock_has_a_time_that_was_told(stamps: Any) -> None:
    clock = VehicleClock()
    for k, stamp in enumerate(stamps):
        clock.take(stamp, float(k), float(k))
    assert clock.time_s is None or clock.time_s in stamps
