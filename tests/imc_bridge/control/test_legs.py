"""Vehicles led by whole legs: where radio ends at the surface, silence is part of the plan."""

import math
from itertools import pairwise
from typing import Any

import imcpy
import pytest

from imc_bridge import (
    BridgeSettings,
    Guidance,
    LinkChange,
    NodeState,
    RefusedError,
    Waypoint,
    WaypointChange,
    WaypointStatus,
)
from imc_bridge.control.plans import leg_plan, leg_time_s
from tests.support.imc.sea import Sea, open_sea
from tests.support.waiting import until

RADIO_M = 2000.0
SENT, ACKNOWLEDGED, REACHED, REFUSED = (
    WaypointStatus.SENT,
    WaypointStatus.ACKNOWLEDGED,
    WaypointStatus.REACHED,
    WaypointStatus.REFUSED,
)
# Deep enough for a leg under water, as the map of a mission tells it.
DEEP: dict[str, Any] = {"bridge": {"unknown_bottom_depth_m": 3.0}}


def states(sea: Sea, name: str) -> list[NodeState]:
    return [change.state for change in sea.of(LinkChange) if change.vehicle == name]


def maneuvers(plan: imcpy.Message) -> dict[str, Any]:
    again = imcpy.Packet.deserialize(imcpy.Packet.serialize(plan))
    links = [(t.source_man, t.dest_man, t.conditions) for t in again.transitions]
    names = [m.maneuver_id for m in again.maneuvers]
    assert again.start_man_id == names[0]
    assert links == [(before, after, "ManeuverIsDone") for before, after in pairwise(names)]
    return {m.maneuver_id: m.data for m in again.maneuvers}


def test_a_leg_goes_there_floats_up_and_ends_at_the_surface() -> None:
    waypoint = Waypoint("m", 1, 41.185, -8.705, 3.0, speed_mps=1.1)
    found = maneuvers(leg_plan(BridgeSettings(), waypoint, 2.4, descend=False, aim=(41.1851, -8.7051)))
    assert list(found) == ["there", "up", "surface"]
    there, up, surface = found.values()
    assert (there.z, int(there.z_units), int(there.speed_units)) == (pytest.approx(2.4), 1, 0)
    assert (there.lat, there.lon) == (math.radians(41.1851), math.radians(-8.7051))
    assert (up.z, up.duration, up.lat) == (0.0, 16, math.radians(41.185))
    # Where it is, until it knows itself at the surface, whatever satellites it sees.
    assert (surface.z, surface.flags) == (0.0, 0b111)


def test_a_short_leg_circles_down_first() -> None:
    waypoint = Waypoint("m", 1, 41.185, -8.705, 3.0, circle_lat_deg=41.1852, circle_lon_deg=-8.7052)
    found = maneuvers(leg_plan(BridgeSettings(), waypoint, 3.0, descend=True, aim=(41.185, -8.705)))
    assert list(found) == ["down", "there", "up", "surface"]
    down = found["down"]
    assert (down.lat, down.lon, down.flags) == (math.radians(41.1852), math.radians(-8.7052), 0)
    assert (down.start_z, down.end_z, down.radius) == (3.0, 3.0, 10.0)


def test_a_leg_at_the_surface_has_nowhere_to_float_up_from() -> None:
    waypoint = Waypoint("m", 1, 41.185, -8.705, 0.0)
    found = maneuvers(leg_plan(BridgeSettings(), waypoint, 0.0, descend=False, aim=(41.185, -8.705)))
    assert list(found) == ["there", "surface"]


@pytest.mark.slow
async def test_legs_are_flown_out_of_radio_contact_and_reported_when_heard_again() -> None:
    async with open_sea(radio_range_m=RADIO_M, **DEEP) as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        assert sea.state(name) is NodeState.READY, "no plan before the first waypoint"
        for step, place in enumerate([(80.0, 30.0), (80.0, 80.0), (20.0, 70.0)]):
            sea.bridge.goto(name, sea.waypoint(step, *place, 2.5))
            await sea.reached(name, step)
            assert sea.statuses(name, step) == [SENT, ACKNOWLEDGED, REACHED]
            there = sea.fleet.nodes[0].vehicle.position
            assert there.horizontal_distance_m(*place) < 25.0
        assert NodeState.EXPECTED_OFFLINE in states(sea, name), "its silence was expected"
        assert NodeState.LOST not in states(sea, name)
        result = await sea.bridge.stop(name)
        assert result.acknowledged


async def test_a_stop_under_water_is_said_to_be_unheard_and_carried_out_when_it_comes_up() -> None:
    async with open_sea(radio_range_m=RADIO_M, **DEEP) as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        sea.bridge.goto(name, sea.waypoint(0, 80.0, 80.0, 2.5))
        await until(lambda: sea.state(name) is NodeState.EXPECTED_OFFLINE, "it is under water")
        result = await sea.bridge.stop(name, timeout_s=0.3)
        assert not result.acknowledged
        assert "flies its leg to the end" in result.detail
        await until(lambda: sea.state(name) is NodeState.READY, "it is back and without a plan")


@pytest.mark.slow
async def test_a_vehicle_that_never_comes_back_is_released_with_where_to_look() -> None:
    async with open_sea(radio_range_m=RADIO_M, **DEEP) as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        sea.bridge.goto(name, sea.waypoint(0, 80.0, 80.0, 2.5))
        await until(lambda: sea.state(name) is NodeState.EXPECTED_OFFLINE, "it is under water")
        await sea.vanish()
        await until(lambda: REFUSED in sea.statuses(name, 0), "it is given up")
        reason = sea.of(WaypointChange)[-1].reason
        assert "not heard since it left on a leg" in reason
        assert "Look for it at its waypoint" in reason
        assert sea.state(name) is NodeState.LOST


@pytest.mark.slow
async def test_no_leg_goes_deeper_than_the_bottom_allows() -> None:
    async with open_sea() as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        sea.bridge.goto(name, sea.waypoint(0, 60.0, 60.0, 30.0))
        await sea.reached(name, 0)
        assert not sea.fleet.nodes[0].vehicle.collisions
        changes = [change for change in sea.of(WaypointChange) if change.waypoint.step == 0]
        assert all("held at" in change.reason for change in changes)


async def test_a_leg_that_another_console_ends_is_told_and_left_alone() -> None:
    async with open_sea() as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        sea.bridge.goto(name, sea.waypoint(0, 90.0, 90.0, 2.0))
        await until(lambda: ACKNOWLEDGED in sea.statuses(name, 0), "it is under way")
        node = sea.fleet.nodes[0]
        node.plan.on_abort("someone else", node.vehicle.time_s)
        await until(lambda: REFUSED in sea.statuses(name, 0), "the abort is noticed")
        assert "someone else" in sea.of(WaypointChange)[-1].reason
        assert sea.bridge.intervention(name)


@pytest.mark.slow
async def test_how_a_vehicle_is_led_can_be_changed_between_engagements() -> None:
    async with open_sea() as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        sea.bridge.goto(name, sea.waypoint(0, 50.0, 50.0, 1.0))
        await sea.reached(name, 0)
        assert (await sea.bridge.stop(name)).acknowledged
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(1, 20.0, 50.0, 1.0))
        await sea.reached(name, 1)
        node = next(node for node in sea.bridge.nodes() if node.name == name)
        assert node.plan_state == "executing"


async def test_a_refused_plan_is_told_with_the_vehicles_words(monkeypatch: pytest.MonkeyPatch) -> None:
    async with open_sea() as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        monkeypatch.setattr("simulator.dune.plan.SPECIFICATIONS", (imcpy.FollowReference,))
        sea.bridge.goto(name, sea.waypoint(0, 50.0, 50.0, 1.0))
        await until(lambda: REFUSED in sea.statuses(name, 0), "it refuses")
        assert "Goto is not supported" in sea.of(WaypointChange)[-1].reason
        with pytest.raises(RefusedError):
            sea.bridge.goto(name, sea.waypoint(1, 50.0, 50.0, 1.0))


def test_a_leg_is_given_time_to_turn_to_be_slow_and_to_come_up() -> None:
    assert leg_time_s(100.0, 3.0, 1.3) > 100.0 / 1.3 + 20.0
    assert leg_time_s(0.0, 0.0, 1.3) > 10.0
    assert leg_time_s(100.0, 3.0, 1.0, current_mps=0.5) > leg_time_s(100.0, 3.0, 1.0) + 100.0
