"""Pings of swath sonars, as they were measured."""

from typing import Annotated, Any

from fastapi import APIRouter, Header, Path, Response

from app.api.access.auth import Reader
from app.api.http.problems import problems
from app.api.mission import Mission
from app.api.schemas import API
from app.missions.operations.pings import ping_file, pings_of
from app.missions.views.measurements.pings import PingsView

PARQUET = "application/vnd.apache.parquet"

router = APIRouter(
    prefix=f"{API}/missions/{{mission_id}}/pings",
    tags=["maps"],
    responses=problems("unauthenticated", "forbidden", "mission-not-found", "invalid-request"),
)

_FILE: dict[int | str, dict[str, Any]] = {
    200: {"content": {PARQUET: {"schema": {"type": "string", "format": "binary"}}}, "description": "The file"},
    304: {"description": "It is the file that `If-None-Match` names: files never change"},
}


@router.get("", operation_id="listPings", summary="See which pings there are")
async def list_pings(reader: Reader, mission: Mission) -> PingsView:
    """Return the files of pings, and what is in none yet: some thousand of a vehicle fill one, the rest comes last."""
    return await pings_of(mission)


@router.get(
    "/{number}",
    operation_id="getPings",
    summary="Fetch a file of pings",
    response_class=Response,
    responses=problems("pings-not-found", "pings-unreadable") | _FILE,
)
async def get_pings(
    reader: Reader,
    mission: Mission,
    number: Annotated[int, Path(ge=1, lt=2**62, description="The file's number")],
    if_none_match: Annotated[str | None, Header(description="ETag of the file that the client has")] = None,
) -> Response:
    """Return a Parquet file with a row for each ping, also for refused ones, which have a reason.

    Columns: `block`, `step`, `received_at`, `source`, `reason`, `time_s`, `lat_deg`, `lon_deg`, `depth_m`, `roll_rad`,
    `pitch_rad`, `heading_rad`, `position_sd_m`, and the lists `angle_rad` (across the track from straight down,
    positive to starboard) and `range_m`. NaN: not known, or nothing was detected.
    """
    name, digest, content = await ping_file(mission, number)
    headers = {"ETag": f'"{digest}"', "Cache-Control": "private, no-cache"}
    if if_none_match is not None and digest in if_none_match:
        return Response(status_code=304, headers=headers)
    headers["Content-Disposition"] = f'attachment; filename="{name}"'
    return Response(content, media_type=PARQUET, headers=headers)
