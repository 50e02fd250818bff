"""What all vehicles have measured of the bottom, in cells: what one has found lies ahead of another.

Depths are below the surface at the time, so they are forgotten before the tide has made them wrong.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator

from imc_bridge.distances import distance_m

EARTH_RADIUS_M = 6_371_000.0
CELL_M = 5.0
KEPT_PER_CELL = 9
MAX_CELLS = 200_000
MAX_AGE_S = 3600.0
CONFIRMED_WITHIN_M = 2.0

_Cell = tuple[int, int]


class Seabed:
    """Soundings in square cells of 5 m, in rows along parallels; how many degrees a cell is wide is its row's own.

    A single reading may be a false echo, so the shallowest of a cell counts only when a second one, there or in a
    neighbouring cell, is hardly deeper.
    """

    def __init__(self) -> None:
        self._cells: dict[_Cell, deque[tuple[float, float]]] = {}

    def __len__(self) -> int:
        return len(self._cells)

    def add(self, now: float, lat_deg: float, lon_deg: float, bottom_depth_m: float) -> None:
        """Take a sounding in that arrived at ``now`` (seconds of the bridge's clock)."""
        row = _row(lat_deg)
        cell = row, _col(row, lon_deg)
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
        depths = [
            depth
            for cell in self._corridor(start_deg, end_deg, half_width_m)
            if (depth := self._depth(cell, now)) is not None
        ]
        return min(depths, default=None)

    def _corridor(self, start: tuple[float, float], end: tuple[float, float], half_width_m: float) -> Iterator[_Cell]:
        if not self._cells:
            return
        steps = max(math.ceil(distance_m(start, end) / CELL_M), 1)
        reach = math.ceil(half_width_m / CELL_M)
        seen: set[_Cell] = set()
        for k in range(steps + 1):
            share = k / steps
            lat = start[0] + share * (end[0] - start[0])
            lon = start[1] + share * (end[1] - start[1])
            row = _row(lat)
            for i in range(row - reach, row + reach + 1):
                col = _col(i, lon)
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
        lon_deg = math.degrees((col + 0.5) * CELL_M / _radius_m(row))
        for i in (row - 1, row, row + 1):
            middle = _col(i, lon_deg)
            for j in (middle - 1, middle, middle + 1):
                if (i, j) != cell and any(d <= alone + CONFIRMED_WITHIN_M for d in self._fresh((i, j), now)):
                    return alone
        return None

    def _fresh(self, cell: _Cell, now: float) -> list[float]:
        readings = self._cells.get(cell)
        return [] if readings is None else [depth for at, depth in readings if now - at <= MAX_AGE_S]


def _row(lat_deg: float) -> int:
    return math.floor(EARTH_RADIUS_M * math.radians(lat_deg) / CELL_M)


def _col(row: int, lon_deg: float) -> int:
    return math.floor(_radius_m(row) * math.radians(lon_deg) / CELL_M)


def _radius_m(row: int) -> float:
    """Return the radius of a row's parallel."""
    return EARTH_RADIUS_M * max(math.cos((row + 0.5) * CELL_M / EARTH_RADIUS_M), 0.01)
