"""Whose a plan is: ours is ended for a new one, and whenever a released vehicle shows up in it; no other plan is."""

import imcpy
import pytest

from imc_bridge.control.control import Phase
from imc_bridge.nodes.modes import OperationMode, PlanState
from tests.imc_bridge.control.test_follow import Script


@pytest.mark.parametrize("ours", [True, False])
def test_a_vehicle_that_was_released_is_stopped_in_our_plan_and_in_no_other(*, ours: bool) -> None:
    script = Script()
    script.move()
    script.report()
    script.follower.engage(script.now)
    script.run(11.0)
    assert script.follower.phase is Phase.IDLE, "it answered no request"
    script.sent.clear()
    script.report(
        mode=OperationMode.MANEUVER, plan=PlanState.EXECUTING, plan_id="bathyfleet-3F01" if ours else "bathyfleet-3F02"
    )
    script.follower.tick(script.now)
    assert script.operations() == [1] * ours


def test_a_peers_plan_whose_stop_went_unanswered_is_stopped_when_it_shows_up_again_and_a_later_one_is_not() -> None:
    script = Script()
    script.node._peers = {0x3F02}
    script.move()

    def seen(mode: OperationMode, plan: PlanState) -> list[int]:
        """What it is asked while it is seen like this for 4 s."""
        script.sent.clear()
        for _ in range(20):
            script.now += 0.2
            script.report(mode=mode, plan=plan, plan_id="bathyfleet-3F02")
            script.follower.tick(script.now)
        return script.operations()

    seen(OperationMode.MANEUVER, PlanState.EXECUTING)
    script.follower.begin_stop(script.now)
    script.follower.give_up_stop(script.now)
    assert seen(OperationMode.MANEUVER, PlanState.EXECUTING) == [1, 1]
    assert seen(OperationMode.SERVICE, PlanState.READY) == []
    assert seen(OperationMode.MANEUVER, PlanState.EXECUTING) == []


@pytest.mark.parametrize(("controller", "ours"), [(None, False), (0x3F01, True), (0x3F02, False)])
def test_a_plan_of_an_earlier_version_is_ours_where_its_controller_is_known_to_be_us(
    controller: int | None, *, ours: bool
) -> None:
    script = Script()
    script.report(mode=OperationMode.MANEUVER, plan=PlanState.EXECUTING, plan_id="bathyfleet")
    script.move()
    if controller is not None:
        answer = imcpy.FollowRefState()
        answer.control_src = controller
        script.follower.follow_state(answer, script.now)
    assert script.follower.engage(script.now) == ours
    if controller is None:
        assert script.follower.refusal is not None
        assert "wait until it has ended, or stop it from another console" in script.follower.refusal.reason


def test_a_plan_that_another_console_began_as_ours_ended_is_not_stopped() -> None:
    script = Script().follow()
    script.report(plan=PlanState.EXECUTING, plan_id="survey")
    assert script.follower.phase is Phase.ENDED
    script.sent.clear()
    script.follower.begin_stop(script.now)
    assert script.follower.phase is Phase.IDLE
    assert script.operations() == []
