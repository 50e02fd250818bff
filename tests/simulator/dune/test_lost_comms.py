"""Plans that stay on board, and the supervisor that starts one when no console is heard."""

import math
from typing import Any

import imcpy
import pytest

from simulator.dune.plan import Outcome, PlanState
from tests.support.imc.dune_bench import Bench, start_request, stop_request

OTHER = ("127.0.0.1", 6199)
NEPTUS = 0x4001
TIMEOUT_S = 60.0
HOME_M = (50.0, 80.0)
Operation, Type = imcpy.PlanDB.OperationEnum, imcpy.PlanDB.TypeEnum


def way_home(bench: Bench, name: str = "lostcomms") -> imcpy.PlanSpecification:
    lat, lon = bench.vehicle.terrain.frame.to_geodetic(*HOME_M)
    there = imcpy.Goto()
    there.lat, there.lon, there.speed = math.radians(lat), math.radians(lon), 1.2
    there.speed_units, there.z_units = imcpy.SpeedUnits.METERS_PS, imcpy.ZUnits.DEPTH
    item = imcpy.PlanManeuver()
    item.maneuver_id, item.data = "home", there
    plan = imcpy.PlanSpecification()
    plan.plan_id, plan.start_man_id = name, "home"
    plan.maneuvers.append(item)
    return plan


def ask(bench: Bench, operation: Any, plan: imcpy.Message | None = None, name: str = "lostcomms") -> list[Any]:
    """Ask the plan database, and return kinds and words of its replies."""
    request = imcpy.PlanDB()
    request.type, request.op, request.request_id, request.plan_id = Type.REQUEST, operation, 7, name
    if plan is not None:
        request.arg = plan
    bench.wire.sent.clear()
    bench.say(request)
    replies = bench.all(imcpy.PlanDB)
    assert {(r.request_id, r.plan_id) for r in replies} == {(7, name)}
    return [(r.type, r.info) for r in replies]


@pytest.fixture
def bench() -> Bench:
    return Bench(lost_comms_s=TIMEOUT_S).ready()


def fail(bench: Bench) -> None:
    """Let a plan end because its references cease, and the vehicle come up."""
    bench.say(start_request())
    bench.follow(50.0, 60.0)
    bench.run(40.0)
    assert (bench.node.plan.plan_state, bench.node.plan.outcome) == (PlanState.READY, Outcome.FAILURE)


def goes_home(bench: Bench, within_s: float = TIMEOUT_S + 40.0) -> bool:
    for _ in range(round(within_s)):
        bench.run(1.0)
        if bench.node.plan.plan_state is PlanState.EXECUTING:
            return bool(bench.node.plan.plan_control_state().plan_id == "lostcomms")
    return False


def test_plans_are_set_read_and_deleted(bench: Bench) -> None:
    assert ask(bench, Operation.GET) == [(Type.FAILURE, "undefined plan")]
    assert ask(bench, Operation.SET, way_home(bench)) == [
        (Type.IN_PROGRESS, "in progress"), (Type.SUCCESS, "OK (new entry)"),
    ]  # fmt: skip
    information = bench.last(imcpy.PlanDB).arg
    assert (information.plan_id, information.change_sid, len(information.md5)) == ("lostcomms", 0x3F01, 16)
    assert ask(bench, Operation.SET, way_home(bench))[-1] == (Type.SUCCESS, "OK (updated)")
    assert ask(bench, Operation.GET) == [(Type.SUCCESS, "OK")]
    assert bench.last(imcpy.PlanDB).arg.start_man_id == "home"
    assert ask(bench, Operation.DEL) == [(Type.IN_PROGRESS, "in progress"), (Type.SUCCESS, "OK")]
    assert ask(bench, Operation.DEL)[-1] == (Type.FAILURE, "undefined plan")


def test_a_plan_that_is_started_is_kept_and_everyone_told(bench: Bench) -> None:
    bench.say(start_request())
    (told,) = bench.all(imcpy.PlanDB)
    assert (told.type, told.op, told.plan_id, told.info, told.dst) == (
        Type.SUCCESS, Operation.SET, "cao", "OK (new entry)", 0xFFFF,
    )  # fmt: skip
    assert list(bench.node.database.plans) == ["cao"]


def test_wrong_requests_are_refused(bench: Bench) -> None:
    assert ask(bench, Operation.SET, way_home(bench, "other")) == [(Type.FAILURE, "plan id mismatch")]
    assert ask(bench, Operation.SET) == [(Type.FAILURE, "no plan specification given")]
    assert ask(bench, Operation.CLEAR) == [(Type.FAILURE, "unsupported operation")]
    assert ask(bench, Operation.GET, name="") == [(Type.FAILURE, "undefined plan id")]


def test_a_stored_plan_can_be_started_by_its_name_also_after_a_restart(bench: Bench) -> None:
    ask(bench, Operation.SET, way_home(bench))
    bench.node.crash()
    bench.run(15.0)
    bench.introduce()
    bench.run(6.0, bench.beat)
    request = imcpy.PlanControl()
    request.plan_id = "lostcomms"
    bench.say(request)
    assert bench.states() == (3, 3)


def test_after_a_failed_plan_it_goes_home(bench: Bench) -> None:
    ask(bench, Operation.SET, way_home(bench))
    fail(bench)
    assert goes_home(bench)
    bench.run(90.0)
    assert bench.vehicle.position.horizontal_distance_m(*HOME_M) < 15.0


def test_it_also_goes_after_a_stop_but_not_after_success(bench: Bench) -> None:
    ask(bench, Operation.SET, way_home(bench))
    bench.say(start_request(data=way_home(bench).maneuvers[0].data))
    bench.run(100.0, bench.beat)
    assert bench.node.plan.outcome is Outcome.SUCCESS
    assert not goes_home(bench)
    bench.beat()
    bench.run(6.0, bench.beat)
    bench.say(start_request())
    bench.run(3.0, bench.beat)
    bench.say(stop_request())
    assert goes_home(bench)


@pytest.mark.parametrize(("console", "stays"), [(NEPTUS, True), (0x3F02, False)])
def test_a_heartbeat_of_what_dune_takes_for_a_console_keeps_it(bench: Bench, console: int, stays: bool) -> None:
    ask(bench, Operation.SET, way_home(bench))
    bench.introduce(console, OTHER)
    fail(bench)
    bench.run(3.0 * TIMEOUT_S, lambda: bench.say(imcpy.Heartbeat(), src=console, address=OTHER))
    assert (bench.node.plan.plan_control_state().plan_id == "cao") == stays


@pytest.mark.parametrize("how", ["never stored", "abort", "restart", "disarmed"])
def test_nothing_is_started(bench: Bench, how: str) -> None:
    if how != "never stored":
        ask(bench, Operation.SET, way_home(bench))
    if how == "abort":
        bench.say(imcpy.Abort())
        bench.run(3.0, bench.beat)
    elif how == "restart":
        bench.node.crash()
        bench.run(15.0)
        bench.introduce()
        bench.run(6.0, bench.beat)
    elif how == "disarmed":
        ask(bench, Operation.SET)
    fail(bench)
    assert not goes_home(bench)


def test_deleting_the_plan_alone_does_not_disarm(bench: Bench) -> None:
    ask(bench, Operation.SET, way_home(bench))
    ask(bench, Operation.DEL)
    fail(bench)
    assert goes_home(bench)


def test_storing_it_again_after_an_abort_arms_it(bench: Bench) -> None:
    ask(bench, Operation.SET, way_home(bench))
    bench.say(imcpy.Abort())
    bench.run(3.0, bench.beat)
    ask(bench, Operation.SET, way_home(bench))
    assert goes_home(bench), "an aborted vehicle has a failed plan behind it, too"


@pytest.mark.parametrize("lost_comms_s", [0.0, 45.0])
def test_the_supervisor_tells_its_parameters_where_it_runs(lost_comms_s: float) -> None:
    bench = Bench(lost_comms_s=lost_comms_s).ready()
    query = imcpy.QueryEntityParameters()
    query.name = "Lost Comms"
    bench.say(query)
    told = {p.name: p.value for reply in bench.all(imcpy.EntityParameters) for p in reply.params}
    assert told == ({} if lost_comms_s == 0.0 else {"Plan Name": "lostcomms", "Lost Comms Timeout": "45"})
