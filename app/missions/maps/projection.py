"""Maps in the projected system that somebody asks for."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import Frame, ProjectedFrame, named_frame, projected_cells
from app.mapping.coordinates.utm import utm_epsg
from app.mapping.layers import Layer
from app.mapping.types import BathymetricMap
from app.missions.errors import ConflictError, InvalidRequestError
from app.missions.spec.base import PolygonGeometry
from app.missions.views.maps.map import FileOption

NOT_SOUNDED = ("no cell of the map was sounded", "wait for soundings inside of the area")


def projected_frame(name: str, area: PolygonGeometry, frame: LocalFrame) -> ProjectedFrame:
    """Return a projected system for an area by its name, ``utm`` or ``EPSG:nnnn``.

    Raises InvalidRequestError where it cannot be.
    """
    lon, lat = np.transpose(area.ring)
    east, north = (0.5 * float(axis.min() + axis.max()) for axis in frame.to_local(lat, lon))
    try:
        return named_frame(name, frame, east, north)
    except ValueError as error:
        zone = utm_epsg(*(float(degrees) for degrees in frame.to_geographic(east, north)))
        raise InvalidRequestError(
            FileOption.CRS,
            str(error),
            f"give utm (here EPSG:{zone}), or EPSG: and the code of a projected system in metres for this place",
        ) from error


def placed(bathymetry: BathymetricMap, layers: Sequence[Layer], frame: Frame) -> tuple[BathymetricMap, Sequence[Layer]]:
    """Return a map and layers of it on the grid of ``frame``. Raises ConflictError where no cell is known."""
    if isinstance(frame, LocalFrame):
        return bathymetry, layers
    keep = np.logical_or.reduce(
        [np.isfinite(values) for values in (bathymetry.depth_m, *(one.values for one in layers))]
    )
    if not keep.any():
        raise ConflictError(*NOT_SOUNDED)
    cells = projected_cells(bathymetry, frame, keep)
    return cells.map(bathymetry), [replace(one, values=cells.of(one.values, np.nan)) for one in layers]
