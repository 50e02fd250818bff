"""Missions that follow others, flown by the whole service."""

from collections.abc import Collection
from contextlib import suppress
from typing import Any

import pytest

from app.missions import succession
from app.missions.alarm_kinds import AlarmKind
from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.live.mission import LiveMission
from app.missions.operations.history import events_after
from app.missions.operations.polling import waypoint
from app.missions.preflight.survey import preflight
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from app.missions.states import MissionState
from app.missions.views.mission import CheckStatus, CheckView, PreflightView
from app.storage.database import Database
from app.storage.models import MissionRow
from tests.support.missions.harbour import Harbour, Rover, act, sim_spec, state_of, until_state, until_step, view_of
from tests.support.missions.specs import lon_lat, make_spec, rectangle
from tests.support.waiting import until

EAST = rectangle(60, 0, 90, 30)
S = MissionState


async def two_blocks(service: MissionService, *vehicles: str, **changes: Any) -> tuple[str, str]:
    """Two areas side by side, the second after the first; their ids."""
    first = await service.create(sim_spec(*vehicles, name="West", **changes))
    second = await service.create(sim_spec(*vehicles, name="East", area=EAST, after=first.id, **changes))
    return first.id, second.id


async def said(service: MissionService, mission_id: str) -> list[str]:
    return [event.message for event in await events_after(await service.get(mission_id))]


async def until_said(service: MissionService, mission_id: str, words: str) -> None:
    async def there() -> bool:
        return any(words in message for message in await said(service, mission_id))

    await until(there, words)


async def alarms(service: MissionService, mission_id: str) -> list[tuple[AlarmKind, bool]]:
    return [(a.kind, a.ended_at is None) for a in (await service.get(mission_id)).journal.alarms.open]


async def until_alarms(service: MissionService, mission_id: str, *kinds: tuple[AlarmKind, bool]) -> None:
    """An alarm is shown after its line is written."""

    async def there() -> bool:
        return await alarms(service, mission_id) == list(kinds)

    await until(there, f"alarms are {kinds}")


async def test_a_mission_that_another_one_follows_is_not_deleted(service: MissionService) -> None:
    west, east = await two_blocks(service)
    with pytest.raises(ConflictError, match="'East' is to begin after it"):
        await service.delete_stored(west)
    await service.delete_stored(east)
    await service.delete_stored(west)
    assert await service.rows() == []


@pytest.mark.slow
async def test_a_mission_begins_when_the_one_before_it_was_flown_to_its_end(service: MissionService) -> None:
    west, east = await two_blocks(service)
    assert (await view_of(service, east)).after == west
    await act(service, west, "start")
    await until_state(service, east, S.FINISHED)
    assert await state_of(service, west) is S.FINISHED
    assert "running by service: 'West' was flown to its end" in await said(service, east)
    assert await alarms(service, east) == []


@pytest.mark.slow
async def test_simulated_vehicles_go_on_from_where_the_mission_before_left_them(service: MissionService) -> None:
    west, east = await two_blocks(service, "one", "two")
    await act(service, west, "start")
    await until_state(service, east, S.RUNNING)
    ends = {v.name: v for v in (await view_of(service, west)).vehicles}
    begins = {v.name: v for v in (await view_of(service, east)).vehicles}
    assert begins.keys() == ends.keys() == {"one", "two"}
    for name, end in ends.items():
        begin = begins[name]
        assert begin.lat_deg is not None
        assert begin.lon_deg is not None
        assert end.lat_deg is not None
        assert end.lon_deg is not None
        assert begin.lat_deg == pytest.approx(end.lat_deg, abs=1e-4), "ten metres"
        assert begin.lon_deg == pytest.approx(end.lon_deg, abs=1e-4)
        assert begin.battery_pct is not None
        assert begin.battery_pct < 100.0
    await until_state(service, east, S.FINISHED)


@pytest.mark.slow
async def test_three_missions_are_flown_in_their_order_also_across_a_restart(harbour: Harbour) -> None:
    west, east = await two_blocks(harbour.service)
    third = (await harbour.service.create(sim_spec(name="North", area=rectangle(0, 60, 30, 90), after=east))).id
    await act(harbour.service, west, "start")
    await until_step(harbour.service, west, 2)
    service = await harbour.reopen()
    await until_state(service, third, S.FINISHED)
    began = [
        next(e.time for e in await events_after(await service.get(one)) if "running by" in e.message)
        for one in (west, east, third)
    ]
    assert began == sorted(began)


@pytest.mark.parametrize("how", ["abort", "finish"])
async def test_what_a_person_ended_is_followed_by_nothing(service: MissionService, how: str) -> None:
    west, east = await two_blocks(service, steps=1000)
    await act(service, west, "start")
    await until_step(service, west, 1)
    await act(service, west, how)
    await until_said(service, east, "does not begin by itself: 'West' was not flown to its end")
    assert await state_of(service, east) is S.READY
    assert await alarms(service, east) == [], "who did it knows"
    await act(service, east, "start")
    assert await state_of(service, east) is S.RUNNING, "a person may start it all the same"


async def test_a_mission_that_failed_is_followed_by_nothing(service: MissionService) -> None:
    west, east = await two_blocks(service, steps=1000)
    await act(service, west, "start")
    await until_step(service, west, 1)
    live = await service.get(west)
    live.builder.belief = None  # type: ignore[assignment]
    await until(lambda: live.header.state is S.FAILED, "it failed")
    await until_said(service, east, "was not flown to its end")
    assert await state_of(service, east) is S.READY


@pytest.mark.slow
async def test_a_vehicle_that_was_stopped_on_the_way_keeps_the_next_mission_from_beginning_by_itself(
    service: MissionService,
) -> None:
    west, east = await two_blocks(service, steps=12)
    await act(service, west, "start")
    await until_step(service, west, 1)
    await service.team_changes.stop_one(await service.get(west), "b", "Ana")
    await until_state(service, west, S.FINISHED)
    await until_said(service, east, "does not begin by itself: b left 'West'")
    assert await state_of(service, east) is S.READY
    await until_alarms(service, east, (AlarmKind.NOT_BEGUN, True))
    await act(service, east, "start")
    await until_alarms(service, east, (AlarmKind.NOT_BEGUN, False))


@pytest.mark.slow
async def test_a_vehicle_that_went_home_on_the_way_keeps_the_next_mission_from_beginning_by_itself(
    service: MissionService,
) -> None:
    home = {"point": [-8.705, 41.185], "radius_m": 50}
    west, east = await two_blocks(service, steps=40, recovery=home)
    await act(service, west, "start")
    await until_step(service, west, 1)
    live = await service.get(west)
    assert live.withdraw(next(m for m in live.team if m.name == "b"), "return", "its energy is low")  # type: ignore[arg-type]
    await until_said(service, east, "b did not fly 'West' to its end: its energy is low")
    assert await state_of(service, east) is S.READY


ROVERS = [{"name": "a", "kind": "rest"}]


async def asks(service: MissionService, mission_id: str, flies: Collection[int]) -> None:
    """Be a vehicle that asks until it is told to stop, and flies only some of its legs."""
    live, rover, after = await service.get(mission_id), Rover(service, mission_id, "a"), None
    with suppress(ConflictError):
        while True:
            found = await waypoint(live, "a", after_step=after, timeout_s=1.0)
            if found is not None:
                after = found.step
            if found is not None and found.step in flies:
                await rover.post(lat_deg=found.lat_deg, lon_deg=found.lon_deg)


@pytest.mark.usefixtures("simulated_time")
@pytest.mark.parametrize(
    ("steps", "flies", "words"),
    [
        (4, [1, 3, 4], "running by service: 'West' was flown to its end"),
        (4, [1, 2, 3], "running by service: 'West' was flown to its end"),
        (4, [1], "does not begin by itself: a did not fly 'West' to its end: it missed its last 3 of 4 legs"),
        (3, [1], "does not begin by itself: a did not fly 'West' to its end: it missed its last 2 of 3 legs"),
    ],
)
async def test_a_vehicle_that_missed_its_last_legs_keeps_the_next_mission_from_beginning_by_itself(
    service: MissionService, steps: int, flies: list[int], words: str
) -> None:
    west, east = await two_blocks(service, steps=steps, step_deadline_s=20.0, vehicles=ROVERS)
    await Rover(service, west, "a").post()
    await act(service, west, "start")
    await asks(service, west, flies)
    ended = await until_state(service, west, S.FINISHED)
    assert ended.reason == f"every step is done, but a missed {steps - len(flies)} of its {steps} legs"
    await until_said(service, east, words)
    assert await state_of(service, east) is (S.RUNNING if "running" in words else S.READY)


@pytest.mark.usefixtures("simulated_time")
async def test_legs_that_were_missed_before_a_restart_keep_the_next_mission_from_beginning(harbour: Harbour) -> None:
    west, east = await two_blocks(harbour.service, steps=4, step_deadline_s=20.0, vehicles=ROVERS)
    await Rover(harbour.service, west, "a").post()
    await act(harbour.service, west, "start")
    member = (await harbour.service.get(west)).team.named("a")
    await until(lambda: member.flown.legs_missed > 1, "it missed two legs")
    service = await harbour.reopen()
    await Rover(service, west, "a").post()
    await asks(service, west, [])
    ended = await until_state(service, west, S.FINISHED)
    assert ended.reason == "every step is done, but a missed 4 of its 4 legs"
    await until_said(service, east, "does not begin by itself: a flew no leg of 'West'")
    await until_alarms(service, east, (AlarmKind.NOT_BEGUN, True))


@pytest.mark.slow
async def test_vehicles_that_come_home_at_the_end_go_on_from_there(service: MissionService) -> None:
    home = {"point": [-8.705, 41.185], "radius_m": 50}
    west, east = await two_blocks(service, recovery=home)
    await act(service, west, "start")
    await until_state(service, east, S.FINISHED)
    assert await state_of(service, west) is S.FINISHED


async def test_a_grave_alarm_that_nobody_has_taken_keeps_the_next_mission_from_beginning(
    service: MissionService,
) -> None:
    west, east = await two_blocks(service)
    await act(service, west, "start")
    await until_step(service, west, 1)
    await (await service.get(west)).journal.alarm(AlarmKind.ZONE_ENTERED, "a is in a zone", vehicle="a")
    await until_said(service, east, "does not begin by itself: nobody has acknowledged: a is in a zone")
    assert await state_of(service, east) is S.READY


async def test_no_vehicle_sets_out_whose_every_way_in_is_barred(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(succession, "PATIENCE_S", 0.0)
    zones: dict[str, Any] = {
        "keep_out": [rectangle(36, -60, 54, 90)],
        "limits": {"max_step_m": 8.0, "keep_out_margin_m": 2.0},
    }
    rovers = [{"name": "a", "kind": "rest"}]
    first = await service.create(make_spec(name="West", vehicles=rovers, steps=2, **zones))
    second = await service.create(make_spec(name="East", area=EAST, vehicles=rovers, after=first.id, **zones))
    await act(service, first.id, "start")
    rover = Rover(service, first.id, "a")
    await rover.post()
    with suppress(ConflictError):  # of its last poll, by which the mission has ended
        while await state_of(service, first.id) is S.RUNNING:
            await rover.poll(0.1)
    await until_said(
        service,
        second.id,
        "does not begin by itself: Place of a: it is 50 m from the area, and a keep-out zone bars every",
    )
    assert await state_of(service, second.id) is S.READY
    await until_alarms(service, second.id, (AlarmKind.NOT_BEGUN, True))
    places = [check for check in preflight(await service.get(second.id)).checks if check.id == "place.a"]
    assert [check.status for check in places] == ["problem"]


async def test_a_mission_that_is_described_anew_meanwhile_does_not_begin(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    west, east = await two_blocks(service)
    await act(service, west, "start")
    await until_step(service, west, 1)
    monkeypatch.setattr(succession, "preflight", preflight_with_a_problem)
    await until_said(service, east, "begins as soon as it can: Sea: rough")
    await service.describe_anew(await service.get(east), sim_spec(name="Alone", area=EAST))
    monkeypatch.undo()
    await until(lambda: not service._succession._under_way, "nothing is about to begin")
    assert await state_of(service, east) is S.READY
    assert await alarms(service, east) == []


def preflight_with_a_problem(live: LiveMission) -> PreflightView:
    found = preflight(live)
    rough = CheckView(id="sea", title="Sea", status=CheckStatus.PROBLEM, message="rough")
    return found.model_copy(update={"ready": False, "checks": [*found.checks, rough]})


async def test_the_checklist_says_that_the_vehicles_are_with_the_mission_before(service: MissionService) -> None:
    west, east = await two_blocks(service, steps=1000)
    await act(service, west, "start")
    links = [check for check in preflight(await service.get(east)).checks if check.id == "link.a"]
    assert "begins by itself" in links[0].remedy
    await act(service, west, "abort")


async def test_what_ended_while_no_service_ran_is_told_once(harbour: Harbour, database: Database) -> None:
    west, east = await two_blocks(harbour.service)
    await harbour.close()
    async with database.writing() as session:
        (await session.get_one(MissionRow, west)).state = S.FINISHED
    for _ in range(2):
        service = await harbour.open()
        await until_said(service, east, "'West' was flown to its end while the service restarted")
        await until_alarms(service, east, (AlarmKind.NOT_BEGUN, True))
        assert await state_of(service, east) is S.READY
        await harbour.close()


@pytest.mark.parametrize("anew", [False, True])
async def test_a_mission_follows_one_that_there_is(service: MissionService, anew: bool) -> None:
    mission = await service.create(sim_spec())

    async def describe(spec: MissionSpec) -> None:
        await (service.describe_anew(await service.get(mission.id), spec) if anew else service.create(spec))

    with pytest.raises(InvalidRequestError, match="there is no mission 'nobody'"):
        await describe(sim_spec(after="nobody"))
    over = await service.create(sim_spec(name="Over"))
    await act(service, over.id, "abort")
    with pytest.raises(InvalidRequestError, match="'Over' is aborted already"):
        await describe(sim_spec(after=over.id))


async def test_missions_do_not_follow_each_other_round(service: MissionService) -> None:
    west, east = await two_blocks(service)
    for after in (west, east):
        with pytest.raises(InvalidRequestError, match="follows this one"):
            await service.describe_anew(await service.get(west), sim_spec(after=after))
    kept = await service.describe_anew(await service.get(east), sim_spec(name="Farther east", after=west))
    assert kept.after == west


async def test_the_way_in_takes_nothing_of_a_missions_length(service: MissionService) -> None:
    rovers = [{"name": "a", "kind": "rest"}]
    mission = await service.create(make_spec(vehicles=rovers, budget={"km_per_vehicle": 0.03}))
    live = await service.get(mission.id)
    await act(service, mission.id, "start")
    rover = Rover(service, mission.id, "a", east_m=15, north_m=-60)
    await rover.post()
    assert await rover.poll(5.0)
    [member] = live.team
    assert member.committed.way_m < 60.0, "it comes from 60 m away"
    with suppress(ConflictError):
        while await state_of(service, mission.id) is S.RUNNING:
            await rover.poll(0.1)
    assert 25.0 < member.committed.way_m < 40.0, "as much as was asked for, and a last leg"


@pytest.mark.slow
@pytest.mark.parametrize("length", [{"steps": 3}, {"budget": {"minutes": 0.5}}])
async def test_a_restart_while_everybody_goes_home_changes_nothing_of_how_a_mission_ended(
    harbour: Harbour, length: dict[str, Any]
) -> None:
    recovery = {"point": lon_lat(15.0, -300.0)}
    west, east = await two_blocks(harbour.service, "a", "b", recovery=recovery, **length)
    await act(harbour.service, west, "start")
    live = await harbour.service.get(west)
    await until(lambda: bool(list(live.team)) and not live.team.surveying, "everybody goes home")
    await until(lambda: all(m.withdrawal is not None and m.withdrawal.led for m in live.team), "they are led there")
    service = await harbour.reopen()
    ended = await until_state(service, west, S.FINISHED)
    assert ended.reason == ("every step is done" if "steps" in length else "everybody has flown its way")
    await until_state(service, east, S.RUNNING)
