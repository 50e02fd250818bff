"""The fake node against a recorded session of two real DUNE nodes and a console.

The console's side of the recording is replayed to a fake vehicle in the place of lauv-xplore-1, in simulated time,
and what comes back is compared with what came back then.
"""

import gzip
import json
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import imcpy
import pytest

from simulator.floors import seafloors
from simulator.vehicles.vehicle import VehicleLimits
from tests.support.imc.dune_bench import CONSOLE, CONSOLE_ID, Bench
from tests.support.paths import CAPTURES

CAPTURE = CAPTURES / "udp_session.jsonl.gz"
REAL_ID = 0x001E
REAL = "127.0.0.1:6002"

pytestmark = pytest.mark.skipif(not CAPTURE.is_file(), reason=f"no recorded session at {CAPTURE}")


def recording() -> Iterator[Any]:
    with gzip.open(CAPTURE, "rt") as lines:
        for line in lines:
            row = json.loads(line)
            yield row["t"], row["src"], row["dst"], bytes.fromhex(row["hex"])


@pytest.fixture(scope="module")
def sessions() -> Any:
    """What the console got from the real and from the fake vehicle: lists of (seconds, message)."""
    rows = list(recording())
    begin = rows[0][0]
    origin = (41.185 - 100.0 / 111_070.0, -8.7062 - 100.0 / 83_940.0)
    floor = seafloors.generate("flat", 0, width_m=300, height_m=300, origin=origin)
    floor = type(floor)(0 * floor.z_m + 24.8, 1.0, *origin)
    bench = Bench(floor, start=(100.0, 100.0, 0.0), imc_id=REAL_ID)
    # Asked for 1.2 m/s, the real one made a little more.
    bench.vehicle.vehicle.limits = VehicleLimits(min_speed_mps=1.25)
    bench.run(5.0)
    offset = begin - bench.wall_s
    real, fake = [], []
    for t, src, dst, data in rows:
        if dst == "127.0.0.1:6101" and src == REAL:
            real.append((t - begin, imcpy.Packet.deserialize(data)))
        if src != "127.0.0.1:6101":
            continue
        bench.run(max(0.0, t - offset - bench.wall_s))
        if dst == REAL:
            bench.node.receive(data, CONSOLE)
        elif dst == "127.0.0.1:30100":
            bench.node.on_announce(data, CONSOLE)
    bench.run(5.0)
    fake = [(m.timestamp - 1_000_000.0 - 5.0, m) for m, _ in bench.wire.sent]
    announces = [
        imcpy.Packet.deserialize(data)
        for _, src, dst, data in rows
        if dst == "127.0.0.1:30102" and not src.endswith(":6101")
    ]
    announced = [m for m in announces if m.src == REAL_ID], [m for m, _ in bench.announced.sent]
    return real, fake, announced


def own(session: list[Any], kind: type[Any]) -> list[tuple[float, imcpy.Message]]:
    return [(t, m) for t, m in session if isinstance(m, kind) and m.src == REAL_ID]


def changes(values: Iterator[Any] | list[tuple[int, int]]) -> list[Any]:
    values = list(values)
    return values[:1] + [b for a, b in pairwise(values) if a != b]


def both(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
    kind: type[Any],
    describe: Callable[..., Any],
) -> tuple[Any, ...]:
    real, fake, _ = sessions
    return tuple([describe(m) for _, m in own(session, kind)] for session in (real, fake))


def test_the_announce_has_the_same_form(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
) -> None:
    real, fake = (messages[0] for messages in sessions[2])
    assert (fake.dst, fake.dst_ent, fake.src_ent) == (real.dst, real.dst_ent, real.src_ent)
    assert (fake.sys_type, fake.owner) == (real.sys_type, real.owner)

    def form(message: imcpy.Message) -> Any:
        return [service.partition("uid")[0] for service in message.services.split(";")]

    assert form(fake) == form(real)


def test_the_entities_are_the_same(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
) -> None:
    real, fake = both(sessions, imcpy.EntityList, lambda m: (m.dst, m.src_ent, m.list) if m.dst == CONSOLE_ID else None)
    assert [r for r in fake if r] == [r for r in real if r]


def test_plan_control_answers_are_the_same(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
) -> None:
    real, fake = both(
        sessions,
        imcpy.PlanControl,
        lambda m: (m.type, m.op, m.request_id, m.plan_id, m.info, m.dst, m.dst_ent, m.src_ent, type(m.arg)),
    )
    assert fake == real


def test_vehicle_commands_are_the_same(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
) -> None:
    real, fake = both(
        sessions,
        imcpy.VehicleCommand,
        lambda m: (m.type, m.request_id, m.command, m.info, m.dst, m.dst_ent, m.src_ent, type(m.maneuver)),
    )
    assert fake == real


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        (imcpy.PlanControlState, ("state", "plan_id", "man_id", "man_type", "last_outcome", "plan_progress")),
        (imcpy.VehicleState, ("op_mode", "maneuver_type", "error_count", "error_ents", "flags")),
    ],
    ids=["plan", "vehicle"],
)
def test_states_change_in_the_same_order(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
    kind: type[Any],
    fields: tuple[str, ...],
) -> None:
    def seen(session: Any) -> Any:
        states = changes(tuple(getattr(m, f) for f in fields) for _, m in own(session, kind))
        at_rest = imcpy.PlanControlState.StateEnum.READY, imcpy.VehicleState.OperationModeEnum.SERVICE
        return states[1:] if states[0][0] in at_rest else states

    real, fake, _ = sessions
    assert seen(fake) == seen(real)


def test_the_route_is_followed_through_the_same_states(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
) -> None:
    real, fake = both(sessions, imcpy.FollowRefState, lambda m: (int(m.state), m.proximity))
    assert changes(fake) == changes(real)


def test_references_are_echoed_the_same(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
) -> None:
    def echo(m: Any) -> Any:
        r = m.reference
        return None if r is None else (m.control_src, m.control_ent, r.flags, r.lat, r.lon, r.z.value, r.speed.value)

    real, fake = both(sessions, imcpy.FollowRefState, echo)
    assert fake == real


KINDS = (
    imcpy.Heartbeat,
    imcpy.EstimatedState,
    imcpy.VehicleState,
    imcpy.PlanControlState,
    imcpy.GpsFix,
    imcpy.VehicleMedium,
    imcpy.SimulatedState,
    imcpy.NavigationUncertainty,
    imcpy.Distance,
    imcpy.FollowRefState,
)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_telemetry_comes_from_and_goes_to_the_same_entities(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]], kind: type[Any]
) -> None:
    real, fake = both(sessions, kind, lambda m: (m.src_ent, m.dst, m.dst_ent))
    assert set(fake) == set(real)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_telemetry_comes_as_often(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]], kind: type[Any]
) -> None:
    real, fake, _ = sessions
    counts = [sum(20.0 < t < 200.0 for t, _ in own(session, kind)) for session in (real, fake)]
    assert counts[1] == pytest.approx(counts[0], rel=0.08)


def test_the_same_of_what_the_console_says_comes_back(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
) -> None:
    def relayed(session: Any) -> Any:
        return Counter(type(m).__name__ for t, m in session if m.src == CONSOLE_ID and t > 13.85)

    real, fake, _ = sessions
    expected, found = relayed(real), relayed(fake)
    assert found.pop("Heartbeat") == pytest.approx(expected.pop("Heartbeat"), abs=5)
    assert found == expected


def test_the_vehicle_moves_alike(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
) -> None:
    real, fake, _ = sessions

    def at(session: Any, when: Any) -> Any:
        return min(own(session, imcpy.EstimatedState), key=lambda item: abs(item[0] - when))[1]

    for when, tolerance in ((30.0, 8.0), (45.0, 8.0), (100.0, 15.0)):
        a, b = at(real, when), at(fake, when)
        assert (b.x - 100.0, b.y - 100.0) == pytest.approx((a.x, a.y), abs=tolerance)
        assert b.depth == pytest.approx(a.depth, abs=2.5)


def test_the_uncertainty_grows_and_ends_alike(
    sessions: tuple[list[Any], list[Any], tuple[list[imcpy.Message], list[imcpy.Message]]],
) -> None:
    def outline(session: Any) -> Any:
        series = own(session, imcpy.GpsFix)
        return changes((m.validity, m.satellites, m.type) for _, m in series)

    real, fake, _ = sessions
    assert outline(fake) == outline(real)
