"""A map in a projected system that others know by its EPSG code: UTM or a country's own grid."""

import re
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pyproj
from numpy.typing import ArrayLike
from pyproj.exceptions import CRSError, ProjError

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.utm import utm_epsg
from app.mapping.types import BathymetricMap, Grid

UTM = "utm"
"""The zone of a place."""

MOST_STRETCHED = 0.01
"""A system whose metre differs by a larger share from one on the ground was made for another place."""

BESIDE_DEG = 4.0
"""A system may be used so far outside of where it was made for: surveys lie across the borders of zones."""

LEAST_ACCURATE_M = 5.0
"""A datum that WGS 84 is taken to no better than this is none that depths are delivered in."""


class ProjectedFrame:
    """Eastings and northings of a projected system, and the way there from a mission's own frame.

    Parameters
    ----------
    epsg
        Of a system in metres.
    local
        The mission's frame.
    """

    axis_names = "easting_m northing_m"

    def __init__(self, epsg: int, local: LocalFrame) -> None:
        self.epsg = epsg
        self.local = local

    @cached_property
    def crs(self) -> pyproj.CRS:
        """The coordinate reference system."""
        return pyproj.CRS.from_epsg(self.epsg)

    @property
    def statement(self) -> str:
        """What positions are in."""
        return f"{self.crs.name} (EPSG:{self.epsg})"

    def from_local(self, east_m: ArrayLike, north_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return easting and northing of local positions."""
        easting, northing = self._transformer().transform(np.asarray(east_m, float), np.asarray(north_m, float))
        return np.asarray(easting), np.asarray(northing)

    def to_local(self, easting_m: ArrayLike, northing_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return local positions of eastings and northings."""
        places = np.asarray(easting_m, float), np.asarray(northing_m, float)
        east, north = self._transformer().transform(*places, direction=pyproj.enums.TransformDirection.INVERSE)
        return np.asarray(east), np.asarray(north)

    def to_geographic(self, easting_m: ArrayLike, northing_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return ``(lat_deg, lon_deg)``, WGS 84, as the mission's frame has them."""
        return self.local.to_geographic(*self.to_local(easting_m, northing_m))

    def accuracy_m(self, east_m: float, north_m: float) -> float:
        """Return how well a local position is known in the system's datum; infinite where there is no way there."""
        transformer = self._transformer()
        try:
            found = transformer.transform(east_m, north_m, errcheck=True)
        except ProjError:
            return float("inf")
        stated = transformer.get_last_used_operation().accuracy
        return float(stated) if np.isfinite(found).all() and stated >= 0.0 else float("inf")

    def _transformer(self) -> pyproj.Transformer:
        # One must not be shared between threads.
        return pyproj.Transformer.from_crs(self.local.crs, self.crs, always_xy=True, allow_ballpark=False)


Frame = LocalFrame | ProjectedFrame
"""What positions in a file are in."""


def named_frame(name: str, local: LocalFrame, east_m: float, north_m: float) -> ProjectedFrame:
    """Return the system that a name, ``utm`` or ``EPSG:nnnn``, means for a local place.

    Raises
    ------
    ValueError
        When it is none, or none that a map of the place can be delivered in; the message says why.
    """
    lat, lon = (float(degrees) for degrees in local.to_geographic(east_m, north_m))
    if name.lower() == UTM:
        return ProjectedFrame(utm_epsg(lat, lon), local)
    code = re.fullmatch(r"EPSG:([0-9]{1,6})", name, re.ASCII | re.IGNORECASE)
    if code is None:
        raise ValueError(f"{name[:40]!r} is neither utm nor EPSG: and a code")
    frame = ProjectedFrame(int(code[1]), local)
    try:
        crs = frame.crs
    except CRSError:
        raise ValueError(f"there is no EPSG:{frame.epsg}") from None
    if not crs.is_projected or crs.is_compound or {axis.unit_name for axis in crs.axis_info} != {"metre"}:
        raise ValueError(f"{frame.statement} is no projected system in metres")
    if {axis.name for axis in crs.axis_info} != {"Easting", "Northing"}:
        raise ValueError(f"{frame.statement} does not count to the east and to the north")
    try:
        factors = pyproj.Proj(crs).get_factors(lon, lat, errcheck=True)
    except ProjError:
        raise ValueError(f"{frame.statement} does not reach to the area") from None
    if not _reaches(crs, lat, lon):
        where = "" if crs.area_of_use is None else f": {crs.area_of_use.name}"
        raise ValueError(f"{frame.statement} was made for another place{where}")
    stretched = max(abs(factors.tissot_semimajor - 1.0), abs(factors.tissot_semiminor - 1.0))
    if not stretched <= MOST_STRETCHED:
        raise ValueError(f"{frame.statement} was made for another place: lengths at the area are wrong by a lot")
    if frame.accuracy_m(east_m, north_m) > LEAST_ACCURATE_M:
        raise ValueError(f"no way from WGS 84 to {frame.statement} is known to be within {LEAST_ACCURATE_M:g} m")
    return frame


def _reaches(crs: pyproj.CRS, lat_deg: float, lon_deg: float) -> bool:
    """Whether a place lies where a system was made for, or close by, on the same side of the equator as all of that."""
    area = crs.area_of_use
    if area is None:
        return True
    south = area.south if area.south == 0.0 else area.south - BESIDE_DEG
    north = area.north if area.north == 0.0 else area.north + BESIDE_DEG
    # East of its western edge, which may be beyond 180 degrees from its eastern one.
    width_deg = (area.east - area.west) % 360.0 or 360.0
    east_deg = (lon_deg - (area.west - BESIDE_DEG)) % 360.0
    return south <= lat_deg <= north and east_deg <= width_deg + 2.0 * BESIDE_DEG


@dataclass(frozen=True)
class ProjectedCells:
    """Cells of a map that were taken to a projected system.

    Attributes
    ----------
    grid
        In its eastings and northings; its lines are whole multiples of the cell.
    source : (rows, cols)
        The number of the map's cell, row by row, that each cell has its values of; -1 without one.
    """

    frame: ProjectedFrame
    grid: Grid
    source: IntArray

    @property
    def filled(self) -> BoolArray:
        """Which cells have values, (rows, cols)."""
        return np.asarray(self.source >= 0)

    def of(self, layer: FloatArray | IntArray | BoolArray, fill: float) -> FloatArray:
        """Return a layer of the map, (rows, cols) of the map, on this grid."""
        return np.where(self.filled, layer.ravel()[np.maximum(self.source, 0)], fill)

    def map(self, bathymetry: BathymetricMap) -> BathymetricMap:
        """Return the map on this grid; cells without values are unknown."""

        def moved(layer: FloatArray | None) -> FloatArray | None:
            return None if layer is None else self.of(layer, np.nan)

        return replace(
            bathymetry,
            grid=self.grid,
            depth_m=self.of(bathymetry.depth_m, np.nan),
            sd_m=self.of(bathymetry.sd_m, np.nan),
            count=self.of(bathymetry.count, 0).astype(bathymetry.count.dtype),
            sounded=self.of(bathymetry.sounded, 0) > 0,
            roughness=self.of(bathymetry.roughness, np.nan),
            prior=None if bathymetry.prior is None else self.of(bathymetry.prior, 0) > 0,
            process_sd_m=moved(bathymetry.process_sd_m),
            bound_sd_m=moved(bathymetry.bound_sd_m),
            precision=moved(bathymetry.precision),
            horizontal_sd_m=moved(bathymetry.horizontal_sd_m),
            shared_sd_m=moved(bathymetry.shared_sd_m),
            model=f"{bathymetry.model}. Each cell in {self.frame.statement} has the values of the cell at its middle, "
            "or of a shoaler one beside it",
        )


def projected_cells(bathymetry: BathymetricMap, frame: ProjectedFrame, keep: BoolArray) -> ProjectedCells:
    """Return the cells to ``keep``, (rows, cols), on a grid of the same cell, two by two at least.

    Each cell has the values of the map's cell that its centre lies in. The two grids are turned and stretched against
    each other, which leaves some of the map's cells out: they replace a deeper one, or one without a depth, so that no
    shoal is lost.

    Raises
    ------
    ValueError
        When there is nothing to keep.
    """
    if not keep.any():
        raise ValueError("no cell of the map was sounded")
    grid, cell = bathymetry.grid, bathymetry.grid.cell_m
    rows, cols = np.nonzero(keep)
    east, north = frame.from_local(grid.east_m[cols], grid.north_m[rows])
    first_col, first_row = int(np.floor(east.min() / cell)), int(np.floor(north.min() / cell))
    j, i = np.floor(east / cell).astype(np.int64) - first_col, np.floor(north / cell).astype(np.int64) - first_row
    found = Grid(first_col * cell, first_row * cell, cell, max(int(i.max()) + 1, 2), max(int(j.max()) + 1, 2))

    back = frame.to_local(*np.meshgrid(found.east_m, found.north_m))
    col, row = (np.floor((at - low) / cell) for at, low in zip(back, (grid.west_m, grid.south_m), strict=True))
    on_map = (col >= 0) & (col < grid.cols) & (row >= 0) & (row < grid.rows)
    number = np.where(on_map, row * grid.cols + col, 0).astype(np.int64)
    source = np.where(on_map & keep.ravel()[number], number, -1)

    depth = np.where(np.isfinite(bathymetry.depth_m), bathymetry.depth_m, np.inf).ravel()
    kept = np.flatnonzero(keep)
    shoal_last = np.argsort(-depth[kept])
    shoalest = np.full(source.shape, -1)
    shoalest[i[shoal_last], j[shoal_last]] = kept[shoal_last]
    shoaler = (shoalest >= 0) & ((source < 0) | (depth[shoalest] < depth[source]))
    return ProjectedCells(frame, found, np.where(shoaler, shoalest, source))
