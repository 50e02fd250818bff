"""A mission's map as tiles for web maps and GIS, and the TileJSON that tells of them."""

import re
from collections.abc import Callable, Coroutine
from typing import Annotated, Any

from fastapi import APIRouter, Header, Path, Query, Request, Response
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field

from app.api.access.auth import READERS, Reader, RoleCheck
from app.api.http.links import link_root
from app.api.http.problems import problems
from app.api.maps.maps import End
from app.api.mission import Mission
from app.api.schemas import API, MissionId
from app.api.state import Service, edge_state
from app.mapping.coordinates.web_tiles import MAX_ZOOM, SIDE_PX, WebTile, finest_zoom
from app.missions.errors import InvalidRequestError
from app.missions.live.mission import LiveMission
from app.missions.maps.gis_layers import WEB_LAYERS, Range, WebLayer
from app.missions.operations.maps.map_pictures import PictureRequest
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from app.missions.states import ENDED

router = APIRouter(
    prefix=f"{API}/missions/{{mission_id}}/tiles",
    tags=["maps"],
    responses=problems("unauthenticated", "forbidden", "mission-not-found", "invalid-request"),
)

FRESH_S, FRESH_ENDED_S = 1, 30
"""How long programs may show a tile without asking again, of a mission that goes on and of one that has ended."""

DOUBLE = "@2x"

_Layer = Annotated[str, Path(description=f"One of {', '.join(WEB_LAYERS)}", pattern="^[a-z]+$", examples=["depth"])]
_IfNoneMatch = Annotated[str | None, Header(description="ETag of the tile that the client has")]
_Min = Annotated[End, Query(description="Value of the first colour; default: what the layer's TileJSON says")]
_Max = Annotated[End, Query(description="Value of the last colour; default: what the layer's TileJSON says")]


class TileJson(BaseModel):
    """Where a layer's tiles are (TileJSON 3.0)."""

    tilejson: str = "3.0.0"
    name: str
    description: str
    version: str = "1.0.0"
    attribution: str = ""
    scheme: str = "xyz"
    format: str = "png"
    tiles: list[str] = Field(description="Address of each tile, with {z}, {x} and {y}")
    minzoom: int
    maxzoom: int = Field(description="A cell of the map is at least four pixels wide there; there are tiles beyond")
    bounds: list[float] = Field(min_length=4, max_length=4, description="West, south, east and north, degrees")
    center: list[float] = Field(min_length=3, max_length=3, description="Longitude, latitude and zoom to begin with")
    layer: str
    unit: str = Field(description="Of `range`; empty for layers by classes")
    range: list[float] = Field(min_length=2, max_length=2, description="Values of the first and the last colour")


@router.get("/{layer}.json", operation_id="getTileJson", summary="See where a layer's tiles are")
async def get_tile_json(
    request: Request,
    service: Service,
    reader: Reader,
    mission_id: MissionId,
    layer: _Layer,
    min: _Min = None,  # noqa: A002
    max: _Max = None,  # noqa: A002
) -> TileJson:
    """Return the TileJSON of a layer; the addresses in it hold the key that it was asked for with, if any."""
    kind = _kind(layer)
    spec = await service.spec(mission_id)
    range_ = _range(kind, spec, min, max)
    west, south, east, north = _bounds(spec)
    maxzoom = finest_zoom(spec.cell_m, (south + north) / 2)
    query = "" if min is None and max is None else f"?min={range_[0]!r}&max={range_[1]!r}"
    return TileJson(
        name=f"{spec.name}: {kind.title}",
        description=kind.meaning,
        tiles=[f"{link_root(request)}{API}/missions/{mission_id}/tiles/{layer}/{{z}}/{{x}}/{{y}}.png{query}"],
        minzoom=0,
        maxzoom=maxzoom,
        bounds=[west, south, east, north],
        center=[(west + east) / 2, (south + north) / 2, _first_zoom(maxzoom)],
        layer=layer,
        unit=kind.unit,
        range=list(range_),
    )


class _TileRoute(APIRoute):
    """Answers plain requests itself: hundreds of tiles a second are asked for, and checking each field costs most."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return what answers a request."""
        handle = super().get_route_handler()

        async def answer(request: Request) -> Response:
            path = request.path_params
            found = _PLAIN.match(f"{path['layer']}/{path['z']}/{path['x']}/{path['y']}")
            kind = WEB_LAYERS.get(path["layer"])
            if found is None or kind is None or request.url.query or not _ID.match(path["mission_id"]):
                return await handle(request)
            edge = edge_state(request)
            await _READERS.admit(request, edge)
            mission = await edge.service.get(path["mission_id"])
            z, x, y = (int(number) for number in found.groups()[:3])
            return await _answer(
                edge.service,
                mission,
                kind,
                _tile(z, x, y),
                double=found[4] is not None,
                range_=kind.default_range(mission.spec),
                if_none_match=request.headers.get("if-none-match"),
            )

        return answer


_PLAIN = re.compile(r"^[a-z]+/([0-9]{1,2})/([0-9]{1,8})/([0-9]{1,8})(@2x)?$")
_ID = re.compile(r"^[A-Za-z0-9_-]{1,64}$")
_READERS = RoleCheck(READERS, "look")

tile_router = APIRouter(prefix=router.prefix, tags=["maps"], responses=router.responses, route_class=_TileRoute)


@tile_router.get(
    "/{layer}/{z}/{x}/{y}.png",
    operation_id="getTile",
    summary="See the map as tiles",
    response_class=Response,
    responses={
        200: {
            "description": "256 by 256 pixels of EPSG:3857, transparent where nothing is known; `@2x`: twice as many",
            "content": {"image/png": {"schema": {"type": "string", "format": "binary"}}},
        },
        304: {"description": "The tile still shows what the one of `If-None-Match` does"},
    },
)
async def get_tile(
    service: Service,
    reader: Reader,
    mission: Mission,
    layer: _Layer,
    z: Annotated[int, Path(ge=0, le=MAX_ZOOM, description="Zoom: the Earth is 2^z tiles wide")],
    x: Annotated[int, Path(ge=0, lt=2**MAX_ZOOM, description="Column, from the west")],
    y: Annotated[str, Path(pattern=r"^[0-9]{1,8}(@2x)?$", description="Row, from the north; then perhaps `@2x`")],
    min: _Min = None,  # noqa: A002
    max: _Max = None,  # noqa: A002
    if_none_match: _IfNoneMatch = None,
) -> Response:
    """Return a tile of a layer of the newest map. Its colours stay the same while the map grows."""
    kind = _kind(layer)
    tile = _tile(z, x, int(y.removesuffix(DOUBLE)))
    range_ = _range(kind, mission.spec, min, max)
    double = y.endswith(DOUBLE)
    return await _answer(service, mission, kind, tile, double=double, range_=range_, if_none_match=if_none_match)


async def _answer(
    service: MissionService,
    mission: LiveMission,
    kind: WebLayer,
    tile: WebTile,
    *,
    double: bool,
    range_: Range,
    if_none_match: str | None,
) -> Response:
    window = tile.window(SIDE_PX * (2 if double else 1))
    wanted = PictureRequest(mission.id, kind.name, range_, window)
    picture = await service.map_pictures.picture(mission, service.maps, wanted)
    tag = f'"{picture.tag}"'
    fresh_s = FRESH_ENDED_S if mission.header.state in ENDED else FRESH_S
    headers = {"ETag": tag, "Cache-Control": f"private, max-age={fresh_s}"}
    if if_none_match is not None and (tag in if_none_match or if_none_match.strip() == "*"):
        return Response(status_code=304, headers=headers)
    return Response(picture.content, media_type="image/png", headers=headers)


def _bounds(spec: MissionSpec) -> tuple[float, float, float, float]:
    """Return the area's west, south, east and north, degrees."""
    lon, lat = zip(*spec.area.ring, strict=True)
    return min(lon), min(lat), max(lon), max(lat)


def _first_zoom(finest: int) -> int:
    """Return the zoom that programs may begin with, where a layer has tiles up to the finest."""
    return max(finest - 3, 0)


def _tile(z: int, x: int, y: int) -> WebTile:
    """Return a tile. Raises InvalidRequestError where there is none."""
    try:
        return WebTile(z, x, y)
    except ValueError as error:
        words = str(error)
        raise InvalidRequestError(words[0], words, "Ask for a tile that there is") from None


def _kind(layer: str) -> WebLayer:
    if layer not in WEB_LAYERS:
        raise InvalidRequestError(
            "layer", f"there are no tiles of a layer {layer!r}", f"Use one of {', '.join(WEB_LAYERS)}"
        )
    return WEB_LAYERS[layer]


def _range(kind: WebLayer, spec: MissionSpec, low: float | None, high: float | None) -> Range:
    """Return the colours' range. Raises InvalidRequestError where there is none."""
    usual = kind.default_range(spec)
    if not kind.unit:
        if low is not None or high is not None:
            raise InvalidRequestError(
                "max" if low is None else "min",
                f"the layer {kind.name} has classes, no range",
                "Leave min and max out",
            )
        return usual
    found = usual[0] if low is None else low, usual[1] if high is None else high
    if found[0] >= found[1]:
        raise InvalidRequestError("max", f"max is {found[1]:g} but min is {found[0]:g}", "Give a max above min")
    return found
