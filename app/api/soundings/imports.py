"""Files from elsewhere: vehicles' own logs, soundings and maps to begin with, and a grid to compare the map with."""

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Annotated, Any, TypeVar

from fastapi import APIRouter, Path, Query, Request, Response
from starlette.requests import ClientDisconnect

from app.api.access.auth import Operator, Reader
from app.api.http.first_completed import first_of
from app.api.http.problems import ProblemError, problems
from app.api.mission import Mission
from app.api.schemas import API
from app.api.state import EdgeState, Service, State
from app.missions.live.mission import LiveMission
from app.missions.operations.imports.imports import imports_of, kind_of, reference_of
from app.missions.operations.imports.uploads import Upload
from app.missions.views.measurements.imports import (
    DrawingOptions,
    DrawingView,
    ImportOptions,
    ImportView,
    LogOptions,
    LogView,
    ProposedZonesView,
    ReferenceView,
    ZoneOptions,
)

Found = TypeVar("Found")

router = APIRouter(
    prefix=f"{API}/missions/{{mission_id}}", tags=["imports"], responses=problems("unauthenticated", "forbidden")
)

charts_router = APIRouter(prefix=API, tags=["imports"], responses=problems("unauthenticated", "forbidden"))

_FILE: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "description": "The file as it is, whatever its media type",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}
_SENT = problems(
    "malformed-body", "mission-not-found", "conflict", "body-too-large", "invalid-request", "import-unavailable"
)
_FOUND = problems("mission-not-found", "import-not-found", "invalid-request")

ImportId = Annotated[str, Path(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_-]+$", description="The import's id")]


@asynccontextmanager
async def _sent(
    state: EdgeState, request: Request, mission: LiveMission, options: ImportOptions
) -> AsyncIterator[tuple[LiveMission, Upload]]:
    """Take a file in. What would be refused anyhow is not waited for.

    Beside the file the mission comes as it is in memory now: that one may have left it meanwhile.
    """
    kind_of(options)
    try:
        async with state.service.uploads.receive(request.stream(), state.settings.max_import_bytes) as upload:
            yield await state.service.get(mission.id), upload
    except ClientDisconnect:
        raise ProblemError("malformed-body", "the connection ended before the file did") from None


@router.post(
    "/imports",
    operation_id="importSoundings",
    summary="Begin with soundings or a map from elsewhere",
    status_code=201,
    openapi_extra=_FILE,
    responses=_SENT | {200: {"description": "The same file was imported before: nothing changed", "model": ImportView}},
)
async def import_soundings(
    options: Annotated[ImportOptions, Query()],
    request: Request,
    response: Response,
    state: State,
    operator: Operator,
    mission: Mission,
) -> ImportView:
    """Take all of a file's soundings near the area, or nothing when any of it is wrong.

    They count in the map by their own uncertainty, and are told apart from the mission's own. Sending the same file
    again changes nothing.
    """
    async with _sent(state, request, mission, options) as (mission, upload):
        view = await state.service.imports.add(mission, upload, options, operator.name)
    if view.replayed:
        response.status_code = 200
    return view


@charts_router.post(
    "/chart-zones",
    operation_id="proposeZones",
    summary="Propose keep-out zones from a chart",
    openapi_extra=_FILE,
    responses=problems("malformed-body", "body-too-large", "invalid-request", "import-unavailable"),
)
async def propose_zones(
    options: Annotated[ZoneOptions, Query()], request: Request, state: State, operator: Operator
) -> ProposedZonesView:
    """Return what an ENC cell (S-57, its .000 file) shows in an area to keep out of.

    Land, obstructions, wrecks, rocks and restricted areas. Nothing is stored and no mission changes: who creates one
    looks at them and takes those that apply into `keep_out`. Reading ends with the connection.
    """
    imports = state.service.imports
    return await _read_for(request, state, lambda upload: imports.propose_zones(upload, options))


@charts_router.post(
    "/drawings",
    operation_id="readDrawing",
    summary="Read the lines and areas of a file",
    openapi_extra=_FILE,
    responses=problems("malformed-body", "body-too-large", "invalid-request", "import-unavailable"),
)
async def read_drawing(
    options: Annotated[DrawingOptions, Query()], request: Request, state: State, operator: Operator
) -> DrawingView:
    """Return lines for a mission's `survey_lines` and polygons for its `area` and `keep_out`, as a file has them.

    Line plans and areas from GIS, survey programs and drawings: GeoJSON, KML, GPX, DXF, shapefiles, tables, Hypack.
    Nothing is stored and no mission changes. Reading ends with the connection.
    """
    imports = state.service.imports
    return await _read_for(request, state, lambda upload: imports.read_drawing(upload, options))


async def _read_for(request: Request, state: State, read: Callable[[Upload], Awaitable[Found]]) -> Found:
    """Return what a request's file holds; nobody else's file waits for one that nobody waits for any more."""
    found: list[Found] = []

    async def left() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass

    try:
        async with state.service.uploads.receive(request.stream(), state.settings.max_import_bytes) as upload:

            async def reading() -> None:
                found.append(await read(upload))

            await first_of(reading(), left())
    except ClientDisconnect:
        found.clear()
    if not found:
        raise ProblemError("malformed-body", "the connection ended before the file did, or before it was read")
    return found[0]


@router.get(
    "/imports",
    operation_id="listImports",
    summary="List what was imported",
    responses=problems("mission-not-found", "invalid-request"),
)
async def list_imports(reader: Reader, mission: Mission) -> list[ImportView]:
    """Return what the mission began with, oldest first."""
    return await imports_of(mission)


@router.delete(
    "/imports/{import_id}",
    operation_id="deleteImport",
    summary="Take an import back",
    status_code=204,
    responses=_FOUND,
)
async def delete_import(import_id: ImportId, service: Service, operator: Operator, mission: Mission) -> None:
    """Leave the soundings of a file out of the map again."""
    await service.imports.delete(mission, import_id, operator.name)


@router.post(
    "/logs",
    operation_id="importLog",
    summary="Import a vehicle's own log",
    status_code=202,
    openapi_extra=_FILE,
    responses=_SENT,
)
async def import_log(
    options: Annotated[LogOptions, Query()], request: Request, state: State, operator: Operator, mission: Mission
) -> LogView:
    """Take what a vehicle recorded on board: a log of DUNE, or a multibeam's GSF or KMALL file.

    It is answered when the file has arrived; reading it goes on, and `GET …/logs/{import_id}` tells how far it is.
    Every record counts once, however often it comes: by radio, in another log, or in the same file again.
    """
    service = state.service
    length = request.headers.get("content-length", "")
    service.logs.check(mission, options, int(length) if length.isdecimal() else None)
    try:
        async with AsyncExitStack() as keeping:
            incoming = service.uploads.receive(request.stream(), state.settings.max_import_bytes)
            upload = await keeping.enter_async_context(incoming)
            return service.logs.begin(await service.get(mission.id), upload, options, operator.name, keeping)
    except ClientDisconnect:
        raise ProblemError("malformed-body", "the connection ended before the file did") from None


@router.get(
    "/logs",
    operation_id="listLogs",
    summary="List the logs that were imported",
    responses=problems("mission-not-found", "invalid-request"),
)
async def list_logs(reader: Reader, service: Service, mission: Mission) -> list[LogView]:
    """Return the vehicles' own logs, those from the command line as well, and those that are being read, oldest first.

    Those of which nothing was new are listed until the service ends.
    """
    return await service.logs.all(mission)


@router.get(
    "/logs/{import_id}", operation_id="getLog", summary="See what came of a log, or how far it is", responses=_FOUND
)
async def get_log(import_id: ImportId, reader: Reader, service: Service, mission: Mission) -> LogView:
    """Return the import of a log."""
    return await service.logs.one(mission, import_id)


@router.delete(
    "/logs/{import_id}",
    operation_id="deleteLog",
    summary="Stop reading a log, or take it back",
    responses=_FOUND | problems("conflict"),
)
async def delete_log(import_id: ImportId, service: Service, operator: Operator, mission: Mission) -> LogView:
    """Let nothing count of what a log brought: soundings, pings, track; reading it ends.

    The map is made anew of the rest. What the log brought stays stored, marked; the same file sent again counts again.
    """
    return await service.logs.take_back(mission, import_id, operator.name)


@router.put(
    "/reference",
    operation_id="setReference",
    summary="Compare the map with a grid",
    openapi_extra=_FILE,
    responses=_SENT,
)
async def set_reference(
    options: Annotated[ImportOptions, Query()],
    request: Request,
    state: State,
    operator: Operator,
    mission: Mission,
) -> ReferenceView:
    """Sample a file's depths at the map's cells, to see how far off the map is.

    Shown by `quality`, the layer `difference` and the GeoTIFF; never used for the map or for planning.
    """
    async with _sent(state, request, mission, options) as (mission, upload):
        return await state.service.imports.set_reference(mission, upload, options, operator.name)


@router.get("/reference", operation_id="getReference", summary="See what the map is compared with", responses=_FOUND)
async def get_reference(reader: Reader, mission: Mission) -> ReferenceView:
    """Return the reference grid in short."""
    return await reference_of(mission)


@router.delete(
    "/reference",
    operation_id="deleteReference",
    summary="Compare the map with nothing",
    status_code=204,
    responses=_FOUND,
)
async def delete_reference(service: Service, operator: Operator, mission: Mission) -> None:
    """Forget the reference grid."""
    await service.imports.delete_reference(mission, operator.name)
