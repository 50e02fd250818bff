"""What is taken for a failure of a vehicle, and what is not."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from app.missions.clock import told_by
from app.missions.fleet.hub import FleetHub, VehicleKey
from app.missions.fleet.interface import LinkState, Position, VehicleInfo, VehicleRefusedError, VehicleReport
from app.missions.flight.legs.commit import LegCommit
from app.missions.flight.legs.energy_range import EnergyRange
from app.missions.flight.way_home.failsafe_watch import FailsafeWatch
from app.missions.live.mission import LiveMission
from app.missions.operations.history import events_after
from app.missions.recovery import failsafes
from app.missions.recovery.failsafes import TABLE
from app.missions.service import MissionService
from app.missions.settings import AisSettings
from app.missions.spec.failsafes import Failsafe
from app.missions.task.constraints import make_constraints
from app.missions.traffic.watch import SILENCE_S, Traffic
from app.missions.views.mission import Level
from tests.support.missions.harbour import act, sim_spec, until_step
from tests.support.missions.specs import lon_lat
from tests.support.waiting import until


def watch_of(live: LiveMission, service: MissionService) -> FailsafeWatch:
    constraints = make_constraints(live.spec)
    energy_range = EnergyRange(live, constraints, LegCommit(live, constraints, leads=True))
    return FailsafeWatch(live, service.hub, energy_range, 1.0)


async def test_one_whose_way_home_cannot_be_told_keeps_nobody_from_looking_after_the_others(
    service: MissionService,
) -> None:
    recovery = {"point": lon_lat(2, 2)}
    live = await service.get((await service.create(sim_spec("a", "b", recovery=recovery))).id)
    a, b = live.team.members["a"], live.team.members["b"]
    lon, lat = lon_lat(20, 20)
    for member in (a, b):
        member.report = VehicleReport(member.name, 0.0, Position(lat, lon, 2.0))
    # As a description of before this was checked has it.
    a.spec = a.spec.model_copy(update={"recovery_point": (lat, lon)})
    watch_of(live, service).look()
    assert a.way_home.corners_m is None
    assert b.way_home.corners_m is not None


@pytest.mark.slow
async def test_only_who_is_heard_can_follow_another_console(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A vehicle that starts anew announces itself before it speaks, and can only be refused meanwhile."""
    info, age_s = FleetHub.info, 40.0

    def told(hub: FleetHub, key: VehicleKey) -> VehicleInfo:
        known = info(hub, key)
        return replace(known, state=LinkState.HEARD, age_s=age_s) if key[1] == "b" else known

    async def refuse(_hub: FleetHub, key: VehicleKey) -> None:
        raise VehicleRefusedError(key[1], "it executes a plan of another console", "Stop that plan")

    mission = await service.create(sim_spec("a", "b", steps=1000))
    live = await service.get(mission.id)
    await act(service, mission.id, "start")
    await until_step(service, mission.id, 2)
    b = live.team.members["b"]
    monkeypatch.setattr(FleetHub, "engage", refuse)
    monkeypatch.setattr(FleetHub, "info", told)
    await until(lambda: bool(b.refusal), "it refuses")
    step = live.header.step
    await until_step(service, mission.id, step + 8)
    assert not [one for one in b.failsafes if one.failsafe is Failsafe.OTHER_CONSOLE]
    age_s = 0.2
    await until(lambda: any(one.failsafe is Failsafe.OTHER_CONSOLE for one in b.failsafes), "somebody else has it")
    await act(service, mission.id, "abort")


@pytest.mark.parametrize("silent", [LinkState.LOST, LinkState.EXPECTED_OFFLINE])
async def test_what_a_silent_vehicle_told_last_is_not_over_until_it_tells_otherwise(
    service: MissionService, monkeypatch: pytest.MonkeyPatch, silent: LinkState
) -> None:
    monkeypatch.setitem(failsafes.TABLE, Failsafe.TOO_DEEP, replace(TABLE[Failsafe.TOO_DEEP], after_s=0.0, over_s=0.0))
    info, state, age_s = FleetHub.info, LinkState.ENGAGED, 0.0
    monkeypatch.setattr(FleetHub, "info", lambda hub, key: replace(info(hub, key), state=state, age_s=age_s))
    live = await service.get((await service.create(sim_spec("a"))).id)
    watch, a = watch_of(live, service), live.team.members["a"]
    a.followed = True

    def in_force(depth_m: float) -> set[Failsafe]:
        lon, lat = lon_lat(20, 20)
        a.report = VehicleReport("a", 0.0, Position(lat, lon, depth_m))
        watch.look()
        return {one.failsafe for one in a.failsafes}

    assert in_force(40.0) == {Failsafe.TOO_DEEP}
    state, age_s = silent, 60.0
    for _ in range(3):
        assert in_force(2.0) == {Failsafe.TOO_DEEP}
    state, age_s = LinkState.ENGAGED, 0.0
    assert in_force(2.0) == set()


@pytest.mark.parametrize(
    ("ahead_s", "silent_s", "told"),
    [(0.0, 0.0, ["a", "b"]), (30.0, 0.0, ["a", "b"]), (0.0, 30.0, [])],
    ids=["their clocks agree", "one clock is ahead", "one was heard long ago"],
)
async def test_vehicles_are_too_close_by_when_they_were_heard_whatever_their_clocks_show(
    service: MissionService, monkeypatch: pytest.MonkeyPatch, ahead_s: float, silent_s: float, told: list[str]
) -> None:
    rule = failsafes.TABLE[Failsafe.SEPARATION_LOST]
    monkeypatch.setitem(failsafes.TABLE, Failsafe.SEPARATION_LOST, replace(rule, after_s=0.0))
    live = await service.get((await service.create(sim_spec("a", "b", limits={"min_separation_m": 5.0}))).id)
    watch = watch_of(live, service)

    async def beside(away_m: float) -> None:
        for name, east_m, clock_s, at_s in (("b", 20.0 + away_m, ahead_s, 0.0), ("a", 20.0, 0.0, silent_s)):
            lat, lon = live.frame.to_geographic(np.array(east_m), np.array(20.0))
            with told_by(lambda at_s=at_s: 1.7e9 + at_s):  # type: ignore[misc]
                report = VehicleReport(name, 1.7e9 + at_s + clock_s, Position(float(lat), float(lon), 2.0))
                live.reports.take(report, live.spec, running=True)
        watch.look()

    for member in live.team:
        member.engaged, member.link, member.committed.legs = True, LinkState.ENGAGED, 1
    await beside(40.0)
    await beside(2.0)
    close = [m.name for m in live.team if any(one.failsafe is Failsafe.SEPARATION_LOST for one in m.failsafes)]
    assert close == told


async def test_that_no_ship_is_heard_any_more_is_a_line_of_the_log(service: MissionService) -> None:
    live = await service.get((await service.create(sim_spec("a"))).id)
    live.ships.traffic = traffic = Traffic(AisSettings(tcp_host="ais", max_age_s=600.0))
    [source] = traffic.sources
    watch, heard_s = watch_of(live, service), asyncio.get_running_loop().time()

    async def told(silent_s: float, trouble: str) -> list[tuple[Level, str]]:
        source.heard_s, source.trouble = heard_s - silent_s, trouble
        watch.look()
        watch.look()
        await live.journal.flush()
        return [(one.level, one.message) for one in await events_after(live, 0, 1000) if one.kind == "traffic"]

    assert await told(0.5 * SILENCE_S, "Connection refused") == []
    assert await told(500.0, "") == []  # few ships
    [(level, words)] = await told(500.0, "Connection refused")
    assert level is Level.WARNING
    assert "no ship is heard by AIS any more (TCP ais:10110: Connection refused)" in words
    assert (await told(0.0, ""))[1:] == [(Level.INFO, "AIS is heard again")]
    assert "nothing for 60" in (await told(601.0, ""))[2][1]


@pytest.mark.parametrize(("at_home", "charged_between_flights"), [(False, False), (True, False), (True, True)])
async def test_low_energy_is_over_once_the_battery_is_charged(
    service: MissionService, at_home: bool, charged_between_flights: bool
) -> None:
    spec = sim_spec("a", recovery={"point": lon_lat(2, 2)})
    vehicles = [vehicle.model_copy(update={"endurance_min": 60.0}) for vehicle in spec.vehicles]
    live = await service.get((await service.create(spec.model_copy(update={"vehicles": vehicles}))).id)
    (a,) = live.team
    watch, wait_s = watch_of(live, service), 0.0
    loop = asyncio.get_running_loop()

    async def told(east_m: float, level_pct: float) -> list[str]:
        """Return what the log says of energy after a vehicle was here with this much for two minutes."""
        nonlocal wait_s
        lon, lat = lon_lat(east_m, 20)
        a.report = VehicleReport("a", wait_s, Position(lat, lon, 2.0), battery_pct=level_pct)
        a.energy.take_level(level_pct)
        for _ in range(3):
            wait_s += 61.0
            watch.look()
        await live.journal.flush()
        return [one.message for one in await events_after(live, 0, 1000) if "energy" in one.message]

    began_s = loop.time()
    watch_clock = pytest.MonkeyPatch()
    watch_clock.setattr(loop, "time", lambda: began_s + wait_s)
    try:
        (low,) = await told(400.0, 12.0)
        assert "for sure, and its way home takes" in low
        if at_home:
            assert a.withdrawal is not None
            a.withdrawal.over = True
        if charged_between_flights:
            watch = watch_of(live, service)
        else:
            assert await told(5.0, 11.9) == [low]
        assert await told(5.0, 90.0) == [low, "a: low energy is over"]
    finally:
        watch_clock.undo()
