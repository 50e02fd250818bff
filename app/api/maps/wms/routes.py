"""WMS of all missions at ``/wms`` and of one at ``/wms/missions/{id}``.

Programs ask for one picture a view, whenever they draw it: they see a running survey grow, which those that keep tiles
do not.
"""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Depends
from starlette.requests import Request
from starlette.responses import Response

from app.api.access.auth import Reader
from app.api.http.while_connected import while_connected
from app.api.maps.ogc.dataset import Dataset, dataset_of
from app.api.maps.ogc.sources import extent
from app.api.maps.wms.answers import info_answer, map_answer
from app.api.maps.wms.capabilities import Offer, capabilities
from app.api.maps.wms.parameters import (
    PNG,
    SYSTEMS,
    Parameters,
    info_request,
    layer_of_legend,
    map_request,
    range_of,
    version_of,
)
from app.api.maps.wms.problems import NEW, WmsError, report, wrong
from app.api.maps.wms.sources import pictures, usual_range, values
from app.api.state import EdgeState, State
from app.mapping.layers import LAYERS
from app.mapping.products.pictures.legend import class_legend, range_legend
from app.missions.maps.gis_layers import WEB_LAYERS

WMS = "/wms"
WHOLE_EARTH = (-180.0, -90.0, 180.0, 90.0)

router = APIRouter(prefix=WMS, include_in_schema=False)


async def _dataset(request: Request, reader: Reader, state: State) -> Dataset:
    """Return what is asked for; nobody is told who may not even look. Raises MissionNotFoundError."""
    return await dataset_of(request, state, WMS)


Data = Annotated[Dataset, Depends(_dataset)]


@router.api_route("/missions/{mission_id}/", methods=["GET", "HEAD"])
@router.api_route("/missions/{mission_id}", methods=["GET", "HEAD"])
@router.api_route("/", methods=["GET", "HEAD"])
@router.api_route("", methods=["GET", "HEAD"])
async def get_map_service(request: Request, data: Data, state: State) -> Response:
    """Answer an operation of the standard; what is wrong is answered as the standard has it, too."""
    version = version_of(request.query_params)
    try:
        given = Parameters(request.query_params)
        service = given.get("SERVICE", "WMS")
        if service.upper() != "WMS":
            raise wrong("SERVICE", service, "it has to be WMS")
        right = f"use one of {', '.join(OPERATIONS)}; programs begin with ?SERVICE=WMS&REQUEST=GetCapabilities"
        name = given.required("REQUEST", right)
        found = {one.lower(): operation for one, operation in OPERATIONS.items()}.get(name.lower())
        if found is None:
            raise wrong("REQUEST", name, right, "OperationNotSupported")
        return await found(request, state, data, given, version)
    except WmsError as error:
        return report(error, version)


async def _capabilities(request: Request, state: EdgeState, data: Dataset, given: Parameters, version: str) -> Response:
    range_ = range_of(given)
    # What programs ask for later begins with this.
    kept = "" if range_ is None else urlencode({"COLORSCALERANGE": f"{range_[0]!r},{range_[1]!r}"}) + "&"
    ends = extent(data.rows) if data.rows else WHOLE_EARTH
    offer = Offer(data.title, f"{data.root}?{kept}", ends, _epsg(data))
    media_type = "text/xml" if version == NEW else "application/vnd.ogc.wms_xml"
    return Response(capabilities(offer, version), media_type=media_type, headers={"Cache-Control": "no-cache"})


async def _map(request: Request, state: EdgeState, data: Dataset, given: Parameters, version: str) -> Response:
    wanted = map_request(given, version, _epsg(data))
    found = await while_connected(request, pictures(request, state, data, wanted))
    if isinstance(found, Response):
        return found
    return await map_answer(state.service.map_pictures, wanted, found, request.headers.get("if-none-match"))


async def _feature_info(request: Request, state: EdgeState, data: Dataset, given: Parameters, version: str) -> Response:
    asked = info_request(given, version, _epsg(data))
    found = await values(request, state, data, asked.map.window, asked.column, asked.row)
    return info_answer(asked.format, found, *asked.map.window.place(asked.column, asked.row))


async def _legend(request: Request, state: EdgeState, data: Dataset, given: Parameters, version: str) -> Response:
    layer = WEB_LAYERS[layer_of_legend(given)]
    if layer.unit:
        range_ = range_of(given) or usual_range(layer, data.rows)
        content = await asyncio.to_thread(range_legend, layer.title, "m", range_, LAYERS[layer.name].fit)
    else:
        content = await asyncio.to_thread(class_legend, layer.title, layer.classes)
    return Response(content, media_type=PNG, headers={"Cache-Control": "private, max-age=60"})


def _epsg(data: Dataset) -> list[int]:
    return [*SYSTEMS, *data.zone]


OPERATIONS: dict[str, Callable[[Request, EdgeState, Dataset, Parameters, str], Awaitable[Response]]] = {
    "GetCapabilities": _capabilities,
    "GetMap": _map,
    "GetFeatureInfo": _feature_info,
    "GetLegendGraphic": _legend,
}
