"""What operators order vehicles to do in the middle of a mission."""

from fastapi import APIRouter

from app.api.access.auth import Operator, Reader
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import problems
from app.api.mission import Mission
from app.api.schemas import API, VehicleName
from app.missions.flight.orders import orders_of
from app.missions.running import vehicle_orders
from app.missions.spec.orders import DenserOrder, GoOrder, RepeatOrder
from app.missions.views.orders import OrderView

router = APIRouter(
    route_class=JsonRoute,
    prefix=f"{API}/missions/{{mission_id}}",
    tags=["vehicles"],
    responses=problems("unauthenticated", "forbidden"),
)

_PLAIN = problems("mission-not-found", "vehicle-not-found", "conflict", "invalid-request")
_SENT = _PLAIN | problems("malformed-body", "body-too-large", "unsupported-media-type")


@router.get(
    "/orders",
    operation_id="listOrders",
    summary="See what vehicles were ordered",
    responses=problems("mission-not-found", "invalid-request"),
)
async def list_orders(reader: Reader, mission: Mission) -> list[OrderView]:
    """Return the orders that operators gave single vehicles, newest first, at most 200."""
    return await orders_of(mission)


@router.post(
    "/vehicles/{name}/go", operation_id="goVehicle", summary="Send one vehicle to a place now", responses=_SENT
)
async def go_vehicle(name: VehicleName, order: GoOrder, operator: Operator, mission: Mission) -> OrderView:
    """Let a vehicle leave its plan, go to a place, then go on where it left; resuming it ends the order."""
    return await vehicle_orders.go(mission, name, order, operator.name)


@router.post(
    "/vehicles/{name}/skip-line",
    operation_id="skipLine",
    summary="Leave out the rest of a vehicle's line",
    responses=_PLAIN,
)
async def skip_line(name: VehicleName, operator: Operator, mission: Mission) -> OrderView:
    """Let a vehicle go on with its next line now; what it leaves out counts as not surveyed."""
    return await vehicle_orders.skip_line(mission, name, operator.name)


@router.post(
    "/vehicles/{name}/repeat-line",
    operation_id="repeatLine",
    summary="Let a vehicle fly a line again",
    responses=_SENT,
)
async def repeat_line(
    name: VehicleName, operator: Operator, mission: Mission, order: RepeatOrder | None = None
) -> OrderView:
    """Let a vehicle fly the line that it is on again, or another of its lines, then go on where it left."""
    return await vehicle_orders.repeat_line(mission, name, order or RepeatOrder(), operator.name)


@router.post("/denser", operation_id="surveyDenser", summary="Survey a part of the area denser", responses=_SENT)
async def survey_denser(order: DenserOrder, operator: Operator, mission: Mission) -> OrderView:
    """Let a vehicle fly closer lines over a part of the area after the legs that it has, then go on with its part."""
    return await vehicle_orders.survey_denser(mission, order, operator.name)
