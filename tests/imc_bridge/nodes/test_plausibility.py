"""Positions that a vehicle can have reached, and those that it cannot."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.arrays import FloatArray
from imc_bridge.nodes.plausibility import (
    ALLOWANCE_M,
    CONFIRM_S,
    CONFIRMATIONS,
    FASTEST_MPS,
    PlausiblePlace,
    PositionVerdict,
)
from imc_bridge.telemetry.soundings import StateSample

LAT = math.radians(41.0)
EARTH_M = 6_363_000.0
"""The radius of the meridian there."""


def at(time_s: float, north_m: float, depth_m: float = 2.0, lon_rad: float = -0.15) -> StateSample:
    return StateSample(time_s, LAT + north_m / EARTH_M, lon_rad, depth_m, 0.0, 0.0, 0.0)


@given(st.lists(st.tuples(st.floats(0.1, 5.0), st.floats(-1.0, 1.0)), max_size=50))
def test_vehicle_that_swims_is_always_believed(moves: FloatArray) -> None:
    gate, time_s, north_m = PlausiblePlace(), 0.0, 0.0
    for seconds, part in moves:
        time_s += seconds
        north_m += part * FASTEST_MPS * seconds
        assert gate.take(at(time_s, north_m)) is PositionVerdict.GOOD


@pytest.mark.parametrize("away", [{"north_m": 500.0}, {"north_m": 0.0, "depth_m": 90.0}])
def test_forged_positions_among_its_own_are_never_believed(away: dict[str, float]) -> None:
    gate = PlausiblePlace()
    for k in range(100):
        assert gate.take(at(0.5 * k, 0.5 * k)) is PositionVerdict.GOOD
        for j in range(10):
            assert gate.take(at(0.5 * k + 0.04 * j, **away)) is PositionVerdict.DOUBTFUL


def test_place_that_is_confirmed_and_never_contradicted_is_believed() -> None:
    gate = PlausiblePlace()
    gate.take(at(0.0, 0.0))
    steps = [gate.take(at(0.5 + CONFIRM_S / 2 * k, 500.0)) for k in range(CONFIRMATIONS + 1)]
    assert steps == [PositionVerdict.DOUBTFUL] * (CONFIRMATIONS - 1) + [PositionVerdict.MOVED, PositionVerdict.GOOD]
    assert gate.take(at(10.0, 0.0)) is PositionVerdict.DOUBTFUL


def test_fix_after_a_dive_is_believed_at_once() -> None:
    gate = PlausiblePlace()
    gate.take(at(0.0, 0.0))
    assert gate.take(at(0.1, ALLOWANCE_M)) is PositionVerdict.GOOD


def test_date_line_is_no_jump() -> None:
    gate = PlausiblePlace()
    gate.take(at(0.0, 0.0, lon_rad=math.pi))
    assert gate.take(at(0.5, 0.0, lon_rad=-math.pi)) is PositionVerdict.GOOD
