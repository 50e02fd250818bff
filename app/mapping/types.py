"""Grids, soundings and maps: the data that passes between mapping and its users."""

from dataclasses import dataclass, replace

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray

SoundingRows = FloatArray
"""Soundings as rows, shape (n, 4): east, north, depth, standard deviation in metres."""

MAX_SD_M = 1000.0
"""A standard deviation beyond this says nothing true, and a map cannot be computed with it."""

CHARTED_SD = "one standard deviation of the depth, that of what all soundings share, such as the tide, included"
"""What the deviations of :meth:`BathymetricMap.charted` are, as files say it."""


@dataclass(frozen=True)
class Grid:
    """Square cells over a rectangle of the local frame; row 0 is south, column 0 is west.

    ``west_m`` and ``south_m`` are the outer corner of the south-western cell; values sit at cell centres.
    """

    west_m: float
    south_m: float
    cell_m: float
    rows: int
    cols: int

    @property
    def east_m(self) -> FloatArray:
        """Centres of the columns, shape (cols,)."""
        return self.west_m + (np.arange(self.cols, dtype=np.float64) + 0.5) * self.cell_m

    @property
    def north_m(self) -> FloatArray:
        """Centres of the rows, shape (rows,)."""
        return self.south_m + (np.arange(self.rows, dtype=np.float64) + 0.5) * self.cell_m

    @property
    def centres_m(self) -> FloatArray:
        """All cell centres, shape (rows * cols, 2), in row-major order."""
        east, north = np.meshgrid(self.east_m, self.north_m)
        return np.column_stack([east.ravel(), north.ravel()])


@dataclass(frozen=True)
class Soundings:
    """Accepted soundings, corrected, local frame. All arrays have shape (n,); depth is positive down."""

    east_m: FloatArray
    north_m: FloatArray
    depth_m: FloatArray
    sd_m: FloatArray

    @classmethod
    def of_rows(cls, rows: SoundingRows) -> "Soundings":
        """Return what stands in rows; a column that lies together in memory is not copied."""
        return cls(*(np.ascontiguousarray(column) for column in rows.T))

    def __len__(self) -> int:
        return len(self.depth_m)

    def take(self, rows: IntArray | BoolArray | slice) -> "Soundings":
        """Return the soundings with the given numbers, of a slice, or where a boolean array is True."""
        return Soundings(self.east_m[rows], self.north_m[rows], self.depth_m[rows], self.sd_m[rows])

    def check(self) -> None:
        """Raise ValueError unless all is finite, of one length, and every sd positive."""
        for name in ("east_m", "north_m", "depth_m", "sd_m"):
            values = getattr(self, name)
            if values.shape != (len(self),):
                raise ValueError(f"soundings.{name} has shape {values.shape}; depth_m has {len(self)} values")
            finite = np.isfinite(values)
            if not finite.all():
                i = int(np.argmin(finite))
                raise ValueError(f"soundings.{name}[{i}] is {values[i]}; it must be finite")
        positive = self.sd_m > 0.0
        if not positive.all():
            i = int(np.argmin(positive))
            raise ValueError(f"soundings.sd_m[{i}] is {self.sd_m[i]}; it must be positive")


@dataclass(frozen=True)
class BathymetricMap:
    """A map on a grid; every layer has shape (rows, cols), NaN outside the area.

    Attributes
    ----------
    depth_m, sd_m
        Estimate and posterior standard deviation of the sea floor's depth (not of a new sounding).
    count
        Soundings in the cell.
    sounded
        True where the cell was sounded, False where it is interpolated.
    roughness
        Relative local variability of the sea floor, mean about 1.
    correlation_length_m
        Fitted length scale.
    prior
        True where soundings were imported as prior knowledge; None without any. They are not in ``count`` or
        ``sounded``.
    process_sd_m
        What the process alone says of the deviation, wherever soundings are: what planners weigh places by. None: the
        same as ``sd_m``.
    bound_sd_m
        What the deviation hardly exceeds, as far as soundings could tell; infinite where none supports the cell. None:
        the same as ``sd_m``.
    precision
        Sum of the soundings' inverse variances, whose mean weighted by them is the depth; None where the map is no such
        mean.
    horizontal_sd_m
        Of each horizontal coordinate of a cell's soundings, as far as it is known of them, NaN where of none. None: it
        is known nowhere.
    shared_sd_m
        The part of ``sd_m`` that a cell's soundings share, so that more of them do not average it out: NaN without any.
        None: it is not known apart.
    """

    grid: Grid
    depth_m: FloatArray
    sd_m: FloatArray
    count: IntArray
    sounded: BoolArray
    roughness: FloatArray
    correlation_length_m: float
    model: str
    prior: BoolArray | None = None
    process_sd_m: FloatArray | None = None
    bound_sd_m: FloatArray | None = None
    precision: FloatArray | None = None
    horizontal_sd_m: FloatArray | None = None
    shared_sd_m: FloatArray | None = None

    @property
    def planning_sd_m(self) -> FloatArray:
        """The deviation that places are weighed by, (rows, cols)."""
        return self.sd_m if self.process_sd_m is None else self.process_sd_m

    @property
    def claim_sd_m(self) -> FloatArray:
        """The deviation that claims are made by, (rows, cols)."""
        return self.sd_m if self.bound_sd_m is None else self.bound_sd_m

    def charted(self, common_sd_m: float) -> "BathymetricMap":
        """Return the map with the deviations of charted depths, as every file states them.

        Parameters
        ----------
        common_sd_m
            Standard deviation of what all soundings share, as an uncertain water level: no deviation of the map itself
            holds it.
        """

        def whole(sd_m: FloatArray | None) -> FloatArray | None:
            return None if sd_m is None else np.asarray(np.hypot(sd_m, common_sd_m))

        return replace(
            self,
            sd_m=np.hypot(self.sd_m, common_sd_m),
            process_sd_m=whole(self.process_sd_m),
            bound_sd_m=whole(self.bound_sd_m),
            shared_sd_m=whole(self.shared_sd_m),
        )

    def known(self, accuracy_m: float) -> BoolArray:
        """Return which cells are known to an accuracy and supported by soundings, (rows, cols)."""
        return np.asarray(self.claim_sd_m <= accuracy_m)
