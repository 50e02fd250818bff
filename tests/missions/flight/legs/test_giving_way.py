"""Vehicles that are about to meet: one gives way, and flies its leg when the other is past."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from shapely.geometry import Point, box

from app.commands.home import fly_mission
from app.exploration.lines import lawnmower
from app.mapping.coordinates.georeference import LocalFrame
from app.missions.fleet.interface import LinkState, Position, WaypointStatus
from app.missions.flight.legs.asides import MOST_ASIDES, Because
from app.missions.flight.legs.commit import NO_LEG
from app.missions.flight.legs.giving_way import PATIENCE_S
from app.missions.safety.room import CIRCLE_M
from app.missions.service import MissionService
from app.missions.settings import SimulationSettings
from app.missions.spec.failsafes import Response
from app.missions.spec.mission import MissionSpec
from app.missions.spec.orders import OrderKind, OrderState
from app.missions.task.planner import turn_radius_m
from app.missions.team import CommittedLeg, OperatorOrder, Withdrawal
from tests.support.missions.harbour import sim_spec
from tests.support.missions.placed import Place, PlacedVehicles
from tests.support.missions.specs import LAT, LON, rectangle

HERE, THERE = (5.0, 30.0, 3.0), (50.0, 30.0, 3.0)


@pytest.fixture
async def scene(service: MissionService, monkeypatch: pytest.MonkeyPatch) -> PlacedVehicles:
    limits = {"max_step_m": 20.0, "min_separation_m": 5.0}
    live = await service.get((await service.create(sim_spec("a", "b", side_m=60.0, limits=limits))).id)
    return PlacedVehicles(live, service.hub, monkeypatch)


async def test_of_two_that_head_for_each_other_the_second_gives_way_and_goes_on_when_the_first_is_past(
    scene: PlacedVehicles,
) -> None:
    scene.put("a", HERE, (50.0, 30.0, 3.0))
    second = scene.put("b", THERE, (1.0, 30.0, 3.0))
    await scene.giving_way.look()
    [waits] = scene.ordered
    assert (waits.vehicle, waits.step) == ("b", NO_LEG)
    assert abs(scene.where_m(waits)[1] - 30.0) > scene.live.spec.limits.min_separation_m  # off the first one's way
    assert second.ordered

    # Once the first one is past, its own leg is sent again.
    scene.put("b", (*scene.where_m(waits), 3.0), (1.0, 30.0, 3.0))
    scene.put("a", (56.0, 30.0, 3.0), (59.0, 30.0, 3.0))
    await scene.giving_way.look()
    assert scene.ordered[-1] is second.order
    assert second.waits_m is None


@pytest.mark.parametrize(
    ("at", "to"),
    [
        ((30.0, 30.0, 4.0), (1.0, 30.0, 4.0)),
        ((30.0, 40.0, 3.0), (1.0, 40.0, 3.0)),
        ((30.0, 30.0, 3.0), (55.0, 30.0, 3.0)),
    ],
    ids=["a metre deeper", "beside it", "ahead of it, as fast"],
)
async def test_who_meets_nobody_flies_on(scene: PlacedVehicles, at: Place, to: Place) -> None:
    scene.put("a", HERE, (50.0, 30.0, 3.0))
    scene.put("b", at, to)
    await scene.giving_way.look()
    assert scene.ordered == []


async def test_a_vehicle_that_climbs_through_anothers_depth_meets_it(scene: PlacedVehicles) -> None:
    scene.put("a", HERE, (50.0, 30.0, 3.0))
    scene.put("b", (50.0, 30.0, 6.0), (1.0, 30.0, 0.0))
    await scene.giving_way.look()
    assert [order.step for order in scene.ordered] == [NO_LEG]


@pytest.mark.parametrize(("far_m", "meets"), [(10.0, True), (28.0, False)], ids=["in a moment", "later"])
async def test_a_vehicle_that_climbs_on_its_next_leg_meets_who_is_there(
    scene: PlacedVehicles, far_m: float, meets: bool
) -> None:
    """Seen over a shoal: one rose beside another one as its next leg led over less water."""
    scene.put("a", (5.0, 30.0, 3.0), (55.0, 30.0, 3.0))
    climbs = scene.put("b", (58.0, 30.0, 6.0), (58.0 - far_m, 30.0, 6.0))
    lat, lon = LocalFrame(LAT, LON).to_geographic(1.0, 30.0)
    climbs.ahead.append(CommittedLeg(2, Position(float(lat), float(lon), 3.0), np.array([1.0, 30.0])))
    await scene.giving_way.look()
    assert [order.step for order in scene.ordered] == [NO_LEG] * meets


@pytest.mark.parametrize("waiting", ["a", "b"])
async def test_who_has_flown_its_way_and_only_waits_makes_room(scene: PlacedVehicles, waiting: str) -> None:
    """Seen at the end of missions: one gave way to a vehicle that waited for it, until its leg was given up."""
    [flying] = {"a", "b"} - {waiting}
    moves = scene.put(flying, HERE, (50.0, 30.0, 3.0))
    waits = scene.put(waiting, (28.0, 30.0, 3.0), (27.0, 30.0, 3.0))
    waits.status = WaypointStatus.REACHED
    await scene.giving_way.look()
    [order] = scene.ordered
    assert (order.vehicle, order.step) == (waiting, NO_LEG)
    assert moves.waits_m is None
    assert abs(scene.where_m(order)[1] - 30.0) > scene.live.spec.limits.min_separation_m
    assert not waits.ordered, "its leg stays flown"

    # It stays where it was sent, and nobody is in anybody's way there.
    scene.put(waiting, (*scene.where_m(order), 3.0), (27.0, 30.0, 3.0)).status = WaypointStatus.REACHED
    await scene.giving_way.look()
    assert scene.ordered == [order]


async def test_who_makes_room_rather_goes_where_its_circles_stay_inside_the_area(scene: PlacedVehicles) -> None:
    makes_room, inside = 0, 0
    for heading_deg in range(0, 360, 30):
        scene.ordered.clear()
        scene.put("a", (1.0, 15.0, 3.0), (50.0, 15.0, 3.0), anew=True)
        waits = scene.put("b", (28.0, 14.0, 3.0), (27.0, 14.0, 3.0), heading_rad=math.radians(heading_deg), anew=True)
        waits.status = WaypointStatus.REACHED
        await scene.giving_way.look()
        for order in scene.ordered:
            if order.vehicle == "b":
                makes_room += 1
                place_m = np.array(scene.where_m(order))
                inside += bool(np.min([place_m, 60.0 - place_m]) >= CIRCLE_M - 0.01)
    # First of all it keeps apart: where it heads decides where it can be in time.
    assert makes_room >= 3
    assert inside >= 0.75 * makes_room, (inside, makes_room)


async def test_nobody_waits_where_its_circles_lead_into_a_zone(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seen at the end of a mission: one of 2.5 m/s made room beside a zone, and circled through it."""
    limits = {"max_step_m": 20.0, "min_separation_m": 5.0, "keep_out_margin_m": 2.0}
    spec = sim_spec("a", "b", side_m=60.0, limits=limits, speed_mps=2.5, keep_out=[rectangle(20, 20, 36, 24)])
    scene = PlacedVehicles(await service.get((await service.create(spec)).id), service.hub, monkeypatch)
    zone, circle_m, waits = box(20.0, 20.0, 36.0, 24.0), turn_radius_m(spec, spec.vehicles[1]), 0
    for north_m in (35.0, 38.0, 42.0):
        for heading_deg in range(0, 360, 45):
            scene.ordered.clear()
            scene.put("a", (1.0, north_m + 1.0, 3.0), (55.0, north_m + 1.0, 3.0), anew=True)
            heading_rad = math.radians(heading_deg)
            one = scene.put("b", (28.0, north_m, 3.0), (27.0, north_m, 3.0), heading_rad=heading_rad, anew=True)
            one.status = WaypointStatus.REACHED
            await scene.giving_way.look()
            for order in scene.ordered:
                waits += 1
                assert zone.distance(Point(scene.where_m(order))) > circle_m
    assert waits >= 5


@pytest.mark.parametrize("lead_m", [None, (30.0, 5.0, 3.0)])
async def test_who_has_flown_its_last_leg_is_taken_to_fly_on_to_where_it_is_led(
    scene: PlacedVehicles, lead_m: Place | None
) -> None:
    flown = scene.put("a", (30.0, 42.0, 3.0), (30.0, 45.0, 3.0), heading_rad=math.pi)
    assert flown.order is not None
    lead = None
    if lead_m is not None:
        lat, lon = LocalFrame(LAT, LON).to_geographic(*lead_m[:2])
        lead = Position(float(lat), float(lon), lead_m[2])
    flown.order = replace(flown.order, lead=lead)
    flown.status = WaypointStatus.REACHED
    scene.put("b", (48.0, 25.0, 3.0), (10.0, 25.0, 3.0))
    await scene.giving_way.look()
    assert bool(scene.ordered) == (lead is not None)


async def test_a_vehicle_that_waits_where_it_was_ordered_to_be_stays_there(scene: PlacedVehicles) -> None:
    scene.put("a", HERE, (50.0, 30.0, 3.0))
    waits = scene.put("b", (28.0, 30.0, 3.0), (27.0, 30.0, 3.0))
    waits.status = WaypointStatus.REACHED
    way_m = np.array([[27.0, 30.0]])
    waits.asked = OperatorOrder(1, OrderKind.GO, OrderState.FLYING, way_m, "Ana", datetime.now(UTC))
    await scene.giving_way.look()
    assert {order.vehicle for order in scene.ordered} == {"a"}


async def test_who_surveys_gives_way_to_who_goes_home(scene: PlacedVehicles) -> None:
    scene.put("a", HERE, (50.0, 30.0, 3.0))
    scene.put("b", THERE, (1.0, 30.0, 3.0)).withdrawal = Withdrawal(Response.RETURN, "its energy", led=True)
    await scene.giving_way.look()
    assert {order.vehicle for order in scene.ordered} == {"a"}


async def test_of_two_side_by_side_whose_ways_close_in_one_goes_aside_in_time(scene: PlacedVehicles) -> None:
    """Seen with 20 vehicles on their way home: nowhere was room for circles that were taken to begin at once."""
    ways = {"a": ((20.0, 30.0, 3.0), (55.0, 30.0, 3.0)), "b": ((20.0, 36.5, 3.0), (55.0, 28.0, 3.0))}
    for name, (at, to) in ways.items():
        scene.put(name, at, to)
    await scene.giving_way.look()
    [order] = scene.ordered
    [flies_on] = ways.keys() - {order.vehicle}
    aside_m = scene.steers_m(order.vehicle, np.array(scene.where_m(order)))
    on_m = scene.steers_m(flies_on, np.array(ways[flies_on][1][:2]))
    seconds = min(len(aside_m), len(on_m))
    assert np.hypot(*(aside_m[:seconds] - on_m[:seconds]).T).min() > scene.live.spec.limits.min_separation_m


@pytest.mark.parametrize(("to_depth_m", "meets"), [(0.0, True), (3.0, False)], ids=["comes up", "stays down"])
async def test_who_passes_above_a_vehicle_that_comes_up_at_home_keeps_off(
    scene: PlacedVehicles, to_depth_m: float, meets: bool
) -> None:
    scene.put("a", (5.0, 30.0, 1.0), (50.0, 30.0, 1.0))
    home = scene.put("b", (20.0, 30.0, 3.0), (20.0, 30.0, to_depth_m))
    home.status = WaypointStatus.REACHED
    home.withdrawal = Withdrawal(Response.RETURN, "its energy", led=True)
    await scene.giving_way.look()
    assert [order.vehicle for order in scene.ordered] == ["a"] * meets


@pytest.mark.parametrize("clock_ahead_s", [0.0, 3600.0, -3600.0])
async def test_a_vehicle_out_of_reach_is_taken_to_fly_its_leg(scene: PlacedVehicles, clock_ahead_s: float) -> None:
    scene.put("a", (30.0, 1.0, 3.0), (30.0, 55.0, 3.0), heard_s=120.0)
    # It was 33 m away when it was heard last, ten seconds ago: alone where it was then it would meet nobody.
    silent = scene.put("b", (1.0, 16.0, 3.0), (59.0, 16.0, 3.0), heard_s=110.0, clock_ahead_s=clock_ahead_s)
    silent.link = LinkState.LOST
    await scene.giving_way.look()
    assert {order.vehicle for order in scene.ordered} == {"a"}


async def test_who_waits_waits_no_longer_than_a_minute(scene: PlacedVehicles) -> None:
    scene.put("a", HERE, (50.0, 30.0, 3.0))
    second = scene.put("b", THERE, (1.0, 30.0, 3.0))
    await scene.giving_way.look()
    began_s = second.leg.began_s
    scene.asides.of(Because.VEHICLE)["b"].since_s -= PATIENCE_S
    await scene.giving_way.look()
    assert scene.ordered[1] is second.order
    assert second.leg.began_s == pytest.approx(began_s + PATIENCE_S, abs=5.0)


async def test_while_a_vehicle_gives_way_it_is_not_late_for_its_leg(scene: PlacedVehicles) -> None:
    scene.put("a", HERE, (50.0, 30.0, 3.0))
    second = scene.put("b", THERE, (1.0, 30.0, 3.0))
    await scene.giving_way.look()
    second.leg.allowed_s = 0.0
    assert second not in await scene.dispatch.settle_late([second])
    assert second.ordered
    await scene.asides.lead_on(second)
    assert await scene.dispatch.settle_late([second]) == [second]


async def test_who_gives_way_again_and_again_is_late_for_its_leg_in_the_end(scene: PlacedVehicles) -> None:
    scene.put("a", HERE, (50.0, 30.0, 3.0))
    second = scene.put("b", THERE, (1.0, 30.0, 3.0))
    for _ in range(MOST_ASIDES):
        await scene.giving_way.look()
        assert second.lets_pass
        await scene.asides.lead_on(second)
    await scene.giving_way.look()
    assert second.waits_m is not None
    second.leg.allowed_s = 0.0
    assert await scene.dispatch.settle_late([second]) == [second]


async def test_who_gave_way_to_a_vehicle_that_is_home_goes_on(scene: PlacedVehicles) -> None:
    first = scene.put("a", HERE, (50.0, 30.0, 3.0))
    second = scene.put("b", THERE, (1.0, 30.0, 3.0))
    await scene.giving_way.look()
    first.withdrawal = Withdrawal(Response.RETURN, "its energy", over=True)
    await scene.giving_way.look()
    assert second.waits_m is None
    assert scene.ordered[1] is second.order


@pytest.mark.slow
def test_vehicles_whose_lines_lead_past_each_other_pass_and_survey(monkeypatch: pytest.MonkeyPatch) -> None:
    routes = lawnmower.shared_lines
    # Each has the other's strip, at one depth: neither could set out while the other stood in its way.
    monkeypatch.setattr(lawnmower, "shared_lines", lambda *given: routes(*given)[::-1])
    frame, side_m = LocalFrame(LAT, LON), 60.0

    def lon_lat(east_m: float, north_m: float) -> list[float]:
        return [float(x) for x in reversed(frame.to_geographic(np.array(east_m), np.array(north_m)))]

    ring = [(0.0, 0.0), (side_m, 0.0), (side_m, side_m), (0.0, side_m), (0.0, 0.0)]
    spec = MissionSpec.model_validate(
        {
            "name": "past each other",
            "area": {"type": "Polygon", "coordinates": [[lon_lat(*corner) for corner in ring]]},
            "vehicles": [{"name": name, "kind": "sim", "depth_m": 2.0, "endurance_min": 10.0} for name in ("a", "b")],
            "budget": {"minutes": 60},
            "speed_mps": 1.5,
            "recovery": {"point": lon_lat(30.0, -20.0)},
            "limits": {"max_step_m": 20.0},
            "planner": {"name": "lawnmower"},
        }
    )
    mission = fly_mission(spec, SimulationSettings(seed=1, current_mps=(0.3, 0.2)), None, 2, 20.0)
    assert mission["wrong"] == []
    assert mission["touched_before"] == 0
    assert min(vehicle["surveyed_pct"] for vehicle in mission["vehicles"].values()) > 45.0
