"""What cannot be answered, in the words of the standard: a report of exceptions that programs show to who uses them."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass

from starlette.responses import Response

NEW, OLD = "1.3.0", "1.1.1"
_OGC = "http://www.opengis.net/ogc"


@dataclass
class WmsError(Exception):
    """Raised for a request that cannot be answered: the standard's code, the parameter, and what would be right."""

    code: str
    locator: str
    text: str


def wrong(name: str, value: str, right: str, code: str = "InvalidParameterValue") -> WmsError:
    """Return what is said of a parameter that has a wrong value."""
    return WmsError(code, name, f"{name} is {value[:60]!r}: {right}")


def missing(name: str, right: str) -> WmsError:
    """Return what is said of a parameter that is not there."""
    return WmsError("MissingParameterValue", name, f"{name} is missing: {right}")


def report(error: WmsError, version: str) -> Response:
    """Return the answer to a request that cannot be answered.

    Its status is 200, as it is of other servers: programs show these words only then, else but the status.
    """
    root = ET.Element("ServiceExceptionReport", version=version)
    if version == NEW:
        root.set("xmlns", _OGC)
    attributes = {"code": error.code}
    if version == NEW:
        attributes["locator"] = error.locator
    ET.SubElement(root, "ServiceException", attributes).text = error.text
    media_type = "text/xml" if version == NEW else "application/vnd.ogc.se_xml"
    content = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return Response(content, media_type=media_type, headers={"Cache-Control": "no-store"})
