"""The collections of features, each declared once."""

from dataclasses import dataclass, field
from typing import Any

from app.missions.operations.maps.features import Kind

_TEXT: dict[str, Any] = {"type": "string"}
_TIME: dict[str, Any] = {"type": "string", "format": "date-time"}
_NUMBER: dict[str, Any] = {"type": "number"}
_COUNT: dict[str, Any] = {"type": "integer"}
_TRUTH: dict[str, Any] = {"type": "boolean"}
_OPEN_TEXT: dict[str, Any] = {"type": "string", "nullable": True}
_OPEN_TIME: dict[str, Any] = {"type": "string", "format": "date-time", "nullable": True}
_OPEN_NUMBER: dict[str, Any] = {"type": "number", "nullable": True}


@dataclass(frozen=True)
class Collection:
    """A collection of features: the type of their geometry, their properties, and those that can be asked by."""

    kind: Kind
    title: str
    description: str
    geometry: str
    properties: dict[str, dict[str, Any]] = field(default_factory=dict)
    queryables: tuple[str, ...] = ("mission",)


COLLECTIONS = {
    collection.kind.value: collection
    for collection in (
        Collection(
            Kind.AREAS,
            "Areas",
            "The area of each mission. Time: from when it was created until it ended.",
            "Polygon",
            {
                "mission": _TEXT,
                "name": _TEXT,
                "state": _TEXT,
                "start_datetime": _TIME,
                "end_datetime": _OPEN_TIME,
            },
            ("mission", "state"),
        ),
        Collection(
            Kind.TRACKS,
            "Tracks",
            "Where each vehicle of a mission has been, to within 0.2 m. Time: of its first and its last position.",
            "LineString",
            {"mission": _TEXT, "vehicle": _TEXT, "start_datetime": _TIME, "end_datetime": _TIME},
            ("mission", "vehicle"),
        ),
        Collection(
            Kind.SOUNDINGS,
            "Soundings",
            "Accepted soundings, corrected, in the order of arrival. Beams of swath sonars are in the map only.",
            "Point",
            {
                "mission": _TEXT,
                "vehicle": _TEXT,
                "datetime": _TIME,
                "depth_m": _NUMBER,
                "sd_m": _NUMBER,
                "position_sd_m": _OPEN_NUMBER,
                "beam": _COUNT,
                "step": _COUNT,
            },
            ("mission", "vehicle"),
        ),
        Collection(
            Kind.CONTOURS,
            "Contours",
            "Lines of equal depth of the newest map, about ten of them. Time: the mission's.",
            "MultiLineString",
            {"mission": _TEXT, "depth_m": _NUMBER, "vertical_datum": _TEXT, "version": _COUNT},
        ),
        Collection(
            Kind.HOLIDAYS,
            "Holidays",
            "What swath sonars missed inside of what was swept, by the newest map. Time: the mission's.",
            "MultiPolygon",
            {
                "mission": _TEXT,
                "number": _COUNT,
                "area_m2": _NUMBER,
                "lat_deg": _NUMBER,
                "lon_deg": _NUMBER,
                "version": _COUNT,
            },
        ),
        Collection(
            Kind.VEHICLES,
            "Vehicles",
            "Where the vehicles of missions that have not ended are now. Time: of the last position, by the vehicle.",
            "Point",
            {
                "mission": _TEXT,
                "vehicle": _TEXT,
                "datetime": _TIME,
                "active": _TRUTH,
                "phase": _TEXT,
                "link": _TEXT,
                "age_s": _OPEN_NUMBER,
                "depth_m": _OPEN_NUMBER,
                "altitude_m": _OPEN_NUMBER,
                "heading_deg": _OPEN_NUMBER,
                "speed_mps": _OPEN_NUMBER,
                "battery_pct": _OPEN_NUMBER,
                "position_sd_m": _OPEN_NUMBER,
            },
            ("mission", "vehicle"),
        ),
        Collection(
            Kind.TRAFFIC,
            "Ships",
            "Ships near missions that have not ended, by AIS, each with the vehicle near the surface that it comes "
            "closest to. Time: when it was heard.",
            "Point",
            {
                "mission": _TEXT,
                "datetime": _TIME,
                "mmsi": _COUNT,
                "name": _TEXT,
                "call_sign": _TEXT,
                "type": _TEXT,
                "status": _TEXT,
                "own": _TRUTH,
                "sog_mps": _OPEN_NUMBER,
                "cog_deg": _OPEN_NUMBER,
                "heading_deg": _OPEN_NUMBER,
                "length_m": _OPEN_NUMBER,
                "width_m": _OPEN_NUMBER,
                "draught_m": _OPEN_NUMBER,
                "closest_vehicle": _OPEN_TEXT,
                "closest_m": _OPEN_NUMBER,
                "closest_in_s": _OPEN_NUMBER,
                "alarm": _TRUTH,
            },
        ),
    )
}
"""Every collection by its id."""
