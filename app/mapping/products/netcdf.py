"""Map as NetCDF after the Climate and Forecast conventions."""

import threading
from collections.abc import Sequence
from datetime import datetime

import numpy as np
from netCDF4 import Dataset

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import Frame
from app.mapping.layers import INTERPOLATED, PRIOR, SOUNDED, Layer
from app.mapping.types import BathymetricMap
from app.mapping.water.vertical import INSTANTANEOUS_WATER_LEVEL, VerticalDatum

_ONE_AT_A_TIME = threading.Lock()
"""The library underneath is not safe for several threads."""

CONVENTIONS = "CF-1.8"
FILL = np.float32(-9999.0)
FLAG_FILL = np.int8(-1)

STANDARD_NAMES = {
    INSTANTANEOUS_WATER_LEVEL: "sea_floor_depth_below_sea_surface",
    5715: "sea_floor_depth_below_mean_sea_level",
}
"""The conventions have names for depths below these datums only."""


def netcdf(
    bathymetry: BathymetricMap,
    layers: Sequence[Layer],
    frame: Frame,
    *,
    vertical_datum: VerticalDatum,
    title: str,
    created: datetime,
) -> bytes:
    """Return a NetCDF-4 file with one variable per layer over y and x, and each cell's latitude and longitude."""
    with _ONE_AT_A_TIME:
        # The file lives in memory; the size is only the first guess.
        file = Dataset("map.nc", "w", memory=1 << 20)
        try:
            _write(file, bathymetry, layers, frame, vertical_datum, title, created)
        except BaseException:
            file.close()
            raise
        return bytes(file.close())


def _write(
    file: Dataset,
    bathymetry: BathymetricMap,
    layers: Sequence[Layer],
    frame: Frame,
    vertical_datum: VerticalDatum,
    title: str,
    created: datetime,
) -> None:
    grid = bathymetry.grid
    file.setncatts(
        {
            "Conventions": CONVENTIONS,
            "title": title,
            "institution": "bathyfleet",
            "source": bathymetry.model,
            "history": f"{created:%Y-%m-%dT%H:%M:%SZ} written by bathyfleet",
            "references": "https://cfconventions.org",
            "comment": f"Depths are positive down, below {vertical_datum.statement}",
        }
    )
    file.createDimension("y", grid.rows)
    file.createDimension("x", grid.cols)
    of_origin = isinstance(frame, LocalFrame)
    meanings = (
        [f"{name} of the mission's origin" for name in ("east", "north")] if of_origin else ["easting", "northing"]
    )
    for name, values, meaning in zip("xy", (grid.east_m, grid.north_m), meanings, strict=True):
        axis = file.createVariable(name, "f8", (name,))
        axis.setncatts(
            {
                "standard_name": f"projection_{name}_coordinate",
                "long_name": meaning,
                "units": "m",
                "axis": name.upper(),
            }
        )
        axis[:] = values
    _write_crs(file, frame, vertical_datum)
    lat, lon = frame.to_geographic(*np.meshgrid(grid.east_m, grid.north_m))
    for name, values, unit in (("lat", lat, "degrees_north"), ("lon", lon, "degrees_east")):
        place = file.createVariable(name, "f8", ("y", "x"), compression="zlib")
        full = {"lat": "latitude", "lon": "longitude"}[name]
        place.setncatts({"standard_name": full, "long_name": full, "units": unit})
        place[:] = values
    companions = [layer.name for layer in layers if layer.name != "depth"]
    for layer in layers:
        _write_layer(file, layer, vertical_datum, companions)


def _write_crs(file: Dataset, frame: Frame, vertical_datum: VerticalDatum) -> None:
    crs = file.createVariable("crs", "i4")
    compound = vertical_datum.compound_with(frame.crs)
    cf = {name: value for name, value in frame.crs.to_cf().items() if name != "crs_wkt"}
    crs.setncatts(cf | {"crs_wkt": compound.to_wkt()})
    crs[...] = 0


def _write_layer(file: Dataset, layer: Layer, vertical_datum: VerticalDatum, companions: list[str]) -> None:
    standard_name = STANDARD_NAMES.get(vertical_datum.epsg)
    about: dict[str, object] = {"long_name": layer.meaning, "grid_mapping": "crs", "coordinates": "lat lon"}
    kind, fill = ("i1", FLAG_FILL) if layer.name == "sounded" else ("f4", FILL)
    match layer.name:
        case "depth":
            about |= {"positive": "down", "ancillary_variables": " ".join(companions)}
            about["long_name"] = f"depth of the sea floor below {vertical_datum.crs.name}, positive down"
            if standard_name:
                about["standard_name"] = standard_name
        case "uncertainty":
            if standard_name:
                about["standard_name"] = f"{standard_name} standard_error"
        case "sounded":
            about["flag_values"] = np.array([INTERPOLATED, SOUNDED, PRIOR], np.int8)
            about["flag_meanings"] = "interpolated sounded prior_soundings_only"
    if layer.name != "sounded":
        about["units"] = {"metre": "m"}.get(layer.unit, layer.unit)
    variable = file.createVariable(layer.name, kind, ("y", "x"), compression="zlib", fill_value=fill)
    variable.setncatts(about)
    variable[:] = np.ma.masked_invalid(layer.values).filled(fill)
