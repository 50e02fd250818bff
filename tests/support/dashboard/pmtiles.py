"""A small PMTiles file (version 3) of raster tiles, written after its public specification."""

import gzip
import io
import json
import struct
from collections.abc import Mapping
from math import asinh, pi, radians, tan

from PIL import Image

GZIP, PNG, HEADER_BYTES = 2, 2, 127


def tile_at(zoom: int, lon_deg: float, lat_deg: float) -> tuple[int, int, int]:
    """The web map tile (zoom, x, y) that holds a place."""
    n = 2**zoom
    y = (1 - asinh(tan(radians(lat_deg))) / pi) / 2
    return zoom, int((lon_deg + 180) / 360 * n), int(y * n)


def plain_tile(colour: tuple[int, int, int]) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (256, 256), colour).save(file, "png")
    return file.getvalue()


def write_pmtiles(tiles: Mapping[tuple[int, int, int], bytes], bounds: tuple[float, float, float, float]) -> bytes:
    """Return the file; ``bounds``: west, south, east, north in degrees."""
    ordered = sorted((_tile_id(*place), content) for place, content in tiles.items())
    data = b"".join(content for _, content in ordered)
    entries, last, offset = [], 0, 0
    for number, content in ordered:
        entries.append((number - last, 1, len(content), offset + 1))
        last, offset = number, offset + len(content)
    columns = [[entry[i] for entry in entries] for i in range(4)]
    root = gzip.compress(
        b"".join(_varint(v) for v in [len(entries), *columns[0], *columns[1], *columns[2], *columns[3]])
    )
    metadata = gzip.compress(json.dumps({"name": "harbour chart", "attribution": "test"}).encode())
    at_metadata = HEADER_BYTES + len(root)
    at_data = at_metadata + len(metadata)
    zooms = [zoom for zoom, _, _ in tiles]
    west, south, east, north = (round(degrees * 1e7) for degrees in bounds)
    header = b"PMTiles\x03" + struct.pack(
        "<11Q6B4iB2i",
        *(HEADER_BYTES, len(root), at_metadata, len(metadata), at_data, 0, at_data, len(data)),
        *(len(entries), len(entries), len(entries)),
        *(1, GZIP, 1, PNG, min(zooms), max(zooms)),
        *(west, south, east, north),
        max(zooms),
        *((west + east) // 2, (south + north) // 2),
    )
    assert len(header) == HEADER_BYTES
    return header + root + metadata + data


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def _tile_id(zoom: int, x: int, y: int) -> int:
    """Place on the Hilbert curve of the tile's zoom, after all tiles of smaller zooms."""
    number, n = (4**zoom - 1) // 3, 2**zoom
    s = n // 2
    while s > 0:
        right, up = int(x & s > 0), int(y & s > 0)
        number += s * s * ((3 * right) ^ up)
        if up == 0:
            if right == 1:
                x, y = n - 1 - x, n - 1 - y
            x, y = y, x
        s //= 2
    return number
