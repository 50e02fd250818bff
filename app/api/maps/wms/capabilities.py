"""What the service offers, in both versions of the standard."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import urlencode

import numpy as np

from app.api.maps.ogc.crs import Box
from app.api.maps.wms.parameters import DEFAULT_STYLE, LISTED_INFO_FORMATS, MOST_PX, PNG, names_of
from app.api.maps.wms.problems import NEW
from app.mapping.coordinates.map_windows import WGS84, projection
from app.mapping.products.pictures.legend import CLASSES_PX, RANGE_PX
from app.missions.maps.gis_layers import WEB_LAYERS, WebLayer
from imc_bridge.printable import printable

_DTD = (
    '<!DOCTYPE WMT_MS_Capabilities SYSTEM "http://schemas.opengis.net/wms/1.1.1/WMS_MS_Capabilities.dtd" '
    "[<!ELEMENT VendorSpecificCapabilities EMPTY>]>"
)
_SCHEMAS = (
    *("http://www.opengis.net/wms", "http://schemas.opengis.net/wms/1.3.0/capabilities_1_3_0.xsd"),
    *("http://www.opengis.net/sld", "http://schemas.opengis.net/sld/1.1.0/sld_capabilities.xsd"),
)
_ABSTRACT = (
    "Maps of the sea floor as they are known now. Depths are metres, positive down. COLORSCALERANGE=min,max gives "
    "depth and uncertainty other colours."
)


@dataclass(frozen=True)
class Offer:
    """What is offered at ``address``, which ends so that parameters can follow.

    ``ends``: west, south, east and north, degrees. ``epsg``: codes of the systems that maps can be had in.
    """

    title: str
    address: str
    ends: Box
    epsg: Sequence[int]


def capabilities(offer: Offer, version: str) -> bytes:
    """Return the document that programs begin with."""
    new = version == NEW
    attributes = {"version": version}
    if new:
        attributes |= {
            "xmlns": "http://www.opengis.net/wms",
            "xmlns:sld": "http://www.opengis.net/sld",
            "xmlns:xsi": "http://www.w3.org/2001/XMLSchema-instance",
            "xsi:schemaLocation": " ".join(_SCHEMAS),
        }
    root = ET.Element("WMS_Capabilities" if new else "WMT_MS_Capabilities", attributes)
    _add_service(root, offer, new)
    capability = ET.SubElement(root, "Capability")
    asked = ET.SubElement(capability, "Request")
    operations = {
        "GetCapabilities": ["text/xml" if new else "application/vnd.ogc.wms_xml"],
        "GetMap": [PNG],
        "GetFeatureInfo": list(LISTED_INFO_FORMATS),
        "sld:GetLegendGraphic" if new else "GetLegendGraphic": [PNG],
    }
    for name, formats in operations.items():
        operation = ET.SubElement(asked, name)
        for one in formats:
            ET.SubElement(operation, "Format").text = one
        http = ET.SubElement(ET.SubElement(operation, "DCPType"), "HTTP")
        _link(ET.SubElement(http, "Get"), offer.address)
    ET.SubElement(ET.SubElement(capability, "Exception"), "Format").text = (
        "XML" if new else "application/vnd.ogc.se_xml"
    )
    _add_layers(capability, offer, version)
    content = ET.tostring(root, encoding="unicode")
    opening = '<?xml version="1.0" encoding="UTF-8"?>\n' + ("" if new else f"{_DTD}\n")
    return (opening + content).encode()


def _add_service(root: ET.Element, offer: Offer, new: bool) -> None:
    service = ET.SubElement(root, "Service")
    for name, text in (
        ("Name", "WMS" if new else "OGC:WMS"),
        ("Title", f"bathyfleet: {printable(offer.title)}"),
        ("Abstract", _ABSTRACT),
    ):
        ET.SubElement(service, name).text = text
    _link(service, offer.address)
    if new:
        for name, number in (("LayerLimit", len(WEB_LAYERS)), ("MaxWidth", MOST_PX), ("MaxHeight", MOST_PX)):
            ET.SubElement(service, name).text = str(number)


def _add_layers(capability: ET.Element, offer: Offer, version: str) -> None:
    new = version == NEW
    root = ET.SubElement(capability, "Layer")
    ET.SubElement(root, "Title").text = printable(offer.title)
    for name in names_of(offer.epsg, version):
        ET.SubElement(root, "CRS" if new else "SRS").text = name
    west, south, east, north = offer.ends
    if new:
        box = ET.SubElement(root, "EX_GeographicBoundingBox")
        for name, value in (
            ("westBoundLongitude", west),
            ("eastBoundLongitude", east),
            ("southBoundLatitude", south),
            ("northBoundLatitude", north),
        ):
            ET.SubElement(box, name).text = repr(value)
    else:
        ET.SubElement(root, "LatLonBoundingBox", _corners(west, south, east, north))
    for epsg in offer.epsg:
        ends = _ends_in(epsg, offer.ends)
        if epsg == WGS84 and new:  # latitude first
            ends = ends[1], ends[0], ends[3], ends[2]
        ET.SubElement(root, "BoundingBox", {"CRS" if new else "SRS": f"EPSG:{epsg}", **_corners(*ends)})
    for layer in WEB_LAYERS.values():
        _add_layer(root, offer, layer, version)


def _add_layer(root: ET.Element, offer: Offer, layer: WebLayer, version: str) -> None:
    described = ET.SubElement(root, "Layer", queryable="1", opaque="0")
    for name, text in (("Name", layer.name), ("Title", layer.title), ("Abstract", layer.meaning)):
        ET.SubElement(described, name).text = text
    style = ET.SubElement(described, "Style")
    ET.SubElement(style, "Name").text = DEFAULT_STYLE
    ET.SubElement(style, "Title").text = "Colours that stay the same while the map grows"
    width, height = RANGE_PX if layer.unit else CLASSES_PX
    legend = ET.SubElement(style, "LegendURL", width=str(width), height=str(height))
    ET.SubElement(legend, "Format").text = PNG
    query = {"SERVICE": "WMS", "VERSION": version, "REQUEST": "GetLegendGraphic", "LAYER": layer.name, "FORMAT": PNG}
    if version == NEW:
        query["SLD_VERSION"] = "1.1.0"
    _link(legend, offer.address + urlencode(query))


def _ends_in(epsg: int, ends: Box) -> Box:
    west, south, east, north = ends
    along = np.linspace(0.0, 1.0, 9)
    # The poles are not in every system.
    lat, lon = np.meshgrid(np.clip(south + along * (north - south), -85.0, 85.0), west + along * (east - west))
    x, y = projection(epsg).to_plane(lat, lon)
    return float(x.min()), float(y.min()), float(x.max()), float(y.max())


def _corners(min_x: float, min_y: float, max_x: float, max_y: float) -> dict[str, str]:
    return {"minx": repr(min_x), "miny": repr(min_y), "maxx": repr(max_x), "maxy": repr(max_y)}


def _link(parent: ET.Element, address: str) -> None:
    # Declared where the DTD of 1.1.1 declares it: it allows that nowhere else.
    attributes = {"xmlns:xlink": "http://www.w3.org/1999/xlink", "xlink:type": "simple", "xlink:href": address}
    ET.SubElement(parent, "OnlineResource", attributes)
