"""Radio that ends at the surface: the vehicle is out of reach as soon as it dives."""

import pytest

from imc_bridge import LinkChange, NodeState, Sounding, SoundingRefused, WaypointChange, WaypointStatus
from imc_bridge.doctor.doctor import Cause, judge
from tests.support.imc.sea import open_sea
from tests.support.waiting import until

RANGE_M = 5000.0


@pytest.mark.slow
async def test_waypoints_are_reached_though_every_dive_breaks_the_link() -> None:
    async with open_sea(radio_range_m=RANGE_M) as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        for step, north in enumerate((45.0, 85.0)):
            sea.bridge.goto(name, sea.waypoint(step, 50, north, 2.0))
            await sea.reached(name, step)
        statuses = [change.status for change in sea.of(WaypointChange)]
        assert WaypointStatus.REFUSED not in statuses
        assert "came up" in [c for c in sea.of(WaypointChange) if c.status is WaypointStatus.REACHED][-1].reason
        states = [change.state for change in sea.of(LinkChange)]
        assert NodeState.EXPECTED_OFFLINE in states
        assert NodeState.LOST not in states
        # What it measured before it was out of reach and after it was back counts, at the edges of the gap too.
        lost = [s for s in sea.of(SoundingRefused) if "no state" in s.reason]
        assert len(lost) <= 0.05 * len(sea.of(Sounding))
        # Who leads a vehicle by references where radio ends is told what would be right.
        assert sea.bridge.nodes()[0].radio_gaps > 0
        [finding] = [f for f in judge(sea.bridge, 1.0).nodes[0].findings if f.cause is Cause.RADIO_GAPS]
        assert "guidance 'legs'" in finding.remedy
        assert (await sea.bridge.stop(name)).acknowledged


async def test_console_that_announces_no_place_is_out_of_range_for_good() -> None:
    # Why the first announce waits for a place: DUNE's simulation keeps the first one.
    async with open_sea(radio_range_m=RANGE_M, bridge={"position": (0.0, 0.0)}) as sea:
        await until(lambda: any("another port" in node.reason for node in sea.bridge.nodes()), "it stays mute")


@pytest.mark.slow
async def test_vehicle_that_stays_away_longer_than_it_can_is_lost() -> None:
    async with open_sea(radio_range_m=RANGE_M) as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 90, 2.0))
        await until(lambda: sea.state(name) is NodeState.EXPECTED_OFFLINE, "it has dived")
        await sea.vanish()
        await until(lambda: sea.state(name) is NodeState.LOST, "it is lost")
        await until(lambda: sea.statuses(name, 0)[-1] is WaypointStatus.REFUSED, "its waypoint was given up")


@pytest.mark.parametrize("depth_m", [0.0, 0.3])
async def test_at_the_surface_nothing_is_out_of_reach(depth_m: float) -> None:
    async with open_sea(radio_range_m=RANGE_M) as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50, 40, depth_m))
        await sea.reached(name, 0)
        assert NodeState.EXPECTED_OFFLINE not in [change.state for change in sea.of(LinkChange)]
