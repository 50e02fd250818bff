"""What is exchanged with Neptus' ConvCAO panel, as values: depths in metres, positive down; places in cells.

Cells are counted from the south-western corner: rows to the north, columns to the east. The panel counts the depth of
a vehicle as a height above ``max_depth_m``; the depths of its multibeam samples are plain depths.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import Literal

from imcpy.coordinates import WGS84

BathymeterRule = Literal["twice", "once", "off"]
SampleRule = Literal["checked", "off"]


@dataclass(frozen=True, slots=True)
class CellPosition:
    """Where a vehicle is: row and column in cells, depth in metres."""

    row: float
    col: float
    depth_m: float


@dataclass(frozen=True, slots=True)
class Area:
    """The rectangle of the panel's settings (``conf/noptcoords.properties`` of Neptus).

    ``max_depth_m`` is the depth from which the panel counts heights.
    """

    centre_lat_deg: float
    centre_lon_deg: float
    rows: int = 240
    cols: int = 240
    cell_m: float = 1.0
    max_depth_m: float = 50.0

    def to_geographic(self, row: float, col: float) -> tuple[float, float]:
        """Latitude and longitude (degrees) of a place."""
        lat, lon = WGS84.displace(
            math.radians(self.centre_lat_deg),
            math.radians(self.centre_lon_deg),
            (row - self.rows / 2) * self.cell_m,
            (col - self.cols / 2) * self.cell_m,
        )
        return math.degrees(lat), math.degrees(lon)

    def to_cells(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """Row and column of a place."""
        north, east, _ = WGS84.displacement(
            math.radians(self.centre_lat_deg),
            math.radians(self.centre_lon_deg),
            0.0,
            math.radians(lat_deg),
            math.radians(lon_deg),
            0.0,
        )
        return float(north) / self.cell_m + self.rows / 2, float(east) / self.cell_m + self.cols / 2

    def corners(self) -> list[tuple[float, float]]:
        """Latitude and longitude (degrees): south-west, south-east, north-east, north-west."""
        return [
            self.to_geographic(row, col)
            for row, col in ((0, 0), (0, self.cols), (self.rows, self.cols), (self.rows, 0))
        ]

    def depth_of(self, height_m: float) -> float:
        """Depth of a vehicle whose height the panel gave: cut to whole metres, so the middle of that metre."""
        whole = float(height_m).is_integer()
        return max(self.max_depth_m - height_m - (0.5 if whole and height_m < self.max_depth_m else 0.0), 0.0)

    def on_border(self, row: float, col: float) -> bool:
        """Whether the panel may have moved a place here that was outside: it puts those on the border, silently."""
        return not (0.0 < row < self.rows - 1 and 0.0 < col < self.cols - 1)


@dataclass(frozen=True, slots=True)
class Conventions:
    """How the panel's figures are meant.

    ``bathymeter``: ``twice``: the unmodified panel, which subtracts the vehicle's depth and the bottom's depth, which
    holds the vehicle's depth already, from ``max_depth_m``; ``once``: a panel that was corrected, ``max_depth_m`` minus
    the bottom's depth; ``off``: not used. ``samples``: ``checked`` against the `Bathymeter` where that is used, since
    the panel makes a sample of every range that any sensor reports; ``off``: not used.
    """

    area: Area
    bathymeter: BathymeterRule = "twice"
    samples: SampleRule = "checked"


@dataclass(frozen=True, slots=True)
class CellSounding:
    """A measurement of the bottom at a place in cells."""

    row: float
    col: float
    vehicle_depth_m: float
    bottom_depth_m: float
    source: str
    vehicle: int | None = None
    """Index of the vehicle that measured; None where the panel gives none."""
    depth_sd_m: float | None = None


@dataclass(frozen=True, slots=True)
class Bottom:
    """Depth of the sea floor at a place in cells, as a vehicle's `Bathymeter` has it."""

    row: float
    col: float
    depth_m: float
    sd_m: float


@dataclass(frozen=True, slots=True)
class StepData:
    """One step: where the vehicles are and what was sounded since the last step."""

    session: str
    time_step: int
    places: tuple[CellPosition, ...]
    soundings: tuple[CellSounding, ...]
    refused: Counter[str]
    bottoms: tuple[Bottom | None, ...] = ()
    """What the `Bathymeter` says of the sea floor under each vehicle; None where it does not know."""
    altitude_ratios: tuple[float | None, ...] = ()
    """For each vehicle how high its samples have it above the bottom, by how high it has itself."""
    pairs: bool = False
    """Written by a panel of 2013, which knows whole cells only and no depth, and cannot read anything else."""
