"""The life cycle of a plan against a scripted vehicle, where a fake DUNE cannot be made to misbehave."""

import itertools
import math
from collections.abc import Callable
from typing import Any

import imcpy
import pytest

from imc_bridge.control.control import Phase
from imc_bridge.control.follow import Follower
from imc_bridge.control.legs import LegFollower
from imc_bridge.events import StateReport, Waypoint, WaypointStatus
from imc_bridge.network.discovery import Announcement
from imc_bridge.nodes.modes import OperationMode, PlanState
from imc_bridge.nodes.node import Node
from imc_bridge.nodes.status import status_of
from imc_bridge.settings import BridgeSettings

ADDRESS = ("127.0.0.1", 6002)
WAYPOINT = Waypoint("m", 0, 41.186, -8.705, 1.5)


class Script:
    """A vehicle whose every message is written by the test; one tick is 0.2 s."""

    def __init__(self, kind: type[Any] = Follower, **settings: Any) -> None:
        self.settings = BridgeSettings(**settings)
        self.now = 100.0
        self.time_s = 1.7e9
        self.sent: list[Any] = []
        self.changes: list[Any] = []
        self.node = Node(0x1E, "v", self.settings, self.now)
        self.node.announced(Announcement(0x1E, "v", 2, (ADDRESS,)), (ADDRESS,), self.now)
        self.follower = kind(self.node, self.settings, self.sent.append, self.changes.append, itertools.count(7))
        self.mode, self.plan = OperationMode.SERVICE, PlanState.READY
        self.alive = True
        self.here: tuple[float, float, float] | None = None
        self.spoil: Callable[[Any], bool] = lambda _state: True
        """Changes a state that is on its way; False: it does not arrive."""

    def report(
        self,
        *,
        mode: OperationMode | None = None,
        plan: PlanState | None = None,
        plan_id: str | None = None,
        error: str = "",
        time_s: float = 0.0,
    ) -> None:
        self.mode = self.mode if mode is None else mode
        self.plan = self.plan if plan is None else plan
        vehicle, control = imcpy.VehicleState(), imcpy.PlanControlState()
        vehicle.op_mode = imcpy.VehicleState.OperationModeEnum(int(self.mode))
        vehicle.last_error = error
        control.state = imcpy.PlanControlState.StateEnum(int(self.plan))
        control.plan_id = self.settings.plan_id if plan_id is None else plan_id
        control.timestamp = time_s
        self.node.heard(self.now, ADDRESS)
        self.node.take_vehicle_state(vehicle, self.now)
        self.follower.vehicle_state_changed(self.now)
        self.node.take_plan_state(control, self.now)
        self.follower.plan_state_changed(self.now)

    def move(self, lat_deg: float = 41.185, lon_deg: float = -8.705, depth_m: float = 0.0) -> None:
        self.here = lat_deg, lon_deg, depth_m
        self.node.places.clear()  # the script puts it where it wants
        self.tell_state()

    def tell_state(self) -> None:
        """Let it tell where it is."""
        assert self.here is not None
        lat_deg, lon_deg, depth_m = self.here
        self.time_s += 0.1
        state = imcpy.EstimatedState()
        state.timestamp = self.time_s
        state.lat, state.lon, state.depth = math.radians(lat_deg), math.radians(lon_deg), depth_m
        if not self.spoil(state):
            return
        report = self.node.take_state(state, self.now)
        if isinstance(report, StateReport):
            self.follower.moved(report, self.now)

    def echo(self, state: int = 2, reference: imcpy.Message | None = None, *, time_s: float = 0.0) -> None:
        message = imcpy.FollowRefState()
        message.timestamp = time_s
        message.control_src = self.settings.id
        message.state = imcpy.FollowRefState.StateEnum(state)
        sent = self.of("Reference")
        if reference or sent:
            message.reference = reference or sent[-1]
        self.follower.follow_state(message, self.now)

    def reply(
        self, *, ok: bool, info: str, operation: int = 0, request_id: int | None = None, time_s: float = 0.0
    ) -> None:
        message = imcpy.PlanControl()
        kinds = imcpy.PlanControl.TypeEnum
        message.type = kinds.SUCCESS if ok else kinds.FAILURE
        message.op = imcpy.PlanControl.OperationEnum(operation)
        message.request_id = self.of("PlanControl")[-1].request_id if request_id is None else request_id
        message.info = info
        message.timestamp = time_s
        self.follower.plan_control_reply(message, self.now)

    def run(self, seconds: float, echoing: bool = True) -> None:
        for _ in range(round(seconds / 0.2)):
            self.now += 0.2
            before = len(self.of("Reference"))
            if self.alive:
                self.report()
                if self.here is not None:
                    self.tell_state()
            self.follower.tick(self.now)
            if self.alive and echoing and len(self.of("Reference")) > before:
                self.echo()

    def of(self, kind: str) -> list[imcpy.Message]:
        return [message for message in self.sent if type(message).__name__ == kind]

    def operations(self) -> list[int]:
        return [int(message.op) for message in self.of("PlanControl")]

    def statuses(self) -> list[WaypointStatus]:
        return [change.status for change in self.changes]

    def follow(self, waypoint: Waypoint | None = WAYPOINT) -> "Script":
        """Bring it to following a waypoint."""
        self.report()
        self.move()
        self.follower.engage(self.now)
        self.follower.tick(self.now)
        self.report(mode=OperationMode.MANEUVER, plan=PlanState.EXECUTING)
        if waypoint is not None:
            self.follower.order(waypoint, self.now)
            self.echo()
        return self


def test_plan_is_sent_only_when_the_vehicle_is_in_service_and_ready() -> None:
    script = Script()
    script.move()
    script.report(mode=OperationMode.BOOT, plan=PlanState.BLOCKED)
    assert script.follower.engage(script.now)
    script.run(3.0)
    assert script.sent == []
    script.report(mode=OperationMode.SERVICE, plan=PlanState.READY)
    script.run(0.2)
    assert script.operations() == [0]


def test_start_is_repeated_with_the_same_request_until_answered() -> None:
    script = Script()
    script.move()
    script.report()
    script.follower.engage(script.now)
    script.run(5.0)
    starts = script.of("PlanControl")
    assert len(starts) == 3
    assert len({start.request_id for start in starts}) == 1


def test_vehicle_that_never_answers_is_refused() -> None:
    script = Script()
    script.move()
    script.report()
    script.follower.engage(script.now)
    script.run(11.0)
    assert not script.follower.engaged
    assert "no answer to the plan within 10 s" in script.follower.refusal.reason


@pytest.mark.parametrize("kind", [Follower, LegFollower])
def test_vehicle_that_tells_no_position_is_not_engaged(kind: type[Any]) -> None:
    """It would be sent down where nobody knows what is below it."""
    script = Script(kind)
    script.follower.engage(script.now)
    script.run(16.0)
    assert script.sent == []
    assert "tells no position" in script.follower.refusal.reason

    script.move()
    assert script.follower.engage(script.now)


def test_vehicle_without_a_fix_is_not_sent_to_where_no_ship_is() -> None:
    """Before its first fix it reports latitude and longitude 0: told to stay there it set out with the fix."""
    script = Script()
    script.move(0.0, 0.0)
    assert script.node.report is None
    script.follower.engage(script.now)
    script.run(3.0)
    assert script.sent == []

    script.move()
    script.run(0.2)
    script.report(mode=OperationMode.MANEUVER, plan=PlanState.EXECUTING)
    script.run(2.0)
    assert {round(math.degrees(reference.lat), 6) for reference in script.of("Reference")} == {41.185}


def test_vehicle_that_never_gets_ready_is_refused_with_its_error() -> None:
    script = Script()
    script.report(mode=OperationMode.ERROR, plan=PlanState.BLOCKED, error="leak detected")
    script.follower.engage(script.now)
    script.now += 16.0
    script.report(error="leak detected")
    script.follower.tick(script.now)
    assert "leak detected" in script.follower.refusal.reason


def test_refused_plan_is_reported_with_the_vehicles_words() -> None:
    script = Script()
    script.move()
    script.report()
    script.follower.engage(script.now)
    script.follower.tick(script.now)
    script.reply(ok=False, info="vehicle is not ready: DVL error", request_id=999)
    assert script.follower.engaged
    script.reply(ok=False, info="vehicle is not ready: DVL error")
    assert not script.follower.engaged
    assert "DVL error" in script.follower.refusal.reason


def test_vehicle_holds_its_place_at_the_surface_until_the_first_waypoint() -> None:
    script = Script().follow(waypoint=None)
    script.run(5.0)
    references = script.of("Reference")
    assert len(references) == pytest.approx(6, abs=1)
    assert {(round(math.degrees(r.lat), 6), r.z.value) for r in references} == {(41.185, 0.0)}


def test_references_go_on_every_second_and_only_their_echo_acknowledges() -> None:
    script = Script().follow()
    assert script.statuses() == [WaypointStatus.SENT, WaypointStatus.ACKNOWLEDGED]
    other = Waypoint("m", 1, 41.187, -8.705, 1.5)
    stale = script.of("Reference")[-1]
    script.follower.order(other, script.now)
    script.echo(reference=stale)
    assert script.statuses()[2:] == [WaypointStatus.SENT]
    count = len(script.of("Reference"))
    script.run(10.0)
    assert script.statuses()[2:] == [WaypointStatus.SENT, WaypointStatus.ACKNOWLEDGED]
    assert len(script.of("Reference")) - count == pytest.approx(10, abs=1)


def test_echo_of_another_controller_is_no_acknowledgement() -> None:
    script = Script()
    script.report()
    script.move()
    script.follower.engage(script.now)
    script.follower.tick(script.now)
    script.report(mode=OperationMode.MANEUVER, plan=PlanState.EXECUTING)
    script.follower.order(WAYPOINT, script.now)
    message = imcpy.FollowRefState()
    message.control_src = 0x4001
    message.reference = script.of("Reference")[-1]
    script.follower.follow_state(message, script.now)
    assert script.statuses() == [WaypointStatus.SENT]


def test_arrival_needs_both_the_place_and_the_depth() -> None:
    script = Script().follow()
    script.move(41.186, -8.705, depth_m=0.0)
    assert WaypointStatus.REACHED not in script.statuses()
    script.move(41.1865, -8.705, depth_m=1.5)
    assert WaypointStatus.REACHED not in script.statuses()
    script.move(41.18601, -8.705, depth_m=1.2)
    assert script.statuses()[-1] is WaypointStatus.REACHED
    script.move(41.18601, -8.705, depth_m=1.2)
    assert script.statuses().count(WaypointStatus.REACHED) == 1


@pytest.mark.parametrize("cause", ["timeout", "failure", "starved", "reboot"])
def test_plan_that_fails_in_mid_way_is_started_again_with_the_same_waypoint(cause: str) -> None:
    script = Script().follow()
    match cause:
        case "timeout":
            script.echo(state=6)
        case "failure":
            script.reply(ok=False, info="maneuver failed")
        case "starved":
            script.reply(ok=False, info="Path Control: expected new path control reference")
            script.report(mode=OperationMode.ERROR, plan=PlanState.BLOCKED)
        case "reboot":
            script.follower.rebooted(script.now)
    script.report(mode=OperationMode.SERVICE, plan=PlanState.READY)
    script.run(2.0)
    assert script.follower.phase is Phase.STARTING
    script.report(mode=OperationMode.MANEUVER, plan=PlanState.EXECUTING)
    assert script.follower.phase is Phase.FOLLOWING
    script.run(1.0)
    assert script.of("Reference")[-1].lat == pytest.approx(math.radians(41.186))
    assert WaypointStatus.REFUSED not in script.statuses()


def test_plan_that_fails_again_and_again_is_given_up() -> None:
    script = Script(max_restarts=2).follow()
    for _ in range(3):
        script.reply(ok=False, info="thruster fault")
        script.report(mode=OperationMode.SERVICE, plan=PlanState.READY)
        script.run(2.0)
        if script.follower.engaged:
            script.report(mode=OperationMode.MANEUVER, plan=PlanState.EXECUTING)
    assert script.statuses()[-1] is WaypointStatus.REFUSED
    assert "plan failed 3 times, last: thruster fault" in script.changes[-1].reason


@pytest.mark.parametrize(
    ("end", "words"),
    [
        (lambda s: s.follower.foreign_abort(0x4001, s.now), "aborted by console 0x4001"),
        (lambda s: s.report(mode=OperationMode.ERROR, plan=PlanState.BLOCKED, error="leak"), "leak"),
        (lambda s: s.follower.foreign_plan_control(0x4001, 1), "stopped by console 0x4001"),
        (lambda s: s.report(plan=PlanState.EXECUTING, plan_id="home"), "took over with plan 'home'"),
    ],
    ids=["abort", "error", "stop", "take-over"],
)
def test_vehicle_that_somebody_else_takes_is_let_go(end: Callable[..., Any], words: str) -> None:
    script = Script().follow()
    end(script)
    if "took over" not in words:
        script.report(mode=OperationMode.SERVICE, plan=PlanState.READY)
        script.run(2.0)
    else:
        script.now += 2.0
        script.follower.tick(script.now)
    assert not script.follower.engaged
    assert words in script.changes[-1].reason
    references = len(script.of("Reference"))
    script.run(5.0)
    assert len(script.of("Reference")) == references
    assert script.operations() == [0]


def test_plan_state_that_comes_late_does_not_end_a_running_plan() -> None:
    script = Script().follow()
    script.report(plan=PlanState.READY)
    script.report(plan=PlanState.EXECUTING)
    script.run(3.0)
    assert script.follower.phase is Phase.FOLLOWING
    assert script.operations() == [0]


@pytest.mark.parametrize("kind", [Follower, LegFollower])
def test_plan_state_from_before_the_plan_that_was_held_up_on_its_way_ends_nothing(kind: type[Any]) -> None:
    script = Script(kind)
    script.report()
    script.move()
    script.follower.engage(script.now)
    script.follower.tick(script.now)
    script.follower.order(WAYPOINT, script.now)
    script.reply(ok=True, info="plan loaded", time_s=50.0)
    script.report(mode=OperationMode.MANEUVER, plan=PlanState.EXECUTING, time_s=51.0)
    script.echo()
    script.alive = False
    for late_s in (48.0, 49.0):
        script.now += 30.0
        script.report(mode=OperationMode.SERVICE, plan=PlanState.READY, time_s=late_s)
    script.move()
    assert script.follower.phase is Phase.FOLLOWING
    assert script.statuses() == [WaypointStatus.SENT, WaypointStatus.ACKNOWLEDGED]
    assert script.operations() == [0], "it is neither stopped nor started again"


def test_unanswered_references_of_a_live_vehicle_restart_its_plan() -> None:
    script = Script().follow()
    script.run(13.0, echoing=False)
    assert script.follower.phase is Phase.WAITING
    assert script.operations()[-1] == 1


def test_stop_is_repeated_and_ends_in_abort() -> None:
    script = Script().follow()
    script.alive = False
    script.follower.begin_stop(script.now)
    script.run(1.0)
    script.follower.escalate_stop()
    script.run(1.0)
    stops = [m for m in script.of("PlanControl") if int(m.op) == 1]
    assert len(stops) >= 3
    assert len({stop.request_id for stop in stops}) == 1
    assert script.of("Abort")
    references = len(script.of("Reference"))
    script.follower.give_up_stop(script.now)
    script.run(3.0)
    assert len(script.of("Reference")) == references


def test_vehicle_that_comes_back_following_after_an_unheard_stop_is_stopped() -> None:
    script = Script().follow()
    script.alive = False
    script.follower.begin_stop(script.now)
    script.run(1.0)
    script.follower.give_up_stop(script.now)
    stops = len(script.of("PlanControl"))
    script.alive = True
    script.run(1.0)
    assert len(script.of("PlanControl")) > stops
    assert script.operations()[-1] == 1


def test_stop_is_acknowledged_only_by_its_own_reply_or_the_end_of_the_plan() -> None:
    script = Script().follow()
    script.follower.begin_stop(script.now)
    script.reply(ok=True, info="plan stopped", operation=1, request_id=1)
    assert script.follower.phase is Phase.STOPPING
    script.report(plan=PlanState.EXECUTING)
    assert script.follower.phase is Phase.STOPPING
    script.reply(ok=True, info="plan stopped", operation=1)
    assert script.follower.phase is Phase.IDLE
    assert script.follower.stop_detail == "plan stopped"


def test_guarded_depth_is_raised_at_once_when_the_bottom_rises() -> None:
    script = Script().follow(Waypoint("m", 0, 41.186, -8.705, 10.0, min_altitude_m=3.0))
    for _ in range(20):
        script.follower.guard.add(script.time_s, 41.185, -8.705, 20.0)
    script.run(1.0)
    assert script.of("Reference")[-1].z.value == pytest.approx(10.0)
    for _ in range(3):
        script.follower.guard.add(script.time_s, 41.185, -8.705, 9.0)
    script.run(0.2)
    assert script.of("Reference")[-1].z.value == pytest.approx(6.0)


# Heard, and telling no position


def _without_numbers(state: Any) -> bool:
    state.x = math.nan
    return True


def _without_fix(state: Any) -> bool:
    state.lat = state.lon = 0.0
    return True


def _unsent(_state: Any) -> bool:
    return False


class _Elsewhere:
    """Every state is somewhere else, and none near the last one."""

    def __init__(self) -> None:
        self._count = itertools.count(1)

    def __call__(self, state: Any) -> bool:
        state.lat = math.radians(41.185 + 0.1 * next(self._count))
        return True


BLIND = {"NaN": _without_numbers, "0, 0": _without_fix, "no state": _unsent, "never where it can be": _Elsewhere()}


def blinded(kind: type[Any], spoil: Callable[[Any], bool], depth_m: float = 1.0) -> Script:
    """A vehicle on its way, of which nothing but its position is missing from now on."""
    script = Script(kind).follow()
    script.run(2.0)
    if kind is LegFollower:
        script.report(mode=OperationMode.MANEUVER, plan=PlanState.EXECUTING)
    script.move(depth_m=depth_m)
    script.run(1.0)
    assert script.follower.phase is Phase.FOLLOWING
    script.spoil = spoil
    return script


@pytest.mark.parametrize("spoil", BLIND.values(), ids=BLIND.keys())
def test_vehicle_that_tells_no_position_is_held_at_the_surface_and_goes_on_when_it_does(
    spoil: Callable[[Any], bool],
) -> None:
    script = blinded(Follower, spoil)
    assert script.of("Reference")[-1].z.value > 0.0
    script.run(5.0)
    held = script.of("Reference")[-1]
    assert held.z.value == 0.0
    assert math.degrees(held.lat) == pytest.approx(41.185)
    assert script.follower.phase is Phase.FOLLOWING
    assert "tells no position" in status_of(script.node, script.now).reason
    # It has a fix again.
    script.spoil = lambda _state: True
    script.run(2.0)
    assert script.of("Reference")[-1].z.value > 0.0
    assert math.degrees(script.of("Reference")[-1].lat) == pytest.approx(WAYPOINT.lat_deg)
    assert "tells no position" not in status_of(script.node, script.now).reason
    assert script.statuses() == [WaypointStatus.SENT, WaypointStatus.ACKNOWLEDGED]


@pytest.mark.parametrize("spoil", BLIND.values(), ids=BLIND.keys())
def test_vehicle_that_tells_no_position_for_longer_than_it_takes_to_come_up_is_let_go(
    spoil: Callable[[Any], bool],
) -> None:
    script = blinded(Follower, spoil)
    patience_s = script.node.patience_s
    assert patience_s >= 30.0
    script.run(patience_s - 2.0)
    assert script.follower.phase is Phase.FOLLOWING
    script.run(4.0)
    assert script.follower.phase is Phase.IDLE
    assert "told no position for" in script.follower.refusal.reason
    assert script.statuses()[-1] is WaypointStatus.REFUSED
    assert script.operations()[-1] == 1, "it is told to stop"
    # It is not taken over again before it tells where it is.
    script.report(mode=OperationMode.SERVICE, plan=PlanState.READY)
    script.follower.engage(script.now)
    script.run(10.0)
    assert script.follower.phase is Phase.WAITING
    script.spoil = lambda _state: True
    script.run(0.4)
    assert script.follower.phase is Phase.STARTING


@pytest.mark.parametrize("spoil", BLIND.values(), ids=BLIND.keys())
def test_leg_of_a_vehicle_that_tells_no_position_is_stopped_and_begun_again(spoil: Callable[[Any], bool]) -> None:
    script = blinded(LegFollower, spoil)
    assert script.operations() == [0]
    script.run(15.0)
    assert script.follower.phase is Phase.WAITING
    assert script.operations()[-1] == 1
    assert "tells no position" in status_of(script.node, script.now).reason
    script.report(mode=OperationMode.SERVICE, plan=PlanState.READY)
    script.run(5.0)
    assert script.operations()[-1] == 1, "no leg begins where nobody knows"
    script.spoil = lambda _state: True
    script.run(1.0)
    assert script.follower.phase is Phase.FOLLOWING
    assert script.operations()[-1] == 0


def test_vehicle_between_two_legs_that_tells_no_position_gets_none_and_is_let_go() -> None:
    script = Script(LegFollower)
    script.report()
    script.move()
    script.follower.engage(script.now)
    script.run(1.0)
    script.spoil = _without_numbers
    script.run(4.0)
    script.follower.order(WAYPOINT, script.now)
    script.run(10.0)
    assert script.sent == []
    script.run(20.0)
    assert script.follower.phase is Phase.IDLE
    assert "told no position" in script.follower.refusal.reason


@pytest.mark.parametrize("pause_s", [12.0, 60.0])
def test_vehicle_that_is_heard_seldom_is_not_taken_for_one_without_position(pause_s: float) -> None:
    script = Script().follow()
    for _ in range(20):
        script.now += pause_s
        script.report()
    assert not script.node.without_position


def test_vehicle_whose_radio_ended_under_water_is_not_taken_for_one_without_position() -> None:
    script = blinded(Follower, lambda _state: True)
    script.alive = False
    script.run(8.0)
    script.alive = True
    script.spoil = _unsent  # the first packets after the gap are others
    script.run(1.0)
    assert not script.node.without_position


def test_states_that_are_lost_now_and_then_make_no_vehicle_come_up() -> None:
    script = blinded(Follower, lambda _state: True)
    arrives = itertools.cycle([False] * 9 + [True])
    script.spoil = lambda _state: next(arrives)
    script.run(20.0)
    assert all(reference.z.value > 0.0 for reference in script.of("Reference")[-15:])


def test_a_late_word_of_a_timeout_ends_no_plan_that_began_or_was_answered_since() -> None:
    script = Script()
    script.report()
    script.move()
    script.follower.engage(script.now)
    script.follower.tick(script.now)
    script.reply(ok=True, info="plan loaded", time_s=50.0)
    script.report(mode=OperationMode.MANEUVER, plan=PlanState.EXECUTING, time_s=51.0)
    script.follower.order(WAYPOINT, script.now)
    script.echo(6, time_s=48.0)
    assert script.follower.phase is Phase.FOLLOWING, "that was another plan"
    script.echo(time_s=55.0)
    script.echo(6, time_s=54.0)
    assert script.follower.phase is Phase.FOLLOWING, "it was answered since"
    script.echo(6, time_s=61.0)
    assert script.follower.phase is Phase.ENDED
