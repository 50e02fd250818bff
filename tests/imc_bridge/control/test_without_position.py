"""A vehicle that is heard and does not tell where it is: nobody knows the bottom below it."""

import math

import pytest

from imc_bridge import Guidance, WaypointStatus
from imc_bridge.doctor.doctor import Cause, judge
from tests.support.imc.sea import Sea, open_sea
from tests.support.waiting import until

SPEED = 10.0


def by_depth(sea: Sea) -> list[tuple[float, float, float]]:
    """East, north and depth of the area's corners, the shallowest first."""
    corners = [(east, north) for east in (10.0, 90.0) for north in (10.0, 90.0)]
    return sorted(((e, n, float(sea.floor.depth_at_point(e, n))) for e, n in corners), key=lambda corner: corner[2])


@pytest.mark.slow
async def test_vehicle_that_loses_its_position_over_a_slope_comes_up_and_goes_on_when_it_has_it_again() -> None:
    async with open_sea(speed=SPEED, family="slope") as sea:
        (name,) = await sea.ready()
        (node,) = sea.fleet.nodes
        shallow, *_, deep = by_depth(sea)
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, deep[0], deep[1], deep[2] - 3.0))
        await sea.reached(name, 0)
        sea.bridge.goto(name, sea.waypoint(1, shallow[0], shallow[1], deep[2] - 3.0))
        begun_m = node.vehicle.state.distance_m
        await until(lambda: node.vehicle.state.distance_m > begun_m + 10.0, "it is on its way up the slope")
        node.fail("navigation")
        await until(lambda: node.vehicle.true_position.depth_m < 0.3, "it is at the surface")
        assert not node.vehicle.collided
        (view,) = sea.bridge.nodes()
        assert view.engaged
        assert "tells no position" in view.reason
        assert view.without_position
        assert view.age_s is not None
        assert view.position_age_s is not None
        assert view.position_age_s > view.age_s
        assert Cause.LOW_RATE in judge(sea.bridge, 1.0).causes
        assert "and no position in any for" in judge(sea.bridge, 1.0).text()
        # It stays where it was known last.
        told = view.report
        assert told is not None
        east, north = sea.floor.frame.to_local(told.lat_deg, told.lon_deg)
        here = node.vehicle.true_position
        assert math.hypot(here.east_m - east, here.north_m - north) < 30.0
        node.mend()
        await sea.reached(name, 1)
        assert not node.vehicle.collided
        assert "tells no position" not in sea.bridge.nodes()[0].reason
        assert WaypointStatus.REFUSED not in sea.statuses(name, 1)


@pytest.mark.slow
async def test_leg_of_a_vehicle_that_loses_its_position_is_ended_and_flown_when_it_has_it_again() -> None:
    async with open_sea(speed=SPEED, family="slope") as sea:
        (name,) = await sea.ready()
        (node,) = sea.fleet.nodes
        await sea.bridge.engage(name, Guidance.LEGS)
        sea.bridge.goto(name, sea.waypoint(0, 50.0, 90.0, 2.0))
        await until(lambda: node.vehicle.true_position.depth_m > 1.5, "it is on its leg")
        node.fail("navigation")
        await until(lambda: node.vehicle.true_position.depth_m < 0.3, "its leg is ended, and it has floated up")
        assert node.vehicle.true_position.north_m < 70.0
        assert "tells no position" in sea.bridge.nodes()[0].reason
        node.mend()
        await sea.reached(name, 0)
