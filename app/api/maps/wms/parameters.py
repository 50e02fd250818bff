"""Parameters of requests for maps, whose names may be written large or small."""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from starlette.datastructures import QueryParams

from app.api.maps.maps import MAX_VALUE_M
from app.api.maps.wms.problems import NEW, OLD, WmsError, missing, wrong
from app.mapping.coordinates.map_windows import WEB_MERCATOR, WGS84, MapWindow
from app.missions.maps.gis_layers import WEB_LAYERS, Range

MOST_PX = 4096
"""Pixels along each side of a picture."""
MOST_BEYOND = 1e9
"""No coordinate of a system is larger."""
LEAST_SIDE = 1e-9
"""A rectangle has some size."""

PNG = "image/png"
HTML, TEXT, JSON = "text/html", "text/plain", "application/json"
INFO_FORMATS = (HTML, TEXT, JSON)
LISTED_INFO_FORMATS = (HTML, TEXT)
"""QGIS would ask for JSON if it were listed, and take the answer for GML unless it begins with ``Content-Type`` in this
very writing, which our server does not use."""
DEFAULT_STYLE = "default"
_COLOUR = re.compile(r"^(?:0x|#)([0-9a-f]{6})$", re.IGNORECASE)


@dataclass(frozen=True)
class MapRequest:
    """A picture that is asked for: layers, the lowest first, as they lie over each other.

    ``range``: values of the first and the last colour, None for the usual ones. ``background``: red, green and blue,
    None where it is to be transparent.
    """

    layers: Sequence[str]
    window: MapWindow
    range: Range | None
    background: tuple[int, int, int] | None


@dataclass(frozen=True)
class InfoRequest:
    """What is known of the place under a pixel."""

    map: MapRequest
    column: int
    row: int
    format: str


class Parameters:
    """The parameters of a request.

    Raises
    ------
    WmsError
        When one is given twice with different values.
    """

    def __init__(self, query: QueryParams) -> None:
        self._values: dict[str, str] = {}
        for name, value in query.multi_items():
            if self._values.setdefault(name.upper(), value) != value:
                raise wrong(name.upper()[:40], value, "it is given twice, with different values; give one")

    def get(self, name: str, usual: str = "") -> str:
        """Return a parameter's value; what is usual where it is missing or empty."""
        return self._values.get(name) or usual

    def required(self, name: str, right: str) -> str:
        """Return a parameter's value. Raises WmsError where it is missing or empty."""
        if not self.get(name):
            raise missing(name, right)
        return self._values[name]


def version_of(query: Mapping[str, str]) -> str:
    """Return the version that is spoken with who asks: what is not 1.1 or older is 1.3.0."""
    values = {name.upper(): value for name, value in query.items()}
    said = values.get("VERSION") or values.get("WMTVER") or ""
    if not said:
        return OLD if "SRS" in values and "CRS" not in values else NEW
    return OLD if re.match(r"^1\.[0-2](\.|$)", said) else NEW


def map_request(given: Parameters, version: str, offered: Collection[int]) -> MapRequest:
    """Return the picture that is asked for; ``offered``: EPSG codes. Raises WmsError."""
    return _map(given, _layers(given, "LAYERS"), version, offered)


def _map(given: Parameters, layers: Sequence[str], version: str, offered: Collection[int]) -> MapRequest:
    styles = [style for style in given.get("STYLES").split(",") if style not in ("", DEFAULT_STYLE)]
    if styles:
        raise wrong("STYLES", styles[0], f"leave it empty, there is one style, {DEFAULT_STYLE}", "StyleNotDefined")
    said = given.get("FORMAT", PNG)
    if said.split(";")[0].strip().lower() != PNG:
        raise wrong("FORMAT", said, f"it has to be {PNG}", "InvalidFormat")
    epsg, latitude_first = _system(given, version, offered)
    west, south, east, north = _box(given, latitude_first)
    width, height = (_whole(given, name, 1, MOST_PX) for name in ("WIDTH", "HEIGHT"))
    window = MapWindow(epsg, west, south, east, north, width, height)
    return MapRequest(layers, window, range_of(given), _background(given))


def info_request(given: Parameters, version: str, offered: Collection[int]) -> InfoRequest:
    """Return the place that is asked about; ``offered``: EPSG codes. Raises WmsError."""
    asked = _layers(given, "QUERY_LAYERS")
    wanted = _map(given, asked, version, offered)
    said = given.get("INFO_FORMAT", TEXT).lower()
    found = JSON if said in ("application/geo+json", "application/geojson") else said.split(";")[0].strip()
    if found not in INFO_FORMATS:
        raise wrong("INFO_FORMAT", said, f"use one of {', '.join(INFO_FORMATS)}", "InvalidFormat")
    names = ("I", "J") if version == NEW else ("X", "Y")
    sides = wanted.window.width_px, wanted.window.height_px
    column, row = (_whole(given, name, 0, side - 1, "InvalidPoint") for name, side in zip(names, sides, strict=True))
    return InfoRequest(wanted, column, row, found)


def layer_of_legend(given: Parameters) -> str:
    """Return the layer whose legend is asked for. Raises WmsError."""
    said = given.get("FORMAT", PNG)
    if said.split(";")[0].strip().lower() != PNG:
        raise wrong("FORMAT", said, f"it has to be {PNG}", "InvalidFormat")
    return _known_layer("LAYER", given.required("LAYER", f"name one of {', '.join(WEB_LAYERS)}"))


def range_of(given: Parameters) -> Range | None:
    """Return the values of the first and the last colour; None for the usual ones. Raises WmsError."""
    said = given.get("COLORSCALERANGE")
    if said.lower() in ("", "auto", "default"):
        return None
    numbers = _numbers(said)
    if len(numbers) != 2 or not numbers[0] < numbers[1] or max(map(abs, numbers)) > MAX_VALUE_M:
        raise wrong("COLORSCALERANGE", said, "give two numbers of metres, the smaller one first, such as 0,60")
    return numbers[0], numbers[1]


def _layers(given: Parameters, name: str) -> list[str]:
    right = f"name one of {', '.join(WEB_LAYERS)}, or several with commas between"
    layers = [_known_layer(name, layer) for layer in given.required(name, right).split(",")]
    if len(layers) > len(WEB_LAYERS):
        raise WmsError("InvalidParameterValue", name, f"{name} has {len(layers)} layers: at most {len(WEB_LAYERS)}")
    return layers


def _known_layer(name: str, layer: str) -> str:
    if layer not in WEB_LAYERS:
        raise wrong(name, layer, f"the layers are {', '.join(WEB_LAYERS)}", "LayerNotDefined")
    return layer


def _system(given: Parameters, version: str, offered: Collection[int]) -> tuple[int, bool]:
    """Return the EPSG code of the system that is asked for, and whether its latitudes come first."""
    name = "CRS" if version == NEW else "SRS"
    right = f"use one of {', '.join(names_of(offered, version))}"
    said = given.required(name, right).upper()
    if said == "CRS:84":
        return WGS84, False
    authority, _, code = said.partition(":")
    if authority != "EPSG" or code not in {str(one) for one in offered}:
        raise wrong(name, said, right, f"Invalid{name}")
    return int(code), int(code) == WGS84 and version == NEW


def names_of(offered: Collection[int], version: str) -> list[str]:
    """Return how systems of coordinates are called in a version."""
    return [*(f"EPSG:{epsg}" for epsg in offered), *(["CRS:84"] if version == NEW else [])]


def _box(given: Parameters, latitude_first: bool) -> tuple[float, float, float, float]:
    order = "south,west,north,east" if latitude_first else "west,south,east,north"
    right = f"give four numbers, {order}, as the axes of the system go"
    said = given.required("BBOX", right)
    numbers = _numbers(said)
    if len(numbers) != 4 or max(map(abs, numbers)) > MOST_BEYOND:
        raise wrong("BBOX", said, right)
    west, south, east, north = (numbers[i] for i in ((1, 0, 3, 2) if latitude_first else (0, 1, 2, 3)))
    if east - west < LEAST_SIDE or north - south < LEAST_SIDE:
        raise wrong("BBOX", said, f"the third number has to be above the first, the fourth above the second: {order}")
    return west, south, east, north


def _numbers(text: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",", 5)]
    except ValueError:
        return []
    return numbers if all(map(math.isfinite, numbers)) else []


def _whole(given: Parameters, name: str, least: int, most: int, code: str = "InvalidParameterValue") -> int:
    right = f"give a whole number from {least} to {most}"
    said = given.required(name, right)
    if not (said.isascii() and said.isdigit() and len(said) < 10 and least <= int(said) <= most):
        raise wrong(name, said, right, code)
    return int(said)


def _background(given: Parameters) -> tuple[int, int, int] | None:
    transparent = given.get("TRANSPARENT", "FALSE")
    if transparent.upper() not in ("TRUE", "FALSE"):
        raise wrong("TRANSPARENT", transparent, "it has to be TRUE or FALSE")
    said = given.get("BGCOLOR", "0xFFFFFF")
    found = _COLOUR.match(said)
    if found is None:
        raise wrong("BGCOLOR", said, "give red, green and blue such as 0xFFFFFF")
    red, green, blue = bytes.fromhex(found[1])
    return None if transparent.upper() == "TRUE" else (red, green, blue)


SYSTEMS = (WEB_MERCATOR, WGS84)
"""EPSG codes of the systems that every map can be had in."""
