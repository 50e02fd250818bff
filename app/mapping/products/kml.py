"""Depth contours and tracks as KML, for Google Earth and chart plotters."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence

from app.mapping.products.contours import Contour
from app.mapping.products.tracks import Track, elevation_text, lines_of, utc_text

NAMESPACE = "http://www.opengis.net/kml/2.2"
GOOGLE_NAMESPACE = "http://www.google.com/kml/ext/2.2"
"""Of tracks with times."""


def contours_kml(contours: Sequence[Contour], *, title: str, vertical_datum: str) -> bytes:
    """Return one placemark per depth with its lines, on the surface."""
    document = _document(title, f"Depths in metres below {vertical_datum}")
    for contour in contours:
        mark = _child(document, "Placemark")
        _child(mark, "name", f"{contour.depth_m:g} m")
        data = _child(_child(mark, "ExtendedData"), "Data", name="depth_m")
        _child(data, "value", repr(contour.depth_m))
        lines = _child(mark, "MultiGeometry")
        for line in contour.lines:
            _line(lines, line)
    return _text(document)


def tracks_kml(tracks: Sequence[Track], *, title: str) -> bytes:
    """Return one placemark per vehicle, a track with times; its altitudes are minus the vehicle's depth."""
    document = _document(title, "Tracks of the vehicles")
    for track in lines_of(tracks):
        mark = _child(document, "Placemark")
        _child(mark, "name", track.vehicle)
        element = _child(mark, "gx:Track")
        _child(element, "altitudeMode", "absolute")
        for point in track.points:
            _child(element, "when", utc_text(point.time_s))
        for point in track.points:
            _child(element, "gx:coord", f"{point.lon_deg:.8f} {point.lat_deg:.8f} {elevation_text(point.depth_m)}")
    return _text(document, {"xmlns:gx": GOOGLE_NAMESPACE})


def _document(title: str, description: str) -> ET.Element:
    document = ET.Element("Document")
    _child(document, "name", title)
    _child(document, "description", description)
    return document


def _child(parent: ET.Element, tag: str, text: str | None = None, **attributes: str) -> ET.Element:
    child = ET.SubElement(parent, tag, attributes)
    child.text = text
    return child


def _line(parent: ET.Element, line: Iterable[tuple[float, float]]) -> None:
    element = _child(parent, "LineString")
    _child(element, "tessellate", "1")
    _child(element, "coordinates", " ".join(f"{lon:.8f},{lat:.8f}" for lon, lat in line))


def _text(document: ET.Element, further: Mapping[str, str] | None = None) -> bytes:
    root = ET.Element("kml", {"xmlns": NAMESPACE, **(further or {})})
    root.append(document)
    ET.indent(root, " ")
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))
