"""Where maps come from: missions of this process, and those of others, which are asked."""

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

import httpx
import orjson
import structlog
from pydantic import BaseModel, ValidationError
from starlette.requests import Request

from app.api.accounts.processes import comes_from_peer
from app.api.http.problems import ProblemError
from app.api.maps.ogc.dataset import Dataset
from app.api.maps.ogc.sources import PEER_S, enlarged, extent
from app.api.maps.wms.parameters import JSON, PNG, MapRequest
from app.api.maps.wms.problems import NEW
from app.api.state import EdgeState
from app.mapping.coordinates.map_windows import WGS84, MapWindow
from app.missions.errors import MissionElsewhereError, MissionNotFoundError, MissionUnreadableError
from app.missions.maps.gis_layers import WEB_LAYERS, CellValues, Range, WebLayer
from app.missions.operations.maps.map_pictures import MapPicture, PictureRequest
from app.missions.running.ownership import Peer
from app.missions.spec.limits import Limits
from app.storage.models import MissionRow

MOST_MISSIONS = 8
"""At most so many missions, the newest, are drawn into one picture."""
BESIDE_M = 1000.0
"""Maps reach a little beyond their areas."""

log = structlog.get_logger(__name__)


class _Stored(BaseModel):
    """What of a stored description its colours follow from."""

    limits: Limits
    accuracy_m: float


@dataclass(frozen=True)
class FeatureInfo:
    """What is known of a place by the map of a mission."""

    mission_id: str
    name: str
    values: CellValues


def usual_range(layer: WebLayer, rows: Sequence[MissionRow]) -> Range:
    """Return the range of a layer's colours that holds those of all missions that can be read."""
    ranges: list[Range] = []
    for row in rows:
        with suppress(ValidationError):
            ranges.append(layer.default_range(_Stored.model_validate(row.spec)))
    ranges = ranges or [(0.0, 1.0)]
    return min(low for low, _ in ranges), max(high for _, high in ranges)


async def pictures(request: Request, edge: EdgeState, data: Dataset, wanted: MapRequest) -> list[MapPicture]:
    """Return the pictures that lie over each other, the lowest first. Raises ProblemError, MissionNotFoundError."""
    rows = _about(data.rows, wanted.window.bounds_deg())
    ranges = {name: _range(name, data, wanted) for name in wanted.layers}
    asked = [
        _picture(request, edge, data, row, PictureRequest(row.id, name, range_, wanted.window))
        for name, range_ in ranges.items()
        for row in rows
    ]
    return [found for found in await asyncio.gather(*asked) if found is not None]


def _range(name: str, data: Dataset, wanted: MapRequest) -> Range:
    layer = WEB_LAYERS[name]
    return wanted.range if wanted.range is not None and layer.unit else usual_range(layer, data.rows)


def _about(rows: Sequence[MissionRow], ends: tuple[float, float, float, float]) -> list[MissionRow]:
    """Return the missions near a rectangle, oldest first, at most so many as are drawn."""
    west, south, east, north = enlarged(ends, BESIDE_M)
    found = []
    for row in rows:
        own = extent([row])
        if own[0] <= east and own[2] >= west and own[1] <= north and own[3] >= south:
            found.append(row)
    return found[-MOST_MISSIONS:]


async def _picture(
    request: Request, edge: EdgeState, data: Dataset, row: MissionRow, wanted: PictureRequest
) -> MapPicture | None:
    try:
        peer = await _owner(request, edge, row)
        if peer is not None:
            query = {"REQUEST": "GetMap", "LAYERS": wanted.layer, "FORMAT": PNG}
            answer = await _asked(request, edge, peer, row, query, wanted.window, wanted.range)
            return MapPicture(answer.content, answer.headers.get("etag", "").strip('"'))
        return await edge.service.map_pictures.picture(await edge.service.get(row.id), edge.service.maps, wanted)
    except (MissionElsewhereError, MissionNotFoundError, MissionUnreadableError, httpx.HTTPError) as error:
        _leave_out(data, row, error)
        return None


async def values(
    request: Request, edge: EdgeState, data: Dataset, window: MapWindow, column: int, row: int
) -> list[FeatureInfo]:
    """Return what is known of the place under a pixel, by the newest mission first."""
    lat, lon = window.place(column, row)
    near = _about(data.rows, (lon, lat, lon, lat)) if abs(lat) <= 90.0 and abs(lon) <= 180.0 else []
    found = await asyncio.gather(*(_values(request, edge, data, one, lat, lon) for one in reversed(near)))
    return [one for one in found if one is not None]


async def _values(
    request: Request, edge: EdgeState, data: Dataset, row: MissionRow, lat: float, lon: float
) -> FeatureInfo | None:
    try:
        peer = await _owner(request, edge, row)
        if peer is not None:
            return await _values_of_peer(request, edge, peer, row, lat, lon)
        live = await edge.service.get(row.id)
        values = await edge.service.map_pictures.values(live, edge.service.maps, lat, lon)
    except (MissionElsewhereError, MissionNotFoundError, MissionUnreadableError, httpx.HTTPError) as error:
        _leave_out(data, row, error)
        return None
    return None if values is None else FeatureInfo(row.id, row.name, values)


async def _values_of_peer(
    request: Request, edge: EdgeState, peer: Peer, row: MissionRow, lat: float, lon: float
) -> FeatureInfo | None:
    side = 1e-7
    window = MapWindow(WGS84, lon - side, lat - side, lon + side, lat + side, 1, 1)
    query = {"REQUEST": "GetFeatureInfo", "QUERY_LAYERS": "depth", "INFO_FORMAT": JSON, "I": "0", "J": "0"}
    answer = await _asked(request, edge, peer, row, query, window, None)
    for feature in orjson.loads(answer.content)["features"]:
        said = feature["properties"]
        values = CellValues(said["depth_m"], said["sd_m"], said["soundings"], said["vertical_datum"])
        return FeatureInfo(row.id, row.name, values)
    return None


async def _owner(request: Request, edge: EdgeState, row: MissionRow) -> Peer | None:
    """Return the other process that has a mission."""
    return None if comes_from_peer(request.scope) else await edge.service.process.owner(row.id)


async def _asked(
    request: Request,
    edge: EdgeState,
    peer: Peer,
    row: MissionRow,
    query: dict[str, str],
    window: MapWindow,
    range_: Range | None,
) -> httpx.Response:
    """Return what another process answers in the name of who asks. Raises httpx.HTTPError."""
    system = "CRS:84" if window.epsg == WGS84 else f"EPSG:{window.epsg}"
    ends = window.west, window.south, window.east, window.north
    full: dict[str, Any] = {"SERVICE": "WMS", "VERSION": NEW, **query, "CRS": system, "TRANSPARENT": "TRUE"}
    full |= {"BBOX": ",".join(map(repr, ends)), "WIDTH": window.width_px, "HEIGHT": window.height_px}
    if range_ is not None:
        full["COLORSCALERANGE"] = f"{range_[0]!r},{range_[1]!r}"
    # What this process has seen of the picture is not what its client has.
    headers = [(name, value) for name, value in request.scope["headers"] if not name.startswith(b"if-")]
    scope = dict(request.scope) | {"method": "GET", "headers": headers}
    target = f"/wms/missions/{row.id}?{urlencode(full)}"
    answer = await edge.peers.to(peer).send(edge.peers.request(peer, scope, target, timeout=PEER_S))
    answer.raise_for_status()
    if answer.headers.get("content-type", "").startswith("text/xml"):
        raise httpx.RemoteProtocolError(answer.text[:500])
    return answer


def _leave_out(data: Dataset, row: MissionRow, error: Exception) -> None:
    """Go on without a mission among many. Raises ProblemError for the one that is asked for alone."""
    if data.single:
        if isinstance(error, httpx.HTTPError):
            raise ProblemError(
                "mission-elsewhere", "the process that has the mission does not answer", remedy="Ask again in a moment"
            ) from None
        raise error
    log.warning("a mission is left out of a map", mission=row.id, error=str(error) or type(error).__name__)
