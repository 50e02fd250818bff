"""What of a mission lies somewhere, as features; soundings, of which there may be millions, page by page."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import orjson
from shapely.geometry import box, shape
from shapely.geometry.base import BaseGeometry

from app.mapping.products.contours import find_contours, usual_interval_m
from app.mapping.products.tracks import utc_text
from app.missions.errors import ConflictError, MapNotReadyError
from app.missions.live.mission import LiveMission
from app.missions.maps.products import snapshot_holidays
from app.missions.maps.snapshot import MapSnapshot
from app.missions.operations.maps.mission_maps import newest_map
from app.missions.running.final_maps import FinalMaps
from app.missions.states import ENDED, MissionState
from app.storage.database import Database
from app.storage.models import MissionRow
from app.storage.queries import soundings as sounding_queries

FEWEST_OF_A_LINE = 2

ROWS_LOOKED_AT = 50_000
"""Soundings that are held against a box by one query."""


class Kind(StrEnum):
    """What features there are."""

    AREAS = "areas"
    TRACKS = "tracks"
    SOUNDINGS = "soundings"
    CONTOURS = "contours"
    HOLIDAYS = "holidays"
    VEHICLES = "vehicles"
    TRAFFIC = "traffic"


@dataclass(frozen=True)
class Feature:
    """Something that lies somewhere.

    Attributes
    ----------
    id
        That of its mission, a point and its own; of soundings a number.
    geometry, properties
        As in GeoJSON, longitude and latitude of WGS 84.
    begins_s, ends_s
        When it was there, Unix seconds; ``ends_s`` None: it still is.
    """

    id: str | int
    geometry: dict[str, Any]
    properties: dict[str, Any]
    begins_s: float
    ends_s: float | None


@dataclass(frozen=True)
class Wanted:
    """Which features are asked for.

    Attributes
    ----------
    boxes
        West, south, east and north, degrees: they have to touch one of them. None: anywhere.
    from_s, until_s
        When they have to have been there, Unix seconds; None: without an end.
    vehicle, state
        None: any.
    """

    boxes: Sequence[tuple[float, float, float, float]] | None = None
    from_s: float | None = None
    until_s: float | None = None
    vehicle: str | None = None
    state: str | None = None

    def meets_time(self, begins_s: float, ends_s: float | None) -> bool:
        """Tell whether something was there at any of the times that are asked for."""
        return (self.until_s is None or begins_s <= self.until_s) and (
            self.from_s is None or ends_s is None or ends_s >= self.from_s
        )

    def meets_place(self, geometry: BaseGeometry) -> bool:
        """Tell whether a geometry touches what is asked for."""
        return self.boxes is None or any(geometry.intersects(box(*corners)) for corners in self.boxes)

    def takes(self, feature: Feature) -> bool:
        """Tell whether a feature is asked for."""
        properties = feature.properties
        return (
            self.meets_time(feature.begins_s, feature.ends_s)
            and (self.vehicle is None or properties.get("vehicle") == self.vehicle)
            and (self.state is None or properties.get("state") == self.state)
            and self.meets_place(shape(feature.geometry))
        )


def order_of(kind: Kind, feature_id: str) -> tuple[float, str]:
    """Return where a feature stands among those of its mission, also where there is none of that id any more."""
    own = feature_id.partition(".")[2]
    if kind in (Kind.CONTOURS, Kind.HOLIDAYS):
        try:
            return float(own), ""
        except ValueError:
            return 0.0, own
    return 0.0, own


def period_of(row: MissionRow) -> tuple[float, float | None]:
    """Return from when to when a mission went on, Unix seconds; the latter None while it does."""
    ended = MissionState(row.state) in ENDED
    return row.created_at.timestamp(), row.updated_at.timestamp() if ended else None


def area_of(row: MissionRow) -> Feature:
    """Return the area of a mission."""
    begins_s, ends_s = period_of(row)
    properties = {
        "mission": row.id,
        "name": row.name,
        "state": row.state,
        "start_datetime": utc_text(begins_s),
        "end_datetime": None if ends_s is None else utc_text(ends_s),
    }
    return Feature(row.id, row.spec["area"] | {"type": "Polygon"}, properties, begins_s, ends_s)


async def features_of(live: LiveMission, maps: FinalMaps, kind: Kind, row: MissionRow) -> list[Feature]:
    """Return all features of a kind of a mission, in their order; not for soundings, of which there may be millions."""
    if kind is Kind.AREAS:
        return [area_of(row)]
    if kind is Kind.TRACKS:
        return await _tracks(live)
    if kind is Kind.VEHICLES:
        return _vehicles(live)
    if kind is Kind.TRAFFIC:
        return _traffic(live)
    try:
        snapshot = await newest_map(live, maps, patient=False)
    except MapNotReadyError:
        return []
    return await live.part(_MapFeatures).of(snapshot, kind, period_of(row))


async def _tracks(live: LiveMission) -> list[Feature]:
    await live.journal.flush()
    lines = await live.trails.newest()
    periods = live.trails.periods_s()
    return [
        Feature(
            f"{live.id}.{vehicle}",
            {"type": "LineString", "coordinates": [[lon, lat] for lon, lat, _ in places]},
            {
                "mission": live.id,
                "vehicle": vehicle,
                "start_datetime": utc_text(periods[vehicle][0]),
                "end_datetime": utc_text(periods[vehicle][1]),
            },
            *periods[vehicle],
        )
        for vehicle, places in sorted(lines.items())
        if len(places) >= FEWEST_OF_A_LINE
    ]


def _vehicles(live: LiveMission) -> list[Feature]:
    if live.header.state in ENDED:
        return []
    found = []
    for view in sorted(live.vehicles.all(), key=lambda view: view.name):
        member = live.team.get(view.name) or live.team.departed.get(view.name)
        if view.lat_deg is None or view.lon_deg is None or member is None or member.report is None:
            continue
        shown = view.model_dump(mode="json", include=set(_VEHICLE_FIELDS))
        at_s = member.report.time_s
        properties = {"mission": live.id, "vehicle": view.name, "datetime": utc_text(at_s), **shown}
        place = {"type": "Point", "coordinates": [view.lon_deg, view.lat_deg]}
        found.append(Feature(f"{live.id}.{view.name}", place, properties, at_s, at_s))
    return found


_VEHICLE_FIELDS = (
    *("active", "phase", "link", "age_s", "depth_m", "altitude_m", "heading_deg", "speed_mps", "battery_pct"),
    "position_sd_m",
)


def _traffic(live: LiveMission) -> list[Feature]:
    if live.header.state in ENDED:
        return []
    found = []
    for view in sorted(live.ships.views(), key=lambda view: str(view.mmsi)):
        shown = view.model_dump(mode="json", exclude={"lat_deg", "lon_deg", "closest", "heard_at", "age_s"})
        at_s, closest = view.heard_at.timestamp(), view.closest
        properties = {
            "mission": live.id,
            "datetime": utc_text(at_s),
            **shown,
            "closest_vehicle": None if closest is None else closest.vehicle,
            "closest_m": None if closest is None else closest.distance_m,
            "closest_in_s": None if closest is None else closest.in_s,
            "alarm": closest is not None and closest.alarm,
        }
        place = {"type": "Point", "coordinates": [view.lon_deg, view.lat_deg]}
        found.append(Feature(f"{live.id}.{view.mmsi}", place, properties, at_s, at_s))
    return found


class _MapFeatures:
    """Features that are made of a mission's map, kept until there is a newer one."""

    def __init__(self, live: LiveMission) -> None:
        self._id = live.id
        self._made: dict[Kind, tuple[str, list[Feature]]] = {}
        self._making = asyncio.Lock()

    async def of(self, snapshot: MapSnapshot, kind: Kind, period_s: tuple[float, float | None]) -> list[Feature]:
        """Return contours or holidays of a map."""
        tag = f"{snapshot.tag} {period_s}"
        async with self._making:
            if kind not in self._made or self._made[kind][0] != tag:
                make: Callable[..., list[Feature]] = _contours if kind is Kind.CONTOURS else _holidays
                self._made[kind] = tag, await asyncio.to_thread(make, self._id, snapshot, period_s)
            return self._made[kind][1]


def _contours(mission_id: str, snapshot: MapSnapshot, period_s: tuple[float, float | None]) -> list[Feature]:
    bathymetry = snapshot.built.map
    found = find_contours(bathymetry, snapshot.facts.frame, usual_interval_m(bathymetry.depth_m))
    datum = snapshot.facts.vertical_datum.statement
    return [
        Feature(
            f"{mission_id}.{contour.depth_m:g}",
            {"type": "MultiLineString", "coordinates": [[[lon, lat] for lon, lat in line] for line in contour.lines]},
            {"mission": mission_id, "depth_m": contour.depth_m, "vertical_datum": datum, "version": snapshot.version},
            *period_s,
        )
        for contour in found
    ]


def _holidays(mission_id: str, snapshot: MapSnapshot, period_s: tuple[float, float | None]) -> list[Feature]:
    try:
        found = orjson.loads(snapshot_holidays(snapshot))["features"]
    except ConflictError:
        return []
    return [
        Feature(
            f"{mission_id}.{one['properties']['number']}",
            one["geometry"],
            {"mission": mission_id, **one["properties"], "version": snapshot.version},
            *period_s,
        )
        for one in found
    ]


async def soundings_after(
    database: Database, mission_ids: Sequence[str] | None, wanted: Wanted, after: int, limit: int
) -> list[Feature]:
    """Return up to ``limit`` accepted soundings with an id above ``after``, in the order in which they came.

    None only where there are no more, whatever part of them lies in the boxes. ``mission_ids`` None: of all missions.
    """
    found: list[Feature] = []
    most = 2 * limit if wanted == Wanted() else ROWS_LOOKED_AT
    async with database.reading() as session:
        while True:
            queries = sounding_queries.accepted_after(
                mission_ids,
                after,
                most,
                boxes=wanted.boxes,
                from_s=wanted.from_s,
                until_s=wanted.until_s,
                vehicle=wanted.vehicle,
            )
            looked_at, rows = await sounding_queries.window(session, queries, most, limit - len(found))
            found += [_sounding(row) for row in rows]
            if looked_at is None or len(found) >= limit:
                return found
            after = looked_at


async def sounding_of(database: Database, sounding_id: int) -> Feature | None:
    """Return an accepted sounding; None where there is none of that id."""
    found = await soundings_after(database, None, Wanted(), sounding_id - 1, 1)
    return found[0] if found and found[0].id == sounding_id else None


def _sounding(row: Any) -> Feature:
    properties = {
        "mission": row.mission_id,
        "vehicle": row.vehicle,
        "datetime": utc_text(row.time_s),
        "depth_m": round(row.depth_m, 3),
        "sd_m": round(row.sd_m, 3),
        "position_sd_m": row.position_sd_m,
        "beam": row.beam,
        "step": row.step,
    }
    place = {"type": "Point", "coordinates": [row.lon_deg, row.lat_deg]}
    return Feature(row.id, place, properties, row.time_s, row.time_s)
