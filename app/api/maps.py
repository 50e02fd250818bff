"""A mission's map: as JSON, as a picture to lay over a web map, and as the files hydrographers use."""

import asyncio
from email.utils import quote
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Header, Path, Query, Response

from app.api.auth import Reader
from app.api.problems import ProblemError, problems
from app.api.schemas import API, MissionId
from app.api.state import EdgeState, Service, State
from app.mapping.products.overlay import overlay_png
from app.missions.maps import FORMATS
from app.missions.views import MapView

router = APIRouter(
    prefix=f"{API}/missions/{{mission_id}}",
    tags=["maps"],
    responses=problems("unauthenticated", "forbidden", "mission-not-found", "map-not-ready", "invalid-request"),
)

MAX_VALUE_M = 20_000.0
"""No sea is deeper."""

TEXTS = {
    "tif": "GeoTIFF: depth, standard deviation and count",
    "xyz": "longitude, latitude and depth of every cell",
    "csv": "every sounding, raw and corrected, with its verdict",
    "geojson": "depth contours, area and tracks",
    "png": "a picture with axes and legend",
}
"""The formats of ``/map.{format}`` in words."""

_NOT_MODIFIED: dict[int | str, dict[str, Any]] = {
    304: {"description": "The map is still the one that `If-None-Match` names"}
}
_IfNoneMatch = Annotated[str | None, Header(description="ETag of the map that the client has")]


@router.get(
    "/map",
    operation_id="getMap",
    summary="See the map",
    response_model=MapView,
    responses=_NOT_MODIFIED,
)
async def get_map(
    mission_id: MissionId, service: Service, state: State, reader: Reader, if_none_match: _IfNoneMatch = None
) -> Response:
    """Return depth, standard deviation and count of every cell, with an ETag that changes with every new map."""
    snapshot = await service.map(mission_id)
    tag = _tag(state, mission_id, snapshot.version)
    if _matches(tag, if_none_match):
        return _not_modified(tag)
    content = await asyncio.to_thread(lambda: snapshot.view().model_dump_json())
    return Response(content, media_type="application/json", headers=_caching(tag))


@router.get(
    "/map.overlay.png",
    operation_id="getMapOverlay",
    summary="See the map as a transparent picture",
    response_class=Response,
    responses=_NOT_MODIFIED
    | {
        200: {
            "description": "One pixel per cell, north up",
            "content": {"image/png": {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def get_overlay(
    mission_id: MissionId,
    service: Service,
    state: State,
    reader: Reader,
    layer: Annotated[Literal["depth", "uncertainty"], Query(description="Depth, or its standard deviation")] = "depth",
    min: Annotated[  # noqa: A002 - the query parameter's name
        float | None,
        Query(
            ge=-MAX_VALUE_M,
            le=MAX_VALUE_M,
            allow_inf_nan=False,
            description="Value at the palette's begin, m; default: the map's least",
        ),
    ] = None,
    max: Annotated[  # noqa: A002 - the query parameter's name
        float | None,
        Query(
            ge=-MAX_VALUE_M,
            le=MAX_VALUE_M,
            allow_inf_nan=False,
            description="Value at the palette's end, m; default: the map's largest",
        ),
    ] = None,
    if_none_match: _IfNoneMatch = None,
) -> Response:
    """Return a picture to lay between the `corners` of the map's JSON; cells without a value are transparent.

    Give both `min` and `max` to keep the colours of two pictures comparable.
    """
    if min is not None and max is not None and max <= min:
        raise ProblemError("invalid-request", f"max is {max:g} but min is {min:g}", remedy="Give a max above min")
    snapshot = await service.map(mission_id)
    tag = _tag(state, mission_id, snapshot.version, layer, min, max)
    if _matches(tag, if_none_match):
        return _not_modified(tag)
    bathymetry = snapshot.built.map
    values = bathymetry.depth_m if layer == "depth" else bathymetry.sd_m
    low = float(np.nanmin(values)) if min is None else min
    high = float(np.nanmax(values)) if max is None else max
    # A flat map, or one beyond the only end that was given, is all one colour.
    range_m = (low, high) if low < high else (low, low + 1.0) if max is None else (high - 1.0, high)
    picture = await asyncio.to_thread(overlay_png, bathymetry, range_m, layer=layer)
    return Response(picture, media_type="image/png", headers=_caching(tag))


@router.get(
    "/map.{format}",
    operation_id="getMapFile",
    summary="Download the map",
    response_class=Response,
    responses=problems("mission-not-found", "map-not-ready", "format-not-found")
    | {
        200: {
            "description": "; ".join(f"`.{name}`: {text}" for name, text in TEXTS.items()),
            "content": {
                FORMATS[name].partition(";")[0]: {"schema": {"type": "string", "format": "binary"}} for name in TEXTS
            },
        }
    },
)
async def get_map_file(
    mission_id: MissionId,
    format: Annotated[str, Path(description="One of " + ", ".join(TEXTS), examples=["tif"])],  # noqa: A002
    service: Service,
    reader: Reader,
) -> Response:
    """Return the map as a file."""
    if format not in TEXTS:
        raise ProblemError(
            "format-not-found",
            f"the map is not made as .{format[:20]}",
            remedy="Use one of " + ", ".join(f".{name}" for name in TEXTS),
        )
    product = await service.export(mission_id, format)
    return Response(
        product.content,
        media_type=product.media_type,
        headers={
            "Content-Disposition": f'attachment; filename="{quote(product.filename)}"',
            "Cache-Control": "no-cache",
        },
    )


def _tag(state: EdgeState, mission_id: str, version: int, *variant: object) -> str:
    shown = "".join(f"-{part}" for part in variant)
    return f'"{mission_id}-{state.run_id}-{version}{shown}"'


def _matches(tag: str, if_none_match: str | None) -> bool:
    if if_none_match is None:
        return False
    sent = [candidate.strip().removeprefix("W/") for candidate in if_none_match.split(",")]
    return tag in sent or "*" in sent


def _caching(tag: str) -> dict[str, str]:
    return {"ETag": tag, "Cache-Control": "no-cache"}


def _not_modified(tag: str) -> Response:
    return Response(status_code=304, headers=_caching(tag))
