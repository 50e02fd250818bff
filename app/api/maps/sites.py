"""Sites: places that are surveyed again and again, their map, and what changed between surveys."""

import asyncio
from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Body, Path, Query, Response

from app.api.access.auth import Operator, Reader
from app.api.bodies.json_route import JsonRoute
from app.api.http.problems import ProblemError, body_problems, problems
from app.api.maps.maps import file_answer
from app.api.mission import Mission
from app.api.schemas import API, SiteChoice
from app.api.state import Service
from app.missions.maps.site_files import CHANGE_FILES, MAP_FILES, ChangeFile, MapFile, changes_file, site_map_file
from app.missions.running.mission_views import mission_view
from app.missions.spec.site import SiteChanges, SiteId, SiteSpec
from app.missions.views.maps.sites import ChangesView, SiteMapView, SiteView, SurveyView
from app.missions.views.mission import MissionView

router = APIRouter(
    route_class=JsonRoute, prefix=f"{API}/sites", tags=["sites"], responses=problems("unauthenticated", "forbidden")
)
mission_router = APIRouter(
    route_class=JsonRoute, prefix=f"{API}/missions", tags=["sites"], responses=problems("unauthenticated", "forbidden")
)

_SENT = body_problems()
_FOUND = problems("site-not-found", "invalid-request")
_MAPPED = problems("site-not-found", "map-not-ready", "invalid-request")
_COMPARED = _MAPPED | problems("conflict")

Site = Annotated[SiteId, Path(description="The site's id", examples=["0197a3c8-6f2e-7c41-9d0f-5b2f6f0c1a2b"])]
_Earlier = Annotated[
    SiteId | None,
    Query(
        alias="from", description="Mission of the earlier survey; default: the one before the other, below its datum"
    ),
]
_Later = Annotated[
    SiteId | None,
    Query(alias="to", description="Mission of the later survey; default: the newest that can be compared"),
]
_Confidence = Annotated[
    float,
    Query(gt=0, lt=1, allow_inf_nan=False, description="Of unchanged ground this share is not called changed"),
]

_Crs = Annotated[
    str | None,
    Query(
        max_length=40,
        description="System of positions in `.tif`, `.xyz` and `.dxf`, in metres: `utm`, the zone of the site's "
        "middle, or `EPSG:nnnn`; default: the site's own frame",
        examples=["utm"],
    ),
]

EXAMPLE_SITE = {
    "name": "Leixoes, harbour mouth",
    "area": {
        "type": "Polygon",
        "coordinates": [[[-8.705, 41.185], [-8.7038, 41.185], [-8.7038, 41.1859], [-8.705, 41.1859], [-8.705, 41.185]]],
    },
    "cell_m": 1.0,
    "yearly_change_m": 0.05,
}


@router.post(
    "",
    operation_id="createSite",
    summary="Describe a site",
    status_code=201,
    responses=_SENT
    | {201: {"headers": {"Location": {"description": "Path of the site", "schema": {"type": "string"}}}}},
)
async def create_site(
    spec: Annotated[
        SiteSpec, Body(openapi_examples={"mouth": {"summary": "A harbour's mouth", "value": EXAMPLE_SITE}})
    ],
    service: Service,
    operator: Operator,
    response: Response,
) -> SiteView:
    """Store a place that is surveyed again and again. Missions belong to it by their field `site`."""
    site = await service.sites.create(spec)
    response.headers["Location"] = f"{router.prefix}/{site.id}"
    return site


@router.get("", operation_id="listSites", summary="List the sites")
async def list_sites(service: Service, reader: Reader) -> list[SiteView]:
    """Return every site, newest first."""
    return await service.sites.all()


@router.get("/{site_id}", operation_id="getSite", summary="See a site", responses=_FOUND)
async def get_site(site_id: Site, service: Service, reader: Reader) -> SiteView:
    """Return a site with the number of its missions and surveys."""
    return await service.sites.view(site_id)


@router.patch("/{site_id}", operation_id="changeSite", summary="Change a site", responses=_SENT | _FOUND)
async def change_site(site_id: Site, changes: SiteChanges, service: Service, operator: Operator) -> SiteView:
    """Change name, area, cell or `yearly_change_m`; its map is made anew of its surveys, which stay as they are.

    An area that has no ground in common with one of its missions is refused.
    """
    return await service.sites.change(site_id, changes)


@router.delete(
    "/{site_id}",
    operation_id="deleteSite",
    summary="Delete a site without surveys",
    status_code=204,
    responses=_FOUND | problems("conflict"),
)
async def delete_site(site_id: Site, service: Service, operator: Operator) -> None:
    """Remove a site that has neither missions nor surveys. Any other one is refused: what was measured is kept."""
    await service.sites.delete(site_id)


@router.get("/{site_id}/surveys", operation_id="listSurveys", summary="List a site's surveys", responses=_FOUND)
async def list_surveys(site_id: Site, service: Service, reader: Reader) -> list[SurveyView]:
    """Return its missions with dates, share and accuracy, oldest first; those that have not ended come last."""
    return await service.site_models.surveys(site_id)


@router.get(
    "/{site_id}/map",
    operation_id="getSiteMap",
    summary="See a site's map",
    response_model=SiteMapView,
    responses=_MAPPED,
)
async def get_site_map(site_id: Site, service: Service, reader: Reader) -> Response:
    """Return depth, deviation, newest survey and number of surveys of every cell, as of now.

    Each survey's own soundings count by their uncertainty, which grows by `yearly_change_m` with their age; where a
    survey found the floor changed, those before it count no more. What nobody measured is null.
    """
    site = await service.site_models.map(site_id)
    content = await asyncio.to_thread(lambda: site.view().model_dump_json())
    return Response(content, media_type="application/json", headers={"Cache-Control": "no-cache"})


@router.get(
    "/{site_id}/changes",
    operation_id="getChanges",
    summary="See what changed between two surveys",
    responses=_COMPARED,
)
async def get_changes(
    site_id: Site,
    service: Service,
    reader: Reader,
    earlier: _Earlier = None,
    later: _Later = None,
    confidence: _Confidence = 0.95,
) -> ChangesView:
    """Return volumes gained and lost with their deviations, and the share of significant cells.

    A difference is significant by |d| / sqrt(sd1^2 + sd2^2), each survey by its own soundings alone.
    """
    change = await service.site_models.changes(site_id, earlier, later, confidence)
    return await asyncio.to_thread(change.view)


def _files(kinds: Mapping[str, MapFile | ChangeFile]) -> dict[int | str, dict[str, Any]]:
    binary = {"schema": {"type": "string", "format": "binary"}}
    return problems("format-not-found") | {
        200: {
            "description": "; ".join(f"`.{ending}`: {kind.title}" for ending, kind in kinds.items()),
            "content": {kind.media_type.partition(";")[0]: binary for kind in kinds.values()},
        }
    }


def _check(what: str, ending: str, kinds: Mapping[str, MapFile | ChangeFile]) -> None:
    if ending not in kinds:
        raise ProblemError(
            "format-not-found",
            f"{what} not made as .{ending[:20]}",
            remedy="Use one of " + ", ".join(f".{name}" for name in kinds),
        )


@router.get(
    "/{site_id}/map.{format}",
    operation_id="getSiteMapFile",
    summary="Download a site's map",
    response_class=Response,
    responses=_MAPPED | _files(MAP_FILES),
)
async def get_site_map_file(
    site_id: Site,
    format: Annotated[str, Path(description=f"One of {', '.join(MAP_FILES)}", examples=["tif"])],  # noqa: A002
    service: Service,
    reader: Reader,
    crs: _Crs = None,
) -> Response:
    """Return the site's map as a file."""
    _check("the map of a site is", format, MAP_FILES)
    site = await service.site_models.map(site_id)
    return file_answer(await asyncio.to_thread(site_map_file, format, site, crs))


@router.get(
    "/{site_id}/changes.{format}",
    operation_id="getChangesFile",
    summary="Download what changed between two surveys",
    response_class=Response,
    responses=_COMPARED | _files(CHANGE_FILES),
)
async def get_changes_file(
    site_id: Site,
    format: Annotated[str, Path(description=f"One of {', '.join(CHANGE_FILES)}", examples=["tif"])],  # noqa: A002
    service: Service,
    reader: Reader,
    earlier: _Earlier = None,
    later: _Later = None,
    confidence: _Confidence = 0.95,
) -> Response:
    """Return difference, deviation and significance of each cell as a file."""
    _check("changes are", format, CHANGE_FILES)
    change = await service.site_models.changes(site_id, earlier, later, confidence)
    return file_answer(await asyncio.to_thread(changes_file, format, change))


@mission_router.put(
    "/{mission_id}/site",
    operation_id="setSite",
    summary="Put a mission into a site",
    responses=_SENT | problems("mission-not-found", "conflict"),
)
async def set_site(choice: SiteChoice, service: Service, operator: Operator, mission: Mission) -> MissionView:
    """Let a mission that is not at sea belong to a site, also afterwards: what it found goes with it."""
    await service.sites.join(mission, choice.site, operator.name)
    return mission_view(mission)
