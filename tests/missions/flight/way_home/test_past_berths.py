"""Ways home lead below those who wait to be taken out of the water, or round them where there is no room below."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from shapely import LineString, Point

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.missions.fleet.interface import Position, VehicleReport
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.way_home.past_berths import way_past_berths
from app.missions.flight.way_home.withdrawals import Withdrawals
from app.missions.live.mission import LiveMission
from app.missions.recovery.berths import home_of
from app.missions.service import MissionService
from app.missions.spec.failsafes import Response
from app.missions.task.constraints import make_constraints
from app.missions.team import Withdrawal
from tests.support.missions.harbour import sim_spec
from tests.support.missions.placed import PlacedVehicles
from tests.support.missions.specs import lon_lat

POINT_M = (60.0, 120.0)
NAMES = ("a", "b", "c", "d")
LEAST_M = 5.0


async def team_over(service: MissionService, depth_m: float) -> tuple[LiveMission, EnergyRange]:
    """Four vehicles that share a recovery point, over an even floor."""
    limits = {"min_depth_m": 2.0, "max_depth_m": 20.0, "min_altitude_m": 2.0, "min_separation_m": LEAST_M}
    view = await service.create(sim_spec(*NAMES, side_m=100.0, limits=limits, recovery={"point": lon_lat(*POINT_M)}))
    live = await service.get(view.id)
    bottom = Bottom(0.0, 0.0, 10.0, np.full((13, 10), depth_m))
    committing = cast("Any", SimpleNamespace(bottom=bottom))
    return live, EnergyRange(live, make_constraints(live.spec), committing)


def berth_m(live: LiveMission, name: str) -> FloatArray:
    member = live.team.members[name]
    place_m = home_of(member.spec, member.slot, live.spec, live.team.specs)
    assert place_m is not None
    return place_m


def nearest_m(here_m: FloatArray, way: list[tuple[FloatArray, float]], place_m: FloatArray, above_m: float) -> float:
    """How near a way comes to a place where it is no deeper than that."""
    corners = [here_m, *(corner for corner, _ in way)]
    pieces = [LineString([corners[k], corners[k + 1]]) for k, (_, depth_m) in enumerate(way) if depth_m < above_m]
    return min((piece.distance(Point(place_m)) for piece in pieces), default=np.inf)


@pytest.mark.parametrize("name", NAMES)
async def test_a_way_over_a_shallow_bottom_goes_round_the_berths_of_others(service: MissionService, name: str) -> None:
    """Seen in 4 m of water: a vehicle passed 1.2 m from one that lay at its berth, as its own one was behind that."""
    live, energy_range = await team_over(service, 4.0)
    member, home_m = live.team.members[name], berth_m(live, name)
    straight = 0
    for here_m in np.random.default_rng(4).uniform((0.0, 0.0), (100.0, 95.0), (30, 2)):
        way = way_past_berths(member, here_m, home_m, live, energy_range)
        assert way is not None
        np.testing.assert_allclose(way[-1][0], home_m)
        for other in NAMES:
            if other != name:
                assert nearest_m(here_m, way, berth_m(live, other), above_m=1.0) >= LEAST_M
        direct_m = float(np.hypot(*(home_m - here_m)))
        corners = np.vstack([here_m, *(corner for corner, _ in way)])
        flown_m = float(np.hypot(*np.diff(corners, axis=0).T).sum())
        assert flown_m <= direct_m + 12.0
        straight += flown_m <= direct_m + 0.1
    assert straight > 0, "nothing is in the way from everywhere"


async def test_a_way_goes_round_where_another_one_really_lies(service: MissionService) -> None:
    live, energy_range = await team_over(service, 4.0)
    lies, home_m = live.team.members["b"], berth_m(live, "a")
    here_m = home_m - (0.0, 80.0)
    lon, lat = lon_lat(*(home_m - (0.5, 30.0)))
    lies.report, lies.withdrawal = (
        VehicleReport("b", 0.0, Position(lat, lon, 0.0)),
        Withdrawal(Response.SURFACE, "", True),
    )
    way = way_past_berths(live.team.members["a"], here_m, home_m, live, energy_range)
    assert way is not None
    assert nearest_m(here_m, way, home_m - (0.5, 30.0), above_m=1.0) >= LEAST_M


async def test_a_way_through_deep_water_leads_straight_below_those_who_wait(service: MissionService) -> None:
    live, energy_range = await team_over(service, 30.0)
    for name in NAMES:
        member, home_m = live.team.members[name], berth_m(live, name)
        way = way_past_berths(member, np.array([50.0, 20.0]), home_m, live, energy_range)
        assert way is not None
        assert [depth_m >= 2.0 for _, depth_m in way] == [True]


@pytest.mark.parametrize("aside_m", [1.0, 12.0], ids=["on its way", "beside it"])
async def test_who_comes_to_lie_on_a_way_home_is_gone_round(
    service: MissionService, monkeypatch: pytest.MonkeyPatch, aside_m: float
) -> None:
    """Seen in shallow water: one was home where it had turned, and another one that was led before passed over it."""
    live, energy_range = await team_over(service, 4.0)
    scene = PlacedVehicles(live, service.hub, monkeypatch)
    withdrawals = Withdrawals(live, service.hub, scene.leg_commit, scene.dispatch, energy_range, 1.0)
    home_m = berth_m(live, "a")
    here, lies_m = (float(home_m[0]), 30.0, 1.0), home_m - (aside_m, 40.0)
    a = scene.put("a", here, (*home_m, 0.0))
    a.withdrawal = Withdrawal(Response.RETURN, "")
    for _ in range(2):
        await withdrawals.look()
    first = a.order
    assert a.ordered
    b = scene.put("b", (*lies_m, 0.0), (*lies_m, 0.0))
    b.withdrawal = Withdrawal(Response.RETURN, "", over=True)
    for _ in range(3):
        await withdrawals.look()
    assert a.ordered
    assert a.order is not None
    if aside_m > LEAST_M:
        assert a.order is first
        return
    assert a.target_m is not None
    ends = [(a.target_m, a.order.position.depth_m), *((leg.target_m, leg.position.depth_m) for leg in a.ahead)]
    assert nearest_m(np.array(here[:2]), ends, lies_m, above_m=1.0) >= LEAST_M
    led = a.order
    await withdrawals.look()
    assert a.order is led, "once is enough"
