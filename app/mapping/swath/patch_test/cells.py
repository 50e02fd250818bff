"""Cells that several lines saw: by how much the lines' depths differ there, and what would change that."""

from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.swath.patch_test.ground import block_of

ROLL, PITCH, HEADING, LATENCY, BEND = range(5)
"""What may be wrong, by its number."""

LEAST_BEAMS = 4
"""A line with fewer beams in a cell tells nothing of it."""

LEAST_EXTENT = 0.1
"""Beams of a cell spread at least so far as a share of its side in every direction: else they tell no slope."""

SURE, SLOPE_SD = 25.0, 0.01
"""A slope tells of what moves beams aside when its square is so many times its variance, to which swaths that are bent
and tilted add: slopes that are not there would else be taken for knowledge."""

LEVEL, BENT = 1e-6, 1e-3
"""What slopes and bends of cells with few beams are held level with, as a share of the beams."""

PRIOR_BEAMS = 4.0
"""How beams scatter in a cell is taken to be as usual by so many of them: a few tell little of it."""

LEAST_SD = 0.001
"""Mean depths of a line in a cell are known no better than this share of the height."""


@dataclass(frozen=True)
class SharedCells:
    """What lines say of cells that at least two of them saw; g rows, one for each line in each cell.

    Attributes
    ----------
    cell, line, block : (g,)
        Index of the cell, from 0; number of the line; block of ground that the cell lies in.
    depth_m : (g,)
        Mean depth of the line's beams, carried to the middle of the cell's beams along its surface.
    sd_m : (g,)
        Of that, from how its beams scatter about that.
    change : (g, 5)
        By how much the depth changes with roll, pitch, heading (per radian), latency (per second) and the bend of the
        swath (by a share of the sound speed at the sonar). Of pitch, heading and latency only what they do along a
        slope: on even ground depths tell of a pitch by how it goes together with the vehicle's motion alone, and so
        would errors of heave and attitude.
    along : (g,)
        How far along its line, -1 at the first of the line's rows to 1 at the last.
    slope : (g, 2)
        Of the cell to the east and to the north, as far as it is sure, else zero.
    """

    cell: IntArray
    line: IntArray
    block: IntArray
    depth_m: FloatArray
    sd_m: FloatArray
    change: FloatArray
    along: FloatArray
    slope: FloatArray

    def __len__(self) -> int:
        return len(self.cell)

    @property
    def cells(self) -> int:
        """How many there are."""
        return int(self.cell.max(initial=-1)) + 1


@dataclass(frozen=True)
class _Surface:
    """Surfaces of c cells; NaN: unknown.

    Their middles (c, 2), terms (c, 5), slopes in the middle (c, 2) with their covariance (c, 2, 2), and how beams
    scatter about them (c,).
    """

    middle_m: FloatArray
    bend: FloatArray
    slope: FloatArray
    covariance: FloatArray
    scatter_m: FloatArray

    @property
    def is_sure(self) -> BoolArray:
        with np.errstate(invalid="ignore", divide="ignore"):
            a, b, d = (self.covariance + SLOPE_SD**2 * np.eye(2)).reshape(-1, 4)[:, [0, 1, 3]].T
            x, y = self.slope.T
            squared = (d * x**2 - 2.0 * b * x * y + a * y**2) / (a * d - b**2)
            return np.asarray(squared >= SURE)


def shared_cells(
    where_m: FloatArray,
    change: FloatArray,
    line: IntArray,
    time_s: FloatArray,
    size_m: tuple[float, float],
    height_m: float,
) -> SharedCells:
    """Return the cells that beams of several lines met.

    Parameters
    ----------
    where_m : (n, 3)
        East, north and down.
    change : (n, 5, 3)
        Of these with each of them.
    line, time_s : (n,)
    size_m
        Sides of a cell, and of a block: a power of two times that.
    height_m
        Usual height of the sonar above ground.
    """
    key = block_of(where_m[:, :2], size_m[0])
    rows = _seen_twice(key, line)
    where_m, change, line, time_s, key = where_m[rows], change[rows], line[rows], time_s[rows], key[rows]
    _, cell = np.unique(key, return_inverse=True)
    group, of_group, size = _groups(cell, line)
    surface = _surfaces(where_m, cell, group, size, size_m[0])
    sure = _sure_slopes(where_m, cell, line, surface, size_m)
    middle = surface.middle_m
    off = (where_m[:, :2] - middle[cell]) / (0.5 * size_m[0])
    depth = where_m[:, 2] - (surface.bend[cell] * _terms(off)).sum(axis=1)
    seen = -(change[:, :, :2] * sure[cell][:, None, :]).sum(axis=2)
    for upright in (ROLL, BEND):
        seen[:, upright] += change[:, upright, 2]
    scatter = surface.scatter_m[cell[of_group]]
    known = np.isfinite(scatter)
    sd = np.hypot(np.where(known, scatter, 0.0) / np.sqrt(size), LEAST_SD * height_m)
    kept = known & _both(cell[of_group], known)
    _, numbered = np.unique(cell[of_group][kept], return_inverse=True)
    return SharedCells(
        cell=numbered.astype(np.int64),
        line=line[of_group][kept],
        block=block_of(middle[cell[of_group]][kept], size_m[1]),
        depth_m=_means(depth[:, None], group)[kept, 0],
        sd_m=sd[kept],
        change=_means(seen, group)[kept],
        along=_along(line[of_group], _means(time_s[:, None], group)[:, 0])[kept],
        slope=sure[cell[of_group]][kept],
    )


def _seen_twice(key: IntArray, line: IntArray) -> BoolArray:
    """Return which beams lie in a cell where their line has enough, and another one, too."""
    _, group, count = np.unique(np.column_stack([key, line]), axis=0, return_inverse=True, return_counts=True)
    group = group.reshape(-1)
    enough = count[group] >= LEAST_BEAMS
    lines = np.unique(np.column_stack([key[enough], line[enough]]), axis=0)
    cells, seen = np.unique(lines[:, 0], return_counts=True)
    return np.asarray(enough & np.isin(key, cells[seen > 1]))


def _along(line: IntArray, time_s: FloatArray) -> FloatArray:
    """Return how far along its line each row (g,) is, -1 to 1, by its time."""
    count = int(line.max(initial=-1)) + 1
    first, last = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(first, line, time_s)
    np.maximum.at(last, line, time_s)
    return np.asarray(2.0 * (time_s - first[line]) / np.maximum(last - first, 1e-9)[line] - 1.0)


def _both(cell: IntArray, known: BoolArray) -> BoolArray:
    return np.asarray(np.bincount(cell, known, int(cell.max(initial=-1)) + 1)[cell] > 1)


def _groups(cell: IntArray, line: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the group of each beam, by cell and line, one beam of each, and how many it has."""
    code = cell * (int(line.max(initial=0)) + 1) + line
    _, first, group, size = np.unique(code, return_index=True, return_inverse=True, return_counts=True)
    return group.reshape(-1), first, size


def _means(values: FloatArray, of: IntArray) -> FloatArray:
    """Return the mean of rows (n, m) by their numbers (n,)."""
    count = np.maximum(np.bincount(of), 1)
    return np.column_stack([np.bincount(of, column) for column in values.T]) / count[:, None]


def _surfaces(where_m: FloatArray, cell: IntArray, group: IntArray, size: IntArray, size_m: float) -> _Surface:
    """Return the surfaces that lines have in common in each cell, whatever they differ by in depth.

    They are curved: beams of two lines lie differently in a cell, and what they differ by for that is no mounting.
    """
    cells = int(cell.max(initial=-1)) + 1
    middle = _means(where_m[:, :2], cell)
    at = (where_m[:, :2] - middle[cell]) / (0.5 * size_m)
    table = np.column_stack([_terms(at), where_m[:, 2]])
    table -= _means(table, group)[group]

    def total(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(cell, values, cells))

    terms = table.shape[1] - 1
    products = np.empty((cells, terms + 1, terms + 1))
    for i in range(terms + 1):
        for j in range(i + 1):
            products[:, i, j] = products[:, j, i] = total(table[:, i] * table[:, j])
    beams = np.bincount(cell, minlength=cells)
    free = beams - total(1.0 / size[group]).round() - terms
    ee, en, nn = products[:, 0, 0], products[:, 0, 1], products[:, 1, 1]
    narrowest = 0.5 * (ee + nn - np.sqrt((ee - nn) ** 2 + 4.0 * en**2))
    wide = (narrowest >= beams * (2.0 * LEAST_EXTENT) ** 2) & (free >= 1.0)
    normal = products[:, :terms, :terms] + np.diag([LEVEL] * 2 + [BENT] * (terms - 2)) * beams[:, None, None]
    inverse = np.linalg.inv(normal)
    bend = np.einsum("cij,cj->ci", inverse, products[:, :terms, terms])
    left = np.maximum(products[:, terms, terms] - np.einsum("ci,ci->c", bend, products[:, :terms, terms]), 0.0)
    usual = float(np.median(left[wide] / free[wide])) if wide.any() else 0.0
    variance = np.where(wide, (left + PRIOR_BEAMS * usual) / np.maximum(free + PRIOR_BEAMS, 1.0), np.nan)
    scale = 2.0 / size_m
    return _Surface(
        middle_m=middle,
        bend=np.where(wide[:, None], bend, 0.0),
        slope=np.where(wide[:, None], scale * bend[:, :2], np.nan),
        covariance=scale**2 * variance[:, None, None] * inverse[:, :2, :2],
        scatter_m=np.sqrt(variance),
    )


def _terms(at: FloatArray) -> FloatArray:
    """Return what depths in a cell depend on (n, 5), at places (n, 2) in halves of its side from its middle."""
    east, north = at.T
    return np.column_stack([east, north, east**2, east * north, north**2])


def _sure_slopes(
    where_m: FloatArray, cell: IntArray, line: IntArray, surface: _Surface, size_m: tuple[float, float]
) -> FloatArray:
    """Return the slope of each cell (c, 2) where it is sure, else that of wider ground around it, else zero."""
    found, open_ = np.nan_to_num(surface.slope), ~surface.is_sure
    found[open_] = 0.0
    wide_m = 2.0 * size_m[0]
    while wide_m <= size_m[1] * 1.001 and open_.any():
        _, wider = np.unique(block_of(where_m[:, :2], wide_m), return_inverse=True)
        group, _, size = _groups(wider, line)
        around = _surfaces(where_m, wider, group, size, wide_m)
        of_cell = np.zeros(len(found), dtype=np.int64)
        of_cell[cell] = wider
        taken = open_ & around.is_sure[of_cell]
        found[taken] = around.slope[of_cell[taken]]
        open_ &= ~taken
        wide_m *= 2.0
    return found
