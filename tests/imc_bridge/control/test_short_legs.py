"""Legs of 10 m out of radio contact, judged by the patience of real time: ten seconds of silence are ten seconds."""

import pytest

from imc_bridge import Guidance, LinkChange, NodeState, WaypointChange, WaypointStatus
from tests.support.imc.sea import Sea, open_sea
from tests.support.waiting import until

RADIO_M = 2000.0
SPEED = 10.0
# A loss shows after 10 s of the vehicle as it does in real time, and not after 1 s of the wall.
REAL_TIME = {"lost_after_wall_s": 0.3, "unknown_bottom_depth_m": 5.0}
SENT, ACKNOWLEDGED, REACHED = WaypointStatus.SENT, WaypointStatus.ACKNOWLEDGED, WaypointStatus.REACHED
DEPTH_M = 2.5


def circle(sea: Sea, step: int, east_m: float, north_m: float) -> dict[str, float]:
    """Where there is room to descend."""
    lat, lon = sea.floor.frame.to_geodetic(east_m, north_m)
    return {"circle_lat_deg": lat, "circle_lon_deg": lon}


@pytest.mark.slow
async def test_legs_of_10_m_are_reached_at_their_depth_without_a_loss_or_a_refusal() -> None:
    async with open_sea(radio_range_m=RADIO_M, speed=SPEED, bridge=REAL_TIME, family="flat") as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        vehicle = sea.fleet.nodes[0].vehicle
        for step in range(5):
            place = 50.0, 20.0 + 10.0 * step
            sea.bridge.goto(name, sea.waypoint(step, *place, DEPTH_M, min_altitude_m=1.0, **circle(sea, step, *place)))
            deepest = 0.0

            def watch(step: int = step) -> bool:
                nonlocal deepest
                deepest = max(deepest, vehicle.position.depth_m)
                return REACHED in sea.statuses(name, step)

            await until(watch, f"step {step} is reached")
            assert sea.statuses(name, step) == [SENT, ACKNOWLEDGED, REACHED]
            assert deepest == pytest.approx(DEPTH_M, abs=0.6)
            assert vehicle.position.depth_m < 0.5, "a leg ends at the surface"
            assert vehicle.position.horizontal_distance_m(*place) < 15.0
        states = [change.state for change in sea.of(LinkChange) if change.vehicle == name]
        assert NodeState.LOST not in states
        assert NodeState.EXPECTED_OFFLINE in states
        reasons = [c.reason for c in sea.of(WaypointChange) if c.status is REACHED]
        assert not any("not at its depth" in reason for reason in reasons)


@pytest.mark.slow
async def test_a_leg_without_room_to_descend_says_that_its_depth_was_not_reached() -> None:
    async with open_sea(radio_range_m=RADIO_M, speed=SPEED, bridge=REAL_TIME, family="flat") as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        sea.bridge.goto(name, sea.waypoint(0, 50.0, 16.0, 4.0, min_altitude_m=1.0))
        await sea.reached(name, 0)
        reason = sea.of(WaypointChange)[-1].reason
        assert "4.0 m" in reason
        assert "too short" in reason


@pytest.mark.slow
async def test_an_order_to_a_vehicle_that_is_under_water_waits_until_it_is_heard() -> None:
    async with open_sea(radio_range_m=RADIO_M, speed=SPEED, bridge=REAL_TIME, family="flat") as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        sea.bridge.goto(name, sea.waypoint(0, 50.0, 90.0, DEPTH_M))
        await until(lambda: sea.state(name) is NodeState.EXPECTED_OFFLINE, "it is under water")
        sea.bridge.goto(name, sea.waypoint(1, 50.0, 50.0, DEPTH_M))
        assert sea.statuses(name, 1) == [], "nothing is started into the silence"
        await until(lambda: REACHED in sea.statuses(name, 1), "it came up, got its order and flew it")
        assert WaypointStatus.REFUSED not in [change.status for change in sea.of(WaypointChange)]
