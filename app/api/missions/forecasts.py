"""What is to be expected of a mission before it is started."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request

from app.api.access.auth import Operator
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import body_problems, problems
from app.api.http.while_connected import while_connected
from app.api.mission import Mission
from app.api.missions.missions import DescribedMission
from app.api.schemas import API
from app.api.state import Service
from app.missions.forecast.preview import PlanView
from app.missions.forecast.request import ForecastView

router = APIRouter(
    route_class=JsonRoute, prefix=API, tags=["missions"], responses=problems("unauthenticated", "forbidden")
)

_FloorDepth = Annotated[
    float | None,
    Query(gt=0, le=11_000, allow_inf_nan=False, description="How deep it is where nothing is known; default: a guess"),
]


@router.post(
    "/missions/{mission_id}/forecast",
    operation_id="forecastMission",
    summary="Foretell a mission",
    response_model=ForecastView,
    responses=body_problems("mission-not-found", "conflict"),
)
async def forecast_mission(
    service: Service, operator: Operator, mission: Mission, request: Request, floor_depth_m: _FloorDepth = None
) -> Any:
    """Simulate what is left of a mission, over what was imported of the sea floor and a guess for the rest."""
    return await while_connected(request, service.forecaster.of_mission(mission, floor_depth_m))


@router.post(
    "/forecast",
    operation_id="forecastDescription",
    summary="Foretell a mission that is being described",
    response_model=ForecastView,
    responses=body_problems(),
)
async def forecast_description(
    spec: DescribedMission,
    service: Service,
    operator: Operator,
    request: Request,
    floor_depth_m: _FloorDepth = None,
) -> Any:
    """Simulate a mission that nobody has created, over a sea floor that is guessed. Nothing is stored, nothing moves.

    Takes half a minute or so, on a busy machine a minute or two; a client that does not wait any more ends it.
    """
    return await while_connected(request, service.forecaster.of_description(spec, floor_depth_m))


@router.post(
    "/plan",
    operation_id="previewPlan",
    summary="Plan a mission that is being described",
    response_model=PlanView,
    responses=body_problems(),
)
async def preview_plan(
    spec: DescribedMission,
    service: Service,
    operator: Operator,
    request: Request,
    floor_depth_m: _FloorDepth = None,
) -> Any:
    """Return the lines that a mission would begin with, before anyone creates it. Nothing is stored, nothing moves.

    Takes parts of a second, so it can be asked for while an area is dragged; a client that leaves ends it.
    """
    return await while_connected(request, service.previews.of(spec, floor_depth_m))
