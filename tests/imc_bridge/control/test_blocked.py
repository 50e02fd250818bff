"""Plan control that calls itself blocked because DUNE's own VehicleState was late, while the maneuver goes on."""

import imcpy
import pytest

from imc_bridge import Guidance, WaypointChange, WaypointStatus
from simulator.dune.plan import PlanEngine
from tests.support.imc.sea import Sea, open_sea
from tests.support.waiting import until

ACKNOWLEDGED, REACHED, REFUSED = WaypointStatus.ACKNOWLEDGED, WaypointStatus.REACHED, WaypointStatus.REFUSED


def plan_of(sea: Sea) -> PlanEngine:
    return sea.fleet.nodes[0].plan


def plan_state(sea: Sea, name: str) -> str | None:
    return next(node.plan_state for node in sea.bridge.nodes() if node.name == name)


@pytest.mark.slow
@pytest.mark.parametrize("guidance", [Guidance.FOLLOW, Guidance.LEGS])
async def test_a_late_vehicle_state_is_nobodys_abort(guidance: Guidance) -> None:
    async with open_sea() as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name, guidance)
        sea.bridge.goto(name, sea.waypoint(0, 50.0, 90.0, 1.0))
        await until(lambda: ACKNOWLEDGED in sea.statuses(name, 0), "it is under way")
        plan_of(sea).miss_vehicle_state()
        await until(lambda: plan_state(sea, name) == "blocked", "it is heard of")
        await sea.reached(name, 0)
        assert REFUSED not in [change.status for change in sea.of(WaypointChange)]
        assert not sea.bridge.intervention(name)
        sea.bridge.goto(name, sea.waypoint(1, 50.0, 50.0, 1.0))
        await sea.reached(name, 1)
        assert (await sea.bridge.stop(name)).acknowledged


async def blocked_under_way(sea: Sea) -> str:
    """Return the vehicle, which flies by references and has its plan control blocked."""
    [name] = await sea.ready()
    await sea.bridge.engage(name)
    sea.bridge.goto(name, sea.waypoint(0, 50.0, 95.0, 1.0))
    await until(lambda: ACKNOWLEDGED in sea.statuses(name, 0), "it is under way")
    plan_of(sea).miss_vehicle_state()
    await until(lambda: plan_state(sea, name) == "blocked", "it is heard of")
    return name


async def test_a_plan_by_references_is_brought_back_while_its_vehicle_goes_on() -> None:
    async with open_sea() as sea:
        name = await blocked_under_way(sea)
        await until(lambda: plan_state(sea, name) == "executing", "its plan is in order again")
        assert REACHED not in sea.statuses(name, 0), "it did not have to end for that"


async def test_a_vehicle_that_takes_no_stop_is_stopped_by_an_abort(monkeypatch: pytest.MonkeyPatch) -> None:
    # As if it could not be brought back before the stop.
    monkeypatch.setattr("imc_bridge.control.follow.BLOCKED_S", 1e9)
    async with open_sea() as sea:
        name = await blocked_under_way(sea)
        result = await sea.bridge.stop(name, timeout_s=20.0)
        assert result.acknowledged
        assert plan_of(sea).maneuver is None, "it is not only said to have stopped"
        assert int(plan_of(sea).vehicle_state().op_mode) != int(imcpy.VehicleState.OperationModeEnum.MANEUVER)


async def test_an_abort_by_another_console_is_still_one() -> None:
    async with open_sea() as sea:
        [name] = await sea.ready()
        await sea.bridge.engage(name)
        sea.bridge.goto(name, sea.waypoint(0, 50.0, 90.0, 1.0))
        await until(lambda: ACKNOWLEDGED in sea.statuses(name, 0), "it is under way")
        plan_of(sea).on_abort("someone else", sea.fleet.nodes[0].vehicle.time_s)
        await until(lambda: bool(sea.bridge.intervention(name)), "the abort is noticed")
