"""Everything that missions are made of: the vehicles that are heard and the planners that can decide."""

from fastapi import APIRouter, Request
from pydantic import TypeAdapter

from app.api.access.auth import Reader
from app.api.http.problems import problems
from app.api.peer_lists import from_peers
from app.api.schemas import API
from app.api.state import Service, State
from app.missions.running.mission_views import planner_views
from app.missions.views.doctor import DoctorView
from app.missions.views.mission import PlannerView, VehicleView
from app.missions.views.traffic import TrafficView

_views = TypeAdapter(list[VehicleView])


router = APIRouter(prefix=API, responses=problems("unauthenticated", "forbidden"))


@router.get("/vehicles", operation_id="listVehicles", summary="List the vehicles", tags=["vehicles"])
async def list_vehicles(request: Request, state: State, service: Service, reader: Reader) -> list[VehicleView]:
    """Return every vehicle that was heard or takes part in a mission: its link and what is missing, its position."""
    heard = await service.vehicles() + await from_peers(request, state, _views)
    # Several processes may hear the same vehicle: the one that leads it knows it best.
    known = {(view.kind, view.name): view for view in sorted(heard, key=lambda view: view.mission_id is not None)}
    return [view for view in heard if known[view.kind, view.name] is view]


@router.get("/doctor", operation_id="examineLinks", summary="Say what is missing", tags=["vehicles"])
async def examine_links(service: Service, reader: Reader) -> DoctorView:
    """Return what keeps IMC vehicles from working with this service, each finding with its cause and what to do."""
    return service.doctor()


@router.get("/traffic", operation_id="listShips", summary="List the ships about", tags=["vehicles"])
async def list_ships(service: Service, reader: Reader) -> TrafficView:
    """Return the ships that were heard by AIS lately, each with the vehicle near the surface that it comes closest to.

    Each process hears for itself: this is what the one hears that is asked.
    """
    return service.ships()


@router.get("/planners", operation_id="listPlanners", summary="List the planners", tags=["planners"])
async def list_planners(reader: Reader) -> list[PlannerView]:
    """Return the planners that a mission may name, each with the JSON schema of its options."""
    return planner_views()
