"""Where features come from: missions of this process, those of others, which are asked, and the database."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any
from urllib.parse import urlsplit

import httpx
import orjson
import structlog
from starlette.requests import Request

from app.api.accounts.processes import comes_from_peer
from app.api.maps.ogc.crs import Box
from app.api.maps.ogc.parameters import MOST_LIMIT, ItemsQuery
from app.api.state import EdgeState
from app.mapping.coordinates.distances import METRES_PER_DEGREE
from app.missions.errors import MissionElsewhereError, MissionNotFoundError, MissionUnreadableError
from app.missions.operations.maps.features import (
    Feature,
    Kind,
    area_of,
    features_of,
    order_of,
    period_of,
    sounding_of,
    soundings_after,
)
from app.missions.running.ownership import Peer
from app.storage.models import MissionRow

PEER_S = 20.0
"""How long another process may take to answer."""

BESIDE_M = 60_000.0
"""Farther from the area nothing of a mission is looked for."""
NEAR_M = 500.0
"""Vehicles turn and drift so far beside their ways."""
FEW = 4
"""All features are counted of at most so many missions."""

LARGEST_ID = 2**63 - 1

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class Page:
    """Features, where to go on (empty: there are no more), and how many there are in all, as far as that is known."""

    features: list[Feature]
    after: str = ""
    matched: int | None = None


async def page(request: Request, edge: EdgeState, kind: Kind, rows: Sequence[MissionRow], query: ItemsQuery) -> Page:
    """Return a page of the features of missions, which are in the order in which they were created."""
    asked = [row for row in rows if _may_have(row, kind, query)]
    if kind is Kind.SOUNDINGS:
        return await _soundings(edge, rows, asked, query)
    after_mission, _, _ = query.after.partition(".")
    ids = [row.id for row in asked]
    if query.after and after_mission not in ids:
        # It may have been deleted, or be none: those that were created later follow.
        asked_after = [row for row in rows if row.id == after_mission]
        asked = [row for row in asked if asked_after and _order(row) > _order(asked_after[0])]
        first = 0
    else:
        first = ids.index(after_mission) if query.after else 0
    counted = kind is Kind.AREAS or len(asked) <= FEW
    found: list[Feature] = []
    matched = 0
    for number, row in enumerate(asked):
        if (number < first and not counted) or (len(found) > query.limit and not counted):
            continue
        own = [feature for feature in await _all(request, edge, kind, row) if query.wanted.takes(feature)]
        matched += len(own)
        if number == first and query.after:
            begun = order_of(kind, query.after)
            own = [feature for feature in own if order_of(kind, str(feature.id)) > begun]
        if number >= first:
            found += own
    more = len(found) > query.limit
    found = found[: query.limit]
    whole = not query.after and not more
    return Page(found, str(found[-1].id) if more else "", matched if counted or whole else None)


async def _soundings(edge: EdgeState, rows: Sequence[MissionRow], asked: list[MissionRow], query: ItemsQuery) -> Page:
    ids = None if len(asked) == len(rows) and len(rows) > 1 else [row.id for row in asked]
    if ids is not None and not ids:
        return Page([], matched=0)
    after = min(int(query.after), LARGEST_ID) if query.after.isascii() and query.after.isdigit() else 0
    found = await soundings_after(edge.service.database, ids, query.wanted, after, query.limit + 1)
    if len(found) <= query.limit:
        return Page(found, matched=None if query.after else len(found))
    return Page(found[: query.limit], str(found[query.limit - 1].id))


async def feature(
    request: Request, edge: EdgeState, kind: Kind, rows: Sequence[MissionRow], feature_id: str
) -> Feature | None:
    """Return the feature of an id; None where there is none."""
    if kind is Kind.SOUNDINGS:
        if not (feature_id.isascii() and feature_id.isdigit() and len(feature_id) < 19):
            return None
        found = await sounding_of(edge.service.database, int(feature_id))
        known = {row.id for row in rows}
        return found if found is not None and found.properties["mission"] in known else None
    mission_id = feature_id.partition(".")[0]
    for row in rows:
        if row.id == mission_id:
            return next((one for one in await _all(request, edge, kind, row) if one.id == feature_id), None)
    return None


async def _all(request: Request, edge: EdgeState, kind: Kind, row: MissionRow) -> list[Feature]:
    """Return all features of a mission, whoever has it; none where nobody can tell."""
    if kind is Kind.AREAS:
        return [area_of(row)]
    try:
        peer = None if comes_from_peer(request.scope) else await edge.service.process.owner(row.id)
        if peer is not None:
            return await _of_peer(request, edge, peer, kind, row)
        return await features_of(await edge.service.get(row.id), edge.service.maps, kind, row)
    except (MissionElsewhereError, MissionNotFoundError, MissionUnreadableError, httpx.HTTPError) as error:
        log.warning("features are left out", mission=row.id, kind=kind, error=str(error) or type(error).__name__)
        return []


async def _of_peer(request: Request, edge: EdgeState, peer: Peer, kind: Kind, row: MissionRow) -> list[Feature]:
    target = f"/ogc/missions/{row.id}/collections/{kind}/items?limit={MOST_LIMIT}"
    scope = dict(request.scope) | {"method": "GET"}
    found = []
    while target:
        answer = await edge.peers.to(peer).send(edge.peers.request(peer, scope, target, timeout=PEER_S))
        answer.raise_for_status()
        collection = orjson.loads(answer.content)
        found += [_read(one, row) for one in collection["features"]]
        following = [link["href"] for link in collection["links"] if link["rel"] == "next"]
        address = urlsplit(following[0]) if following else None
        target = f"{address.path}?{address.query}" if address else ""
    return found


def _read(one: dict[str, Any], row: MissionRow) -> Feature:
    properties = one["properties"]
    at = properties.get("datetime")
    begin, end = (at, at) if at else (properties.get("start_datetime"), properties.get("end_datetime"))
    if begin is None:
        return Feature(one["id"], one["geometry"], properties, *period_of(row))
    begins_s = datetime.fromisoformat(begin).timestamp()
    return Feature(
        one["id"], one["geometry"], properties, begins_s, datetime.fromisoformat(end).timestamp() if end else None
    )


def _order(row: MissionRow) -> tuple[datetime, str]:
    return row.created_at, row.id


def _may_have(row: MissionRow, kind: Kind, query: ItemsQuery) -> bool:
    """Tell whether a mission may have some of what is asked for, at a glance."""
    if query.mission is not None and row.id != query.mission:
        return False
    if query.wanted.boxes is None:
        return True
    west, south, east, north = enlarged(extent([row]), 0.0 if kind is Kind.AREAS else BESIDE_M)
    return any(one[0] <= east and one[2] >= west and one[1] <= north and one[3] >= south for one in query.wanted.boxes)


def extent(rows: Sequence[MissionRow]) -> Box:
    """Return the ends of the areas of missions."""
    places = [place for row in rows for place in row.spec["area"]["coordinates"][0]]
    lon, lat = zip(*places, strict=True)
    return min(lon), min(lat), max(lon), max(lat)


def extent_of_ways(rows: Sequence[MissionRow]) -> Box:
    """Return about where vehicles of missions go: over the areas, and from and to where they set out and come home."""
    places = [place for row in rows for place in _ends_of_ways(row.spec)]
    west, south, east, north = extent(rows)
    lon, lat = zip(*places, (west, south), (east, north), strict=True)
    return enlarged((min(lon), min(lat), max(lon), max(lat)), NEAR_M)


def _ends_of_ways(spec: dict[str, Any]) -> list[tuple[float, float]]:
    vehicles = spec.get("vehicles", [])
    points = [(spec.get("recovery") or {}).get("point")]
    points += [vehicle.get(name) for vehicle in vehicles for name in ("start", "recovery_point")]
    return [(point[0], point[1]) for point in points if point is not None]


def enlarged(ends: Box, by_m: float) -> Box:
    """Return ends that lie so many metres further out."""
    west, south, east, north = ends
    up = by_m / METRES_PER_DEGREE
    across = up / max(math.cos(math.radians(max(abs(south), abs(north)))), 0.01)
    return max(west - across, -180.0), max(south - up, -90.0), min(east + across, 180.0), min(north + up, 90.0)
