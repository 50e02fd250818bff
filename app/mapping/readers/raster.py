"""Grids by GDAL: GeoTIFF, ESRI ASCII and BAG."""

import re
from typing import Any

import numpy as np
import pyproj
import rasterio
from rasterio.errors import RasterioError

from app.arrays import FloatArray
from app.mapping.readers.file_extensions import DRIVERS
from app.mapping.readers.hdf5 import check_contained
from app.mapping.readers.types import MAX_RASTER_CELLS, Points, Positive, Raster, ReadError
from app.mapping.readers.units import metres_in
from app.mapping.readers.vr_bag import read_refined
from app.mapping.water.vertical import vertical_unit

DEPTH_BANDS = ("depth", "elevation", "height", "z")
SD_BANDS = ("uncertainty", "sd", "standard deviation", "standard_deviation")

OPTIONS = {"AAIGrid": {"DATATYPE": "Float64"}}
"""GDAL takes a grid for one of whole numbers where none of its first values has a fraction, and NaN for 0."""
HEADER_BYTES = 4096
"""An ASCII grid's header is shorter."""
BYTES_AT_ONCE = 2**20
IS_SPACE = np.isin(np.arange(256), [*b" \t\n\v\f\r", 0, 0x1A])
"""By byte; some programs end a file with one of the last two."""
IN_NUMBERS = IS_SPACE | np.isin(np.arange(256), [*b"0123456789+-.,eEnaNA"])
"""By byte; GDAL takes other words for 0."""

NAMES = {"GTiff": "GeoTIFF", "AAIGrid": "ESRI ASCII grid", "BAG": "BAG"}


def read_raster(content: bytes, kind: str) -> Points | Raster:
    """Return the grid in a file: its depths and, if it has such a band, their standard deviations.

    Of a BAG of variable resolution the refined cells are returned, each as a sounding in its middle.

    Parameters
    ----------
    kind
        The ending of its name, a key of :data:`DRIVERS`.

    Raises
    ------
    ReadError
        When the file cannot be read, is too large or has no band with a value, or more or fewer values than cells.
    """
    driver = DRIVERS[kind]
    if driver == "BAG":
        check_contained(content)
    try:
        if not content:
            raise RasterioError("empty")
        with (
            rasterio.MemoryFile(content, filename=f"file{kind}") as memory,
            memory.open(driver=driver, **OPTIONS.get(driver, {})) as file,
        ):
            if driver == "AAIGrid":
                _check_ascii(content, file)
            refined = read_refined(content, file.transform, _crs(file)) if driver == "BAG" else None
            return _read(file) if refined is None else refined
    except RasterioError:
        # GDAL's words quote what it stumbled over.
        what = NAMES[driver]
        raise ReadError("file", f"it cannot be read as {what}", f"send a {what} that is whole") from None


def _check_ascii(content: bytes, file: Any) -> None:
    """Raise ReadError where an ASCII grid has not one number for each cell: GDAL makes up those that are missing."""
    _check_size(file)
    count, cells = _count_numbers(content, _header_bytes(content)), file.width * file.height
    if count is None:
        raise ReadError("file", "some of its values are no numbers", "send NODATA_value where there is no depth")
    if count != cells:
        raise ReadError(
            "file",
            f"ncols x nrows is {file.width} x {file.height} = {cells}, and {count} values follow",
            "send the whole grid, with one value for each cell: NODATA_value where there is none",
        )


def _header_bytes(content: bytes) -> int:
    """Return how long the head of an ASCII grid is: names, each with what it stands for."""
    end, words = 0, iter(re.finditer(rb"\S+", content[:HEADER_BYTES]))
    for name in words:
        if not name[0][:1].isalpha() or name[0].lower() == b"nan":
            break
        value = next(words, name)
        end = value.end()
    return end


def _count_numbers(content: bytes, begin: int) -> int | None:
    """Return how many words follow; None where some are no numbers.

    They are looked at some at a time: a copy of each would take many times the file's memory.
    """
    count, was_space = 0, True
    for first in range(begin, len(content), BYTES_AT_ONCE):
        part = np.frombuffer(content, np.uint8, min(BYTES_AT_ONCE, len(content) - first), first)
        if not IN_NUMBERS[part].all():
            return None
        is_space = IS_SPACE[part]
        count += int(np.count_nonzero(is_space[:-1] & ~is_space[1:])) + bool(was_space and not is_space[0])
        was_space = bool(is_space[-1])
    return count


def _check_size(file: Any) -> None:
    if file.width * file.height > MAX_RASTER_CELLS:
        raise ReadError(
            "file",
            f"{file.width} x {file.height} cells are more than {MAX_RASTER_CELLS}",
            "cut it to the mission's area or make it coarser",
        )


def _read(file: Any) -> Raster:
    _check_size(file)
    names = [(name or "").lower() for name in file.descriptions]
    depth = next((names.index(name) for name in DEPTH_BANDS if name in names), 0) + 1
    sd = next((names.index(name) for name in SD_BANDS if name in names), None)
    z = _band(file, depth)
    if not np.isfinite(z).any():
        raise ReadError(f"band {depth}", "no cell of it has a value", "check the file's nodata value")
    return Raster(
        z,
        np.full(z.shape, np.nan) if sd is None else _band(file, sd + 1),
        file.transform,
        _crs(file),
        _direction(file, names[depth - 1]),
    )


def _crs(file: Any) -> pyproj.CRS | None:
    return None if file.crs is None else pyproj.CRS.from_wkt(file.crs.to_wkt())


def _band(file: Any, number: int) -> FloatArray:
    """Return a band in metres, NaN where it has no value: whole numbers may stand for others, and units differ."""
    if np.issubdtype(np.dtype(file.dtypes[number - 1]), np.complexfloating):
        raise ReadError(f"band {number}", f"its values are {file.dtypes[number - 1]}", "depths are real numbers")
    values = np.ma.filled(np.ma.asarray(file.read(number, masked=True)).astype(np.float64), np.nan)
    values = file.scales[number - 1] * values + file.offsets[number - 1]
    return np.where(np.isfinite(values), _metres(file, number) * values, np.nan)


def _metres(file: Any, number: int) -> float:
    """Return how many metres one is in a band, by its own unit, else by that of the vertical axis."""
    said = file.units[number - 1]
    crs = _crs(file)
    if said or crs is None or file.driver == "BAG":
        return metres_in(said, f"band {number}")
    return vertical_unit(crs)[0]


def _direction(file: Any, name: str) -> Positive | None:
    if file.driver == "BAG":
        return "up"  # whatever its vertical system says, the format holds elevations
    stated = file.tags().get("DEPTH_POSITIVE")
    if stated in ("down", "up"):
        return "down" if stated == "down" else "up"
    return {"depth": "down", "elevation": "up", "height": "up"}.get(name)  # type: ignore[return-value]
