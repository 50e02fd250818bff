"""A vehicle whose clock is wrong gets the water level of another time, and is told of."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from app.mapping.water.tide_files import parse_tid
from app.missions.fleet.interface import LinkCapabilities, Position, VehicleReport
from app.missions.flight.observation.vehicle_clocks import VehicleClocks
from app.missions.operations.history import events_after
from app.missions.service import MissionService
from tests.support.missions.harbour import sim_spec

NOON = datetime(2026, 6, 1, 12, tzinfo=UTC)
TABLE = parse_tid("\n".join(f"{NOON + timedelta(hours=6 * k - 6):%Y/%m/%d %H:%M} {1.0 + k % 2}" for k in range(3)))


@pytest.mark.parametrize(
    ("ahead_s", "has_table", "time_scale", "told"),
    [
        (-3600.0, True, 1.0, ["60 min behind"]),
        (7200.0, True, 1.0, ["120 min ahead of"]),
        (30.0, True, 1.0, []),
        (-3600.0, False, 1.0, []),
        (-3600.0, True, 10.0, []),
    ],
    ids=["a time zone off", "ahead", "nearly right", "no tide table", "simulated time"],
)
async def test_a_clock_that_is_wrong_is_told_of_once(
    service: MissionService, ahead_s: float, has_table: bool, time_scale: float, told: list[str]
) -> None:
    live = await service.get((await service.create(sim_spec("a"))).id)
    live.gate.corrections.table = TABLE if has_table else None
    [member] = live.team
    member.capabilities = replace(LinkCapabilities(), stays_put=True)
    member.heard_s = NOON.timestamp()
    member.report = VehicleReport("a", NOON.timestamp() + ahead_s, Position(41.185, -8.705, 2.0))
    clocks = VehicleClocks(live, time_scale)
    await clocks.look()
    await clocks.look()
    lines = [event.message for event in await events_after(live, 0, 1000) if event.kind == "clock"]
    assert len(lines) == len(told)
    assert all(words in line for words, line in zip(told, lines, strict=True))
