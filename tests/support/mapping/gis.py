"""Tiles put together, as web maps do."""

import io
import math
from typing import Any

import httpx
import numpy as np
from numpy.typing import NDArray
from PIL import Image

Pixels = NDArray[np.uint8]


def tile_of(lat_deg: float, lon_deg: float, zoom: int) -> tuple[int, int]:
    """Column and row of the tile that a place lies in: the formula of the OpenStreetMap wiki."""
    n = 2**zoom
    lat = math.radians(lat_deg)
    return int((lon_deg + 180.0) / 360.0 * n), int((1.0 - math.asinh(math.tan(lat)) / math.pi) / 2.0 * n)


def picture_of(answer: httpx.Response) -> Pixels:
    """The pixels of a tile."""
    assert answer.status_code == httpx.codes.OK, answer.text
    assert answer.headers["content-type"] == "image/png"
    return np.asarray(Image.open(io.BytesIO(answer.content)))


async def mosaic(
    client: httpx.AsyncClient, tilejson: dict[str, Any], zoom: int, suffix: str = ""
) -> tuple[Pixels, tuple[int, int]]:
    """All tiles over a layer's bounds as one picture, and column and row of its first one."""
    west, south, east, north = tilejson["bounds"]
    (first_x, first_y), (last_x, last_y) = tile_of(north, west, zoom), tile_of(south, east, zoom)
    (template,) = tilejson["tiles"]
    rows = []
    for y in range(first_y, last_y + 1):
        row = []
        for x in range(first_x, last_x + 1):
            address = template.replace("{z}", str(zoom)).replace("{x}", str(x)).replace("{y}", f"{y}{suffix}")
            row.append(picture_of(await client.get(address)))
        rows.append(np.hstack(row))
    return np.vstack(rows), (first_x, first_y)
