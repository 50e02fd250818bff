"""Whole missions through the service, with vehicles simulated in it and vehicles that poll."""

import asyncio
import io
import json
import math
from collections.abc import Callable
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import rasterio
from PIL import Image
from shapely.geometry import Point, Polygon
from sqlalchemy import event, select
from structlog.testing import CapturingLogger

from app.exploration.core.bottom import Bottom
from app.exploration.core.problem import Proposal, Situation
from app.exploration.planner.random_walk import RandomPlanner
from app.exploration.planners import COVERERS, PLANNERS
from app.missions.errors import (
    ConflictError,
    InvalidRequestError,
    MapNotReadyError,
    MissionNotFoundError,
    VehicleNotFoundError,
)
from app.missions.fleet.interface import LinkState, WaypointStatus
from app.missions.live.watchers import feed
from app.missions.maps.products import PRODUCTS
from app.missions.operations.history import events_after, telemetry_of
from app.missions.operations.maps.mission_maps import export, newest_map
from app.missions.operations.measurements import measure
from app.missions.operations.polling import waypoint
from app.missions.running.mission_views import planner_views, watched
from app.missions.service import MissionService
from app.missions.settings import ServiceSettings, SimulationSettings
from app.missions.soundings.measurement import Measurement
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleKind, VehicleSpec
from app.missions.states import Action, MissionState, MoveRefusedError
from app.missions.views.measurements.soundings import Verdict
from app.missions.views.messages import EventMessage, MapMessage, SnapshotMessage, StateMessage
from app.missions.views.mission import EventView, Level
from app.storage.database import Database
from app.storage.models import MissionRow, MissionVehicleRow, SoundingRow, StepRow, WaypointRow
from tests.support.missions.harbour import (
    CLOCK_S,
    Harbour,
    Rover,
    act,
    sim_spec,
    state_of,
    until_state,
    until_step,
    view_of,
)
from tests.support.missions.specs import lon_lat, make_spec, rectangle
from tests.support.missions.stored_soundings import soundings_of
from tests.support.waiting import until

S = MissionState

REFUSED = {"s102": "chart datum", "vr.bag": "one size", "tiers.zip": "one size"}
"""Files of a mission without tide and without cells by depth."""


async def step_numbers(database: Database, mission_id: str) -> list[int]:
    async with database.reading() as session:
        rows = await session.scalars(select(StepRow).where(StepRow.mission_id == mission_id).order_by(StepRow.number))
        return [row.number for row in rows]


async def kinds(service: MissionService, mission_id: str) -> list[str]:
    return [line.kind for line in await events_after(await service.get(mission_id))]


async def until_stopped(service: MissionService, mission_id: str, count: int) -> None:
    """The mission's end is written before its vehicles' answers to the stop are."""

    async def told() -> bool:
        return (await kinds(service, mission_id)).count("stop") == count

    await until(told, "every answer to the stop is logged")


async def started(service: MissionService, spec: MissionSpec) -> str:
    mission = await service.create(spec)
    await act(service, mission.id, "start", actor="Ana")
    return mission.id


# Life


async def test_a_vehicle_is_stopped_while_who_joins_waits_for_a_disk(service: MissionService) -> None:
    live = await service.get(await started(service, sim_spec("a", "b", steps=1000)))
    await until_step(service, live.id, 1)
    async with service.database.writing():
        joining = asyncio.create_task(
            service.team_changes.join(live, VehicleSpec(name="c", kind=VehicleKind.SIM), "Ana")
        )
        await asyncio.sleep(0)
        stopping = asyncio.create_task(service.team_changes.stop_one(live, "a", "Bo"))
        await until(lambda: service.hub.info((VehicleKind.SIM, "a")).state is LinkState.READY, "it is stopped")
        assert not joining.done()
    [stop] = await stopping
    await joining
    assert (stop.vehicle, stop.acknowledged) == ("a", True)
    assert sorted(live.team.members) == ["b", "c"]
    await act(service, live.id, "abort")


@pytest.mark.parametrize("action", ["abort", "pause"])
async def test_vehicles_are_stopped_while_who_joins_waits_for_a_disk(service: MissionService, action: str) -> None:
    live = await service.get(await started(service, sim_spec("a", "b", steps=1000)))
    await until_step(service, live.id, 1)
    async with service.database.writing():  # a long transaction: nobody else can write
        joining = asyncio.create_task(
            service.team_changes.join(live, VehicleSpec(name="c", kind=VehicleKind.SIM), "Ana")
        )
        await asyncio.sleep(0)
        stopping = asyncio.create_task(act(service, live.id, action))
        await until(lambda: not any(member.engaged for member in live.team), "the vehicles are stopped")
        assert not joining.done()
        assert live.header.state is S.RUNNING, "that waits"
    await joining
    assert (await stopping).mission.state == {"abort": S.ABORTED, "pause": S.PAUSED}[action]
    assert not any(member.engaged for member in live.team)
    if action == "pause":
        await act(service, live.id, "resume")
        await until(lambda: live.team.members["c"].legs > 0, "all go on, with who joined")
        await act(service, live.id, "abort")


async def test_a_mission_with_a_described_multibeam_runs_to_its_end(service: MissionService) -> None:
    vehicles = [{"name": "a", "kind": "sim", "sensor": "multibeam", "sonar": {"aperture_deg": 90, "beams": 32}}]
    mission_id = await started(service, sim_spec(steps=3, vehicles=vehicles))
    ended = await until_state(service, mission_id, S.FINISHED)
    assert ended.progress.step == 3


async def test_a_mission_from_start_to_products(service: MissionService, database: Database) -> None:
    created = await service.create(sim_spec(steps=6))
    assert (created.state, created.progress.step) == (S.READY, 0)
    with pytest.raises(MapNotReadyError):
        await newest_map(await service.get(created.id), service.maps)
    action = await act(service, created.id, "start", actor="Ana")
    assert action.mission.state is S.RUNNING
    await until_state(service, created.id, S.FINISHED)
    await until_stopped(service, created.id, 2)
    soundings = [row for row in await soundings_of(await service.get(created.id)) if row.verdict == "accepted"]
    ended = await view_of(service, created.id)
    assert ended.progress.step == 6
    assert ended.progress.soundings > 50
    assert ended.progress.distance_m > 5
    assert {vehicle.link for vehicle in ended.vehicles} == {LinkState.UNKNOWN}  # simulated: put away
    assert all(vehicle.lat_deg is not None for vehicle in ended.vehicles)
    assert await step_numbers(database, created.id) == [1, 2, 3, 4, 5, 6]

    area = Polygon(ended.spec.local_area())
    async with database.reading() as session:
        waypoints = (await session.scalars(select(WaypointRow))).all()
    assert len(waypoints) == 12
    assert all(area.buffer(1e-3).covers(Point(w.east_m, w.north_m)) for w in waypoints)
    assert {w.status for w in waypoints} <= {"reached", "missed", "acknowledged"}
    assert len(soundings) == ended.progress.soundings

    snapshot = await newest_map(await service.get(created.id), service.maps)
    assert snapshot.built.soundings == len(soundings)
    view = snapshot.view()
    assert (view.rows, view.cols, view.step) == (15, 15, 6)
    for extension, kind in PRODUCTS.items():
        if kind.resource != "map":
            continue
        if extension in REFUSED:
            with pytest.raises(ConflictError, match=REFUSED[extension]):
                await export(
                    await service.get(created.id), service.maps, service.settings.provider, service.compute, extension
                )
            continue
        product = await export(
            await service.get(created.id), service.maps, service.settings.provider, service.compute, extension
        )
        assert (product.filename, product.media_type) == (f"quay.{extension}", kind.media_type)
        if extension == "tif":
            with rasterio.open(io.BytesIO(product.content.whole())) as image:
                assert image.shape == (15, 15)
                north_up = snapshot.built.map.depth_m[::-1]
                np.testing.assert_allclose(np.abs(image.read(1)), np.abs(north_up), rtol=1e-5)
        elif extension.endswith("png"):
            assert Image.open(io.BytesIO(product.content.whole())).size > (1, 1)
        elif extension == "geojson":
            features = json.loads(product.content.whole())["features"]
            assert {"area", "track"} <= {f["properties"].get("kind") for f in features}
        elif extension == "csv":
            rows = product.content.whole().decode().splitlines()
            assert len(rows) == 2 + ended.progress.soundings + ended.progress.rejected
        elif extension == "xyz":
            cells = [row for row in product.content.whole().decode().splitlines() if row and not row.startswith("#")]
            assert len(cells) >= 225
    with pytest.raises(InvalidRequestError, match="there is no format 'doc'") as caught:
        await export(await service.get(created.id), service.maps, service.settings.provider, service.compute, "doc")
    assert "tif" in caught.value.remedy


async def test_pausing_stops_the_vehicles_and_resuming_goes_on(service: MissionService, database: Database) -> None:
    mission_id = await started(service, sim_spec(steps=6))
    for step in (1, 2, 4):
        await until_step(service, mission_id, step)
        paused = await act(service, mission_id, "pause", actor="Ana", note="ship ahead")
        assert (paused.mission.state, paused.mission.reason) == (S.PAUSED, "ship ahead")
        assert {stop.vehicle: stop.acknowledged for stop in paused.stops} == {"a": True, "b": True}
        assert {v.link for v in (await view_of(service, mission_id)).vehicles} == {LinkState.READY}
        await act(service, mission_id, "resume", actor="Ana")
    await until_state(service, mission_id, S.FINISHED)
    assert await step_numbers(database, mission_id) == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(("action", "state"), [("abort", S.ABORTED), ("finish", S.FINISHED)])
async def test_ending_a_mission_stops_its_vehicles_and_frees_them(
    service: MissionService, action: Any, state: S
) -> None:
    mission_id = await started(service, sim_spec(steps=500))
    await until_step(service, mission_id, 1)
    ended = await act(service, mission_id, action, actor="Ana")
    assert ended.mission.state is state
    assert [(stop.vehicle, stop.acknowledged) for stop in ended.stops] == [("a", True), ("b", True)]
    assert await service.vehicles() == []  # simulated ones are put away
    assert (await kinds(service, mission_id)).count("stop") == 2
    for refused in Action:
        with pytest.raises(MoveRefusedError) as caught:
            await act(service, mission_id, refused, actor="Ana")
        assert "create a new mission" in caught.value.remedy.lower()
    with pytest.raises(ConflictError, match="takes no more vehicles"):
        await service.team_changes.join(
            await service.get(mission_id), VehicleSpec(name="c", kind="sim"), actor="operator"
        )
    other = await started(service, sim_spec(steps=1))
    await until_state(service, other, S.FINISHED)


@pytest.mark.slow
async def test_a_stop_that_is_not_acknowledged_is_an_alarm(service: MissionService) -> None:
    mission = await service.create(make_spec(steps=50, vehicles=[{"name": "a", "kind": "rest"}]))
    rover = Rover(service, mission.id, "a")
    await rover.post()
    await act(service, mission.id, "start", actor="Ana")
    await until(lambda: rover.poll(), "it was sent somewhere")
    aborted = await act(service, mission.id, "abort", actor="Ana")
    (stop,) = aborted.stops
    assert not stop.acknowledged
    assert "told at its next poll" in stop.detail
    (line,) = [line for line in await events_after(await service.get(mission.id)) if line.kind == "stop"]
    assert line.level is Level.ALARM
    with pytest.raises(ConflictError, match="aborted: stop and hold"):
        await rover.poll()


@pytest.mark.slow
async def test_an_abort_while_the_last_stops_go_out_is_refused_or_stays(service: MissionService) -> None:
    """The end of the flight and an operator's abort at the same time lead to one end, not to both."""
    mission = await service.create(make_spec(steps=1, vehicles=[{"name": "a", "kind": "rest"}]))
    rover = Rover(service, mission.id, "a")
    await rover.post()
    await act(service, mission.id, "start", actor="Ana")
    await until(lambda: rover.poll(), "it was sent somewhere")  # and arrived: the loop ends, the stop waits for a poll
    await until(lambda: service._registry._live[mission.id].flight.halted, "its stop is on the way")
    try:
        await act(service, mission.id, "abort", actor="Ana")
    except MoveRefusedError:
        expected = S.FINISHED
    else:
        expected = S.ABORTED
    await until(lambda: not service._runs, "the flight has ended")
    assert await state_of(service, mission.id) is expected
    states = [line.data["state"] for line in await events_after(await service.get(mission.id)) if line.kind == "state"]
    assert states == ["ready", "running", expected]


@pytest.mark.slow
async def test_a_service_that_is_shut_down_while_a_mission_ends_writes_the_end_first(
    harbour: Harbour, database: Database
) -> None:
    service = harbour.service
    mission = await service.create(make_spec(steps=1, vehicles=[{"name": "a", "kind": "rest"}]))
    rover = Rover(service, mission.id, "a")
    await rover.post()
    await act(service, mission.id, "start", actor="Ana")
    await until(lambda: rover.poll(), "it was sent somewhere")
    await until(lambda: service._registry._live[mission.id].flight.halted, "its stop is on the way")
    await harbour.close()
    async with database.reading() as session:
        row = await session.get(MissionRow, mission.id)
    assert row is not None
    assert (row.state, row.reason) == ("finished", "every step is done")
    assert harbour.database._engine.sync_engine.pool.checkedin() == 0  # type: ignore[attr-defined]


@dataclass
class _Fault:
    step: int


class FailingPlanner(RandomPlanner):
    """Fails in one step."""

    name: ClassVar[str] = "failing"
    fault: ClassVar[_Fault] = _Fault(3)

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        if team.step == self.fault.step:
            raise FloatingPointError("the estimator diverged")
        return super()._decide(team, bottom, seed)


class NowherePlanner(RandomPlanner):
    """Proposes what is no place."""

    name: ClassVar[str] = "nowhere"

    def propose(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        return Proposal(np.full(situation.positions.shape, math.nan), math.nan)


@pytest.fixture
def bad_planners(monkeypatch: pytest.MonkeyPatch) -> None:
    """Known before the service starts, which goes through all planners in a thread of its own."""
    for planner in (FailingPlanner, NowherePlanner):
        monkeypatch.setitem(PLANNERS, planner.name, planner)


async def test_a_planner_that_fails_ends_the_mission_with_the_reason(
    bad_planners: None, service: MissionService, database: Database
) -> None:
    mission_id = await started(service, sim_spec(steps=6, planner={"name": "failing"}))
    ended = await until_state(service, mission_id, S.FAILED)
    assert "the estimator diverged" in ended.reason
    assert ended.progress.step == 2
    assert {v.link for v in ended.vehicles} == {LinkState.UNKNOWN}
    await until_stopped(service, mission_id, 2)
    await until(lambda: service.hub.claimed_by((VehicleKind.SIM, "a")) is None, "its vehicles are free")
    async with database.reading() as session:
        row = await session.get(MissionRow, mission_id)
    assert row is not None
    assert (row.state, "the estimator diverged" in row.reason) == ("failed", True)


async def test_a_planner_that_proposes_nowhere_makes_vehicles_hold(bad_planners: None, service: MissionService) -> None:
    mission_id = await started(service, sim_spec(steps=2, planner={"name": "nowhere"}))
    await until_state(service, mission_id, S.FINISHED)
    notes = [line.message for line in await events_after(await service.get(mission_id)) if line.kind == "safety"]
    assert any("the vehicle holds" in note for note in notes)


# Vehicles


@pytest.mark.slow
async def test_vehicles_join_and_leave_while_a_mission_runs(service: MissionService, database: Database) -> None:
    mission_id = await started(service, sim_spec("a", steps=500, side_m=40.0))
    await until_step(service, mission_id, 1)
    await service.team_changes.join(
        await service.get(mission_id), VehicleSpec(name="late", kind="sim"), actor="operator"
    )
    assert [v.name for v in (await view_of(service, mission_id)).vehicles] == ["a", "late"]

    def flown_by(name: str) -> Callable[[], Any]:
        async def flown() -> bool:
            view = await view_of(service, mission_id)
            return any(w.vehicle == name and w.status is WaypointStatus.REACHED for w in view.waypoints)

        return flown

    await until(flown_by("late"), "the late one reached a waypoint")
    await service.team_changes.take_out(await service.get(mission_id), "a", actor="operator")
    left = await view_of(service, mission_id)
    assert [(v.name, v.active, v.mission_id) for v in left.vehicles] == [("late", True, mission_id), ("a", False, None)]
    step = left.progress.step
    await until_step(service, mission_id, step + 3)
    async with database.reading() as session:
        after = await session.scalars(select(WaypointRow.vehicle).where(WaypointRow.step > step + 1))
        assert set(after) == {"late"}
        slots = {row.name: (row.slot, row.left_at is None) for row in await session.scalars(select(MissionVehicleRow))}
    assert slots == {"a": (0, False), "late": (1, True)}
    assert {v.name: v.mission_id for v in await service.vehicles()} == {"a": None, "late": mission_id}
    await service.team_changes.join(await service.get(mission_id), VehicleSpec(name="a", kind="sim"), actor="operator")
    await until(flown_by("a"), "the one that came back reached a waypoint")
    async with database.reading() as session:
        assert (await session.get(MissionVehicleRow, (mission_id, "a"))).slot == 0
    with pytest.raises(ConflictError, match="takes part already"):
        await service.team_changes.join(
            await service.get(mission_id), VehicleSpec(name="a", kind="sim"), actor="operator"
        )
    with pytest.raises(VehicleNotFoundError, match="'x' takes no part"):
        await service.team_changes.take_out(await service.get(mission_id), "x", actor="operator")
    await act(service, mission_id, "abort", actor="Ana")


async def test_a_draft_becomes_ready_with_its_first_vehicle_and_back(service: MissionService) -> None:
    mission = await service.create(make_spec(vehicles=[]))
    assert (mission.state, mission.reason) == (S.DRAFT, "no vehicle yet")
    with pytest.raises(MoveRefusedError) as caught:
        await act(service, mission.id, "start", actor="Ana")
    assert "Add at least one vehicle" in caught.value.remedy
    live = await service.get(mission.id)
    await service.team_changes.join(live, VehicleSpec(name="a", kind="rest"), actor="operator")
    assert live.header.state is S.READY
    await service.team_changes.take_out(live, "a", actor="operator")
    assert live.header.state is S.DRAFT


@pytest.mark.slow
async def test_a_straggler_does_not_stall_the_others(service: MissionService, database: Database) -> None:
    mission = await service.create(
        sim_spec(
            "a", steps=4, step_deadline_s=80, vehicles=[{"name": "a", "kind": "sim"}, {"name": "stuck", "kind": "rest"}]
        )
    )
    stuck = Rover(service, mission.id, "stuck")
    await stuck.post()
    await act(service, mission.id, "start", actor="Ana")

    async def poll_without_moving() -> None:
        after = None
        while True:
            try:
                found = await waypoint(await service.get(mission.id), "stuck", after_step=after, timeout_s=5)
            except ConflictError:
                return
            after = found.step if found else after
            await measure(await service.get(mission.id), [stuck.item(range_m=None)])

    polling = asyncio.create_task(poll_without_moving())
    await until_state(service, mission.id, S.FINISHED)
    await polling
    assert await step_numbers(database, mission.id) == [1, 2, 3, 4]
    lines = [line for line in await events_after(await service.get(mission.id)) if line.kind == "straggler"]
    assert any("stuck" in line.data["vehicles"] for line in lines)
    async with database.reading() as session:
        fates = {(w.vehicle, w.status): w.reason for w in await session.scalars(select(WaypointRow))}
    assert "not reached within 80 s" in fates["stuck", "missed"]
    assert ("a", "reached") in fates


async def test_a_mission_waits_for_a_vehicle_and_says_so(service: MissionService) -> None:
    mission = await service.create(make_spec(steps=2, step_deadline_s=5, vehicles=[{"name": "a", "kind": "rest"}]))
    await act(service, mission.id, "start", actor="Ana")

    async def complains() -> bool:
        return "waiting" in await kinds(service, mission.id)

    await until(complains, "the mission says that it waits")
    async with Rover(service, mission.id, "a") as rover:
        await until_state(service, mission.id, S.FINISHED)
    assert rover.steps[0] == 1, "it was sent; on a busy machine its second leg may count as missed before it polls"


async def test_a_vehicle_is_in_one_mission_at_a_time(service: MissionService) -> None:
    first = await started(service, sim_spec(steps=500))
    second = await service.create(sim_spec(steps=1))
    with pytest.raises(ConflictError, match=rf"'a' takes part in mission '.+' \({first}\)") as caught:
        await act(service, second.id, "start", actor="Ana")
    assert caught.value.remedy
    assert await state_of(service, second.id) is S.READY
    third = await started(service, sim_spec("c", steps=500))
    with pytest.raises(ConflictError, match=rf"'a' takes part in mission '.+' \({first}\)"):
        await service.team_changes.join(await service.get(third), VehicleSpec(name="a", kind="sim"), actor="operator")
    assert [v.name for v in (await view_of(service, third)).vehicles] == ["c"]
    await act(service, first, "abort", actor="Ana")
    await act(service, third, "abort", actor="Ana")
    await act(service, second.id, "start", actor="Ana")
    await until_state(service, second.id, S.FINISHED)


async def test_a_start_that_fails_half_way_claims_nothing(service: MissionService) -> None:
    vehicles = [{"name": "a", "kind": "sim"}, {"name": "far", "kind": "sim", "start": lon_lat(5000, 0)}]
    mission = await service.create(sim_spec(vehicles=vehicles))
    with pytest.raises(ConflictError, match="'far' cannot be launched") as caught:
        await act(service, mission.id, "start", actor="Ana")
    assert "start" in caught.value.remedy
    assert await state_of(service, mission.id) is S.READY
    other = await started(service, sim_spec("a", steps=1))
    await until_state(service, other, S.FINISHED)
    running = await started(service, sim_spec("b", steps=500))
    with pytest.raises(ConflictError, match="'far' cannot be launched"):
        await service.team_changes.join(
            await service.get(running), VehicleSpec.model_validate(vehicles[1]), actor="operator"
        )
    assert [v.name for v in (await view_of(service, running)).vehicles] == ["b"]
    await act(service, running, "abort", actor="Ana")


async def test_a_terrain_file_that_is_missing_is_named_at_the_start(harbour_closed: Harbour, tmp_path: Path) -> None:
    simulation = SimulationSettings(terrain=tmp_path / "bank.npz")
    service = await harbour_closed.open(simulation=simulation)
    mission = await service.create(sim_spec("a"))
    with pytest.raises(ConflictError, match=r"bank\.npz: no such file") as caught:
        await act(service, mission.id, "start", actor="Ana")
    assert "simulation.terrain" in caught.value.remedy


async def test_a_vehicle_taken_out_is_told_at_its_next_poll(service: MissionService) -> None:
    mission = await service.create(make_spec(steps=500))
    async with Rover(service, mission.id, "a", 5, 5), Rover(service, mission.id, "b", 20, 20) as leaving:
        await act(service, mission.id, "start", actor="Ana")
        await until_step(service, mission.id, 2)
        await service.team_changes.take_out(await service.get(mission.id), "b", actor="operator")
        await until(lambda: leaving.told, "it was told")
        stops = [line for line in await events_after(await service.get(mission.id)) if line.kind == "stop"]
        assert [(line.data["vehicle"], line.data["acknowledged"]) for line in stops] == [("b", True)]
        await act(service, mission.id, "abort", actor="Ana")


async def test_a_vehicle_that_comes_back_later_is_told_that_it_takes_no_part(service: MissionService) -> None:
    mission = await service.create(make_spec(steps=500))
    here = Rover(service, mission.id, "b")
    await here.post()
    async with Rover(service, mission.id, "a"):
        await act(service, mission.id, "start", actor="Ana")
        await until(lambda: here.poll(), "it was sent somewhere")
        removing = asyncio.create_task(
            service.team_changes.take_out(await service.get(mission.id), "b", actor="operator")
        )
        await until(lambda: service._registry._live[mission.id].team.get("b") is None, "it is out")
        with pytest.raises(VehicleNotFoundError) as caught:
            await here.poll()
        assert "stop" in caught.value.remedy
        await removing
        (line,) = [line for line in await events_after(await service.get(mission.id)) if line.kind == "stop"]
        assert line.data["acknowledged"]
        await act(service, mission.id, "abort", actor="Ana")


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"planner": {"name": "oracle"}}, "planner.name"),
        ({"planner": {"name": "osarses"}}, "planner.name"),
        ({"vehicles": [{"name": "a", "kind": "imc"}]}, "vehicles.0.kind"),
        ({"vehicles": [{"name": "a", "kind": "rest", "depth_m": 31}]}, "vehicles.0.depth_m"),
    ],
)
async def test_what_cannot_be_flown_is_refused_by_field_and_not_stored(
    service: MissionService, changes: dict[str, Any], field: str
) -> None:
    with pytest.raises(InvalidRequestError) as caught:
        await service.create(make_spec(**changes))
    assert caught.value.field == field
    assert caught.value.remedy
    assert await service.missions() == []


async def test_what_does_not_exist_is_not_found(service: MissionService) -> None:
    with pytest.raises(MissionNotFoundError, match="'x'"):
        await service.get("x")
    with pytest.raises(MissionNotFoundError, match="'x'"):
        await service.check_exists("x")


# Measurements


async def rest_mission(service: MissionService) -> tuple[str, Rover]:
    mission = await service.create(make_spec(vehicles=[{"name": "a", "kind": "rest"}, {"name": "s", "kind": "sim"}]))
    return mission.id, Rover(service, mission.id, "a")


async def stored(database: Database) -> list[SoundingRow]:
    async with database.reading() as session:
        return list((await session.scalars(select(SoundingRow).order_by(SoundingRow.id))).all())


async def test_every_item_of_a_batch_has_its_verdict(service: MissionService, database: Database) -> None:
    mission_id, rover = await rest_mission(service)
    good = rover.item()
    items = [
        good,
        rover.item(range_m=-1.0),
        rover.item(range_m=None),
        good,
        rover.item(vehicle="x"),
        rover.item(vehicle="s"),
        rover.item(lat_deg=95.0),
        rover.item(lon_deg=171.0, lat_deg=-41.0),
        rover.item(depth_m=1e308, range_m=1e308),
        rover.item(range_sd_m=1e300),
        rover.item(beam=3),
    ]
    answer = await measure(await service.get(mission_id), items)
    assert [item.index for item in answer.items] == list(range(len(items)))
    assert [item.verdict for item in answer.items] == [
        Verdict.ACCEPTED,
        Verdict.REJECTED,
        Verdict.ACCEPTED,
        Verdict.DUPLICATE,
        *[Verdict.REJECTED] * 6,
        Verdict.ACCEPTED,
    ]
    reasons = [item.reason for item in answer.items]
    for index, words in {
        1: "range_m: -1 is not positive",
        2: "position report",
        3: "already stored",
        4: "vehicle: 'x' takes no part",
        5: "only vehicles of kind rest post",
        6: "lat_deg: 95.0",
        7: "within 200 km",
        8: "depth_m: inf is not a finite number",
        9: "depth_sd_m: 1e+300",
    }.items():
        assert words in reasons[index]
    assert (answer.accepted, answer.rejected, answer.duplicate) == (3, 7, 1)
    assert [row.verdict for row in await stored(database)] == ["accepted", "rejected", "rejected", "accepted"]
    progress = (await view_of(service, mission_id)).progress
    assert (progress.soundings, progress.rejected) == (2, 2)
    assert (await newest_map(await service.get(mission_id), service.maps)).built.soundings == 2


async def test_an_item_that_cannot_be_stored_does_not_shadow_a_good_one(
    service: MissionService, database: Database
) -> None:
    mission_id, rover = await rest_mission(service)
    good = rover.item()
    bad = good.model_copy(update={"depth_m": 1e308, "range_m": 1e308})
    answer = await measure(await service.get(mission_id), [bad, good])
    assert [item.verdict for item in answer.items] == [Verdict.REJECTED, Verdict.ACCEPTED]
    assert [row.verdict for row in await stored(database)] == ["accepted"]
    assert (await view_of(service, mission_id)).progress.soundings == 1


async def test_a_batch_sent_again_is_stored_once(service: MissionService, database: Database) -> None:
    mission_id, rover = await rest_mission(service)
    items = [rover.item() for _ in range(5)]
    live = await service.get(mission_id)
    answers = await asyncio.gather(*(measure(live, items, idempotency_key="k1") for _ in range(8)))
    assert sum(not answer.replayed for answer in answers) == 1
    assert {answer.accepted for answer in answers} == {5}
    assert len(await stored(database)) == 5
    assert (await measure(await service.get(mission_id), items)).duplicate == 5
    with pytest.raises(ConflictError, match="'k1' was used before with other measurements") as caught:
        await measure(await service.get(mission_id), [rover.item()], idempotency_key="k1")
    assert "new key" in caught.value.remedy
    assert len(await stored(database)) == 5


async def test_batches_at_the_same_time_are_all_stored(service: MissionService, database: Database) -> None:
    mission_id, rover = await rest_mission(service)
    batches = [[rover.item() for _ in range(10)] for _ in range(20)]
    live = await service.get(mission_id)
    answers = await asyncio.gather(*(measure(live, batch) for batch in batches))
    assert sum(answer.accepted for answer in answers) == 200
    assert len(await stored(database)) == 200
    assert (await view_of(service, mission_id)).progress.soundings == 200


async def test_what_waits_together_is_answered_as_if_it_had_come_one_by_one(
    service: MissionService, database: Database
) -> None:
    mission_id, rover = await rest_mission(service)
    first, second, third = rover.item(), rover.item(), rover.item()
    unreadable = third.model_copy(update={"lat_deg": 91.0})
    orders = [("k1", [first]), ("k2", [first, second]), ("k1", [first]), ("k1", [third]), (None, [unreadable, third])]
    live = await service.get(mission_id)
    found = await asyncio.gather(
        *(measure(live, items, idempotency_key=key) for key, items in orders),
        return_exceptions=True,
    )
    one, two, again, other, last = found
    assert isinstance(other, ConflictError)
    verdicts = [[str(item.verdict) for item in getattr(answer, "items", [])] for answer in (one, two, again, last)]
    assert verdicts == [["accepted"], ["duplicate", "accepted"], ["accepted"], ["rejected", "accepted"]]
    assert [getattr(answer, "replayed", None) for answer in (one, two, again, last)] == [False, False, True, False]
    assert [item.index for item in getattr(last, "items", [])] == [0, 1]
    assert len(await stored(database)) == 3


async def test_a_draft_takes_no_measurements_and_too_many_are_refused(service: MissionService) -> None:
    draft = await service.create(make_spec(vehicles=[]))
    with pytest.raises(ConflictError, match="draft"):
        await measure(await service.get(draft.id), [])
    mission_id, rover = await rest_mission(service)
    item = rover.item()
    with pytest.raises(InvalidRequestError, match="10001 items") as caught:
        await measure(await service.get(mission_id), [item] * 10_001)
    assert caught.value.remedy


async def test_a_position_on_the_other_side_of_the_earth_harms_nobody(service: MissionService) -> None:
    mission = await service.create(make_spec(steps=3, vehicles=[{"name": "a", "kind": "rest"}]))
    lost = Measurement(vehicle="a", time_s=CLOCK_S - 1, lat_deg=-41.0, lon_deg=171.0, depth_m=0.0)
    await measure(await service.get(mission.id), [lost])
    await act(service, mission.id, "start", actor="Ana")
    answer = await measure(await service.get(mission.id), [lost])
    assert "within 200 km" in answer.items[0].reason
    async with Rover(service, mission.id, "a"):
        await until_state(service, mission.id, S.FINISHED)


# Recovery


@pytest.mark.slow
async def test_a_restart_goes_on_after_the_last_step(harbour: Harbour, database: Database) -> None:
    mission_id = await started(harbour.service, sim_spec(steps=8))
    for step in (1, 3, 5):
        await until_step(harbour.service, mission_id, step)
        before = (await view_of(harbour.service, mission_id)).progress
        await harbour.reopen()
        after = (await view_of(harbour.service, mission_id)).progress
        assert after.step >= before.step
        assert after.soundings >= before.soundings
        assert await state_of(harbour.service, mission_id) in (S.RUNNING, S.FINISHED)
    await until_state(harbour.service, mission_id, S.FINISHED)
    await until_stopped(harbour.service, mission_id, 2)
    assert await step_numbers(database, mission_id) == list(range(1, 9))
    assert (await kinds(harbour.service, mission_id)).count("resumed") >= 1
    verdicts = [row.verdict for row in await soundings_of(await harbour.service.get(mission_id))]
    ended = await view_of(harbour.service, mission_id)
    assert ended.progress.soundings == verdicts.count("accepted")


async def test_the_log_of_a_service_that_ends_says_who_was_stopped(
    harbour: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    mission_id = await started(harbour.service, sim_spec("a", "b", steps=50))
    await until_step(harbour.service, mission_id, 1)
    log = CapturingLogger()
    monkeypatch.setattr("app.missions.service.log", log)
    await harbour.close()
    said = [call.args[0] for call in log.calls if call.method_name == "info"]
    assert said == [f"the service ends: {name} acknowledged the stop" for name in ("a", "b")]


async def test_a_paused_mission_is_paused_after_a_restart_and_keeps_its_vehicles(harbour: Harbour) -> None:
    mission_id = await started(harbour.service, sim_spec(steps=3))
    await act(harbour.service, mission_id, "pause", actor="Ana")
    service = await harbour.reopen()
    assert await state_of(service, mission_id) is S.PAUSED
    other = await service.create(sim_spec("a", steps=1))
    with pytest.raises(ConflictError, match="takes part in mission"):
        await act(service, other.id, "start", actor="Ana")
    await act(service, mission_id, "resume", actor="Ana")
    await until_state(service, mission_id, S.FINISHED)


@pytest.mark.parametrize(
    "moment", [pytest.param(moment, marks=[pytest.mark.slow] if moment % 2 else []) for moment in range(2, 40, 5)]
)
async def test_a_loop_cancelled_at_any_write_goes_on_without_repeating_a_step(
    moment: int, harbour: Harbour, database: Database
) -> None:
    mission_id = await started(harbour.service, sim_spec("a", steps=4))
    writes = 0
    cut = asyncio.Event()

    def cancel(_connection: object) -> None:
        nonlocal writes
        writes += 1
        if writes == moment and mission_id in harbour.service._runs:
            harbour.service._runs[mission_id].cancel()
            cut.set()

    engine = harbour.database._engine.sync_engine
    event.listen(engine, "commit", cancel)
    ended = asyncio.create_task(until_state(harbour.service, mission_id, S.FINISHED))
    cutting = asyncio.create_task(cut.wait())
    await asyncio.wait([ended, cutting], return_when=asyncio.FIRST_COMPLETED)
    event.remove(engine, "commit", cancel)
    cutting.cancel()
    if cut.is_set():
        ended.cancel()
        await asyncio.gather(ended, return_exceptions=True)
        await harbour.reopen()
    await until_state(harbour.service, mission_id, S.FINISHED)
    await ended if not ended.cancelled() else None
    assert await step_numbers(database, mission_id) == [1, 2, 3, 4]


@pytest.mark.slow
async def test_a_vehicle_that_only_polls_after_a_restart_is_remembered(harbour: Harbour, database: Database) -> None:
    mission = await harbour.service.create(make_spec(steps=10, vehicles=[{"name": "a", "kind": "rest"}]))
    rover = Rover(harbour.service, mission.id, "a")
    await rover.post()
    await act(harbour.service, mission.id, "start", actor="Ana")
    await until(lambda: rover.poll(), "it was sent somewhere")
    rover.service = await harbour.reopen()
    # It holds where it said it is, and says no more.
    await until(lambda: rover.poll(), "it was sent on")
    assert rover.steps == [1, 2]
    await until(lambda: rover.poll(), "it was sent on")
    await act(harbour.service, mission.id, "abort", actor="Ana")


async def test_a_batch_sent_again_to_a_new_process_tells_where_the_vehicle_is(harbour: Harbour) -> None:
    mission = await harbour.service.create(make_spec(steps=2, vehicles=[{"name": "a", "kind": "rest"}]))
    rover = Rover(harbour.service, mission.id, "a")
    item = rover.item()
    await measure(await harbour.service.get(mission.id), [item], idempotency_key="k")
    service = await harbour.reopen()
    assert (await measure(await service.get(mission.id), [item], idempotency_key="k")).replayed
    assert [(v.name, v.link, v.lat_deg) for v in await service.vehicles()] == [("a", LinkState.READY, item.lat_deg)]
    # A repetition that comes late does not take a vehicle back.
    newer = rover.item(lat_deg=item.lat_deg + 1e-5)
    await measure(await service.get(mission.id), [newer])
    await measure(await service.get(mission.id), [item], idempotency_key="k")
    assert (await service.vehicles())[0].lat_deg == newer.lat_deg


async def test_a_mission_whose_vehicle_cannot_be_launched_any_more_fails_alone(harbour: Harbour, tmp_path: Any) -> None:
    far = await started(
        harbour.service, sim_spec(steps=500, vehicles=[{"name": "z", "kind": "sim", "start": lon_lat(28, 28)}])
    )
    good = await started(harbour.service, sim_spec("a", steps=500))
    path = tmp_path / "small.npz"
    np.savez(path, z=np.full((10, 10), 9.0), cell_m=1.0)
    service = await harbour.reopen(simulation={"terrain": path})
    assert await state_of(service, far) is S.FAILED
    assert "'z' cannot be launched" in (await view_of(service, far)).reason
    assert await state_of(service, good) is S.RUNNING
    await act(service, good, "abort", actor="Ana")


# What watchers see


async def test_a_watcher_gets_a_snapshot_first_and_then_every_event_in_order(service: MissionService) -> None:
    mission = await service.create(sim_spec(steps=3))
    async with watched(await service.get(mission.id)) as messages, asyncio.timeout(90):
        first = await anext(messages)
        assert isinstance(first, SnapshotMessage)
        assert first.mission.state is S.READY
        await act(service, mission.id, "start", actor="Ana")
        seen: list[int] = []
        steps: list[int] = []
        types = set()
        async for message in messages:
            types.add(message.type)
            if isinstance(message, EventMessage):
                seen.append(message.event.id)
            if isinstance(message, StateMessage):
                steps.append(message.mission.progress.step)
            if isinstance(message, EventMessage) and message.event.data.get("state") == "finished":
                break
    assert types >= {"vehicles", "waypoints", "mission", "map", "event"}
    assert steps == sorted(steps)
    stored_events = await events_after(await service.get(mission.id), after=first.last_event_id)
    assert seen == [line.id for line in stored_events][: len(seen)]
    assert seen == sorted(set(seen))


async def test_a_line_whose_writer_is_cancelled_is_seen_if_it_is_stored(service: MissionService) -> None:
    live = await service.get((await service.create(sim_spec(steps=3))).id)
    with live.broadcaster.subscribe() as messages:
        writing = asyncio.create_task(live.journal.log(Level.INFO, "note", "cut off"))
        await asyncio.sleep(0)  # it has begun
        writing.cancel()
        await asyncio.gather(writing, return_exceptions=True)
        await live.journal.log(Level.INFO, "note", "whole")
        told = []
        async for message in messages:
            if isinstance(message, EventMessage):
                told.append(message.event.message)
            if told[-1:] == ["whole"]:
                break
    stored = [line.message for line in await events_after(live)]
    assert [text for text in stored if text in ("cut off", "whole")] == told == ["cut off", "whole"]


async def test_a_crowd_is_told_of_a_new_map_less_often_but_always_of_the_last(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(feed, "CROWD_MAP_S", math.inf)
    mission = await service.create(sim_spec(steps=3))
    async with AsyncExitStack() as crowd, asyncio.timeout(90):
        for _ in range(feed.CROWD - 1):
            await crowd.enter_async_context(watched(await service.get(mission.id)))
        messages = await crowd.enter_async_context(watched(await service.get(mission.id)))
        await act(service, mission.id, "start", actor="Ana")
        told: list[int] = []
        while_running = None
        async for message in messages:
            if isinstance(message, EventMessage) and message.event.data.get("state") == "finished":
                while_running = len(told)
                monkeypatch.setattr(feed, "CROWD_MAP_S", 0.0)
            if isinstance(message, MapMessage):
                told.append(message.version)
                if while_running is not None and message.version > told[0]:
                    break
        assert while_running == 1
        assert told == sorted(told)


async def test_events_are_ordered_and_can_be_taken_up_after_any(harbour: Harbour) -> None:
    mission_id = await started(harbour.service, sim_spec(steps=2))
    await until_state(harbour.service, mission_id, S.FINISHED)

    await until_stopped(harbour.service, mission_id, 2)
    every = await events_after(await harbour.service.get(mission_id))
    assert [line.id for line in every] == sorted({line.id for line in every})
    assert [line.data["state"] for line in every if line.kind == "state"] == ["ready", "running", "finished"]
    for i, line in enumerate(every):
        assert await events_after(await harbour.service.get(mission_id), after=line.id) == every[i + 1 :]
    paged: list[EventView] = []
    while page := await events_after(
        await harbour.service.get(mission_id), after=paged[-1].id if paged else 0, limit=2
    ):
        paged += page
    assert paged == every
    service = await harbour.reopen()
    assert await events_after(await service.get(mission_id)) == every


async def test_what_vehicles_told_while_a_mission_ran_is_kept_for_charts(harbour: Harbour) -> None:
    mission_id = await started(harbour.service, sim_spec(steps=3))
    await until_state(harbour.service, mission_id, S.FINISHED)
    service = await harbour.reopen()
    found = await telemetry_of(await service.get(mission_id), 100)
    assert [vehicle.vehicle for vehicle in found.vehicles] == ["a", "b"]
    assert found.times_s == sorted(found.times_s)
    for vehicle in found.vehicles:
        depths = [depth for depth in vehicle.depth_m if depth is not None]
        assert len(vehicle.age_s) == len(found.times_s) >= 1
        assert depths
        assert all(0 <= depth < 20 for depth in depths)
    assert (await telemetry_of(await service.get((await service.create(make_spec())).id), 100)).times_s == []


async def test_missions_are_listed_newest_first_and_survive_leaving_memory(service: MissionService) -> None:
    made = [await service.create(make_spec(name=f"M{i}")) for i in range(14)]
    for mission in made:
        await act(service, mission.id, "abort", actor="Ana")
    assert [m.name for m in await service.missions()] == [f"M{i}" for i in reversed(range(14))]
    assert all(m.state is S.ABORTED for m in await service.missions())


async def test_readiness_and_planners(service: MissionService) -> None:
    assert await service.ready() == (True, {"links": "ok", "watch": "ok", "database": "ok"})
    planners = {planner.name: planner for planner in planner_views()}
    assert set(planners) == {*PLANNERS, *COVERERS}
    assert all(planner.summary and "properties" in planner.options for planner in planners.values())


async def test_the_real_sea_floor_is_mapped_as_it_is(
    terrains: Any, harbour: Harbour, make_settings: Callable[..., ServiceSettings]
) -> None:
    from simulator.floors.terrain_files import load_terrain

    path = terrains / "leixoes_slope.npz"
    service = await harbour.reopen(simulation={"terrain": path})
    terrain = load_terrain(path)
    lat, lon = terrain.frame.to_geodetic(0.0, 0.0)
    spec = sim_spec(steps=8)
    if terrain.origin_lat_deg is not None:
        frame_shift = np.array([lon, lat]) - np.array(lon_lat(0, 0))
        ring = (np.array(rectangle(5, 5, 35, 35)["coordinates"][0]) + frame_shift).tolist()
        spec = sim_spec(steps=8, area={"type": "Polygon", "coordinates": [ring]})
    mission_id = await started(service, spec)
    await until_state(service, mission_id, S.FINISHED)
    rows = [row for row in await soundings_of(await service.get(mission_id)) if row.verdict == "accepted"]
    errors = [row.depth_m - terrain.depth_at_point(*terrain.frame.to_local(row.lat_deg, row.lon_deg)) for row in rows]
    errors = [error for error in errors if math.isfinite(error)]
    assert len(errors) > 30
    assert abs(np.median(errors)) < 0.2
