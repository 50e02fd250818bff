"""How much a scan from a cell would show: unexplored cells in its sight as far as obstacles are known."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.arrays import FloatArray, IntArray
from app.estimation.occupancy import Cell
from app.exploration.core.search_task import SearchTask

NOTHING = 1e-6
"""Worth below which there is nothing to see; sums of many cells' worths are no more exact than that."""


class Rays(NamedTuple):
    """Offsets (rays, most, 2) in rows and columns that rays from a cell's centre pass, and how many each has."""

    offsets: IntArray
    lengths: IntArray


@cache
def rays(reach_cells: float) -> Rays:
    """Return enough rays to pass every cell within reach."""
    count = max(8, 4 * int(np.ceil(np.pi * reach_cells)))
    ways: list[list[tuple[int, int]]] = []
    for k in range(count):
        bearing = 2.0 * np.pi * (k + 0.5) / count
        north, east = np.cos(bearing), np.sin(bearing)
        # Where the ray crosses a border between rows or columns a new cell begins.
        borders = np.arange(0.5, reach_cells)
        crossings = np.concatenate([borders / max(abs(north), 1e-12), borders / max(abs(east), 1e-12)])
        at = np.sort(np.append(0.0, crossings[crossings < reach_cells]))
        middles = (at[:-1] + at[1:]) / 2.0
        ways.append([(int(np.floor(0.5 + m * north)), int(np.floor(0.5 + m * east))) for m in middles])
    offsets = np.zeros((count, max(map(len, ways)), 2), dtype=np.int64)
    for k, way in enumerate(ways):
        offsets[k, : len(way)] = way
    return Rays(offsets, np.array([len(way) for way in ways], dtype=np.int64))


def gains(task: SearchTask, worth: FloatArray, places: IntArray) -> FloatArray:
    """Return the worth (n,) of all unexplored cells in sight of each of some cells (n, 2).

    ``worth`` (rows, cols) of a cell counts where it is unexplored; what is not known as an obstacle hides nothing.
    """
    table = rays(task.scanner.reach_m / task.grid.cell_m)
    return _gains(task.states, worth, np.ascontiguousarray(places, dtype=np.int64), *table)


class Gains:
    """What :func:`gains` says of places on one site again and again, where only little changes from time to time.

    A place is looked at again once a cell within its reach has changed, be it in its worth or in what is known of it.
    """

    def __init__(self) -> None:
        self._shown = np.zeros((0, 0))
        self._gains = np.zeros((0, 0))

    def of(self, task: SearchTask, worth: FloatArray, places: IntArray) -> FloatArray:
        """Return what :func:`gains` returns."""
        table = rays(task.scanner.reach_m / task.grid.cell_m)
        shown = np.where(task.states == Cell.UNEXPLORED, worth, 0.0)
        shown[task.states >= Cell.KNOWN] = -1.0
        if self._shown.shape != shown.shape:
            self._shown = np.full(shown.shape, np.nan)
            self._gains = np.full(shown.shape, np.nan)
        _forget(self._gains, np.argwhere(shown != self._shown), int(np.abs(table.offsets).max()))
        self._shown = shown
        kept = self._gains[places[:, 0], places[:, 1]]
        again = np.isnan(kept)
        if again.any():
            kept[again] = _gains(task.states, worth, np.ascontiguousarray(places[again]), *table)
            self._gains[places[again, 0], places[again, 1]] = kept[again]
        return kept


def take(task: SearchTask, worth: FloatArray, place: IntArray) -> None:
    """Set the worth of everything in sight of a cell (2,) to 0: another vehicle will look at it."""
    table = rays(task.scanner.reach_m / task.grid.cell_m)
    _take(task.states, worth, place, *table)


@njit(cache=True, nogil=True)
def _gains(
    states: NDArray[np.uint8], worth: FloatArray, places: IntArray, offsets: IntArray, lengths: IntArray
) -> FloatArray:
    rows, cols = states.shape
    counted = np.full((rows, cols), -1, dtype=np.int32)
    result = np.zeros(len(places))
    # What lies in a square about a place, from sums over rectangles: most places are far from anything unexplored.
    within = np.zeros((rows + 1, cols + 1))
    for row in range(rows):
        line = 0.0
        for col in range(cols):
            line += worth[row, col] if states[row, col] == Cell.UNEXPLORED else 0.0
            within[row + 1, col + 1] = within[row, col + 1] + line
    reach = int(np.max(np.abs(offsets)))
    for k in range(len(places)):
        south, north = max(0, places[k, 0] - reach), min(rows, places[k, 0] + reach + 1)
        west, east = max(0, places[k, 1] - reach), min(cols, places[k, 1] + reach + 1)
        square = within[north, east] - within[south, east] - within[north, west] + within[south, west]
        if square < NOTHING:
            continue
        for ray in range(len(lengths)):
            for i in range(lengths[ray]):
                row, col = places[k, 0] + offsets[ray, i, 0], places[k, 1] + offsets[ray, i, 1]
                if not (0 <= row < rows and 0 <= col < cols) or states[row, col] >= Cell.KNOWN:
                    break
                if states[row, col] == Cell.UNEXPLORED and counted[row, col] != k:
                    counted[row, col] = k
                    result[k] += worth[row, col]
    return result


@njit(cache=True, nogil=True)
def _forget(kept: FloatArray, changed: IntArray, reach: int) -> None:
    """Set to NaN what lies in the squares about the changed cells (n, 2)."""
    rows, cols = kept.shape
    if 2 * len(changed) > rows * cols:
        kept[:] = np.nan
        return
    for k in range(len(changed)):
        for row in range(max(0, changed[k, 0] - reach), min(rows, changed[k, 0] + reach + 1)):
            for col in range(max(0, changed[k, 1] - reach), min(cols, changed[k, 1] + reach + 1)):
                kept[row, col] = np.nan


@njit(cache=True, nogil=True)
def _take(states: NDArray[np.uint8], worth: FloatArray, place: IntArray, offsets: IntArray, lengths: IntArray) -> None:
    rows, cols = states.shape
    for ray in range(len(lengths)):
        for i in range(lengths[ray]):
            row, col = place[0] + offsets[ray, i, 0], place[1] + offsets[ray, i, 1]
            if not (0 <= row < rows and 0 <= col < cols) or states[row, col] >= Cell.KNOWN:
                break
            worth[row, col] = 0.0
