"""Grids in NetCDF: one variable of depths or heights over two regular axes."""

import re
from typing import Any

import numpy as np
import pyproj
from affine import Affine
from netCDF4 import Dataset

from app.arrays import FloatArray
from app.mapping.readers.hdf5 import check_contained
from app.mapping.readers.types import MAX_RASTER_CELLS, Positive, Raster, ReadError
from app.mapping.readers.units import known_metres_in, metres_in
from app.mapping.water.vertical import vertical_unit

DEPTH_NAMES = ("depth", "elevation", "bathymetry", "z", "height", "topo", "band1")
SD_NAMES = ("uncertainty", "sd", "depth_uncertainty", "standard_deviation")
REGULAR = 1e-3
"""Largest deviation of an axis from even spacing, in cells."""


CLASSIC = (b"CDF\x01", b"CDF\x02", b"CDF\x05")
"""How NetCDF begins that is not HDF5. It has nothing that leads to other files."""

_PLAIN_NAME = re.compile(r"[A-Za-z0-9_]{1,40}")


def read_netcdf(content: bytes) -> Raster:
    """Return the grid of depths in a file.

    Raises
    ------
    ReadError
        When there is no such variable, or its axes are not regular.
    """
    if not content.startswith(CLASSIC):
        check_contained(content)
    try:
        file = Dataset("memory.nc", memory=content)
        try:
            return _read(file)
        finally:
            file.close()
    except ReadError:
        raise
    except (OSError, RuntimeError, ValueError, TypeError, IndexError, AttributeError, OverflowError):
        raise ReadError("file", "it cannot be read as NetCDF", "send a NetCDF file that is whole") from None


def _read(file: Any) -> Raster:
    variable = _depth_variable(file)
    name = _called(variable.name)
    rows, cols = variable.shape
    if rows * cols > MAX_RASTER_CELLS:
        raise ReadError(name, f"{cols} x {rows} cells are more than {MAX_RASTER_CELLS}", "cut it to the mission's area")
    turned = _is_eastward(file, variable.dimensions[0]) and not _is_eastward(file, variable.dimensions[1])
    y_name, x_name = variable.dimensions[::-1] if turned else variable.dimensions
    y, x = _axis(file, y_name), _axis(file, x_name)
    crs, unit_m = _crs(file, variable, x_name, y_name), _unit_m(file, x_name, y_name)
    z = _metres(variable, crs)
    if not np.isfinite(z).any():
        raise ReadError(name, "no cell of it has a value", "check its _FillValue")
    sd = next((file.variables[n] for n in SD_NAMES if n in file.variables), None)
    same = sd is not None and sd.dimensions == variable.dimensions
    sd_values = _metres(sd, crs) if same else np.full(z.shape, np.nan)
    if turned:
        z, sd_values = z.T, sd_values.T
    step_x, step_y = (x[-1] - x[0]) / (len(x) - 1), (y[-1] - y[0]) / (len(y) - 1)
    transform = Affine(step_x, 0.0, x[0] - 0.5 * step_x, 0.0, step_y, y[0] - 0.5 * step_y)
    return Raster(z, sd_values, transform, crs, _direction(variable), unit_m)


def _depth_variable(file: Any) -> Any:
    flat = [v for v in file.variables.values() if v.ndim == 2 and np.issubdtype(v.dtype, np.number)]
    for variable in flat:
        standard = str(getattr(variable, "standard_name", ""))
        if standard.startswith("sea_floor_depth") and " " not in standard:
            return variable
    lower = {variable.name.lower(): variable for variable in flat}
    found = next((lower[name] for name in DEPTH_NAMES if name in lower), None)
    if found is None:
        raise ReadError(
            "variable",
            f"none of its {len(lower)} variables of two dimensions is a grid of depths",
            "name it depth or elevation",
        )
    return found


def _called(name: str) -> str:
    """Name a variable for a message, where its name is one and not a text of whatever kind."""
    return f"variable {name}" if _PLAIN_NAME.fullmatch(name) else "a variable"


def _axis(file: Any, name: str) -> FloatArray:
    variable = file.variables.get(name)
    if variable is None or variable.ndim != 1 or len(variable) < 2:
        raise ReadError(_called(name), "it is not an axis of at least two values", "give each axis its coordinates")
    values = _values(variable)
    even = np.linspace(values[0], values[-1], len(values))
    step = abs(values[-1] - values[0]) / (len(values) - 1)
    most = REGULAR * step
    if variable.dtype == np.float32:
        # Degrees of single precision are rounded to a metre or so, which is more than that of a fine grid's cells.
        most += min(float(np.spacing(np.float32(np.max(np.abs(values))))), 0.5 * step)
    if not np.all(np.isfinite(values)) or step == 0 or np.max(np.abs(values - even)) > most:
        raise ReadError(_called(name), "its values are not evenly spaced", "regrid the file, or send it as XYZ")
    return values


def _unit_m(file: Any, *names: str) -> float | None:
    """Return how many metres the unit of axes has; None where they state none of length, or not the same."""
    stated = {known_metres_in(getattr(file.variables[name], "units", "")) for name in names}
    return stated.pop() if len(stated) == 1 else None


def _is_eastward(file: Any, name: str) -> bool:
    """Return whether an axis says that it leads to the east."""
    variable = file.variables.get(name)
    said = [str(getattr(variable, attribute, "")).lower() for attribute in ("axis", "standard_name")]
    return (
        said[0] == "x"
        or said[1] in ("longitude", "projection_x_coordinate")
        or name.lower() in ("x", "lon", "long", "longitude", "easting", "east")
    )


def _metres(variable: Any, crs: pyproj.CRS | None) -> FloatArray:
    """Return values in metres by their own unit, else by that of the vertical axis."""
    said = str(getattr(variable, "units", "")).strip()
    unit_m = metres_in(said, _called(variable.name)) if said else vertical_unit(crs)[0]
    return unit_m * _values(variable)


def _values(variable: Any) -> FloatArray:
    values = np.ma.filled(np.ma.asarray(variable[:]).astype(np.float64), np.nan)
    return np.where(np.isfinite(values), values, np.nan)


def _crs(file: Any, variable: Any, x_name: str, y_name: str) -> pyproj.CRS | None:
    mapping = file.variables.get(str(getattr(variable, "grid_mapping", "")).partition(":")[0].strip())
    if mapping is not None:
        attributes = {key: mapping.getncattr(key) for key in mapping.ncattrs()}
        try:
            wkt = attributes.get("crs_wkt") or attributes.get("spatial_ref")
            return pyproj.CRS.from_wkt(wkt) if wkt else pyproj.CRS.from_cf(attributes)
        except (pyproj.exceptions.CRSError, KeyError):
            raise ReadError(_called(mapping.name), "it describes no known projection", "write crs_wkt") from None
    geographic = x_name.lower().startswith("lon") and y_name.lower().startswith("lat")
    return pyproj.CRS.from_epsg(4326) if geographic else None


def _direction(variable: Any) -> Positive | None:
    stated = str(getattr(variable, "positive", "")).lower()
    if stated in ("down", "up"):
        return "down" if stated == "down" else "up"
    standard = str(getattr(variable, "standard_name", ""))
    if "depth" in standard:
        return "down"
    if standard.startswith(("altitude", "height", "surface_altitude")):
        return "up"
    return {"depth": "down", "elevation": "up", "height": "up", "topo": "up"}.get(variable.name.lower())  # type: ignore[return-value]
