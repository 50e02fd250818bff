"""Missions: describing, listing, moving through their states, and their vehicles."""

from collections.abc import Callable
from typing import Annotated, Any

from fastapi import APIRouter, Body, Query, Request, Response
from pydantic import TypeAdapter

from app.api.access.auth import Operator, Reader
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import body_problems, problems
from app.api.mission import Mission
from app.api.peer_lists import from_peers
from app.api.schemas import API, ActionRequest, EndRequest, MissionId, NoteRequest, StartRequest, VehicleName
from app.api.state import Service, State
from app.missions.errors import MissionNotFoundError
from app.missions.operations import history
from app.missions.preflight.survey import preflight
from app.missions.running.homecoming import call_home, hold
from app.missions.running.mission_views import action_view, mission_view
from app.missions.spec.budget import Budget
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleSpec
from app.missions.states import Action
from app.missions.views.mission import ActionView, EventView, MissionSummary, MissionView, PreflightView, StepView
from app.missions.views.telemetry import TelemetryView

router = APIRouter(
    route_class=JsonRoute,
    prefix=f"{API}/missions",
    tags=["missions"],
    responses=problems("unauthenticated", "forbidden"),
)

_summaries = TypeAdapter(list[MissionSummary])

_FOUND = problems("mission-not-found", "invalid-request")
_OF_A_VEHICLE: dict[str, Any] = {
    "responses": problems("mission-not-found", "vehicle-not-found", "conflict", "invalid-request"),
    "tags": ["vehicles"],
}

EXAMPLE_SPEC = {
    "name": "Leixoes quay",
    "area": {
        "type": "Polygon",
        "coordinates": [[[-8.705, 41.185], [-8.7038, 41.185], [-8.7038, 41.1859], [-8.705, 41.1859], [-8.705, 41.185]]],
    },
    "vehicles": [
        {"name": "lauv-xplore-1", "kind": "imc", "sensor": "dvl"},
        {"name": "lauv-xplore-2", "kind": "imc", "sensor": "dvl"},
    ],
    "steps": 100,
    "limits": {"max_step_m": 10, "min_depth_m": 2, "max_depth_m": 8},
    "planner": {"name": "cao"},
}

DescribedMission = Annotated[
    MissionSpec, Body(openapi_examples={"quay": {"summary": "Two IMC vehicles at a quay", "value": EXAMPLE_SPEC}})
]
"""A mission as the body of a request."""


@router.post(
    "",
    operation_id="createMission",
    summary="Describe a new mission",
    status_code=201,
    responses=body_problems("conflict")
    | {201: {"headers": {"Location": {"description": "Path of the mission", "schema": {"type": "string"}}}}},
)
async def create_mission(
    spec: DescribedMission,
    service: Service,
    operator: Operator,
    response: Response,
) -> MissionView:
    """Store a mission. It is a draft until it has a vehicle, then ready to start; nothing moves yet."""
    mission = await service.create(spec, actor=operator.name)
    response.headers["Location"] = f"{router.prefix}/{mission.id}"
    return mission


@router.get(
    "",
    operation_id="listMissions",
    summary="List the missions",
    responses=problems("mission-not-found", "invalid-request"),
)
async def list_missions(
    request: Request,
    state: State,
    service: Service,
    reader: Reader,
    before: Annotated[
        str | None,
        Query(
            min_length=1,
            max_length=64,
            pattern=r"^[A-Za-z0-9_-]+$",
            description="Only missions older than that of this id",
        ),
    ] = None,
    limit: Annotated[
        int | None, Query(ge=1, le=1000, description="Most missions in the answer; all of them unless given")
    ] = None,
) -> list[MissionSummary]:
    """Return every mission, newest first, with its state and progress."""
    # One that ended and that no process has in memory is listed by each.
    found = {one.id: one for one in [*await service.missions(), *await from_peers(request, state, _summaries)]}
    newest = sorted(found.values(), key=lambda mission: (mission.created_at, mission.id), reverse=True)
    if before is None:
        return newest[:limit]
    if before not in found:
        raise MissionNotFoundError(f"there is no mission {before!r} any more", "begin again without `before`")
    older = newest[newest.index(found[before]) + 1 :]
    return older[:limit]


@router.get(
    "/{mission_id}",
    operation_id="getMission",
    summary="See a mission",
    responses=_FOUND,
)
async def get_mission(reader: Reader, mission: Mission) -> MissionView:
    """Return a mission with its description, its vehicles as they are now and their newest waypoints."""
    return mission_view(mission)


@router.put(
    "/{mission_id}",
    operation_id="describeMission",
    summary="Describe a mission anew that has not started",
    responses=body_problems("mission-not-found", "conflict"),
)
async def describe_mission(
    spec: Annotated[MissionSpec, Body()], service: Service, operator: Operator, mission: Mission
) -> MissionView:
    """Replace what a mission in draft or ready is to do, its vehicles included; it keeps its id and its log.

    One that started is refused, and one that was given depths or tides for its area.
    """
    return await service.describe_anew(mission, spec, actor=operator.name)


@router.put(
    "/{mission_id}/budget",
    operation_id="setBudget",
    summary="Change how long a mission is",
    responses=body_problems("mission-not-found", "conflict"),
)
async def set_budget(
    budget: Annotated[Budget, Body(openapi_examples={"longer": {"value": {"minutes": 80}}})],
    service: Service,
    operator: Operator,
    mission: Mission,
) -> MissionView:
    """Make a survey longer or shorter, also while it runs or is paused: vehicles fly on, and what they flew counts.

    The new length counts from the mission's beginning, in the same unit or another one. One that is used up already is
    refused: finish the mission instead. A search is as long as its time window.
    """
    return await service.set_budget(mission, budget, actor=operator.name)


@router.delete(
    "/{mission_id}",
    operation_id="deleteMission",
    summary="Delete a mission that was not flown",
    status_code=204,
    responses=problems("mission-not-found", "conflict", "invalid-request"),
)
async def delete_mission(mission_id: MissionId, service: Service, operator: Operator) -> None:
    """Remove a mission in which no step was taken and nothing measured, with its imports. The audit log keeps who did.

    Any other one is refused: what was measured is kept.
    """
    await service.delete_stored(mission_id)


_ACTION_PROBLEMS = body_problems("mission-not-found", "move-refused", "conflict")

_ACTION_TEXTS = {
    Action.START: (
        "Start a mission",
        "Engage the vehicles and begin the first step. Every vehicle has to be ready; a refusal names what is missing.",
    ),
    Action.PAUSE: (
        "Pause a mission",
        "Stop the vehicles and the steps until resumed. The answer tells which vehicles acknowledged the stop.",
    ),
    Action.RESUME: ("Resume a paused mission", "Engage the vehicles again and go on with the next step."),
    Action.ABORT: (
        "Abort a mission",
        "Stop every vehicle now and end the mission. The answer tells which vehicles acknowledged the stop. With "
        '{"return": true} they go home first.',
    ),
    Action.FINISH: (
        "Finish a mission early",
        "End the mission as finished; its products stay available. Vehicles with a recovery point go home first, "
        'unless the mission says otherwise or {"return": false} is sent: then they stop where they are. A second '
        "finish stops them.",
    ),
}


def _add_action(action: Action) -> None:
    summary, description = _ACTION_TEXTS[action]

    async def act(
        service: Service, operator: Operator, mission: Mission, body: ActionRequest | None = None
    ) -> ActionView:
        note = body.note if body is not None else ""
        return await service.act(mission, action, actor=operator.name, note=note)

    async def start(
        service: Service, operator: Operator, mission: Mission, body: StartRequest | None = None
    ) -> ActionView:
        asked = body or StartRequest()
        return await service.start(mission, asked.confirmed, actor=operator.name, note=asked.note)

    async def end(service: Service, operator: Operator, mission: Mission, body: EndRequest | None = None) -> ActionView:
        asked = body or EndRequest()
        return await service.act(mission, action, actor=operator.name, note=asked.note, return_home=asked.return_home)

    endpoints: dict[Action, Callable[..., Any]] = {Action.START: start, Action.ABORT: end, Action.FINISH: end}
    router.add_api_route(
        f"/{{mission_id}}/{action}",
        endpoints.get(action, act),
        methods=["POST"],
        operation_id=f"{action}Mission",
        summary=summary,
        description=description,
        responses=_ACTION_PROBLEMS,
    )


for _action in Action:
    _add_action(_action)


@router.get(
    "/{mission_id}/preflight",
    operation_id="checkMission",
    summary="See what stands before the start",
    responses=_FOUND,
)
async def check_mission(reader: Reader, service: Service, mission: Mission) -> PreflightView:
    """Return the checklist: links, the doctor's findings, batteries, places, depths, area, tide, longest duration."""
    found = preflight(mission, await service.at_sea(), service.doctor().vehicles)
    return found.model_copy(update={"questions": list(service.settings.checklist)})


@router.get(
    "/{mission_id}/steps",
    operation_id="listSteps",
    summary="See what was decided",
    responses=_FOUND,
)
async def list_steps(
    reader: Reader,
    mission: Mission,
    after: Annotated[int, Query(ge=0, lt=2**31, description="Only steps with a larger number")] = 0,
    limit: Annotated[int, Query(ge=1, le=1000, description="Most steps in the answer")] = 1000,
) -> list[StepView]:
    """Return the steps with their figures and with what became of their waypoints, first to last."""
    return await history.steps_after(mission, after, limit)


@router.get(
    "/{mission_id}/telemetry",
    operation_id="getTelemetry",
    summary="See the vehicles' figures over time",
    responses=_FOUND,
)
async def get_telemetry(
    reader: Reader,
    mission: Mission,
    points: Annotated[int, Query(ge=2, le=5000, description="Most moments in the answer, evenly spread")] = 720,
) -> TelemetryView:
    """Return depth, altitude, battery and link age of every vehicle while the mission ran, oldest first."""
    return await history.telemetry_of(mission, points)


@router.post(
    "/{mission_id}/notes",
    operation_id="writeNote",
    summary="Write into the log",
    status_code=201,
    responses=body_problems("mission-not-found"),
)
async def write_note(note: NoteRequest, operator: Operator, mission: Mission) -> EventView:
    """Keep an operator's words in the mission's log, for the next watch."""
    return await history.write_note(mission, note.text.strip(), operator.name)


@router.post(
    "/{mission_id}/vehicles/{name}/abort",
    operation_id="abortVehicle",
    summary="Stop one vehicle",
    **_OF_A_VEHICLE,
)
async def abort_vehicle(name: VehicleName, service: Service, operator: Operator, mission: Mission) -> ActionView:
    """Stop a vehicle now and go on without it; the answer tells whether it acknowledged."""
    return action_view(mission, await service.team_changes.stop_one(mission, name, operator.name))


@router.post(
    "/{mission_id}/vehicles/{name}/return",
    operation_id="returnVehicle",
    summary="Send one vehicle home",
    **_OF_A_VEHICLE,
)
async def return_vehicle(name: VehicleName, operator: Operator, mission: Mission) -> MissionView:
    """Send a vehicle to its recovery point, for a new battery or for good; the others go on with its part."""
    await call_home(mission, name, operator.name)
    return mission_view(mission)


@router.post(
    "/{mission_id}/vehicles/{name}/hold",
    operation_id="holdVehicle",
    summary="Keep one vehicle where it is",
    **_OF_A_VEHICLE,
)
async def hold_vehicle(name: VehicleName, operator: Operator, mission: Mission) -> MissionView:
    """Let a vehicle wait where it is until it is resumed, goes home or its energy asks for that; the others go on."""
    await hold(mission, name, operator.name)
    return mission_view(mission)


@router.post(
    "/{mission_id}/vehicles/{name}/resume",
    operation_id="resumeVehicle",
    summary="Let a vehicle survey again",
    **_OF_A_VEHICLE,
)
async def resume_vehicle(name: VehicleName, service: Service, operator: Operator, mission: Mission) -> MissionView:
    """Let a vehicle go on that went home, for example with a new battery: it joins where the team is."""
    await service.send_on(mission, name, operator.name)
    return mission_view(mission)


@router.post(
    "/{mission_id}/vehicles",
    operation_id="addVehicle",
    summary="Add a vehicle to a mission",
    responses=body_problems("mission-not-found", "conflict"),
    tags=["vehicles"],
)
async def add_vehicle(vehicle: VehicleSpec, service: Service, operator: Operator, mission: Mission) -> MissionView:
    """Let a vehicle take part, also while the mission runs: it joins at the next step."""
    await service.team_changes.join(mission, vehicle, operator.name)
    return mission_view(mission)


@router.post(
    "/{mission_id}/vehicles/{name}/rejoin",
    operation_id="rejoinVehicle",
    summary="Take back a vehicle that left",
    **_OF_A_VEHICLE,
)
async def rejoin_vehicle(name: VehicleName, service: Service, operator: Operator, mission: Mission) -> MissionView:
    """Let a vehicle that was aborted or removed take part again, as it was described: it joins at the next step."""
    await service.team_changes.rejoin(mission, name, operator.name)
    return mission_view(mission)


@router.delete(
    "/{mission_id}/vehicles/{name}",
    operation_id="removeVehicle",
    summary="Take a vehicle out of a mission",
    **_OF_A_VEHICLE,
)
async def remove_vehicle(name: VehicleName, service: Service, operator: Operator, mission: Mission) -> MissionView:
    """Stop the vehicle and go on without it; what it measured stays."""
    await service.team_changes.take_out(mission, name, operator.name)
    return mission_view(mission)
