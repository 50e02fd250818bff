"""Measurements in, waypoints out: what a vehicle that speaks REST does."""

from typing import Annotated

from fastapi import APIRouter, Header, Query, Request, Response

from app.api.access.auth import VehicleOrOperator, check_vehicle
from app.api.bodies.json_route import JsonRoute
from app.api.http.first_completed import first_of
from app.api.http.problems import ProblemError, body_problems, problems
from app.api.mission import Mission
from app.api.schemas import API, MeasurementBatch, VehicleName
from app.api.state import Service
from app.missions.operations.measurements import measure
from app.missions.operations.polling import waypoint
from app.missions.soundings.measurement import Measurement
from app.missions.views.measurements.soundings import BatchVerdict, with_unreadable
from app.missions.views.mission import WaypointView

router = APIRouter(
    route_class=JsonRoute,
    prefix=f"{API}/missions/{{mission_id}}",
    tags=["vehicles"],
    responses=problems("unauthenticated", "forbidden"),
)

MAX_WAIT_S = 60.0


@router.post(
    "/measurements",
    operation_id="postMeasurements",
    summary="Post measurements",
    responses=body_problems("mission-not-found", "conflict"),
)
async def post_measurements(
    batch: MeasurementBatch,
    vehicle: VehicleOrOperator,
    mission: Mission,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1,
            max_length=128,
            pattern=r"^[\x21-\x7e]+$",
            description="Name of this batch, made by the sender. Sent again by the same sender with the same key and "
            "content, nothing is stored twice and the first answer is given again",
            examples=["lauv-xplore-1-000042"],
        ),
    ] = None,
) -> BatchVerdict:
    """Store a batch of soundings and position reports.

    Each item has its own verdict: an item that cannot be read or is not plausible is rejected with the reason, the
    others are stored. Whatever is counted as accepted is stored for good.
    """
    readable = [item for item in batch.items if isinstance(item, Measurement)]
    for item in readable:
        check_vehicle(vehicle, item.vehicle)
    answer = await measure(mission, readable, idempotency_key=idempotency_key, sender=vehicle.identity)
    return with_unreadable({i: item for i, item in enumerate(batch.items) if isinstance(item, str)}, answer)


@router.get(
    "/vehicles/{name}/waypoint",
    operation_id="getWaypoint",
    summary="Fetch a vehicle's waypoint",
    response_model=WaypointView,
    responses=problems("mission-not-found", "vehicle-not-found", "conflict", "invalid-request", "not-ready")
    | {204: {"description": "Nothing newer than `after_step` within `timeout_s`: ask again"}},
)
async def get_waypoint(
    name: VehicleName,
    request: Request,
    service: Service,
    vehicle: VehicleOrOperator,
    mission: Mission,
    after_step: Annotated[
        int | None,
        Query(
            ge=0,
            lt=2**31,
            description="Step of the newest waypoint that the vehicle has: only a newer one is sent",
        ),
    ] = None,
    timeout_s: Annotated[
        float,
        Query(ge=0, le=MAX_WAIT_S, allow_inf_nan=False, description="How long to wait for one, wall-clock seconds"),
    ] = 25.0,
) -> Response:
    """Wait for the vehicle's next waypoint (long poll). Fetching a waypoint acknowledges it."""
    check_vehicle(vehicle, name)
    found: WaypointView | None = None
    stopped = service.vehicles_stopped
    if timeout_s == 0.0 and not stopped.is_set():
        return _answer(await waypoint(mission, name, after_step=after_step))

    async def fetch() -> None:
        nonlocal found
        found = await waypoint(mission, name, after_step=after_step, timeout_s=timeout_s)

    async def leave() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass

    # A vehicle that left must not be taken to have acknowledged: the wait ends with its connection. When the service
    # ends it goes on until those that follow were told to stop.
    if await first_of(fetch(), leave(), stopped.wait()) == 2:
        raise ProblemError(
            "not-ready", "the service is shutting down", remedy="Ask again", headers={"Retry-After": "2"}
        )
    return _answer(found)


def _answer(found: WaypointView | None) -> Response:
    if found is None:
        return Response(status_code=204)
    return Response(found.model_dump_json(), media_type="application/json")
