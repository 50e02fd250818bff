"""Where the vehicles were, as GeoJSON and GPX (KML: see ``kml``)."""

import json
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

LAST_SECOND = 253_402_300_799.0
"""The end of the year 9999."""

GPX_NAMESPACE = "http://www.topografix.com/GPX/1/1"


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """A place of a vehicle: WGS 84 degrees, metres below the surface, Unix seconds of its own clock."""

    lon_deg: float
    lat_deg: float
    depth_m: float
    time_s: float


@dataclass(frozen=True, slots=True)
class Track:
    """A vehicle's places in the order in which they were heard."""

    vehicle: str
    points: Sequence[TrackPoint]


def tracks_geojson(tracks: Sequence[Track]) -> bytes:
    """Return one LineString per vehicle; ``depths_m`` and ``times`` have one entry per position."""
    features = [
        {
            "type": "Feature",
            "properties": {
                "kind": "track",
                "vehicle": track.vehicle,
                "depths_m": [round(point.depth_m, 3) + 0.0 for point in track.points],
                "times": [utc_text(point.time_s) for point in track.points],
            },
            "geometry": {
                "type": "LineString",
                "coordinates": [[point.lon_deg, point.lat_deg] for point in track.points],
            },
        }
        for track in lines_of(tracks)
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()


def tracks_gpx(tracks: Sequence[Track], *, title: str) -> bytes:
    """Return GPX 1.1 with one track per vehicle; its elevations are minus the vehicle's depth."""
    root = ET.Element("gpx", version="1.1", creator="bathyfleet", xmlns=GPX_NAMESPACE)
    ET.SubElement(ET.SubElement(root, "metadata"), "name").text = title
    for track in lines_of(tracks):
        element = ET.SubElement(root, "trk")
        ET.SubElement(element, "name").text = track.vehicle
        segment = ET.SubElement(element, "trkseg")
        for point in track.points:
            place = ET.SubElement(segment, "trkpt", lat=f"{point.lat_deg:.8f}", lon=f"{point.lon_deg:.8f}")
            ET.SubElement(place, "ele").text = elevation_text(point.depth_m)
            ET.SubElement(place, "time").text = utc_text(point.time_s)
    ET.indent(root, " ")
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def lines_of(tracks: Sequence[Track]) -> list[Track]:
    """Return the tracks that are lines: one place makes none."""
    return [track for track in tracks if len(track.points) >= 2]


def elevation_text(depth_m: float) -> str:
    """Return minus a depth in metres, to the millimetre; at the surface it is 0.000, never -0.000."""
    return f"{round(-depth_m, 3) + 0.0:.3f}"


def utc_text(time_s: float) -> str:
    """Return Unix seconds as RFC 3339 in UTC, to the millisecond; a clock beyond all bounds is cut to them."""
    return (
        datetime.fromtimestamp(min(max(time_s, 0.0), LAST_SECOND), UTC)
        .isoformat(timespec="milliseconds")
        .replace("+00:00", "Z")
    )
