"""Vehicles that survey no more, and for which no way leads home."""

from typing import Any

import pytest

from app.missions.alarm_kinds import AlarmKind
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.dispatch import Dispatch
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.way_home import withdrawals
from app.missions.flight.way_home.withdrawals import Withdrawals
from app.missions.live.mission import LiveMission
from app.missions.service import MissionService
from app.missions.spec.failsafes import Response
from app.missions.task.constraints import make_constraints
from tests.support.missions.harbour import sim_spec
from tests.support.missions.on_legs import put_on_legs
from tests.support.missions.specs import lon_lat


@pytest.fixture
async def called_home(service: MissionService, monkeypatch: pytest.MonkeyPatch) -> tuple[LiveMission, Withdrawals]:
    """A mission whose one vehicle was called home, where no way leads."""
    monkeypatch.setattr(withdrawals, "way_past_berths", lambda *_: None)
    spec = sim_spec("a", side_m=60.0, recovery={"point": lon_lat(10.0, 10.0)})
    live = await service.get((await service.create(spec)).id)
    put_on_legs(live, "a", (50.0, 50.0))
    live.withdraw(live.team.named("a"), Response.RETURN, "low energy")
    constraints = make_constraints(spec)
    leg_commit = LegCommit(live, constraints, leads=False)
    dispatch = Dispatch(live, service.hub, leg_commit, 1.0, persistent=True)
    energy_range = EnergyRange(live, constraints, leg_commit)
    return live, Withdrawals(live, service.hub, leg_commit, dispatch, energy_range, 1.0)


async def test_a_vehicle_that_no_way_leads_home_for_comes_up(called_home: tuple[LiveMission, Withdrawals]) -> None:
    live, leading = called_home
    await leading.look()
    withdrawal = live.team.named("a").withdrawal
    assert withdrawal is not None
    assert withdrawal.response is Response.SURFACE


async def test_one_that_is_stopped_while_that_is_written_down_stays_stopped(
    called_home: tuple[LiveMission, Withdrawals], monkeypatch: pytest.MonkeyPatch
) -> None:
    live, leading = called_home
    member, alarm = live.team.named("a"), live.journal.alarm

    async def stopped_meanwhile(kind: AlarmKind, *arguments: Any, **more: Any) -> None:
        await alarm(kind, *arguments, **more)
        live.withdraw(member, Response.STOP, "Ana wants it", asked=True)

    monkeypatch.setattr(live.journal, "alarm", stopped_meanwhile)
    await leading.look()
    assert member.withdrawal is not None
    assert member.withdrawal.response is Response.STOP
