"""Vehicles beside keep-out zones: one that would turn into a zone goes another way first."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon

from app.missions.fleet.interface import WaypointStatus as Status
from app.missions.flight.legs.asides import Because
from app.missions.flight.legs.commit import NO_LEG
from app.missions.flight.legs.keeping_off import MOST_TRIES, KeepOutZones
from app.missions.service import MissionService
from app.missions.task.planner import turn_radius_m
from tests.support.missions.harbour import sim_spec
from tests.support.missions.placed import PlacedVehicles
from tests.support.missions.specs import rectangle

ZONE = (20.0, 20.0, 40.0, 40.0)
"""West, south, east, north, of an area from 0 to 60 m."""


@pytest.fixture
async def scene(service: MissionService, monkeypatch: pytest.MonkeyPatch) -> PlacedVehicles:
    spec = sim_spec("a", side_m=60.0, limits={"max_step_m": 20.0}, keep_out=[rectangle(*ZONE)])
    live = await service.get((await service.create(spec)).id)
    return PlacedVehicles(live, service.hub, monkeypatch)


async def test_who_would_turn_into_a_zone_goes_aside_first_and_then_on(scene: PlacedVehicles) -> None:
    # It heads north beside the zone, and its leg leads south: there is no room for a turn to the right.
    vehicle = scene.put("a", (18.0, 30.0, 3.0), (19.0, 5.0, 3.0), heading_rad=math.radians(25.0))
    await scene.keeping_off.look()
    [aside] = scene.ordered
    assert aside.step == NO_LEG
    east, _ = scene.where_m(aside)
    assert east < 18.0
    assert vehicle.ordered

    # It turns away from the zone, and is sent on as soon as there is room.
    scene.put("a", (14.0, 32.0, 3.0), (19.0, 5.0, 3.0), heading_rad=math.radians(250.0))
    await scene.keeping_off.look()
    assert scene.ordered[-1] is vehicle.order
    assert vehicle.waits_m is None
    assert not scene.asides.of(Because.ZONE)


@pytest.mark.parametrize(
    ("at", "to", "heading_deg"),
    [
        ((18.0, 30.0, 3.0), (18.0, 55.0, 3.0), 0.0),
        ((18.0, 30.0, 3.0), (5.0, 30.0, 3.0), 270.0),
        ((5.0, 5.0, 3.0), (5.0, 50.0, 3.0), 180.0),
    ],
    ids=["along it", "away from it", "far from it"],
)
async def test_who_keeps_off_zones_flies_on(
    scene: PlacedVehicles, at: tuple[float, float, float], to: tuple[float, float, float], heading_deg: float
) -> None:
    scene.put("a", at, to, heading_rad=math.radians(heading_deg))
    await scene.keeping_off.look()
    assert scene.ordered == []


async def test_who_gives_way_is_not_led_aside_for_a_zone_as_well(scene: PlacedVehicles) -> None:
    vehicle = scene.put("a", (18.0, 30.0, 3.0), (19.0, 5.0, 3.0), heading_rad=math.radians(25.0))
    assert await scene.asides.lead(vehicle, np.array([10.0, 30.0]), Because.VEHICLE)
    await scene.keeping_off.look()
    assert len(scene.ordered) == 1


async def test_a_vehicle_that_got_another_order_meanwhile_keeps_that(
    scene: PlacedVehicles,
) -> None:
    vehicle = scene.put("a", (18.0, 30.0, 3.0), (19.0, 5.0, 3.0), heading_rad=math.radians(25.0))
    assert await scene.asides.lead(vehicle, np.array([10.0, 30.0]), Because.ZONE)
    scene.put("a", (18.0, 30.0, 3.0), (5.0, 30.0, 3.0), anew=True)
    await scene.asides.lead_on(vehicle)
    assert len(scene.ordered) == 1
    # Led aside from that one, it begins anew.
    assert await scene.asides.lead(vehicle, np.array([10.0, 30.0]), Because.VEHICLE)
    await scene.asides.lead_on(vehicle)
    assert scene.ordered[-1] is vehicle.order


async def test_a_leg_that_has_no_room_for_its_turns_is_given_up(scene: PlacedVehicles) -> None:
    beside, turned = (18.0, 30.0, 3.0), (14.0, 32.0, 3.0)
    for _ in range(MOST_TRIES):
        vehicle = scene.put("a", beside, (19.0, 5.0, 3.0), heading_rad=math.radians(25.0))
        await scene.keeping_off.look()
        assert vehicle.waits_m is not None
        scene.put("a", turned, (19.0, 5.0, 3.0), heading_rad=math.radians(250.0))
        await scene.keeping_off.look()
        assert vehicle.waits_m is None
        assert vehicle.ordered
    scene.put("a", beside, (19.0, 5.0, 3.0), heading_rad=math.radians(25.0))
    await scene.keeping_off.look()
    assert vehicle.status is Status.MISSED
    # Until it has another leg it flies aside, not on into the zone.
    assert scene.ordered[-1].step == NO_LEG
    # That says nothing of its next leg.
    scene.put("a", beside, (19.0, 6.0, 3.0), heading_rad=math.radians(25.0), anew=True)
    await scene.keeping_off.look()
    assert vehicle.ordered
    assert vehicle.waits_m is not None


@given(
    way=st.lists(st.tuples(st.floats(0.0, 60.0), st.floats(0.0, 60.0)), min_size=1, max_size=6),
)
def test_a_way_enters_a_zone_where_it_touches_one_that_it_does_not_begin_in(way: list[tuple[float, float]]) -> None:
    west, south, east, north = ZONE
    zone = np.array([(west, south), (east, south), (east, north), (west, north)])
    begins_in = west < way[0][0] < east and south < way[0][1] < north
    touches = LineString([way[0], *way]).intersects(Polygon(zone))
    assert KeepOutZones([zone]).entered_by(np.array(way)) == (touches and not begins_in)


def test_without_zones_there_is_room_everywhere() -> None:
    assert KeepOutZones([]).room_m(np.zeros((2, 2))) == math.inf


async def test_who_can_turn_beside_a_zone_without_entering_it_does_so(scene: PlacedVehicles) -> None:
    spec, rng = scene.live.spec, np.random.default_rng(5)
    radius_m, zones = turn_radius_m(spec, spec.vehicles[0]), KeepOutZones(map(spec.to_local, spec.keep_out))
    course = np.radians(np.arange(0.0, 360.0, 15.0))
    led = 0
    for _ in range(100):
        at = np.array([20.0 - rng.uniform(0.5, 3.0) * radius_m, rng.uniform(22.0, 38.0)])
        to = np.array([rng.uniform(2.0, 19.0), rng.choice([4.0, 56.0])])
        scene.ordered.clear()
        vehicle = scene.put("a", (*at, 3.0), (*to, 3.0), heading_rad=rng.uniform(0.0, math.tau), anew=True)
        enters = zones.entered_by(scene.steers_m("a", to))
        ring = at + 4.0 * radius_m * np.column_stack([np.sin(course), np.cos(course)])
        avoidable = any(not zones.entered_by(scene.steers_m("a", place)) for place in ring if place[0] < 20.0)
        await scene.keeping_off.look()
        if enters and avoidable:
            led += 1
            assert vehicle.waits_m is not None
            assert not zones.entered_by(scene.steers_m("a", vehicle.waits_m))
        elif not enters:
            assert scene.ordered == []
    assert led >= 10
