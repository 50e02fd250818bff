"""Occupancy of a partly known site on square cells (ACCESS13 section IV-A: the sets V1 to V4, the matrices P and M)."""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray

HIT, MISS = 1.2, -0.4
"""Logarithmic odds that one scan adds to a cell where a beam ended, or that beams only passed."""
CLAMP = (-2.0, 4.0)
"""Bounds of the evidence: a boat that left can be unlearned, and of two echoes in free water the second counts."""
CLOSE = 0.1
"""Distance between the places beyond an echo that are looked at, in cells."""
INTO = 1e-9
"""How far into its cell an echo lies, as a part of a cell: a beam may touch no more than a corner of it."""


class Cell(IntEnum):
    """What is known of a cell."""

    EXPLORED = 1
    """V1: traversable and explored."""
    UNEXPLORED = 2
    """V2: traversable as far as the blueprint says, and not explored."""
    KNOWN = 3
    """V3: an obstacle on the blueprint."""
    FOUND = 4
    """V4: an obstacle that was explored."""


@dataclass(frozen=True)
class Scanner:
    """A laser or an imaging sonar that looks round: ``beams`` bearings, evenly over the full circle.

    Attributes
    ----------
    reach_m : float
        Range of the beams.
    resolution_deg : float
        Angle between neighbouring beams.
    """

    reach_m: float = 8.0
    resolution_deg: float = 0.5

    @property
    def bearings_rad(self) -> FloatArray:
        """Bearings (n,) of a scan, clockwise from north."""
        return np.asarray(np.radians(np.arange(0.0, 360.0, self.resolution_deg)), dtype=np.float64)


@dataclass(frozen=True)
class OccupancyGrid:
    """What is known of a site: the matrix M.

    Attributes
    ----------
    west_m, south_m : float
        Outer corner of the south-western cell.
    cell_m : float
        Side of a cell.
    blueprint : (rows, cols)
        Obstacles known beforehand; row 0 is south, column 0 west.
    evidence : (rows, cols)
        Logarithmic odds of being occupied from all scans; NaN where not scanned.
    """

    west_m: float
    south_m: float
    cell_m: float
    blueprint: BoolArray
    evidence: FloatArray

    @classmethod
    def from_blueprint(
        cls, blueprint: BoolArray, cell_m: float, west_m: float = 0.0, south_m: float = 0.0
    ) -> "OccupancyGrid":
        """Return the grid before the first scan."""
        return cls(west_m, south_m, cell_m, blueprint, np.full(blueprint.shape, np.nan))

    @property
    def states(self) -> NDArray[np.uint8]:
        """Return the :class:`Cell` of every cell, (rows, cols)."""
        states = np.full(self.evidence.shape, Cell.UNEXPLORED, dtype=np.uint8)
        states[self.evidence <= 0.0] = Cell.EXPLORED
        states[self.evidence > 0.0] = Cell.FOUND
        states[self.blueprint] = Cell.KNOWN
        return states

    def seen_from(
        self,
        position_m: FloatArray,
        bearings_rad: FloatArray,
        ranges_m: FloatArray,
        reach_m: float,
        *,
        passing: BoolArray | None = None,
        doubt_m: float = 0.0,
    ) -> "OccupancyGrid":
        """Return the grid after a scan.

        Every cell that beams pass or end in is counted once per scan; an echo in it outweighs beams that pass, and
        where no obstacle stands beside it all that was seen there before: something came. Beside an obstacle it may
        be that one, since neither ranges nor positions are exact. An echo in the cell that the scanner is in counts
        for the next one: no obstacle fills a cell that a vehicle is in.

        Parameters
        ----------
        position_m : (2,) or (3,)
            Where the scan was taken, east and north.
        bearings_rad : (n,)
            Clockwise from north.
        ranges_m : (n,)
            To the echo; inf where there was none within ``reach_m``; NaN: the beam is left out.
        passing : (n,)
            Beams whose echo is of what only passes by: short of it is free, of itself and of what is beyond they say
            nothing. None: of no beam.
        doubt_m : float
            How far an echo may lie in front of an obstacle of the blueprint and still come from it: neither ranges nor
            positions are exact.
        """
        evidence = self.evidence.copy()
        start = (np.asarray(position_m, dtype=np.float64)[:2] - [self.west_m, self.south_m]) / self.cell_m
        _mark(
            evidence,
            start,
            np.asarray(bearings_rad, dtype=np.float64),
            np.asarray(ranges_m, dtype=np.float64) / self.cell_m,
            reach_m / self.cell_m,
            np.zeros(len(ranges_m), dtype=np.bool_) if passing is None else passing,
            self.blueprint,
            doubt_m / self.cell_m,
        )
        return replace(self, evidence=evidence)

    def cell_of(self, en_m: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return rows and columns of positions (..., 2); they may lie outside the grid."""
        col = np.floor((en_m[..., 0] - self.west_m) / self.cell_m).astype(np.int64)
        row = np.floor((en_m[..., 1] - self.south_m) / self.cell_m).astype(np.int64)
        return row, col

    @property
    def centres_m(self) -> FloatArray:
        """Return the cells' centres, (rows, cols, 2)."""
        rows, cols = self.blueprint.shape
        north, east = np.indices((rows, cols)) + 0.5
        return np.stack([self.west_m + self.cell_m * east, self.south_m + self.cell_m * north], axis=-1)


@njit(cache=True, nogil=True)
def _is_before(blueprint: BoolArray, start: FloatArray, east: float, north: float, length: float, doubt: float) -> bool:
    """Tell whether a beam would meet an obstacle of the blueprint within ``doubt`` beyond its echo."""
    rows, cols = blueprint.shape
    pieces = int(np.ceil(doubt / CLOSE))
    for k in range(1, pieces + 1):
        beyond = length + doubt * k / pieces
        row, col = int(np.floor(start[1] + beyond * north)), int(np.floor(start[0] + beyond * east))
        if 0 <= row < rows and 0 <= col < cols and blueprint[row, col]:
            return True
    return False


@njit(cache=True, nogil=True)
def _mark(
    evidence: FloatArray,
    start: FloatArray,
    bearings: FloatArray,
    ranges: FloatArray,
    reach: float,
    passing: BoolArray,
    blueprint: BoolArray,
    doubt: float,
) -> None:
    rows, cols = evidence.shape
    passed = np.zeros((rows, cols), dtype=np.uint8)
    for k in range(len(bearings)):
        if np.isnan(ranges[k]):
            continue
        echo = ranges[k] <= reach
        length = ranges[k] + INTO if echo else reach
        echo = echo and not passing[k]
        east, north = np.sin(bearings[k]), np.cos(bearings[k])
        col, row = int(np.floor(start[0])), int(np.floor(start[1]))
        step_c, step_r = (1 if east > 0 else -1), (1 if north > 0 else -1)
        per_c = 1.0 / abs(east) if east != 0.0 else np.inf
        per_r = 1.0 / abs(north) if north != 0.0 else np.inf
        next_c = ((col + 1 - start[0]) if east > 0 else (start[0] - col)) * per_c if east != 0.0 else np.inf
        next_r = ((row + 1 - start[1]) if north > 0 else (start[1] - row)) * per_r if north != 0.0 else np.inf
        # No obstacle fills the cell that the scanner is in: what is so close stands in the next one.
        length = max(length, min(next_c, next_r) + INTO)
        while 0 <= row < rows and 0 <= col < cols:
            leaves = min(next_c, next_r)
            if leaves >= length:
                # A beam without an echo says nothing of a cell that it only touches.
                if echo and not _is_before(blueprint, start, east, north, length, doubt):
                    passed[row, col] = 2
                break
            if passed[row, col] == 0:
                passed[row, col] = 1
            if next_c < next_r:
                next_c += per_c
                col += step_c
            else:
                next_r += per_r
                row += step_r
    standing = blueprint | (evidence > 0.0)
    for row in range(rows):
        for col in range(cols):
            if passed[row, col] > 0:
                before = 0.0 if np.isnan(evidence[row, col]) else evidence[row, col]
                told = HIT if passed[row, col] == 2 else MISS
                if told == HIT and not standing[max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2].any():
                    before = max(before, 0.0)
                evidence[row, col] = min(max(before + told, CLAMP[0]), CLAMP[1])
