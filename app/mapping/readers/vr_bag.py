"""The refined cells of a BAG of variable resolution, as soundings: GDAL shows its coarse cells alone."""

import io
from typing import Any

import h5py
import numpy as np
import pyproj
from affine import Affine

from app.arrays import FloatArray
from app.mapping.bag_values import NODATA, NOT_REFINED
from app.mapping.readers.types import MAX_RASTER_CELLS, Points, ReadError

METADATA, NODES = "BAG_root/varres_metadata", "BAG_root/varres_refinements"

_UNREADABLE = (OSError, RuntimeError, ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError)


def read_refined(content: bytes, transform: Affine, crs: pyproj.CRS | None) -> Points | None:
    """Return the middles of the refined cells; None where the file has cells of one size.

    Parameters
    ----------
    transform
        Takes columns and rows of its coarse cells, north up, to x and y of ``crs``.

    Raises
    ------
    ReadError
        When the refinements are damaged, too many, or without a value.
    """
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            if METADATA not in file:
                return None
            return _read(file[METADATA], file[NODES], transform, crs)
    except _UNREADABLE as error:
        if isinstance(error, ReadError):
            raise
        raise ReadError("file", "it cannot be read as BAG", "send a BAG that is whole") from None


def _read(metadata: Any, nodes: Any, transform: Affine, crs: pyproj.CRS | None) -> Points:
    if max(metadata.size, nodes.size) > MAX_RASTER_CELLS:
        raise ReadError("file", f"it has more than {MAX_RASTER_CELLS} cells", "cut it to the mission's area")
    about, values = metadata[:], nodes[:].ravel()
    rows, _ = about.shape
    refined = about["index"] != NOT_REFINED
    row, col = np.nonzero(refined)
    cell = about[refined]
    wide, high = (cell[f"dimensions_{axis}"].astype(np.int64) for axis in "xy")
    size = wide * high
    if int(size.astype(float).sum()) > len(values):
        raise ReadError("file", "its refined cells lie beyond its end", "send a BAG that is whole")
    of = np.repeat(np.arange(len(cell)), size)
    number = np.arange(len(of)) - np.repeat(np.cumsum(size) - size, size)
    known = values[cell["index"].astype(np.int64)[of] + number]
    up, right = number // wide[of], number % wide[of]
    # Rows of coarse cells are counted from the south.
    west, south = transform @ (0, rows)
    x = west + transform.a * col[of] + cell["sw_corner_x"][of] + cell["resolution_x"][of] * right
    y = south - transform.e * row[of] + cell["sw_corner_y"][of] + cell["resolution_y"][of] * up
    z, sd = _known(known["depth"]), _known(known["depth_uncrt"])
    there = np.isfinite(z) & np.isfinite(x) & np.isfinite(y)
    if not there.any():
        raise ReadError("file", "no refined cell of it has a value", "check its nodata value")
    lines = np.flatnonzero(there) + 1
    return Points(x[there], y[there], z[there], sd[there], crs, "up", lines, counted="refined cell")


def _known(values: Any) -> FloatArray:
    numbers = np.asarray(values, dtype=np.float64)
    return np.where(np.isfinite(numbers) & (numbers < NODATA), numbers, np.nan)
