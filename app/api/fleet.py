"""Everything that missions are made of: the vehicles that are heard and the planners that can decide."""

from fastapi import APIRouter

from app.api.auth import Reader
from app.api.problems import problems
from app.api.schemas import API
from app.api.state import Service
from app.missions.doctoring import DoctorView
from app.missions.views import PlannerView, VehicleView

router = APIRouter(prefix=API, responses=problems("unauthenticated", "forbidden"))


@router.get("/vehicles", operation_id="listVehicles", summary="List the vehicles", tags=["vehicles"])
async def list_vehicles(service: Service, reader: Reader) -> list[VehicleView]:
    """Return every vehicle that was heard or takes part in a mission: its link and what is missing, its position."""
    return await service.vehicles()


@router.get("/doctor", operation_id="examineLinks", summary="Say what is missing", tags=["vehicles"])
async def examine_links(service: Service, reader: Reader) -> DoctorView:
    """Return what keeps IMC vehicles from working with this service, each finding with its cause and what to do."""
    return service.doctor()


@router.get("/planners", operation_id="listPlanners", summary="List the planners", tags=["planners"])
async def list_planners(service: Service, reader: Reader) -> list[PlannerView]:
    """Return the planners that a mission may name, each with the JSON schema of its options."""
    return service.planners()
