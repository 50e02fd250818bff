"""How a node takes commands."""

import math
from collections.abc import Callable
from typing import Any

import imcpy
import pytest

from simulator.dune.plan import OpMode, PlanState
from simulator.geodesy import LocalFrame
from tests.support.imc.dune_bench import CONSOLE_ID, Bench, done, reference, start_request, stop_request

SERVICE, ERROR, MANEUVER, BOOT = 0, 2, 3, 5
BLOCKED, READY, EXECUTING = 0, 1, 3
WAIT, GOTO, LOITER, HOVER, ELEVATOR, TIMEOUT = 1, 2, 3, 4, 5, 6
FAR, XY_NEAR, Z_NEAR = 1, 2, 4


def replies(bench: Bench) -> list[tuple[int | str, ...]]:
    return [(int(m.type), int(m.op), m.request_id, m.info) for m in bench.all(imcpy.PlanControl)]


def follow_states(bench: Bench) -> list[int]:
    return [int(m.state) for m in bench.all(imcpy.FollowRefState)]


@pytest.fixture
def started(bench: Bench) -> Any:
    bench.say(start_request())
    return bench


def test_it_starts_up_in_five_seconds() -> None:
    bench = Bench()
    bench.run(4.0)
    assert bench.states() == (BOOT, BLOCKED)
    bench.run(2.0)
    assert bench.states() == (SERVICE, READY)


def test_a_plan_is_loaded_and_executed_at_once(bench: Bench) -> None:
    bench.say(start_request(request_id=77))
    assert replies(bench) == [(1, 0, 77, "plan loaded"), (1, 0, 77, "follow: executing maneuver")]
    assert {m.dst for m in bench.all(imcpy.PlanControl)} == {CONSOLE_ID}
    assert [int(m.state) for m in bench.all(imcpy.PlanControlState)] == [2, 3]
    state = bench.last(imcpy.PlanControlState)
    assert (state.plan_id, state.man_id, state.man_type) == ("cao", "follow", 478)
    assert bench.last(imcpy.VehicleState).op_mode == imcpy.VehicleState.OperationModeEnum.MANEUVER
    assert follow_states(bench) == [WAIT]
    assert bench.states() == (MANEUVER, EXECUTING)


@pytest.mark.parametrize("dst", [0, 0xFFFF, 0x0102])
def test_commands_for_others_or_for_all_are_ignored(bench: Bench, dst: int) -> None:
    bench.say(start_request(), dst=dst)
    bench.say(imcpy.Abort(), dst=dst)
    assert bench.states() == (SERVICE, READY)
    assert replies(bench) == []


def test_a_start_during_start_up_is_refused() -> None:
    bench = Bench(boot_s=100.0)
    bench.introduce()
    bench.run(6.0, bench.beat)
    bench.say(start_request())
    assert replies(bench) == [(2, 0, 100, "vehicle is in BOOT mode")]
    assert bench.states() == (BOOT, BLOCKED)


@pytest.mark.parametrize(
    ("break_it", "info"),
    [
        (lambda m: setattr(m, "arg", None), "undefined plan"),
        (lambda m: setattr(m, "arg", imcpy.Heartbeat()), "undefined maneuver or plan"),
        (lambda m: m.arg.maneuvers.clear(), "invalid maneuver ID"),
    ],
)
def test_impossible_plans_fail_with_the_reason(bench: Bench, break_it: Callable[..., Any], info: str) -> None:
    request = start_request()
    break_it(request)
    bench.say(request)
    (kind, op, request_id, told), *rest = replies(bench)
    assert (kind, op, request_id, rest) == (2, 0, 100, [])
    assert info in str(told)
    assert bench.states() == (SERVICE, READY)


def test_unsupported_maneuvers_fail_with_their_name(bench: Bench) -> None:
    bench.say(start_request(data=imcpy.Loiter()))
    assert replies(bench) == [(2, 0, 100, "plan validation failed: Loiter is not supported")]


def goto_request(
    frame: LocalFrame, *places: tuple[float, float, float], request_id: int = 100, nowhere: str | None = None
) -> imcpy.Message:
    """A plan of Gotos joined by "ManeuverIsDone": (east, north, depth) of each."""
    plan = imcpy.PlanSpecification()
    plan.plan_id, plan.start_man_id = "legs", "0"
    for index, (east, north, depth) in enumerate(places):
        goto = imcpy.Goto()
        lat, lon = frame.to_geodetic(east, north)
        goto.lat, goto.lon, goto.z, goto.z_units = math.radians(lat), math.radians(lon), depth, imcpy.ZUnits.DEPTH
        goto.speed, goto.speed_units, goto.timeout = 1.3, imcpy.SpeedUnits.METERS_PS, 1000
        item = imcpy.PlanManeuver()
        item.maneuver_id, item.data = str(index), goto
        plan.maneuvers.append(item)
        if index:
            transition = imcpy.PlanTransition()
            transition.source_man, transition.dest_man = str(index - 1), nowhere or str(index)
            transition.conditions = "ManeuverIsDone"
            plan.transitions.append(transition)
    request = start_request(request_id=request_id)
    request.plan_id, request.arg = "legs", plan
    return request


def test_gotos_are_flown_one_after_the_other_without_further_contact(bench: Bench) -> None:
    bench.say(goto_request(bench.vehicle.terrain.frame, (60.0, 20.0, 2.0), (60.0, 60.0, 0.0)))
    assert replies(bench)[:2] == [(1, 0, 100, "plan loaded"), (1, 0, 100, "0: executing maneuver")]
    bench.run(200.0, bench.beat)
    assert [info for *_, info in replies(bench)] == [
        "plan loaded", "0: executing maneuver", "1: executing maneuver", "plan completed",
    ]  # fmt: skip
    assert bench.states() == (SERVICE, READY)
    assert bench.last(imcpy.PlanControlState).last_outcome == imcpy.PlanControlState.LastPlanOutcomeEnum.SUCCESS
    assert bench.vehicle.position.horizontal_distance_m(60.0, 60.0) < 15.0


def test_gotos_can_be_stopped_on_the_way(bench: Bench) -> None:
    bench.say(goto_request(bench.vehicle.terrain.frame, (80.0, 80.0, 2.0)))
    bench.run(5.0)
    assert bench.states() == (MANEUVER, EXECUTING)
    bench.say(stop_request())
    assert bench.states() == (SERVICE, READY)


def test_transitions_to_nowhere_are_refused(bench: Bench) -> None:
    places = (80.0, 80.0, 2.0), (10.0, 10.0, 0.0)
    bench.say(goto_request(bench.vehicle.terrain.frame, *places, nowhere="7"))
    assert replies(bench) == [(2, 0, 100, "plan validation failed: 7: invalid maneuver ID")]


def test_each_reference_is_answered_with_its_echo(started: Bench) -> None:
    started.follow(50, 80, 3.0)
    started.run(3.0, lambda: started.follow(50, 80, 3.0))
    states = started.all(imcpy.FollowRefState)
    assert len(states) == 1 + 4
    echo = states[-1].reference
    assert (echo.flags, echo.z.value, echo.speed.value) == (0x27, 3.0, pytest.approx(1.2))
    assert states[-1].control_src == CONSOLE_ID
    started.run(4.0)
    assert len(started.all(imcpy.FollowRefState)) == 5, "none comes by itself"


def test_it_goes_there_and_loiters(started: Bench) -> None:
    started.run(120.0, lambda: started.follow(50, 100, 3.0))
    sequence = [(int(m.state), m.proximity) for m in started.all(imcpy.FollowRefState)]
    changes = [b for a, b in zip([None, *sequence], sequence, strict=False) if a != b]
    assert changes == [(WAIT, FAR), (GOTO, FAR), (GOTO, Z_NEAR), (GOTO, XY_NEAR | Z_NEAR), (LOITER, XY_NEAR | Z_NEAR)]
    assert started.vehicle.position.horizontal_distance_m(50, 100) == pytest.approx(7.5, abs=0.6)
    assert started.vehicle.position.depth_m == pytest.approx(3.0, abs=0.1)


def test_it_hovers_at_a_target_at_the_surface(started: Bench) -> None:
    started.run(100.0, lambda: started.follow(50, 80, 0.0))
    assert follow_states(started)[-1] == HOVER
    assert started.vehicle.vehicle.motion.surge_mps == 0.0


def test_it_spirals_where_the_depth_is_not_reached_on_the_way(started: Bench) -> None:
    started.run(120.0, lambda: started.follow(50, 40, 9.0))
    assert ELEVATOR in follow_states(started)
    assert follow_states(started)[-1] == LOITER
    assert started.vehicle.position.depth_m == pytest.approx(9.0, abs=0.3)


def test_a_reference_within_tolerance_is_circled_at_once(started: Bench) -> None:
    started.run(60.0, lambda: started.follow(50, 60, 3.0))
    here = started.vehicle.position
    started.wire.sent.clear()
    started.follow(here.east_m + 5, here.north_m + 5, 3.0, radius=2.0)
    assert follow_states(started) == [LOITER]
    assert started.vehicle.vehicle.loiter_radius_m == 2.0


def test_altitude_is_kept(started: Bench) -> None:
    started.run(90.0, lambda: started.follow(50, 150, 4.0, units=imcpy.ZUnits.ALTITUDE))
    assert started.vehicle.state.altitude_m == pytest.approx(4.0, abs=0.3)


def test_nothing_protects_it_from_the_bottom(started: Bench) -> None:
    started.run(90.0, lambda: started.follow(50, 180, 60.0))
    assert started.vehicle.collided
    assert started.states() == (MANEUVER, EXECUTING)


def test_references_of_others_are_ignored_without_a_word(started: Bench) -> None:
    started.introduce(0x3F02, ("127.0.0.1", 6199))
    started.wire.sent.clear()
    lat, lon = started.vehicle.terrain.frame.to_geodetic(50, 100)
    started.say(reference(lat, lon), src=0x3F02, address=("127.0.0.1", 6199))
    assert started.all(imcpy.FollowRefState) == []


def test_anyone_may_control_when_the_plan_says_so(bench: Bench) -> None:
    bench.say(start_request(control_src=0xFFFF))
    bench.follow(50, 100)
    assert follow_states(bench) == [WAIT, GOTO]


def test_the_controlling_system_ends_the_plan(started: Bench) -> None:
    started.run(20.0, lambda: started.follow(50, 100))
    started.wire.sent.clear()
    started.say(done())
    assert replies(started) == [(1, 0, 100, "plan completed")]
    assert started.states() == (SERVICE, READY)
    assert int(started.last(imcpy.PlanControlState).last_outcome) == 1
    assert [int(m.op_mode) for m in started.all(imcpy.VehicleState)] == [MANEUVER, SERVICE]
    started.run(60.0)
    assert started.vehicle.position.depth_m == 0.0, "it comes up"


def test_stop_ends_the_plan(started: Bench) -> None:
    started.say(stop_request(request_id=5))
    assert replies(started)[-1] == (1, 1, 5, "plan completed")
    assert started.states() == (SERVICE, READY)


def test_stop_without_a_plan_fails(bench: Bench) -> None:
    bench.say(stop_request(request_id=5))
    assert replies(bench) == [(2, 1, 5, "no plan is running, request ignored")]


def test_a_new_start_replaces_the_running_plan(started: Bench) -> None:
    started.run(20.0, lambda: started.follow(50, 100))
    started.wire.sent.clear()
    started.say(start_request(request_id=101, plan_id="again"))
    assert [r[2] for r in replies(started)] == [101, 101]
    assert follow_states(started) == [WAIT]
    assert started.last(imcpy.PlanControlState).plan_id == "again"


def test_a_silent_controller_times_out_on_the_way(started: Bench) -> None:
    started.follow(50, 190)
    started.run(35.0, started.beat)
    assert follow_states(started)[-1] == TIMEOUT
    assert replies(started)[-1] == (2, 0, 100, "FollowReference maneuver error: reference source timed out")
    assert started.states() == (SERVICE, READY)
    assert int(started.last(imcpy.PlanControlState).last_outcome) == 2


def test_arrival_without_a_new_reference_fails_whatever_the_timeout(bench: Bench) -> None:
    bench.say(start_request(timeout=600))
    bench.follow(50, 50)
    bench.run(60.0, bench.beat)
    assert replies(bench)[-1] == (2, 0, 100, "Path Control: expected new path control reference")
    assert bench.states() == (SERVICE, READY)
    modes = [(int(m.op_mode), m.error_ents) for m in bench.all(imcpy.VehicleState)]
    assert (ERROR, "Path Control") in modes


def test_a_reference_every_five_seconds_is_enough(bench: Bench) -> None:
    bench.say(start_request(timeout=600))
    for _ in range(20):
        bench.follow(50, 60)
        bench.run(4.9)
    assert bench.states() == (MANEUVER, EXECUTING)


def test_abort_stops_and_recovers_within_a_second(started: Bench) -> None:
    started.run(20.0, lambda: started.follow(50, 100))
    started.wire.sent.clear()
    started.say(imcpy.Abort())
    assert started.states() == (ERROR, BLOCKED)
    assert "got abort request from system ccu-cao" in started.last(imcpy.VehicleState).last_error
    assert replies(started)[-1][0] == 2
    started.run(0.8)
    assert started.states() == (ERROR, BLOCKED)
    started.run(0.4)
    assert started.states() == (SERVICE, READY)
    assert started.vehicle.vehicle.target is None


def test_a_command_that_arrives_twice_does_no_harm(bench: Bench) -> None:
    for _ in range(2):
        bench.say(start_request())
    for _ in range(2):
        bench.follow(50, 100)
    assert bench.states() == (MANEUVER, EXECUTING)
    bench.say(done())
    bench.say(done())
    assert [r[3] for r in replies(bench)].count("plan completed") == 1


def test_what_a_reference_leaves_out_stays_as_it_was(started: Bench) -> None:
    started.follow(50, 150, 3.0, speed=1.5)
    started.follow(0, 0, 5.0, flags=0x04)
    target = started.vehicle.vehicle.target
    assert (target.east_m, target.north_m) == pytest.approx((50, 150), abs=1e-3)
    assert (target.z_m, target.speed_mps) == (5.0, pytest.approx(1.5))


def test_the_enumerations_are_those_of_imc() -> None:
    assert {m.name: m.value for m in OpMode} == {
        k: int(v) for k, v in imcpy.VehicleState.OperationModeEnum.__members__.items()
    }
    assert {m.name: m.value for m in PlanState} == {
        k: int(v) for k, v in imcpy.PlanControlState.StateEnum.__members__.items()
    }
