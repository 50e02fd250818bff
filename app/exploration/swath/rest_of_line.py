"""What is left of a line that a vehicle flies, laid by what was measured since it began."""

from dataclasses import replace

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.exploration.swath.assignment import FlownLine
from app.exploration.swath.lines import STEEPEST, Line, bend_radius_m, gentle, lines
from app.exploration.swath.raster import Flying, LineRaster


def rest_of_line(
    course: FlownLine, here_m: FloatArray, flying: Flying, raster: LineRaster, free: BoolArray
) -> FloatArray | None:
    """Return what is left of a line from a place (2,) on, (k, 2), none where it is past its end; None: as it was.

    ``free`` are the open cells (along, across) that nobody else will see.
    """
    here = raster.axes.turned(here_m)
    turned = raster.axes.turned(course.path)
    forwards = turned[-1, 0] >= turned[0, 0]
    columns = raster.columns_of(np.array([here[0], turned[-1, 0]]))
    ahead = np.zeros(raster.open.shape[0], dtype=bool)
    ahead[min(columns) : max(columns) + 1] = True
    ahead[columns[0]] = False
    if not ahead.any():
        return None
    if forwards != (turned[-1, 0] >= here[0]):
        return np.zeros((0, 2))
    old = np.interp(raster.along_m, *(turned if forwards else turned[::-1]).T)
    near = np.abs(raster.across_m - old[:, None]) <= 2.5 * raster.half_width_m(flying)
    choice = lines(raster, free & ahead[:, None] & near, course.sign, replace(flying, overlap=course.overlap), old)
    if not choice:
        return np.zeros((0, 2))
    wish = np.full(raster.open.shape[0], np.nan)
    for line in choice:
        wish[line.columns] = line.across_m
    needed = np.flatnonzero(np.isfinite(wish))
    last = needed[-1] if forwards else needed[0]
    whole = np.arange(columns[0], last + 1) if forwards else np.arange(last, columns[0] + 1)
    path = Line(whole, _bent(wish[whole], whole, here, course.sign, flying, raster)).path(raster)
    path = path if forwards else path[::-1]
    passed = (raster.axes.turned(path)[:, 0] - here[0]) * (1 if forwards else -1) <= 0.5 * raster.cell_m
    return simple(path[~passed], 0.1 * raster.cell_m)


def _bent(
    wish_m: FloatArray, columns: IntArray, here: FloatArray, sign: int, flying: Flying, raster: LineRaster
) -> FloatArray:
    """Return where a line lies in columns (n,), metres across: where it is wished (n,) as far as it may bend there."""
    asked = np.where(np.isnan(wish_m), np.inf, sign * wish_m)
    width = flying.half_width_m(
        raster.depth_m[columns, raster.rows_of(np.where(np.isfinite(asked), sign * asked, here[1]))]
    )
    level = gentle(asked, raster.cell_m, bend_radius_m(width, flying))
    level = np.where(np.isfinite(level), sign * level, here[1])
    bend = STEEPEST * np.abs(raster.along_m[columns] - here[0])
    return np.clip(level, here[1] - bend, here[1] + bend)


def simple(path: FloatArray, tolerance_m: float) -> FloatArray:
    """Return a path (k, 2) with as few vertices as leave it where it is (Douglas and Peucker 1973)."""
    if len(path) < 3:
        return path
    keep = np.zeros(len(path), dtype=bool)
    keep[[0, -1]] = True
    pieces = [(0, len(path) - 1)]
    while pieces:
        first, last = pieces.pop()
        chord = path[last] - path[first]
        rest = path[first + 1 : last] - path[first]
        if not len(rest):
            continue
        off = np.abs(chord[0] * rest[:, 1] - chord[1] * rest[:, 0]) / max(float(np.hypot(*chord)), 1e-9)
        k = int(off.argmax())
        if off[k] > tolerance_m:
            keep[first + 1 + k] = True
            pieces += [(first, first + 1 + k), (first + 1 + k, last)]
    return path[keep]
