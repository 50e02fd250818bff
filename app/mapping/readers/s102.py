"""S-102 files (editions 2 and 3): the grid of depths, with its uncertainty."""

import io
from typing import Any

import h5py
import numpy as np
import pyproj
from affine import Affine
from pyproj.exceptions import CRSError

from app.arrays import FloatArray
from app.mapping.readers.hdf5 import check_contained
from app.mapping.readers.types import DATUM_NOTE, MAX_RASTER_CELLS, Raster, ReadError
from app.mapping.water.vertical import EPSG_OF_S100, VerticalDatum

INSTANCE = "BathymetryCoverage/BathymetryCoverage.01"
VALUES = f"{INSTANCE}/Group_001/values"
FILLED = 1_000_000.0
EPSG_REFERENCE = 2
"""A file whose verticalDatumReference is this numbers its datum as EPSG does."""
_CRS = ("horizontalCRS", "horizontalDatumValue")
"""Attributes that number the coordinate reference system, in newer and older editions."""


def read_s102(content: bytes) -> Raster:
    """Return the first grid of depths in a file.

    Raises
    ------
    ReadError
        When it is no S-102, or leads to other files.
    """
    check_contained(content)
    try:
        with h5py.File(io.BytesIO(content), "r") as file:
            return _read(file)
    except ReadError:
        raise
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, AttributeError, OverflowError, CRSError):
        raise ReadError("file", "it cannot be read as S-102", "send an S-102 file that is whole") from None


def _read(file: Any) -> Raster:
    values, instance = file[VALUES], file[INSTANCE]
    if values.ndim != 2 or values.shape[0] * values.shape[1] > MAX_RASTER_CELLS:
        raise ReadError("file", f"it has more than {MAX_RASTER_CELLS} cells", "cut it to the mission's area")
    rows = values.shape[0]
    number = next((int(file.attrs[name]) for name in _CRS if name in file.attrs), None)
    if number is None:
        raise ReadError("file", "it does not say what its positions are in", "write horizontalCRS")
    west, south = (float(instance.attrs[f"gridOrigin{axis}"]) for axis in ("Longitude", "Latitude"))
    step_x, step_y = (float(instance.attrs[f"gridSpacing{axis}"]) for axis in ("Longitudinal", "Latitudinal"))
    if not (np.isfinite([west, south]).all() and step_x > 0.0 and step_y > 0.0):
        raise ReadError("file", "its grid has no place or no spacing", "check gridOrigin and gridSpacing")
    table = values[:]
    depth = _known(table["depth"])
    if not np.isfinite(depth).any():
        raise ReadError("file", "no cell of it has a depth", "send a file with depths")
    sd = _known(table["uncertainty"]) if "uncertainty" in (table.dtype.names or ()) else np.full(depth.shape, np.nan)
    # The origin is the middle of the south-western cell, the first row the southernmost.
    north = south + (rows - 0.5) * step_y
    transform = Affine(step_x, 0.0, west - 0.5 * step_x, 0.0, -step_y, north)
    crs, notes = _with_datum(file, pyproj.CRS.from_epsg(number))
    return Raster(depth[::-1].copy(), sd[::-1].copy(), transform, crs, "down", notes=notes)


def _with_datum(file: Any, horizontal: pyproj.CRS) -> tuple[pyproj.CRS, tuple[str, ...]]:
    """Return the system of the positions with the datum that a file states, and what is to be known of that."""
    if "verticalDatum" not in file.attrs:
        return horizontal, ()
    stated = int(file.attrs["verticalDatum"])
    by_epsg = int(file.attrs.get("verticalDatumReference", 1)) == EPSG_REFERENCE
    epsg = stated if by_epsg else EPSG_OF_S100.get(stated)
    if epsg is None:
        words = f"{DATUM_NOTE}the file states number {stated} of the IHO's register, which is not known here"
        return horizontal, (f"{words}; state datum_offset_m where the mission's is another one",)
    if not pyproj.CRS.from_epsg(epsg).is_vertical:
        raise ReadError("file", "its vertical datum is none", "check verticalDatum")
    return VerticalDatum(epsg, "").compound_with(horizontal), ()


def _known(values: Any) -> FloatArray:
    table = np.asarray(values, dtype=np.float64)
    return np.where(np.isfinite(table) & (table < FILLED), table, np.nan)
