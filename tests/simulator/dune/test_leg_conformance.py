"""The fake node against a recorded session in which radio ends at the surface: a plan of two Gotos, flown in silence.

The vehicle of the recording lived five times faster than the recording's clock. The console's side is replayed to a
fake one in its place, in simulated time, and what comes back is compared message by message.
"""

import gzip
import json
import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import imcpy
import pytest

from simulator.floors import seafloors
from simulator.vehicles.vehicle import VehicleLimits
from tests.support.imc.dune_bench import CONSOLE, CONSOLE_ID, Bench
from tests.support.paths import CAPTURES

CAPTURE = CAPTURES / "wifi_gap_x5.jsonl.gz"
REAL_ID, REAL, CONSOLE_TEXT = 0x001E, "127.0.0.1:6002", "127.0.0.1:6101"
FASTER = 5.0
HOME_RAD = (0.7188138524338574, -0.15195185533713035)
MARGIN_M = 100.0
RANGE_M = 2000.0
ALWAYS = ("SimulatedState",)
"""DUNE's simulation lets it through where radio does not reach."""

pytestmark = pytest.mark.skipif(not CAPTURE.is_file(), reason=f"no recorded session at {CAPTURE}")


@pytest.fixture(scope="module")
def sessions() -> Any:
    """What the console got from the real and from the fake vehicle: lists of (seconds of the vehicle, message)."""
    with gzip.open(CAPTURE, "rt") as lines:
        rows = [json.loads(line) for line in lines]
    rows = [(row["t"], row["src"], row["dst"], bytes.fromhex(row["hex"])) for row in rows]
    begin = rows[0][0]
    lat, lon = map(math.degrees, HOME_RAD)
    origin = (lat - MARGIN_M / 111_070.0, lon - MARGIN_M / 83_940.0)
    floor = seafloors.generate("flat", 0, width_m=300, height_m=300, origin=origin)
    floor = type(floor)(0 * floor.z_m + 24.8, 1.0, *origin)
    bench = Bench(floor, start=(MARGIN_M, MARGIN_M, 0.0), imc_id=REAL_ID, radio_range_m=RANGE_M)
    # Asked for 1.2 m/s, the real one made a little more.
    bench.vehicle.vehicle.limits = VehicleLimits(min_speed_mps=1.45)
    # The recorded vehicle knew its console when the plan came.
    known = next(data for _, src, dst, data in rows if src == CONSOLE_TEXT and dst == "127.0.0.1:30100")
    bench.node.on_announce(known, CONSOLE)
    bench.run(10.0, bench.beat)
    bench.wire.sent.clear()
    offset_s = bench.wall_s
    real = []
    for t, src, dst, data in rows:
        if dst == CONSOLE_TEXT and src == REAL:
            real.append((FASTER * (t - begin), imcpy.Packet.deserialize(data)))
        if src != CONSOLE_TEXT:
            continue
        bench.run(max(0.0, FASTER * (t - begin) + offset_s - bench.wall_s))
        if dst == REAL:
            bench.node.receive(data, CONSOLE)
        elif dst == "127.0.0.1:30100":
            bench.node.on_announce(data, CONSOLE)
    bench.run(5.0)
    fake = [(m.timestamp - bench.clock.start_s - offset_s, m) for m, _ in bench.wire.sent]
    return real, fake


def own(session: list[Any], kind: type[Any]) -> list[tuple[float, imcpy.Message]]:
    return [(t, m) for t, m in session if isinstance(m, kind) and m.src == REAL_ID]


def changes(values: list[tuple[imcpy.Message | int | str, ...]]) -> list[tuple[imcpy.Message | int | str, ...]]:
    values = list(values)
    return values[:1] + [b for a, b in pairwise(values) if a != b]


def described(sessions: tuple[list[Any], list[Any]], kind: type[Any], describe: Callable[..., Any]) -> tuple[Any, ...]:
    return tuple([describe(m) for _, m in own(session, kind)] for session in sessions)


def test_plan_control_answers_are_the_same(sessions: tuple[list[Any], list[Any]]) -> None:
    real, fake = described(
        sessions,
        imcpy.PlanControl,
        lambda m: (m.type, m.op, m.request_id, m.plan_id, m.info, m.dst, m.dst_ent, m.src_ent, type(m.arg)),
    )
    assert [answer[4] for answer in real] == ["plan loaded", "m0: executing maneuver", "plan completed"]
    # The second maneuver begins where no radio reaches: nobody hears that.
    assert fake == real


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        (imcpy.PlanControlState, ("state", "plan_id", "man_id", "man_type", "last_outcome")),
        (imcpy.VehicleState, ("op_mode", "maneuver_type", "error_count", "error_ents", "flags")),
    ],
    ids=["plan", "vehicle"],
)
def test_states_change_in_the_same_order(
    sessions: tuple[list[Any], list[Any]], kind: type[Any], fields: tuple[str, ...]
) -> None:
    real, fake = described(sessions, kind, lambda m: tuple(getattr(m, field) for field in fields))
    idle = imcpy.PlanControlState.StateEnum.READY, imcpy.VehicleState.OperationModeEnum.SERVICE
    real, fake = ([state for k, state in enumerate(changes(s)) if k or state[0] not in idle] for s in (real, fake))
    assert fake == real


def silences(session: list[Any]) -> list[tuple[float, float]]:
    """Gaps of more than 5 s in what the vehicle says of itself by radio: when they begin and how long they last."""
    heard = [t for t, m in session if m.src == REAL_ID and m.msg_name not in ALWAYS]
    return [(a, b - a) for a, b in pairwise(heard) if b - a > 5.0]


def test_it_is_silent_once_and_about_as_long(sessions: tuple[list[Any], list[Any]]) -> None:
    [(real_begin, real_s)], [(fake_begin, fake_s)] = map(silences, sessions)
    assert fake_begin == pytest.approx(real_begin, abs=8.0)
    assert fake_s == pytest.approx(real_s, rel=0.3)


def test_the_plan_takes_about_as_long(sessions: tuple[list[Any], list[Any]]) -> None:
    def took(session: Any) -> Any:
        answers = own(session, imcpy.PlanControl)
        return answers[-1][0] - answers[0][0]

    real_s, fake_s = map(took, sessions)
    assert fake_s == pytest.approx(real_s, rel=0.25)


@pytest.mark.parametrize(
    # VehicleState is not among them: the real one comes more often, with every new estimate of the time of arrival.
    "kind",
    [imcpy.EstimatedState, imcpy.PlanControlState, imcpy.GpsFix, imcpy.Heartbeat],
)
def test_telemetry_comes_as_often_while_radio_reaches(sessions: tuple[list[Any], list[Any]], kind: type[Any]) -> None:
    def rate(session: Any) -> Any:
        times = [t for t, _ in own(session, kind)]
        steps = [b - a for a, b in pairwise(times) if b - a <= 5.0]
        return len(steps) / sum(steps)

    real_hz, fake_hz = map(rate, sessions)
    assert fake_hz == pytest.approx(real_hz, rel=0.15)


def test_the_command_comes_back_to_its_console(sessions: tuple[list[Any], list[Any]]) -> None:
    def echoed(session: Any) -> Any:
        return [m.serialize_fields() for _, m in session if isinstance(m, imcpy.PlanControl) and m.src == CONSOLE_ID]

    real, fake = map(echoed, sessions)
    assert fake == real


def test_it_ends_at_the_surface_where_it_was_sent(sessions: tuple[list[Any], list[Any]]) -> None:
    def end(session: Any) -> Any:
        state = own(session, imcpy.EstimatedState)[-1][1]
        return state.x, state.y, state.depth

    real, fake = map(end, sessions)
    assert (fake[0] - MARGIN_M, fake[1] - MARGIN_M) == pytest.approx(real[:2], abs=12.0)
    assert fake[2] == pytest.approx(real[2], abs=0.4)
