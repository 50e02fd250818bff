"""What vehicles consume, and what becomes of one without energy."""

import numpy as np
import pytest

from simulator.equipment import Equipment
from simulator.floors import seafloors
from simulator.vehicles.battery import Battery, BatterySpec
from simulator.vehicles.vehicle import Guidance
from simulator.world import SimulatedVehicle

FLAT = seafloors.generate("flat", 0)


def swimmer(**battery: float) -> SimulatedVehicle:
    spec = BatterySpec(**battery)
    return SimulatedVehicle("one", FLAT, (20, 20, 2), np.random.default_rng(0), Equipment(battery=spec))


def drained(seconds: float, speed: float, **spec: float) -> float:
    battery = Battery(BatterySpec(endurance_min=100.0, nominal_mps=1.0, **spec))
    battery.drain(seconds, speed)
    return 100.0 - battery.level_pct


def test_it_lasts_as_long_as_its_endurance_at_the_nominal_speed() -> None:
    assert drained(3000.0, 1.0) == pytest.approx(50.0)


def test_the_hotel_load_is_drawn_without_motor() -> None:
    assert drained(3000.0, 0.0) == pytest.approx(0.3 * 50.0)


def test_propulsion_grows_with_the_cube_of_the_speed() -> None:
    assert drained(1000.0, 1.5) == pytest.approx((0.3 + 0.7 * 1.5**3) * 1000.0 / 60.0)


def test_real_consumption_may_be_more_than_told() -> None:
    assert drained(3000.0, 1.0, consumption_factor=1.3) == pytest.approx(65.0)
    battery = Battery(BatterySpec(endurance_min=100.0, nominal_mps=1.0, consumption_factor=1.3))
    assert battery.time_left_s() == 6000.0, "the vehicle does not know of it"


@pytest.mark.parametrize(
    ("field", "value"), [("endurance_min", 0.0), ("level_pct", 101.0), ("consumption_factor", -1.0)]
)
def test_impossible_batteries_are_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=field):
        BatterySpec(**{field: value})


def test_a_vehicle_consumes_less_when_it_drifts() -> None:
    going, drifting = swimmer(), swimmer()
    going.go_to(80, 80, 2.0)
    for vehicle in (going, drifting):
        vehicle.advance(60.0)
    assert going.battery is not None
    assert drifting.battery is not None
    assert going.battery.level_pct < drifting.battery.level_pct < 100.0
    assert 100.0 - drifting.battery.level_pct == pytest.approx(0.3 * 100.0 / 480.0)


def test_without_energy_it_floats_up_and_takes_no_order_until_it_is_charged() -> None:
    vehicle = swimmer(endurance_min=1.0, level_pct=10.0)
    vehicle.go_to(80, 80, 2.0)
    vehicle.advance(60.0)
    assert vehicle.vehicle.guidance is Guidance.IDLE
    assert vehicle.position.depth_m == 0.0
    vehicle.go_to(80, 80, 2.0)
    vehicle.advance(10.0)
    assert vehicle.state.speed_mps == 0.0
    assert not vehicle.arrived
    assert vehicle.battery is not None
    vehicle.battery.recharge(50.0)
    vehicle.go_to(80, 80, 2.0)
    vehicle.advance(5.0)
    assert vehicle.state.speed_mps > 0.3
