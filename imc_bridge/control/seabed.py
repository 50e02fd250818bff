"""What all vehicles have measured of the bottom, in cells: what one has found lies ahead of another.

Depths are below the surface at the time, so they are forgotten before the tide has made them wrong.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator

EARTH_RADIUS_M = 6_371_000.0
CELL_M = 5.0
KEPT_PER_CELL = 9
MAX_CELLS = 200_000
MAX_AGE_S = 3600.0
CONFIRMED_WITHIN_M = 2.0

_Cell = tuple[int, int]


class Seabed:
    """Soundings in square cells of 5 m.

    A single reading may be a false echo, so the shallowest of a cell counts only when a second one, there or in a
    neighbouring cell, is hardly deeper.
    """

    def __init__(self) -> None:
        self._cells: dict[_Cell, deque[tuple[float, float]]] = {}
        self._cos_lat: float | None = None

    def __len__(self) -> int:
        return len(self._cells)

    def add(self, now: float, lat_deg: float, lon_deg: float, bottom_depth_m: float) -> None:
        """Take a sounding in that arrived at ``now`` (seconds of the bridge's clock)."""
        if self._cos_lat is None:
            self._cos_lat = max(math.cos(math.radians(lat_deg)), 0.01)
        cell = self._cell(*self._place_m(lat_deg, lon_deg))
        readings = self._cells.get(cell)
        if readings is None:
            if len(self._cells) >= MAX_CELLS:
                del self._cells[next(iter(self._cells))]
            readings = self._cells[cell] = deque(maxlen=KEPT_PER_CELL)
        readings.append((now, bottom_depth_m))

    def shallowest(
        self, now: float, start_deg: tuple[float, float], end_deg: tuple[float, float], half_width_m: float
    ) -> float | None:
        """Least confirmed depth in a corridor, None where nothing is known.

        Parameters
        ----------
        now
        start_deg, end_deg
            Ends of the corridor's axis, latitude and longitude; they may be one place.
        half_width_m
            The corridor reaches this far to the sides and beyond the ends.
        """
        if self._cos_lat is None:
            return None
        depths = [
            depth
            for cell in self._corridor(self._place_m(*start_deg), self._place_m(*end_deg), half_width_m)
            if (depth := self._depth(cell, now)) is not None
        ]
        return min(depths, default=None)

    def _corridor(self, start: tuple[float, float], end: tuple[float, float], half_width_m: float) -> Iterator[_Cell]:
        length = math.dist(start, end)
        steps = max(math.ceil(length / CELL_M), 1)
        reach = math.ceil(half_width_m / CELL_M)
        seen: set[_Cell] = set()
        for k in range(steps + 1):
            share = k / steps
            north = start[0] + share * (end[0] - start[0])
            east = start[1] + share * (end[1] - start[1])
            row, col = self._cell(north, east)
            for i in range(row - reach, row + reach + 1):
                for j in range(col - reach, col + reach + 1):
                    if (i, j) not in seen:
                        seen.add((i, j))
                        yield i, j

    def _depth(self, cell: _Cell, now: float) -> float | None:
        readings = self._fresh(cell, now)
        if not readings:
            return None
        if len(readings) > 1:
            # The second shallowest of a few, the third of many.
            return sorted(readings)[max(1, (len(readings) - 1) // 4)]
        (alone,) = readings
        row, col = cell
        for i in (row - 1, row, row + 1):
            for j in (col - 1, col, col + 1):
                if (i, j) != cell and any(d <= alone + CONFIRMED_WITHIN_M for d in self._fresh((i, j), now)):
                    return alone
        return None

    def _fresh(self, cell: _Cell, now: float) -> list[float]:
        readings = self._cells.get(cell)
        return [] if readings is None else [depth for at, depth in readings if now - at <= MAX_AGE_S]

    def _place_m(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        cos_lat = 1.0 if self._cos_lat is None else self._cos_lat
        return EARTH_RADIUS_M * math.radians(lat_deg), EARTH_RADIUS_M * math.radians(lon_deg) * cos_lat

    @staticmethod
    def _cell(north_m: float, east_m: float) -> _Cell:
        return math.floor(north_m / CELL_M), math.floor(east_m / CELL_M)
