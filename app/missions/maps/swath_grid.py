"""What the swath sonars of a mission have ensonified: beams placed, counted and averaged in the cells of its map."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.estimation.uncertainty import BeamPaths, SoundingErrors, Uncertainty, uncertainty
from app.exploration.core.coverage import Coverage
from app.mapping.swath.density import DensityGrid
from app.mapping.swath.gridded import gridded_map
from app.mapping.swath.holidays import open_ground, side_of
from app.mapping.swath.pings import Footprints, Pings, PlacedPings
from app.mapping.swath.spikes import states_of
from app.mapping.tiers import asked_of, by_depth
from app.mapping.types import BathymetricMap, Grid, SoundingRows

Place = Callable[[str, Pings], PlacedPings | None]
"""Returns where the beams of a vehicle's pings met the bottom; None where that is nowhere near."""


@dataclass(frozen=True)
class Beams:
    """Beams that count, not spikes and rejected ones: whose pings they are of, where they met the bottom, how surely.

    Place and attitude of the pings are the sonar's.
    """

    pings: Pings
    footprints: Footprints
    uncertainty: Uncertainty

    @property
    def sd_m(self) -> FloatArray:
        """Standard deviation of the depth of each, (m,)."""
        return self.uncertainty.vertical_sd_m


def beams_of(vehicle: str, pings: Pings, place: Place, errors: SoundingErrors) -> Beams | None:
    """Return the beams of one vehicle's pings whose depth is known; None where they are nowhere near."""
    there = place(vehicle, pings)
    if there is None:
        return None
    pings, beams = there.pings, there.footprints
    found = beams.take(states_of(there).used & np.isfinite(beams.depth_m))
    went = BeamPaths(
        angle_rad=found.angle_rad - pings.roll_rad[found.ping],
        down_m=np.abs(found.depth_m - pings.depth_m[found.ping]),
        pitch_rad=pings.pitch_rad[found.ping],
    )
    return Beams(pings, found, uncertainty(went, errors, pings.position_sd_m[found.ping]))


class SwathGrid:
    """Collects pings; everything here belongs in worker threads, which may do so at the same time."""

    def __init__(self, grid: Grid, mask: BoolArray, errors: SoundingErrors, cell_of_depth: float | None = None) -> None:
        self._grid, self._mask, self._cell_of_depth = grid, mask, cell_of_depth
        self.place: Place = lambda vehicle, pings: None
        self.errors = errors
        self._density = DensityGrid(grid, mask)
        self._lock = threading.Lock()
        self.beams = 0
        """How many were taken in, spikes and rejected ones left out."""

    def empty(self) -> "SwathGrid":
        """Return one of the same cells that has taken in nothing."""
        empty = SwathGrid(self._grid, self._mask, self.errors, self._cell_of_depth)
        empty.place = self.place
        return empty

    def add(self, vehicle: str, pings: Pings) -> None:
        """Take in the pings of one vehicle."""
        beams = beams_of(vehicle, pings, self.place, self.errors)
        if beams is None:
            return
        at = beams.footprints
        self.add_placed(at.east_m, at.north_m, at.depth_m, beams.uncertainty)

    def add_placed(self, east_m: FloatArray, north_m: FloatArray, depth_m: FloatArray, sd: Uncertainty) -> None:
        """Take in beams, (n,) each, whose place on the bottom is known."""
        with self._lock:
            self._density.add(east_m, north_m, depth_m, sd.scattered_sd_m, sd.shared_sd_m, sd.horizontal_sd_m)
            self.beams += len(depth_m)

    def begin_anew(self) -> None:
        """Forget all pings: they are read again."""
        with self._lock:
            self._density, self.beams = DensityGrid(self._grid, self._mask), 0

    def map(self, soundings: SoundingRows) -> BathymetricMap | None:
        """Return the map of all beams and of single soundings (n, 4); None without any."""
        with self._lock:
            density = self._density.copy()
        if len(soundings):
            density.add(*soundings.T)
        return gridded_map(density)

    def coverage(self, prior_m: FloatArray | None) -> Coverage:
        """Return what is left to ensonify; ``prior_m`` (rows, cols): depths that were known before."""
        with self._lock:
            count, depth = np.where(self._mask, self._density.count, 0), self._density.depth_m
        if prior_m is not None:
            depth = np.where(np.isfinite(depth), depth, prior_m)
        grid = self._grid
        side, asked = side_of(grid.cell_m, grid.cell_m), asked_of(depth, grid.cell_m, self._cell_of_depth)
        left = by_depth(count, self._mask, asked, lambda count, mask: open_ground(count > 0, mask, side)) > 0
        return Coverage(grid.west_m, grid.south_m, grid.cell_m, self._mask, self._mask & ~left, depth).planned_on()
