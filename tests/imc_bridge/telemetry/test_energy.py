"""What a vehicle says of its energy and of the water it is in."""

import math

import imcpy
import pytest

from imc_bridge import StateReport
from imc_bridge.telemetry.energy import Energy, motion_left_s, read_fuel
from simulator.vehicles.battery import BatterySpec
from tests.support.imc.sea import open_sea
from tests.support.waiting import until


@pytest.mark.parametrize(
    ("opmodes", "left_s"),
    [
        ("Hotel=12.5;Motion=4.1;", 4.1 * 3600.0),
        ("Motion=1.5", 5400.0),
        (" MOTION = 1.5 ;", 5400.0),
        ("Motion=-0.2;", 0.0),
        ("Hotel=12.5;", None),
        ("", None),
        ("Motion=nan;", None),
        ("Motion=inf;", None),
        ("Motion=;", None),
        ("Motion=soon;", None),
        ("Motion", None),
    ],
)
def test_the_time_left_is_that_under_way(opmodes: str, left_s: float | None) -> None:
    left = motion_left_s(opmodes)
    assert left == (None if left_s is None else pytest.approx(left_s))


@pytest.mark.parametrize(
    ("value", "confidence", "energy"),
    [
        (80.0, 35.0, Energy(80.0, 35.0, None)),
        (80.0, -1.0, Energy(80.0, None, None)),
        (80.0, math.nan, Energy(80.0, None, None)),
        (math.nan, 90.0, None),
        (120.0, 90.0, None),
    ],
)
def test_levels_that_cannot_be_are_left_out(value: float, confidence: float, energy: Energy | None) -> None:
    message = imcpy.FuelLevel()
    message.value, message.confidence = value, confidence
    assert read_fuel(message) == energy


async def test_energy_and_current_come_with_the_states() -> None:
    battery = BatterySpec(endurance_min=100.0, level_pct=50.0, confidence_pct=70.0)
    async with open_sea(equipment={"battery": battery}, current=(0.1, -0.2)) as sea:

        def last() -> StateReport:
            return sea.of(StateReport)[-1]

        await until(lambda: sea.of(StateReport) and last().battery_pct and last().current_mps, "it has told both")
        report = last()
        assert report.battery_pct is not None
        assert 40.0 < report.battery_pct <= 50.0
        assert report.battery_confidence_pct == 70.0
        assert report.energy_left_s == pytest.approx(60.0 * report.battery_pct, rel=1e-3)
        assert report.current_mps == pytest.approx((0.1, -0.2))


async def test_still_water_and_unknown_energy_are_not_told() -> None:
    async with open_sea() as sea:
        await sea.ready()
        await until(lambda: len(sea.of(StateReport)) > 3, "it has told its place")
        assert {report.current_mps for report in sea.of(StateReport)} == {None}
