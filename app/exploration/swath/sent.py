"""The pieces of lines that vehicles were sent along: what they will see, and when they count as flown."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.exploration.core.coverage import Coverage
from app.exploration.swath.assignment import Assignment, Piece
from app.exploration.swath.raster import Flying, LineRaster

FLOWN, LAST_PART = 0.5, 0.2
"""A piece of a line counts as flown where this share of the cells under the last part of it is ensonified, and of those
beside its end that were open: what is behind the last ping is still to come."""


def sent_along(path: FloatArray, flying: Flying, coverage: Coverage) -> Piece:
    """Return a piece (k, 2) of a line as a vehicle is sent along it now."""
    return Piece(path, _open_beside_end(path, flying, coverage))


def expected(sweeps: Mapping[str, Assignment], raster: LineRaster, flying: Flying, vehicle: str) -> BoolArray:
    """Return what will be seen on what everybody was sent along, and on what the others' lines have left."""
    seen = np.zeros_like(raster.open)
    for name, sweep in sweeps.items():
        paths = [piece.path for piece in sweep.expected]
        if name != vehicle and sweep.course is not None and len(sweep.course.path) > 1:
            paths.append(sweep.course.path)
        for path in paths:
            seen |= raster.under(path, flying)
    return seen


def forget_flown(pieces: list[Piece], coverage: Coverage) -> None:
    """Expect nothing any more of pieces that were flown; those before them were flown, too."""
    for k in range(len(pieces) - 1, -1, -1):
        rows, cols = _under(pieces[k].path, coverage)
        last = int((1.0 - LAST_PART) * len(rows))
        rows, cols = rows[last:], cols[last:]
        inside = coverage.wanted[rows, cols]
        if not inside.any() or (
            coverage.done[rows, cols][inside].mean() >= FLOWN and _end_seen(pieces[k].open_m, coverage)
        ):
            del pieces[: k + 1]
            break


def _under(path: FloatArray, coverage: Coverage) -> tuple[Any, Any]:
    """Return the rows and columns of the grid's cells under a path (k, 2)."""
    lengths = np.hypot(*np.diff(path, axis=0).T)
    begins = np.concatenate([[0.0], np.cumsum(lengths)])
    at = np.arange(0.0, begins[-1] + 1e-9, coverage.cell_m)
    cols = np.floor((np.interp(at, begins, path[:, 0]) - coverage.west_m) / coverage.cell_m).astype(np.int64)
    rows = np.floor((np.interp(at, begins, path[:, 1]) - coverage.south_m) / coverage.cell_m).astype(np.int64)
    shape = coverage.wanted.shape
    return np.clip(rows, 0, shape[0] - 1), np.clip(cols, 0, shape[1] - 1)


def _open_beside_end(path: FloatArray, flying: Flying, coverage: Coverage) -> FloatArray:
    """Return the centres (n, 2) of open cells across the end of a path (k, 2), as far as the swath goes there."""
    back = path[-2] - path[-1]
    back = back / max(float(np.hypot(*back)), 1e-9)
    end = path[-1] + 0.5 * coverage.cell_m * back
    rows, cols = _under(np.stack([end, end]), coverage)
    depth_m = coverage.depth_m[rows[:1], cols[:1]]
    half_m = float(flying.half_width_m(depth_m)[0]) if np.isfinite(depth_m).all() else 0.0
    aside_m = np.arange(-max(half_m, coverage.cell_m), max(half_m, coverage.cell_m) + 1e-9, coverage.cell_m)
    places = end + aside_m[:, None] * np.array([-back[1], back[0]])
    return np.asarray(places[_cells_at(places, coverage, coverage.left)])


def _end_seen(places: FloatArray, coverage: Coverage) -> bool:
    """Return whether most of the places (n, 2) that were open beside a piece's end are ensonified."""
    return not len(places) or float(_cells_at(places, coverage, coverage.done).mean()) >= FLOWN


def _cells_at(places: FloatArray, coverage: Coverage, cells: BoolArray) -> BoolArray:
    """Return which places (n, 2) lie in some cells of the grid."""
    cols = np.floor((places[:, 0] - coverage.west_m) / coverage.cell_m).astype(np.int64)
    rows = np.floor((places[:, 1] - coverage.south_m) / coverage.cell_m).astype(np.int64)
    shape = cells.shape
    inside = (rows >= 0) & (rows < shape[0]) & (cols >= 0) & (cols < shape[1])
    return np.asarray(inside & cells[np.where(inside, rows, 0), np.where(inside, cols, 0)])
