"""The bottom that comes with an order is counted from the surface, and the order allows for what is turned over."""

import numpy as np
import pytest

from app.exploration.core.bottom import Bottom
from app.exploration.core.problem import Belief
from app.exploration.planners import create_planner
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.water.tides import TideTable
from app.missions.clock import now, told_by
from app.missions.fleet.interface import Position, VehicleReport, WaypointStatus
from app.missions.flight.decisions.decision import Decision, Knowledge, decide
from app.missions.flight.decisions.leg import Leg, Place
from app.missions.flight.legs.commit import LegCommit
from app.missions.service import MissionService
from app.missions.soundings.corrections import Corrections
from app.missions.spec.failsafes import Response
from app.missions.task.constraints import make_constraints
from app.missions.team import Withdrawal
from tests.support.missions.harbour import sim_spec
from tests.support.missions.specs import LAT, LON

DATUM_DEPTH_M = 10.0


def a_table(level_m: float) -> TideTable:
    """A level that stays for days around now."""
    moment = now().timestamp()
    return TideTable("pier", np.array([moment - 1e6, moment + 1e6]), np.array([level_m, level_m]), "0" * 64)


@pytest.mark.parametrize(
    ("level_m", "offset_m", "table_m", "expected_m"),
    [
        (0.0, 0.0, None, 10.0),
        (-1.5, 0.0, None, 8.5),
        (1.5, 0.0, None, 10.0),
        (1.5, 2.0, None, 9.5),
        (1.5, 0.0, -2.0, 8.0),
        (0.0, 1.0, -2.0, 7.0),
    ],
    ids=["none", "low", "high, not used", "datum offset", "table", "table and offset"],
)
async def test_the_guard_gets_the_bottom_below_the_surface(
    service: MissionService, level_m: float, offset_m: float, table_m: float | None, expected_m: float
) -> None:
    tide = {"level_m": level_m, "datum_offset_m": offset_m, "source": "gauge"}
    spec = sim_spec("a", tide=tide)
    mission = (await service.create(spec)).id
    live = await service.get(mission)
    table = None if table_m is None else a_table(table_m)
    level = Corrections(live.frame, spec.tide, table=table).water_level_m(now().timestamp())
    constraints = make_constraints(spec)
    east, north = np.meshgrid(np.arange(1.0, 30.0, 2.0), np.arange(1.0, 30.0, 2.0))
    landmarks = np.column_stack([east.ravel(), north.ravel()])
    count = len(landmarks)
    depth = np.full(count, DATUM_DEPTH_M)
    belief = Belief(landmarks, depth, np.zeros(count), np.ones(count, bool), np.ones(count), 5.0)
    places = [Place("a", np.array([10.0, 10.0]), 0.0, 2.0)]
    planner = create_planner("random", spec.planner.options)
    decision = decide(1, spec, constraints, planner, places, Knowledge(belief, np.zeros((0, 2)), level))
    committing = LegCommit(live, constraints, leads=True)
    member = live.team.join(spec.vehicles[0], 0)
    lat, lon = live.frame.to_geographic(np.array(10.0), np.array(10.0))
    member.report = VehicleReport("a", 0.0, Position(float(lat), float(lon), 0.0))
    await committing.commit(decision, {"a": 1})
    committing.begin_next(member)
    assert member.order is not None
    assert member.order.bottom
    assert {round(place.depth_m, 6) for place in member.order.bottom} == {expected_m}


async def test_the_bottom_of_a_leg_that_begins_later_is_as_much_less_deep_as_the_water_has_fallen(
    service: MissionService,
) -> None:
    live = await service.get((await service.create(sim_spec("a"))).id)
    begun = now().timestamp()
    falling = TideTable("pier", np.array([begun, begun + 7200.0]), np.array([0.5, -1.5]), "0" * 64)
    live.gate.corrections.table = falling
    committing = LegCommit(live, make_constraints(live.spec), leads=True)

    def deep_m(after_s: float) -> float:
        with told_by(lambda: begun + after_s):
            return float(committing.bottom.at(np.array([[15.0, 15.0]]))[0])

    with told_by(lambda: begun):
        committing.take_bottom(Bottom(0.0, 0.0, 30.0, np.full((1, 1), 10.0)))
    assert deep_m(0.0) == 10.0
    assert deep_m(1800.0) == pytest.approx(10.0), "above the datum nothing is counted"
    assert deep_m(3600.0) == pytest.approx(9.5), "halfway down"
    assert deep_m(7200.0) == pytest.approx(8.5)


async def test_an_order_is_no_deeper_than_the_turn_into_its_leg_and_the_circle_after_it_allow(
    service: MissionService,
) -> None:
    keeps = {"name": "a", "kind": "sim", "altitude_m": 4.0, "turn_radius_m": 5.0}
    live = await service.get((await service.create(sim_spec(vehicles=[keeps]))).id)
    committing = LegCommit(live, make_constraints(live.spec), leads=True)
    east, north = np.meshgrid(np.arange(0.5, 30.0), np.arange(0.5, 30.0))
    rising_west = 8.0 + 0.2 * east
    committing.take_bottom(Bottom.from_landmarks(np.column_stack([east.ravel(), north.ravel()]), rising_west.ravel()))
    member = live.team.join(live.spec.vehicles[0], 0)

    def ordered_m(heading_rad: float) -> float:
        lat, lon = live.frame.to_geographic(np.array(15.0), np.array(6.0))
        member.report = VehicleReport("a", 0.0, Position(float(lat), float(lon), 0.0), heading_rad=heading_rad)
        # The ground under the leg itself, 11 m deep, leaves 7 m.
        committing.lead_home(member, [(np.array([15.0, 24.0]), 6.9)])
        committing.begin_next(member)
        assert member.order is not None
        return member.order.position.depth_m

    assert ordered_m(0.0) == pytest.approx(6.9, abs=0.15), "it goes straight on"
    assert ordered_m(np.pi / 2) == pytest.approx(6.9, abs=0.15), "it turns where it is deeper"
    # A turn from west to north leads 5 m to the west, where it is 1 m shoaler.
    assert ordered_m(-np.pi / 2) == pytest.approx(5.9, abs=0.25)
    held, led = committing.holding(member), member.order
    assert held is not None
    assert held.position.depth_m <= 6.9 - 0.2 * 9.0, "the circle is 10 m wide to either side"
    assert led is not None
    assert led.lead is None or led.lead.depth_m <= led.position.depth_m


async def test_what_a_vehicle_leaves_of_a_leg_when_it_arrives_is_not_counted_twice(service: MissionService) -> None:
    live = await service.get((await service.create(sim_spec("a", budget={"minutes": 10}))).id)
    committing = LegCommit(live, make_constraints(live.spec), leads=False)
    member = live.team.join(live.spec.vehicles[0], 0)

    async def commit(number: int, begin: float, end: float) -> None:
        leg = Leg("a", np.array([10.0, end, 2.0]))
        origin_m = {"a": np.array([10.0, begin])}
        await committing.commit(Decision([leg], None, {}, b"", origin_m=origin_m), {"a": number})
        lat, lon = live.frame.to_geographic(np.array(10.0), np.array(begin))
        member.report = VehicleReport("a", 0.0, Position(float(lat), float(lon), 2.0))
        committing.begin_next(member)

    await commit(1, 2.0, 12.0)
    member.status = WaypointStatus.REACHED
    await commit(2, 9.5, 22.0)
    assert member.committed.way_m == pytest.approx(20.0)
    member.status = WaypointStatus.MISSED
    await commit(3, 15.0, 25.0)
    assert member.committed.way_m == pytest.approx(30.0), "what was not reached is flown from where its vehicle is"


async def test_who_comes_up_at_home_stays_there(service: MissionService) -> None:
    """Sent on beyond it, as on a leg of the survey, one came up 18 m further on and met another there."""
    live = await service.get((await service.create(sim_spec("a"))).id)
    committing = LegCommit(live, make_constraints(live.spec), leads=True)
    member = live.team.join(live.spec.vehicles[0], 0)
    lat, lon = live.frame.to_geographic(np.array(15.0), np.array(3.0))
    member.report = VehicleReport("a", 0.0, Position(float(lat), float(lon), 2.0))
    member.withdrawal = Withdrawal(Response.RETURN, "its energy")
    corner, home = np.array([15.0, 10.0]), np.array([15.0, 18.0])
    committing.lead_home(member, [(corner, 2.0), (home, 2.0), (home, 0.0)])
    leads = []
    while member.ahead:
        committing.begin_next(member)
        assert member.order is not None
        leads.append(member.order.lead is not None)
    assert leads == [True, False, False], "it is led through the corner, and to its place"


async def test_a_vehicle_that_drifted_towards_the_area_still_goes_round_the_zone_before_it(
    service: MissionService,
) -> None:
    frame = LocalFrame(LAT, LON)
    corners = [(10.0, -14.0), (20.0, -14.0), (20.0, -8.0), (10.0, -8.0), (10.0, -14.0)]
    ring = [[float(x) for x in reversed(frame.to_geographic(np.array(e), np.array(n)))] for e, n in corners]
    live = await service.get(
        (await service.create(sim_spec("a", keep_out=[{"type": "Polygon", "coordinates": [ring]}]))).id
    )
    committing = LegCommit(live, make_constraints(live.spec), leads=False)
    member = live.team.join(live.spec.vehicles[0], 0)

    def barred(here_m: tuple[float, float], end_m: tuple[float, float]) -> str:
        lat, lon = live.frame.to_geographic(*np.array(here_m))
        member.report = VehicleReport("a", 0.0, Position(float(lat), float(lon), 0.0))
        committing.lead_home(member, [(np.array(end_m), 0.0)])
        return committing.barred(member)

    assert barred((15.0, -19.5), (26.0, -20.0)) == "", "the corner is 0.5 m farther out than the vehicle"
    assert "keep-out" in barred((15.0, -19.5), (15.0, -4.0))
    assert "outside the area" in barred((15.0, 5.0), (26.0, -20.0)), "who is inside never leaves"
