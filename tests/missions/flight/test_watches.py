"""What looks after vehicles of a mission goes on though it fails, and says so."""

import asyncio

import pytest

from app.missions.alarm_kinds import AlarmKind
from app.missions.flight import watches
from app.missions.flight.watches import Watches
from app.missions.flight.way_home.failsafe_watch import FailsafeWatch
from app.missions.operations.history import events_after
from app.missions.service import MissionService
from tests.support.missions.harbour import act, sim_spec
from tests.support.waiting import until

FAILED = [AlarmKind.WATCH_FAILED]


async def test_a_watch_that_fails_begins_anew_and_is_one_alarm_until_it_goes_on(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watches, "BEGIN_ANEW_S", 0.0)
    monkeypatch.setattr(watches, "STEADY_S", 0.01)
    live = await service.get((await service.create(sim_spec())).id)
    failures = [OSError("a disk"), ValueError()]
    told: list[bool] = []

    async def watch() -> None:
        told.append(bool(live.journal.alarms.standing(FAILED)))
        if failures:
            raise failures.pop(0)
        await asyncio.Event().wait()

    keeping = asyncio.create_task(Watches(live).keep("failsafes", watch))
    await until(lambda: len(told) == 3 and not live.journal.alarms.standing(FAILED), "it goes on")
    keeping.cancel()
    await asyncio.gather(keeping, return_exceptions=True)
    assert told == [False, True, True]
    lines = [event.message for event in await events_after(live) if "failsafes: " in event.message]
    assert lines == ["failsafes: it failed and begins anew: a disk", "failsafes: it goes on"]


async def test_failsafes_that_cannot_be_looked_at_are_an_alarm_of_the_mission(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_self: FailsafeWatch) -> None:
        raise ZeroDivisionError

    mission = await service.create(sim_spec(steps=500))
    live = await service.get(mission.id)
    monkeypatch.setattr(FailsafeWatch, "look", fails)
    await act(service, mission.id, "start")
    await until(lambda: bool(live.journal.alarms.standing(FAILED)), "somebody is told")
    await act(service, mission.id, "abort")
    await until(lambda: not live.journal.alarms.standing(FAILED), "it is over with the mission")


async def test_a_watch_ends_with_who_keeps_it(service: MissionService) -> None:
    live = await service.get((await service.create(sim_spec())).id)
    began, ended = asyncio.Event(), asyncio.Event()

    async def watch() -> None:
        try:
            began.set()
            await asyncio.Event().wait()
        finally:
            ended.set()

    keeping = asyncio.create_task(Watches(live).keep("failsafes", watch))
    await began.wait()
    keeping.cancel()
    await asyncio.gather(keeping, return_exceptions=True)
    assert ended.is_set()
