"""DUNE that dies on board and begins anew: it is told as that, and not as radio that ended."""

import pytest

from imc_bridge import Guidance, LinkChange, NodeState, Restarted, WaypointChange, WaypointStatus
from imc_bridge.doctor.doctor import Cause, judge
from tests.support.imc.sea import open_sea
from tests.support.waiting import until

ACKNOWLEDGED, REFUSED = WaypointStatus.ACKNOWLEDGED, WaypointStatus.REFUSED


@pytest.mark.slow
@pytest.mark.parametrize("guidance", [Guidance.FOLLOW, Guidance.LEGS])
async def test_a_crash_under_water_is_told_as_a_restart_and_the_vehicle_goes_on(guidance: Guidance) -> None:
    async with open_sea(radio_range_m=2000.0, bridge={"unknown_bottom_depth_m": 3.0}) as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, guidance)
        sea.bridge.goto(name, sea.waypoint(0, 50.0, 90.0, 2.0))
        await until(lambda: sea.state(name) is NodeState.EXPECTED_OFFLINE, "it is under water")
        sea.fleet.nodes[0].crash()
        await until(lambda: bool(sea.of(Restarted)), "the restart is noticed")
        await sea.reached(name, 0)
        assert sea.of(Restarted) == [Restarted(name, submerged=True)], "told once, though the announce shows it again"
        assert REFUSED not in [change.status for change in sea.of(WaypointChange)]
        [judged] = judge(sea.bridge, 1.0).nodes
        [finding] = [f for f in judged.findings if f.cause is Cause.RESTARTED]
        assert "restarted once" in finding.text
        assert not [c for c in sea.of(LinkChange) if c.state is NodeState.LOST], [
            (c.state.value, c.reason, c.at_s) for c in sea.of(LinkChange)
        ]


@pytest.mark.slow
async def test_the_silence_of_a_crash_is_no_gap_of_the_radio() -> None:
    async with open_sea() as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50.0, 95.0, 1.5))
        await until(lambda: ACKNOWLEDGED in sea.statuses(name, 0), "it is under way")
        node = sea.fleet.nodes[0]
        await until(lambda: node.vehicle.position.depth_m > 1.0, "it is under water")
        node.crash(down_s=30.0)
        await until(lambda: sea.state(name) is NodeState.EXPECTED_OFFLINE, "it is silent")
        await until(lambda: bool(sea.of(Restarted)), "the restart is noticed")
        await sea.reached(name, 0)
        assert sea.bridge.nodes()[0].radio_gaps == 0
        assert Cause.RADIO_GAPS not in judge(sea.bridge, 1.0).causes


async def test_a_restart_at_the_surface_is_told_too() -> None:
    async with open_sea() as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name)
        await until(lambda: sea.state(name) is NodeState.IN_PLAN, "it follows")
        sea.fleet.nodes[0].crash()
        await until(lambda: bool(sea.of(Restarted)), "the restart is noticed")
        assert sea.of(Restarted) == [Restarted(name, submerged=False)]
        await until(lambda: sea.state(name) is NodeState.IN_PLAN, "it follows again")
