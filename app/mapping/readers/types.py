"""What is asked of a reader and what it finds."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pyproj
from affine import Affine
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.types import Grid

MAX_SOUNDINGS = 2_000_000
MAX_RASTER_CELLS = 30_000_000
MAX_ZONES, MAX_CORNERS = 100, 20_000
"""Of what a chart shows to keep out of: as many zones as a mission takes."""

MAX_DRAWINGS, MAX_DRAWN_CORNERS = 2100, 30_000
"""Of a file with lines and areas: as many lines as a mission takes, and areas beside them."""

LOCAL: Literal["local"] = "local"
"""Stands for the mission's own frame where a coordinate reference system is asked for."""

MIN_DEPTH_M, MAX_DEPTH_M = -100.0, 11_100.0
MIN_SD_M = 0.001

DATUM_NOTE = "vertical datum: "
"""How a note begins that depths may be off by the difference of two datums."""

UNUSABLE = 3
"""Exit code of the reading process when the file, not the program, is wrong."""

UNCONFINED = 4
"""Exit code of the reading process when nothing keeps it from other files."""

Positive = Literal["down", "up"]


class ReadError(ValueError):
    """A file that cannot be used. ``field`` names the line, band, variable or option that is wrong."""

    def __init__(self, field: str, message: str, remedy: str) -> None:
        super().__init__(message)
        self.field = field
        self.remedy = remedy


@dataclass(frozen=True)
class ReadOptions:
    """What a file does not say by itself.

    Attributes
    ----------
    crs
        Anything that names a coordinate reference system, for example ``EPSG:32629``, or ``local``.
    positive
        Which way values grow.
    sd_m, order
        Uncertainty where the file states none: a standard deviation, or the S-44 order that was surveyed to.
    datum_offset_m
        Added to every depth to bring it to the mission's datum; None: nobody said that it is another one.
    """

    crs: str | None = None
    positive: Positive | None = None
    sd_m: float | None = None
    order: str | None = None
    datum_offset_m: float | None = None

    @property
    def offset_m(self) -> float:
        """What is added to every depth."""
        return self.datum_offset_m or 0.0


@dataclass(frozen=True)
class MapExtent:
    """Where the mission maps: its frame, its grid, how far outside that still helps, and what its depths are below.

    ``datum_epsg`` is None where the mission's depths are below the water level of the moment.
    """

    frame: LocalFrame
    grid: Grid
    margin_m: float
    datum_epsg: int | None = None


@dataclass(frozen=True)
class Points:
    """Soundings. Arrays have shape (n,); ``z`` is as in the file, ``sd_m`` NaN where the file states none.

    ``lines`` are their numbers in the file, for messages, which call them ``counted``.
    ``crs`` is None where the file does not say; then ``x`` and ``y`` are in what the options name.
    ``detection_sd_m`` is what the sonar's detection alone adds to the deviation that is assumed where ``sd_m`` is NaN.
    ``found`` is how many the file holds where these are not all of them; ``notes`` say what is to be known of them.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    sd_m: FloatArray
    crs: pyproj.CRS | Literal["local"] | None
    positive: Positive | None
    lines: NDArray[np.signedinteger]
    counted: str = "line"
    found: int | None = None
    detection_sd_m: FloatArray | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Raster:
    """A grid. Arrays have shape (rows, cols), row 0 first in the file; NaN is unknown.

    ``transform`` takes columns and rows to x and y of ``crs``, in metres ``unit_m`` long where the file states their
    unit beside it. ``crs`` has the vertical system, too, where the file states it. ``notes`` say what is to be known.
    """

    z: FloatArray
    sd_m: FloatArray
    transform: Affine
    crs: pyproj.CRS | None
    positive: Positive | None
    unit_m: float | None = None
    notes: tuple[str, ...] = ()
