"""Where the next line may lie: as far from what was ensonified as its swath reaches back to it."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.ndimage import find_objects, label

from app.arrays import BoolArray, FloatArray, IntArray
from app.exploration.swath.raster import Flying, LineRaster

STEEPEST = 0.3
"""A line may bend away from its direction by so much, as a tangent: its swath stays across it."""

BRIDGED_RADII = 6.0
"""A line is flown on over ground that is done where that is shorter than so many turning circles' radii."""

MOST_OVERLAP, ALMOST = 0.1, 0.03
"""Lines overlap by more than they must, up to the first share, where that leaves as many; a part of a line that is
smaller than the second needs no line of its own."""

MOST_LEFT, COME_AGAIN_RADII = 6, 10.0
"""So many pieces of ground are left for later, where they hold a line back by more than the way to come again for them:
so many turning circles' radii, and their length."""

STRIP = 0.6
"""What is left open is swept in lines where it is wider than this part of a swath; the rest is filled in the end."""

LARGE = 0.3
"""So is what is so large a share of the area, though one swath sees it."""


@dataclass(frozen=True)
class Line:
    """One line across columns of a raster.

    Attributes
    ----------
    columns : (n,)
        Successive columns of the raster.
    across_m : (n,)
        Where it lies in each.
    """

    columns: IntArray
    across_m: FloatArray

    def path(self, raster: LineRaster) -> FloatArray:
        """Return its vertices (k, 2), east and north, by increasing ``along``, ends at the outer sides of columns."""
        along_m = raster.along_m[self.columns]
        half = 0.5 * raster.cell_m
        along_m = (
            np.concatenate([[along_m[0] - half], along_m[1:-1], [along_m[-1] + half]])
            if len(along_m) > 1
            else (np.array([along_m[0] - half, along_m[0] + half]))
        )
        across_m = self.across_m if len(self.across_m) > 1 else np.repeat(self.across_m, 2)
        return raster.axes.to_en(np.column_stack([along_m, across_m]))


def lines(
    raster: LineRaster, open_cells: BoolArray, sign: int, flying: Flying, near_m: FloatArray | None = None
) -> list[Line]:
    """Return the lines that may be flown next over open cells (along, across), swept towards ``sign`` (1 or -1).

    In each column the line lies so far beyond the first open cell that its swath just reaches back to it: how far that
    is follows from the depth there, which the last line has measured. A line bends gently. Where one line sees all that
    is left of a column it lies as close to ``near_m`` (along), metres across, as that lets it. None: to where it lies
    in columns that need more than one line, or without any in the middle.
    """
    first, last, has = _extent(open_cells, sign)
    if not has.any():
        return []
    columns = np.flatnonzero(has)
    edge_m = _sides(raster, first[columns], -sign)
    width_m = _reach_m(raster, columns, first[columns], edge_m, sign, flying)
    overlap = _even_overlap(raster, open_cells, columns, flying)
    target_m = edge_m + sign * (1.0 - overlap) * width_m
    far_m = _sides(raster, last[columns], sign)
    back_m = far_m - sign * (1.0 - flying.overlap) * _reach_m(raster, columns, last[columns], far_m, -sign, flying)
    sees_all = sign * back_m < sign * target_m
    bridge = max(1, int(BRIDGED_RADII * flying.radius_m / raster.cell_m))
    parted = (np.diff(columns) > bridge) | (
        np.abs(np.diff(edge_m)) > 1.5 * np.maximum(width_m[1:], width_m[:-1]) + raster.cell_m
    )
    found = []
    for part in np.split(np.arange(len(columns)), np.flatnonzero(parted) + 1):
        whole = np.arange(columns[part[0]], columns[part[-1]] + 1)
        more = part[~sees_all[part]]
        if near_m is not None:
            wish_m = near_m[columns[part]]
        elif len(more):
            wish_m = np.interp(part, more, target_m[more])
        else:
            wish_m = 0.5 * (edge_m + far_m)[part]
        lies_m = sign * np.clip(sign * wish_m, sign * back_m[part], sign * target_m[part])
        wish = np.full(len(whole), np.inf)
        wish[columns[part] - whole[0]] = sign * np.where(sees_all[part], lies_m, target_m[part])
        width = np.interp(whole, columns[part], width_m[part])
        radius_m = bend_radius_m(width, flying)
        wish = _worth(wish, width, raster.cell_m, flying.radius_m, radius_m)
        line = Line(whole, sign * gentle(wish, raster.cell_m, radius_m))
        found.append(_in_sight(line, raster, open_cells, flying))
    return found


def _in_sight(line: Line, raster: LineRaster, open_cells: BoolArray, flying: Flying) -> Line:
    """Return a line without ends outside of the area that likely see no open cell (along, across); whole where all are.

    Beside a border at an angle to it a line does not bend far enough to come near what is open there.
    """
    rows = raster.rows_of(line.across_m)
    reach_m = raster.likely_half_width_m(flying)[line.columns, rows] + raster.cell_m
    near = np.abs(raster.across_m - line.across_m[:, None]) <= reach_m[:, None]
    kept = np.flatnonzero((near & open_cells[line.columns]).any(axis=1) | raster.wanted[line.columns, rows])
    if not len(kept):
        return line
    inner = slice(kept[0], kept[-1] + 1)
    return Line(line.columns[inner], line.across_m[inner])


def needed_lines(raster: LineRaster, cells: BoolArray, flying: Flying) -> FloatArray:
    """Return how many lines see the cells (along, across) of each column, parts of lines included."""
    width_m = np.maximum(raster.likely_half_width_m(flying), 0.5 * raster.cell_m)
    return np.asarray((cells * raster.cell_m / ((2.0 - flying.overlap) * width_m)).sum(axis=1))


def _even_overlap(raster: LineRaster, open_cells: BoolArray, columns: IntArray, flying: Flying) -> FloatArray:
    """Return the overlaps (n,) with which a whole number of lines sees what is left of each column."""
    needed = needed_lines(raster, open_cells, flying)[columns]
    spacing = 1.0 - 0.5 * flying.overlap
    whole = np.ceil(float(needed.max()) - ALMOST)
    even = np.minimum(needed / max(whole, 1.0), 1.0)
    return np.asarray(np.clip(2.0 - 2.0 * spacing * even, flying.overlap, max(flying.overlap, MOST_OVERLAP)))


@njit(cache=True, nogil=True)
def gentle(wish: FloatArray, cell_m: float, radius_m: float) -> FloatArray:
    """Return a line (n,) not above the wishes (n,), one a cell, that turns no farther than ``STEEPEST`` and smoothly.

    It is the largest one whose valleys have the radius; its tops are rounded by a mean over half of that.
    """
    level = _valleys(wish, cell_m, radius_m)
    n = len(level)
    half = min(int(0.25 * radius_m / cell_m), (n - 1) // 2)
    rounded = np.empty(n)
    total = level[0] * half
    for k in range(half + 1):
        total += level[k]
    for k in range(n):
        rounded[k] = total / (2 * half + 1)
        total += level[min(k + half + 1, n - 1)] - level[max(k - half, 0)]
    return rounded


@njit(cache=True, nogil=True)
def _valleys(wish: FloatArray, cell_m: float, radius_m: float) -> FloatArray:
    """Return the largest line (n,) not above the wishes whose valleys have the radius."""
    # What wishes farther away than a bend allow rises evenly, what nearer ones allow as the circle does.
    n = len(wish)
    bent_m = STEEPEST * radius_m
    bent = int(np.ceil(bent_m / cell_m))
    level = np.full(n, np.inf)
    for k in range(-bent, bent + 1):
        away_m = cell_m * abs(k)
        rise_m = away_m**2 / (2.0 * radius_m) if away_m < bent_m else STEEPEST * (away_m - 0.5 * bent_m)
        for i in range(max(0, -k), min(n, n - k)):
            level[i] = min(level[i], wish[i + k] + rise_m)
    if n > bent:
        away_m = cell_m * bent
        rise_m = away_m**2 / (2.0 * radius_m) if away_m < bent_m else STEEPEST * (away_m - 0.5 * bent_m)
        climb_m = STEEPEST * cell_m
        lowest = np.inf
        for i in range(n - bent):
            lowest = min(lowest, wish[i] - climb_m * i)
            level[i + bent] = min(level[i + bent], lowest + climb_m * i + rise_m)
        lowest = np.inf
        for i in range(n - bent):
            lowest = min(lowest, wish[n - 1 - i] - climb_m * i)
            level[n - 1 - bent - i] = min(level[n - 1 - bent - i], lowest + climb_m * i + rise_m)
    return level


def warm_up() -> None:
    """Compile what lays lines, or load it from the cache of an earlier start."""
    gentle(_worth(np.zeros(2), np.ones(2), 1.0, 1.0, 1.0), 1.0, 1.0)


@njit(cache=True, nogil=True)
def _worth(wish: FloatArray, width_m: FloatArray, cell_m: float, turning_m: float, radius_m: float) -> FloatArray:
    """Return the wishes (n,) without those that hold the whole line back more than it costs to come again for them.

    ``width_m`` (n,) is how far a line sees to either side, ``turning_m`` the radius of turning circles, ``radius_m``
    the one in which the line bends.
    """
    n = len(wish)
    level = gentle(wish, cell_m, radius_m)
    reach = int(0.5 * radius_m / cell_m) + 1
    for _ in range(MOST_LEFT):
        best_m, best_wish, best_level = 0.0, wish, level
        last = -1
        while last + 1 < n:
            first = last + 1
            while first < n and wish[first] > level[first] + 0.25 * cell_m:
                first += 1
            last = first
            while last + 1 < n and wish[last + 1] <= level[last + 1] + 0.25 * cell_m:
                last += 1
            if first >= n or last + 1 - first > 0.4 * n:
                continue
            # With it go its neighbours that would hold the line back as much.
            held_m = level[first : last + 1].max()
            without, dropped = wish.copy(), 0
            for k in range(max(0, first - reach), min(n, last + reach + 1)):
                if wish[k] <= held_m + 0.3 * width_m[k]:
                    without[k] = np.inf
                    dropped += 1
            if not np.isfinite(without).any():
                continue
            raised = gentle(without, cell_m, radius_m)
            gained_m = ((raised - level) / (2.0 * width_m)).sum() * cell_m
            again_m = COME_AGAIN_RADII * turning_m + dropped * cell_m + width_m.mean()
            if gained_m - again_m > best_m:
                best_m, best_wish, best_level = gained_m - again_m, without, raised
        if best_m == 0.0:
            break
        wish, level = best_wish, best_level
    return wish


def bend_radius_m(width_m: FloatArray, flying: Flying) -> float:
    """Return the radius in which lines bend: the outer beams of successive pings stay close together."""
    return max(float(np.median(width_m)), 2.0 * flying.radius_m)


def strips(raster: LineRaster, flying: Flying) -> tuple[BoolArray, BoolArray]:
    """Return which open cells are swept in lines, and which are left to fill: holes, and slivers of strips."""
    number, count = label(raster.open, np.ones((3, 3)))
    width_m = raster.half_width_m(flying)
    cells, thickest, least_m, most_m = _pieces(number.astype(np.int64), count, width_m)
    swept = cells > LARGE * float(raster.wanted.sum())
    thickest_m = thickest * raster.cell_m
    swept |= thickest_m > STRIP * 2.0 * most_m
    unsure = np.flatnonzero(~swept & (thickest_m > STRIP * 2.0 * least_m))
    where = find_objects(number) if len(unsure) else []
    for k in unsure:
        inside = number[where[k - 1]] == k
        swept[k] = thickest_m[k] > STRIP * 2.0 * float(np.median(width_m[where[k - 1]][inside]))
    large = np.asarray(swept[number])
    return large, np.asarray(raster.open & ~large)


@njit(cache=True, nogil=True)
def _pieces(number: IntArray, count: int, width_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return of each piece, by its number (along, across): its cells, the most of them in a column, and its widths.

    Widths are the least and the most of ``width_m`` (along, across). All have length ``count`` + 1; what is of no piece
    has number 0, and no cells.
    """
    cells, thickest, here = np.zeros(count + 1), np.zeros(count + 1), np.zeros(count + 1)
    least_m, most_m = np.full(count + 1, np.inf), np.full(count + 1, -np.inf)
    for i in range(number.shape[0]):
        for j in range(number.shape[1]):
            k = number[i, j]
            if k > 0:
                here[k] += 1.0
                least_m[k] = min(least_m[k], width_m[i, j])
                most_m[k] = max(most_m[k], width_m[i, j])
        for j in range(number.shape[1]):
            k = number[i, j]
            if here[k] > 0.0:
                cells[k] += here[k]
                thickest[k] = max(thickest[k], here[k])
                here[k] = 0.0
    most_m[0] = np.inf
    return cells, thickest, least_m, most_m


def _extent(open_cells: BoolArray, sign: int) -> tuple[IntArray, IntArray, BoolArray]:
    """Return the first and last open cell of each column as swept, and which columns have any."""
    has = np.asarray(open_cells.any(axis=1))
    low = open_cells.argmax(axis=1)
    high = open_cells.shape[1] - 1 - open_cells[:, ::-1].argmax(axis=1)
    return (low, high, has) if sign > 0 else (high, low, has)


def _sides(raster: LineRaster, rows: IntArray, side: int) -> FloatArray:
    """Return where the outer side of cells lies."""
    return np.asarray(raster.corner_m[1] + (rows + (side > 0)) * raster.cell_m)


def _reach_m(
    raster: LineRaster, columns: IntArray, rows: IntArray, edge_m: FloatArray, sign: int, flying: Flying
) -> FloatArray:
    """Return from how far a line sees the bottom at its edge, from the depth that its own bottom allows."""
    bottom_m = raster.depth_m[columns, rows]
    width_m = flying.half_width_m(bottom_m)
    for _ in range(2):
        over_m = raster.depth_m[columns, raster.rows_of(edge_m + sign * width_m)]
        travels_m = over_m - flying.altitude_m(over_m)
        width_m = flying.sonar.half_width_m(bottom_m - travels_m)
    return np.maximum(width_m, 0.5 * raster.cell_m)
