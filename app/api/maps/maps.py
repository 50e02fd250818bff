"""A mission's map: as JSON, as a picture to lay over a web map, and as the files hydrographers use."""

import asyncio
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from email.utils import quote
from enum import StrEnum
from typing import Annotated, Any, cast

import numpy as np
from fastapi import APIRouter, Depends, Header, Path, Query, Request, Response
from pydantic import Field, GetCoreSchemaHandler
from pydantic_core import CoreSchema
from starlette.responses import StreamingResponse

from app.api.access.auth import Reader
from app.api.http.problems import ProblemError, problems
from app.api.http.while_connected import while_connected
from app.api.mission import Mission
from app.api.schemas import API
from app.api.state import EdgeState, Service, State
from app.mapping.layers import LAYERS, Layer, LayerKind
from app.mapping.products.pictures.overlay import overlay_png
from app.mapping.s44 import Order
from app.missions.errors import InvalidRequestError
from app.missions.maps.products import (
    CONTOURS,
    CROSSOVERS,
    GEOJSON,
    MAP,
    PRODUCTS,
    SEARCH,
    SOUNDINGS,
    SWATHS,
    TIERS,
    TRACKS,
    Product,
    ProductOptions,
    snapshot_holidays,
)
from app.missions.maps.snapshot import MapSnapshot, quality_of
from app.missions.operations.corrections.crossovers import check_of, crossovers_view
from app.missions.operations.corrections.uncertainty_budget import uncertainty_budget
from app.missions.operations.maps.mission_maps import export, map_tiles, newest_map
from app.missions.operations.reports import ReportOptions
from app.missions.report.kinds import REPORTS, ReportKind
from app.missions.report.texts import Language
from app.missions.spec.base import Name
from app.missions.views.maps.map import FileOption, LayerView, MapView, ProductView, QualityView
from app.missions.views.measurements.crossovers import CrossoversView
from app.missions.views.measurements.uncertainty import UncertaintyBudgetView

router = APIRouter(
    prefix=f"{API}/missions/{{mission_id}}",
    tags=["maps"],
    responses=problems("unauthenticated", "forbidden", "mission-not-found", "map-not-ready", "invalid-request"),
)

OVERLAY = "overlay.png"
"""The file that has a path of its own: it is of one layer."""

MAX_VALUE_M = 20_000.0
"""No sea is deeper."""

End = Annotated[float | None, Field(ge=-MAX_VALUE_M, le=MAX_VALUE_M, allow_inf_nan=False)]
"""Of a range of colours; ``min`` and ``max`` are the query parameters' names."""
S44Order = Annotated[Order, Query(description="Order of IHO S-44 that the TVU is compared with")]


def _by_extension(resource: str) -> dict[str, str]:
    """Return the names of a resource's files by their extensions."""
    return {kind.extension: name for name, kind in PRODUCTS.items() if kind.resource == resource and name != OVERLAY}


async def _file_options(
    order: S44Order = Order.ORDER_1A,
    interval_m: Annotated[
        float | None, Query(gt=0, le=1000, allow_inf_nan=False, description="Between contours; default: about ten")
    ] = None,
    min: Annotated[End, Query(description="A picture's least depth")] = None,  # noqa: A002
    max: Annotated[End, Query(description="Its largest depth")] = None,  # noqa: A002
    vehicle: Annotated[
        Name | None, Query(description="Whose soundings, in crowdsourced bathymetry; default: the only vehicle's")
    ] = None,
    crs: Annotated[
        str | None,
        Query(
            max_length=40,
            description="System of positions, in metres: `utm`, the zone of the area's middle, or `EPSG:nnnn`; "
            "default: the mission's own frame, in XYZ longitude and latitude",
            examples=["utm"],
        ),
    ] = None,
) -> ProductOptions:
    if (min is None) != (max is None) or (min is not None and max is not None and not min < max):
        raise InvalidRequestError("max", f"the colour range is {min} to {max}", "Give min and a max above")
    return ProductOptions(order, interval_m, None if min is None or max is None else (min, max), vehicle, crs)


def _layer_enum(title: str, description: str, among: Callable[[LayerKind], bool]) -> type[StrEnum]:
    names = {kind.name.upper(): kind.name for kind in LAYERS.values() if among(kind)}
    made = cast("type[StrEnum]", StrEnum(title, names))
    made.__doc__ = description
    return made


@dataclass(frozen=True)
class OneOf:
    """Lets a string be one of an enumeration that is made of a table; the document has it like one that is written."""

    names: type[StrEnum]

    def __get_pydantic_core_schema__(self, source: type, handler: GetCoreSchemaHandler) -> CoreSchema:
        return handler(self.names)


JSON_LAYERS = _layer_enum(
    "LayerName", "A layer of the map beside those that its JSON always has.", lambda kind: kind.in_json
)
PICTURES = _layer_enum("OverlayLayer", "A layer that can be seen as a picture.", lambda kind: kind.in_pictures)
FURTHER_TILES = _layer_enum(
    "FurtherLayer",
    "A layer that the tiles hold on request.",
    lambda kind: kind.scale is not None and not kind.in_every_tile,
)

_NOT_MODIFIED: dict[int | str, dict[str, Any]] = {
    304: {"description": "The map is still the one that `If-None-Match` names"}
}
_IfNoneMatch = Annotated[str | None, Header(description="ETag of the map that the client has")]


layers_router = APIRouter(prefix=API, tags=["maps"], responses=problems("unauthenticated", "forbidden"))


@layers_router.get("/layers", operation_id="listLayers", summary="List the layers of maps")
async def list_layers(reader: Reader) -> list[LayerView]:
    """Return every layer that a map may have: what its values say, in which colours, and where it can be had."""
    return [
        LayerView.model_validate(replace(kind, meaning=kind.meaning_at(Order.ORDER_1A)), from_attributes=True)
        for kind in LAYERS.values()
    ]


@router.get(
    "/map",
    operation_id="getMap",
    summary="See the map",
    response_model=MapView,
    responses=_NOT_MODIFIED,
)
async def get_map(
    service: Service,
    state: State,
    reader: Reader,
    mission: Mission,
    layer: Annotated[
        list[Annotated[str, OneOf(JSON_LAYERS)]] | None,
        Query(max_length=len(JSON_LAYERS), description="Further layers, in `layers`; repeat it for several"),
    ] = None,
    order: S44Order = Order.ORDER_1A,
    if_none_match: _IfNoneMatch = None,
) -> Response:
    """Return depth, standard deviation and count of every cell, with an ETag that changes with every new map."""
    snapshot = await newest_map(mission, service.maps)
    names = sorted(set(layer or ()))
    tag = _tag(state, snapshot, names, *([order] if names else []))
    if _matches(tag, if_none_match):
        return _not_modified(tag)

    def content() -> str:
        wanted = [layer_of(snapshot, name, order) for name in names]
        return snapshot.view(wanted).model_dump_json()

    content_json = await asyncio.to_thread(content)
    return Response(content_json, media_type="application/json", headers=_caching(tag))


@router.get(
    f"/map.{OVERLAY}",
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
    service: Service,
    state: State,
    reader: Reader,
    mission: Mission,
    layer: Annotated[str, OneOf(PICTURES), Query(description="What is shown")] = "depth",
    order: S44Order = Order.ORDER_1A,
    min: Annotated[End, Query(description="Value at the palette's begin, m; default: the map's least")] = None,  # noqa: A002
    max: Annotated[End, Query(description="Value at the palette's end, m; default: the map's largest")] = None,  # noqa: A002
    if_none_match: _IfNoneMatch = None,
) -> Response:
    """Return a picture to lay between the `corners` of the map's JSON; cells without a value are transparent.

    Give both `min` and `max` to keep the colours of two pictures comparable.
    """
    if min is not None and max is not None and max <= min:
        raise InvalidRequestError("max", f"max is {max:g} but min is {min:g}", "Give a max above min")
    snapshot = await newest_map(mission, service.maps)
    tag = _tag(state, snapshot, [layer], order, min, max)
    if _matches(tag, if_none_match):
        return _not_modified(tag)

    def picture() -> bytes:
        values = layer_of(snapshot, layer, order).values
        low = float(np.nanmin(values)) if min is None else min
        high = float(np.nanmax(values)) if max is None else max
        # A flat map, or one beyond the only end that was given, is all one colour.
        range_m = (low, high) if low < high else (low, low + 1.0) if max is None else (high - 1.0, high)
        return overlay_png(values, snapshot.built.map.sounded, range_m, LAYERS[layer].fit)

    return Response(await asyncio.to_thread(picture), media_type="image/png", headers=_caching(tag))


@router.get(
    "/map/tiles",
    operation_id="getMapTiles",
    summary="Follow the map",
    response_class=Response,
    responses={
        200: {
            "description": "The tiles that changed, in a binary form that the guide to REST describes",
            "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def get_tiles(
    service: Service,
    state: State,
    reader: Reader,
    mission: Mission,
    since: Annotated[
        str, Query(max_length=80, pattern=r"^[A-Za-z0-9.@]*$", description="`tag` of the map that the client has")
    ] = "",
    layer: Annotated[
        list[Annotated[str, OneOf(FURTHER_TILES)]] | None,
        Query(max_length=len(FURTHER_TILES), description="Layers beside the usual ones"),
    ] = None,
    step: Annotated[
        int | None, Query(ge=0, lt=2**31, description="The map as it was at the end of this step; default: the newest")
    ] = None,
) -> Response:
    """Return what changed in the map since the client last asked; all of it when that map is not known any more."""
    content = await map_tiles(mission, service.maps, state.run_id, since, layer or (), step)
    headers = {"Content-Encoding": "deflate", "Cache-Control": "no-store"}
    return Response(content, media_type="application/octet-stream", headers=headers)


@router.get("/quality", operation_id="getQuality", summary="Judge the map")
async def get_quality(service: Service, reader: Reader, mission: Mission) -> QualityView:
    """Say in how many cells the TVU estimate stays within each order of IHO S-44, and how far a reference grid is off.

    No order is claimed by that: an order asks for more than vertical uncertainty.
    """
    return await asyncio.to_thread(quality_of, await newest_map(mission, service.maps))


@router.get("/uncertainty-budget", operation_id="getUncertaintyBudget", summary="See where uncertainty comes from")
async def get_uncertainty_budget(service: Service, reader: Reader, mission: Mission) -> UncertaintyBudgetView:
    """Return what each source of error adds to soundings of swath sonars, straight down and at 45 and 60 degrees.

    It is computed for level ground at the mean depth of the newest map, from the mission's `uncertainty`.
    """
    snapshot = await newest_map(mission, service.maps, patient=False)
    return await asyncio.to_thread(uncertainty_budget, mission, snapshot)


@router.get(
    "/holidays",
    operation_id="getHolidays",
    summary="See what swath sonars missed",
    response_class=Response,
    responses=problems("conflict")
    | _NOT_MODIFIED
    | {200: {"content": {GEOJSON: {}}, "description": "A FeatureCollection with the map's `version`"}},
)
async def get_holidays(
    service: Service, state: State, reader: Reader, mission: Mission, if_none_match: _IfNoneMatch = None
) -> Response:
    """Return the outline of each holiday of the newest map with its `number`, largest first, area and middle."""
    snapshot = await newest_map(mission, service.maps, patient=False)
    tag = _tag(state, snapshot, (), "holidays")
    if _matches(tag, if_none_match):
        return _not_modified(tag)
    return Response(await asyncio.to_thread(snapshot_holidays, snapshot), media_type=GEOJSON, headers=_caching(tag))


@router.get(
    "/crosslines",
    operation_id="getCrosslines",
    summary="See how well the survey agrees with itself",
    response_model=CrossoversView,
    responses=problems("pings-unreadable") | _NOT_MODIFIED,
)
async def get_crosslines(
    service: Service,
    state: State,
    reader: Reader,
    mission: Mission,
    order: S44Order = Order.ORDER_1A,
    if_none_match: _IfNoneMatch = None,
) -> Response:
    """Return what the depths of lines differ where they cross, and crosslines' beams from the grid of the main lines.

    Tide and sound speed are applied. Lines are found in the vehicles' ways: one ends at a gap or a turn. The worst
    crossings are listed as GeoJSON. While the mission runs, the answer may be of an earlier map than the newest.
    """
    snapshot = await newest_map(mission, service.maps, patient=False)
    found = await check_of(mission, snapshot)
    tag = f'"{mission.id}-{state.run_id}-{found.tag}-crossovers{order}"'
    if _matches(tag, if_none_match):
        return _not_modified(tag)
    content = await asyncio.to_thread(lambda: crossovers_view(found, snapshot, order).model_dump_json())
    return Response(content, media_type="application/json", headers=_caching(tag))


@router.get(
    "/crossovers.csv",
    operation_id="getCrossoversFile",
    summary="Download the crossings",
    response_class=Response,
    responses=problems("pings-unreadable")
    | {
        200: {
            "content": {"text/csv": {"schema": {"type": "string"}}},
            "description": "A row for each crossing, the worst beside what the order allows first",
        }
    },
)
async def get_crossovers_file(
    service: Service, reader: Reader, mission: Mission, order: S44Order = Order.ORDER_1A
) -> Response:
    """Return where lines cross as a file, all crossings."""
    options = ProductOptions(order)
    return file_answer(
        await export(mission, service.maps, service.settings.provider, service.compute, "crossovers.csv", options)
    )


def _add_report(kind: ReportKind) -> None:
    async def get_report(
        service: Service,
        reader: Reader,
        mission: Mission,
        request: Request,
        lang: Annotated[Language, Query(description="Language that it is written in")] = Language.EN,
        order: S44Order = Order.ORDER_1A,
    ) -> Response:
        making = service.reports.report(mission, ReportOptions(kind, lang, order))
        return file_answer(await while_connected(request, making))

    name = kind.extension
    router.add_api_route(
        f"/report.{name}",
        get_report,
        methods=["GET"],
        operation_id=f"get{name.capitalize()}Report",
        summary=f"Download the survey's report as {name.upper()}",
        description="Return the survey in one document: place, times, vehicles, corrections, map, uncertainty, "
        "crosslines, what can be said by IHO S-44 and what cannot, rejected soundings, alarms, checksums of files and "
        "the settings to repeat it. Every number is the one that the other answers have.",
        response_class=Response,
        responses=problems("pings-unreadable")
        | {
            200: {
                "description": kind.title,
                "content": {kind.media_type.partition(";")[0]: {"schema": _schema_of(kind.media_type)}},
            }
        },
    )


@router.get("/products", operation_id="listProducts", summary="List the files", responses=problems("mission-not-found"))
async def list_products(reader: Reader, mission: Mission) -> list[ProductView]:
    """Return every file that can be downloaded, with its path."""
    base = f"{API}/missions/{mission.id}"
    reports = [
        ProductView(
            name=f"report.{name}",
            title=kind.title,
            media_type=kind.media_type,
            href=f"{base}/report.{name}",
            needs_map=True,
            options=[FileOption.ORDER, FileOption.LANGUAGE],
        )
        for name, kind in REPORTS.items()
    ]
    return reports + [
        ProductView(
            name=name,
            title=kind.title,
            media_type=kind.media_type,
            href=f"{base}/{kind.resource}.{kind.extension}",
            needs_map=not {MAP, CROSSOVERS}.isdisjoint(kind.needs),
            options=list(kind.options),
        )
        for name, kind in PRODUCTS.items()
        if (SEARCH not in kind.needs or mission.spec.search is not None)
        and (SWATHS not in kind.needs or mission.has_swath_sonars)
        and (TIERS not in kind.needs or mission.spec.coverage.cell_of_depth is not None)
    ]


def file_answer(product: Product | Response) -> Response:
    """Return what lets a client save a file under its name; an answer stays as it is."""
    if isinstance(product, Response):
        return product
    content = product.content
    return StreamingResponse(
        content.pieces(),  # read in a thread
        media_type=product.media_type,
        headers={
            "Content-Length": str(content.size_bytes),
            "Content-Disposition": f'attachment; filename="{quote(product.filename)}"',
            "Cache-Control": "no-cache",
        },
    )


@router.get(
    "/holidays.geojson",
    operation_id="getHolidaysFile",
    summary="Download the holidays",
    response_class=Response,
    responses=problems("conflict") | {200: {"content": {GEOJSON: {}}, "description": "A FeatureCollection"}},
)
async def get_holidays_file(service: Service, reader: Reader, mission: Mission) -> Response:
    """Return what swath sonars missed as a file."""
    return file_answer(
        await export(mission, service.maps, service.settings.provider, service.compute, "holidays.geojson")
    )


_FileOptions = Annotated[ProductOptions, Depends(_file_options)]


def _add_files(resource: str, operation_id: str, summary: str, description: str) -> None:
    kinds = _by_extension(resource)
    formats = ", ".join(kinds)

    async def get_file(
        format: Annotated[str, Path(description=f"One of {formats}", examples=[next(iter(kinds))])],  # noqa: A002
        service: Service,
        reader: Reader,
        mission: Mission,
        options: _FileOptions,
        request: Request,
    ) -> Response:
        if format not in kinds:
            raise ProblemError(
                "format-not-found",
                f"the {resource} {'is' if resource == MAP else 'are'} not made as .{format[:20]}",
                remedy="Use one of " + ", ".join(f".{name}" for name in kinds),
            )
        making = export(mission, service.maps, service.settings.provider, service.compute, kinds[format], options)
        return file_answer(await while_connected(request, making))

    get_file.__doc__ = description
    media = {PRODUCTS[name].media_type.partition(";")[0] for name in kinds.values()}
    router.add_api_route(
        f"/{resource}.{{format}}",
        get_file,
        methods=["GET"],
        operation_id=operation_id,
        summary=summary,
        response_class=Response,
        responses=problems("mission-not-found", "map-not-ready", "format-not-found", "conflict")
        | {
            200: {
                "description": "; ".join(f"`.{ext}`: {PRODUCTS[name].title}" for ext, name in kinds.items()),
                "content": {kind: {"schema": _schema_of(kind)} for kind in sorted(media)},
            }
        },
    )


def _schema_of(media_type: str) -> dict[str, str]:
    return {"type": "object"} if media_type.endswith("json") else {"type": "string", "format": "binary"}


for _kind in REPORTS.values():
    _add_report(_kind)

_add_files(MAP, "getMapFile", "Download the map", "Return the map as a file.")
_add_files(CONTOURS, "getContoursFile", "Download the contours", "Return the map's contours as a file.")
_add_files(SOUNDINGS, "getSoundingsFile", "Download the soundings", "Return the soundings as a file.")
_add_files(TRACKS, "getTracksFile", "Download the tracks", "Return where the vehicles were as a file.")
_add_files("lines", "getLinesFile", "Download the log of lines", "Return the lines that were flown as a file.")


def layer_of(snapshot: MapSnapshot, name: str, order: Order) -> Layer:
    """Return a layer. Raises InvalidRequestError where the mission has none of that name."""
    kind = LAYERS[name]
    found = kind.of(snapshot.source(order))
    if found is None:
        raise InvalidRequestError("layer", kind.absence, kind.remedy)
    return found


def _tag(state: EdgeState, snapshot: MapSnapshot, layers: Collection[str], *variant: object) -> str:
    shown = "".join(f"-{part}" for part in (*layers, *variant))
    if snapshot.interpolation is not None and any(LAYERS[name].live for name in layers):
        shown += f"{snapshot.interpolation.version}"
    return f'"{snapshot.facts.mission_id}-{state.run_id}-{snapshot.version}.{snapshot.revision}{shown}"'


def _matches(tag: str, if_none_match: str | None) -> bool:
    if if_none_match is None:
        return False
    sent = [candidate.strip().removeprefix("W/") for candidate in if_none_match.split(",")]
    return tag in sent or "*" in sent


def _caching(tag: str) -> dict[str, str]:
    return {"ETag": tag, "Cache-Control": "no-cache"}


def _not_modified(tag: str) -> Response:
    return Response(status_code=304, headers=_caching(tag))
