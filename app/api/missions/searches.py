"""Missions that search: scans in, the site as known now out."""

from typing import Annotated

from fastapi import APIRouter, Body, Query, Response

from app.api.access.auth import Reader, VehicleOrOperator, check_vehicle
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import body_problems, problems
from app.api.maps.maps import file_answer
from app.api.mission import Mission
from app.api.schemas import API, ScanBatch
from app.api.state import Service
from app.missions.operations.maps.mission_maps import export
from app.missions.operations.scans import scan, search_grid
from app.missions.search.scan_schema import Scan
from app.missions.views.measurements.soundings import BatchVerdict, with_unreadable
from app.missions.views.search import SearchGridView

router = APIRouter(
    route_class=JsonRoute,
    prefix=f"{API}/missions/{{mission_id}}",
    tags=["searches"],
    responses=problems("unauthenticated", "forbidden", "mission-not-found", "invalid-request"),
)


@router.post(
    "/scans",
    operation_id="postScans",
    summary="Post scans",
    responses=body_problems("mission-not-found", "conflict"),
)
async def post_scans(batch: Annotated[ScanBatch, Body()], vehicle: VehicleOrOperator, mission: Mission) -> BatchVerdict:
    """Store scans of a mission of kind search, and add them to what is known of its site.

    Each scan has its own verdict: one that cannot be read is rejected with the reason, the others are stored; one that
    came before, by its vehicle and time, is a duplicate. Vehicles of any kind
    but sim may have a computer that posts: those that are commanded over IMC, too.
    """
    readable = [item for item in batch.items if isinstance(item, Scan)]
    for item in readable:
        check_vehicle(vehicle, item.vehicle)
    answer = await scan(mission, readable)
    return with_unreadable({i: item for i, item in enumerate(batch.items) if isinstance(item, str)}, answer)


@router.get(
    "/search",
    operation_id="getSearch",
    summary="See the site of a search as known now",
    responses=problems("mission-not-found", "conflict", "invalid-request")
    | {204: {"description": "Nothing newer than `after`"}},
    response_model=SearchGridView,
)
async def get_search(
    reader: Reader,
    mission: Mission,
    after: Annotated[int | None, Query(ge=0, lt=2**62, description="Only what is newer than this version")] = None,
) -> Response:
    """Return what is known of every cell: explored, not explored, an obstacle known beforehand, or one found."""
    view = search_grid(mission, after)
    if view is None:
        return Response(status_code=204)
    return Response(view.model_dump_json(), media_type="application/json")


@router.get(
    "/search/obstacles.geojson",
    operation_id="getSearchObstacles",
    summary="Download the obstacles of a search as GeoJSON",
    responses=problems("mission-not-found", "conflict", "invalid-request")
    | {200: {"content": {"application/geo+json": {}}, "description": "A FeatureCollection of polygons"}},
    response_class=Response,
)
async def get_search_obstacles(service: Service, reader: Reader, mission: Mission) -> Response:
    """Return the outlines of all cells that obstacles fill: known beforehand, and found."""
    return file_answer(
        await export(mission, service.maps, service.settings.provider, service.compute, "obstacles.geojson")
    )
