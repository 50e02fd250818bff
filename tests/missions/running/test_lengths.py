"""How long a mission is, changed while it is flown: at once, for everybody, and also after a restart."""

from typing import Any

import numpy as np
import pytest

from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.fleet.interface import WaypointStatus
from app.missions.flown import Phase
from app.missions.live.mission import LiveMission
from app.missions.operations.history import events_after
from app.missions.service import MissionService
from app.missions.spec.budget import Budget
from app.missions.spec.mission import MissionSpec
from app.missions.states import MissionState
from app.missions.team import Member
from app.missions.views.mission import MissionView
from app.storage.database import Database
from app.storage.models import MissionRow, MissionVehicleRow
from app.storage.queries import missions as mission_queries
from tests.support.missions.harbour import Harbour, act, sim_spec, until_state, view_of
from tests.support.missions.searches import search_json
from tests.support.missions.specs import FRAME, lon_lat
from tests.support.waiting import until

pytestmark = pytest.mark.usefixtures("simulated_time")

HOME = lon_lat(50.0, -10.0)
STEP_M = 10.0


def survey(*names: str, **changes: Any) -> MissionSpec:
    """A survey of 100 m by 100 m whose vehicles come home."""
    shape = {"side_m": 100.0, "cell_m": 4.0, "planner": {"name": "lawnmower"}, "recovery": {"point": HOME}}
    limits = {"limits": {"max_step_m": STEP_M, "min_separation_m": 0.0}}
    return sim_spec(*names or ("a", "b"), **(shape | limits | changes))


async def started(service: MissionService, spec: MissionSpec) -> LiveMission:
    mission = await service.create(spec)
    await act(service, mission.id, "start")
    return await service.get(mission.id)


def come_m(member: Member) -> float:
    return member.committed.way_m - member.way_ahead_m(FRAME)


async def until_flown_m(live: LiveMission, metres: float) -> None:
    await until(lambda: min(map(come_m, live.team)) >= metres, f"everybody came {metres:g} m along its legs")


async def change(service: MissionService, live: LiveMission, **budget: float) -> MissionView:
    return await service.set_budget(live, Budget.model_validate(budget), actor="Ana")


async def lines_of(live: LiveMission) -> list[str]:
    return [event.message for event in await events_after(live, 0, 1000) if event.kind == "budget"]


async def way_m(database: Database, mission_id: str) -> dict[str, float]:
    """How far the vehicles were sent together, and not only beyond what they began."""
    async with database.reading() as session:
        return (await mission_queries.committed_way(session, mission_id))[0]


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["lawnmower", "random", "cao"])
async def test_a_longer_mission_flies_on_past_its_old_end(
    service: MissionService, database: Database, planner: str
) -> None:
    live = await started(service, survey(budget={"km_per_vehicle": 0.1}, planner={"name": planner}))
    await until_flown_m(live, 40.0)
    shown = await change(service, live, km_per_vehicle=0.2)
    assert shown.state is MissionState.RUNNING
    assert shown.progress.budget == shown.spec.budget == Budget(km_per_vehicle=0.2)
    assert shown.progress.steps == shown.spec.steps == 20
    assert shown.progress.km_left_per_vehicle is not None
    assert 0.1 < shown.progress.km_left_per_vehicle < 0.18
    assert await lines_of(live) == [
        "the length is 0.2 km per vehicle now, it was 0.1 km per vehicle: changed by Ana",
    ]
    ended = await until_state(service, live.id, MissionState.FINISHED)
    assert {vehicle.phase for vehicle in ended.vehicles} == {Phase.HOME}
    for flown_m in (await way_m(database, live.id)).values():
        assert 160.0 < flown_m < 205.0


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["lawnmower", "random", "cao"])
async def test_a_shorter_mission_ends_where_it_is_to_and_everybody_comes_home(
    service: MissionService, database: Database, planner: str
) -> None:
    live = await started(service, survey(budget={"km_per_vehicle": 0.4}, planner={"name": planner}))
    await until_flown_m(live, 30.0)
    await change(service, live, km_per_vehicle=0.1)
    ended = await until_state(service, live.id, MissionState.FINISHED)
    assert {vehicle.phase for vehicle in ended.vehicles} == {Phase.HOME}
    for flown_m in (await way_m(database, live.id)).values():
        assert 70.0 < flown_m < 100.0 + STEP_M


async def test_legs_ahead_beyond_the_new_end_are_taken_back(service: MissionService, database: Database) -> None:
    live = await started(service, survey("a", budget={"km_per_vehicle": 0.4}))
    [member] = live.team
    await until(lambda: come_m(member) > 20.0 and len(member.ahead) >= 2, "it has legs ahead")
    numbers = {leg.number for leg in member.ahead}
    await change(service, live, km_per_vehicle=round((come_m(member) + 5.0) / 1000, 4))
    await until(lambda: live.legs_fit_length and not member.ahead, "they are taken back")
    await until_state(service, live.id, MissionState.FINISHED)
    async with database.reading() as session:
        rows = await mission_queries.waypoints_between(session, live.id, min(numbers), max(numbers))
    given_up = [row for row in rows if row.reason.startswith("given up: the mission ends after")]
    assert given_up, "one leg may have begun meanwhile"
    assert [(row.status, row.begun) for row in given_up] == [(WaypointStatus.MISSED, False)] * len(given_up)


@pytest.mark.slow
async def test_minutes_may_become_fewer_or_more(service: MissionService) -> None:
    live = await started(service, survey(budget={"minutes": 4}))
    await until_flown_m(live, 30.0)
    longer = await change(service, live, minutes=5)
    assert longer.progress.minutes_left is not None
    assert 4.0 < longer.progress.minutes_left < 5.0
    shorter = await change(service, live, minutes=2)
    assert shorter.progress.minutes_left is not None
    assert longer.progress.minutes_left - shorter.progress.minutes_left == pytest.approx(3.0, abs=0.1)
    await until_state(service, live.id, MissionState.FINISHED)
    for member in live.team:
        assert 100.0 < member.flown.survey_s < 135.0


@pytest.mark.slow
async def test_a_length_may_be_told_in_another_unit(service: MissionService, database: Database) -> None:
    live = await started(service, survey(budget={"minutes": 10}))
    await until_flown_m(live, 30.0)
    by_way = await change(service, live, km_per_vehicle=0.15)
    assert by_way.progress.km_left_per_vehicle is not None
    assert 0.08 < by_way.progress.km_left_per_vehicle < 0.13
    by_steps = await change(service, live, steps=25)
    assert by_steps.progress.budget == Budget(steps=25)
    ended = await until_state(service, live.id, MissionState.FINISHED)
    assert ended.progress.step == 25
    assert ended.reason.startswith("every step is done")


@pytest.mark.slow
async def test_steps_become_more_and_fewer(service: MissionService) -> None:
    live = await started(service, survey(steps=5))
    await until_flown_m(live, 15.0)
    assert (await change(service, live, steps=20)).progress.steps == 20
    await until(lambda: live.header.step > 6, "it flies on past its old end")
    with pytest.raises(InvalidRequestError, match="is used up") as refused:
        await change(service, live, steps=1)
    assert refused.value.field == "steps"
    assert "finish it instead" in refused.value.remedy
    await change(service, live, steps=live.header.step + 1)
    wanted = live.spec.steps
    ended = await until_state(service, live.id, MissionState.FINISHED)
    assert ended.progress.step <= wanted + 1
    assert {vehicle.phase for vehicle in ended.vehicles} == {Phase.HOME}


@pytest.mark.slow
async def test_a_team_that_goes_in_steps_gets_more_of_them(service: MissionService) -> None:
    together = {"limits": {"max_step_m": 5.0, "min_separation_m": 0.0, "com_range_m": 60.0}, "planner": {"name": "cao"}}
    live = await started(service, survey(steps=3, side_m=40.0, **together))
    await until(lambda: live.header.step >= 2, "it flies")
    await change(service, live, steps=5)
    await until(lambda: live.header.step == 5, "it flies on past its old end")
    with pytest.raises(InvalidRequestError, match=r"1 steps comes to 1 steps, and \d are flown"):
        await change(service, live, steps=1)
    ended = await until_state(service, live.id, MissionState.FINISHED)
    assert ended.progress.step == 5


async def test_what_is_used_up_is_refused_and_nothing_changes(service: MissionService) -> None:
    live = await started(service, survey(budget={"minutes": 10}))
    await until_flown_m(live, 60.0)
    with pytest.raises(InvalidRequestError, match=r"0.5 min is used up: [ab] has surveyed \d\.\d min") as refused:
        await change(service, live, minutes=0.5)
    assert refused.value.field == "minutes"
    assert "finish it instead" in refused.value.remedy
    with pytest.raises(InvalidRequestError, match="none would begin"):
        await change(service, live, km_per_vehicle=0.0001)
    assert live.spec.budget == Budget(minutes=10)
    assert not await lines_of(live)
    await change(service, live, minutes=10)
    assert not await lines_of(live), "it is as long as that already"


@pytest.mark.slow
async def test_who_is_home_is_named_and_sent_on(service: MissionService) -> None:
    vehicles = [{"name": n, "kind": "sim", "speed_mps": v} for n, v in {"fast": 2.0, "slow": 0.5}.items()]
    live = await started(service, survey(budget={"km_per_vehicle": 0.08}, vehicles=vehicles))
    fast, slow = live.team
    await until(lambda: fast.withdrawal is not None, "the fast one has flown its way")
    await change(service, live, km_per_vehicle=0.3)
    assert (await lines_of(live))[0].endswith("changed by Ana; fast had flown all: resume who is to survey on")
    assert slow.withdrawal is None
    await until(lambda: fast.is_home, "it is home")
    before_m = fast.committed.way_m
    await service.send_on(live, "fast", "Ana")
    await until(lambda: fast.committed.way_m > before_m + 50.0, "it surveys on")
    ended = await until_state(service, live.id, MissionState.FINISHED)
    assert {vehicle.phase for vehicle in ended.vehicles} == {Phase.HOME}


@pytest.mark.slow
@pytest.mark.parametrize("again", [False, True])
async def test_while_it_is_paused_it_changes_too_also_after_a_restart(
    harbour: Harbour, database: Database, *, again: bool
) -> None:
    service = harbour.service
    live = await started(service, survey("a", budget={"km_per_vehicle": 0.4}))
    await until_flown_m(live, 30.0)
    await act(service, live.id, "pause")
    if again:
        service = await harbour.reopen()
        live = await service.get(live.id)
    before = (await view_of(service, live.id)).progress.km_left_per_vehicle
    shown = await change(service, live, km_per_vehicle=0.1)
    assert shown.state is MissionState.PAUSED
    assert before is not None
    assert shown.progress.km_left_per_vehicle == pytest.approx(before - 0.3, abs=0.012 if again else 0.004)
    await act(service, live.id, "resume")
    await until_state(service, live.id, MissionState.FINISHED)
    [flown_m] = (await way_m(database, live.id)).values()
    assert 70.0 < flown_m < 100.0 + STEP_M


@pytest.mark.slow
@pytest.mark.parametrize("paused", [False, True])
async def test_another_process_goes_on_with_the_new_length(
    harbour: Harbour, database: Database, *, paused: bool
) -> None:
    service = harbour.service
    live = await started(service, survey("a", budget={"minutes": 3}))
    await until_flown_m(live, 30.0)
    if paused:
        await act(service, live.id, "pause")
    shown = await change(service, live, minutes=5)
    async with database.reading() as session:
        row = await session.get_one(MissionRow, live.id)
        vehicle = await session.get_one(MissionVehicleRow, (live.id, "a"))
    assert row.spec["budget"] == {"minutes": 5.0}
    assert "steps" not in row.spec
    assert vehicle.flown is not None
    assert shown.progress.minutes_left is not None
    assert vehicle.flown["left_m"] / live.spec.speed_mps / 60.0 == pytest.approx(shown.progress.minutes_left, abs=0.02)
    service = await harbour.reopen()
    live = await service.get(live.id)
    assert live.spec.budget == Budget(minutes=5)
    left = (await view_of(service, live.id)).progress.minutes_left
    assert left == pytest.approx(shown.progress.minutes_left, abs=0.3)
    if paused:
        await act(service, live.id, "resume")
    await until_state(service, live.id, MissionState.FINISHED)
    [member] = live.team
    assert member.flown.survey_s > 250.0


async def test_nothing_changes_where_it_cannot_be_written(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = await started(service, survey(budget={"minutes": 10}))
    await until_flown_m(live, 10.0)

    def broken(*_: Any) -> None:
        raise OSError("the disk is full")

    with monkeypatch.context() as context:
        context.setattr("app.missions.running.lengths.add_lines", broken)
        with pytest.raises(OSError, match="the disk is full"):
            await change(service, live, minutes=20)
    assert live.legs_fit_length
    assert live.spec.budget == Budget(minutes=10)
    assert (await service.spec(live.id)).budget == Budget(minutes=10)
    await change(service, live, minutes=20)
    assert len(await lines_of(live)) == 1


async def test_corrections_that_change_meanwhile_keep_the_new_length(service: MissionService) -> None:
    live = await started(service, survey(budget={"minutes": 10}))
    was = live.spec
    await change(service, live, minutes=20)
    live.recorrect(was, live.gate.corrections, live.journal.counts)
    assert live.spec.budget == Budget(minutes=20)
    assert live.spec.steps == was.with_budget(Budget(minutes=20)).steps


async def test_a_mission_that_ends_or_has_ended_stays_as_long_as_it_is(service: MissionService) -> None:
    live = await started(service, survey(budget={"minutes": 10}))
    await until_flown_m(live, 10.0)
    await act(service, live.id, "finish")
    with pytest.raises(ConflictError, match="everybody goes home"):
        await change(service, live, minutes=20)
    await until_state(service, live.id, MissionState.FINISHED)
    with pytest.raises(ConflictError, match="the mission is finished: its length stays as it is"):
        await change(service, live, minutes=20)


@pytest.mark.slow
async def test_before_the_start_it_is_simply_another_length(service: MissionService) -> None:
    mission = await service.create(survey(budget={"minutes": 10}))
    live = await service.get(mission.id)
    shown = await change(service, live, steps=7)
    assert (shown.progress.steps, shown.spec.steps, shown.state) == (7, 7, MissionState.READY)
    await act(service, live.id, "start")
    ended = await until_state(service, live.id, MissionState.FINISHED)
    assert ended.progress.step == 7


async def test_a_search_is_as_long_as_its_window(service: MissionService) -> None:
    mission = await service.create(MissionSpec.model_validate(search_json()))
    with pytest.raises(ConflictError, match=r"its length is search\.window_s"):
        await change(service, await service.get(mission.id), steps=5)


def test_budgets_are_told_in_their_units() -> None:
    told = [Budget(minutes=20), Budget(km_per_vehicle=1.5), Budget(steps=30)]
    assert [budget.words for budget in told] == ["20 min", "1.5 km per vehicle", "30 steps"]
    assert np.all([getattr(budget, budget.unit) is not None for budget in told])
