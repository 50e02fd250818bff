"""The bottom around a section of track as other soundings tell it: kriging on a small raster."""

from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray, IntArray

PER_QUADRANT = 2
NEIGHBOURS = 4 * PER_QUADRANT
"""So many soundings, two in each quadrant, are what a cell is predicted from."""

LAGS_M = np.array([0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0])
"""Upper ends of the distances at which soundings of a section are compared."""

LEAST_EXPONENT, LARGEST_EXPONENT = 0.4, 1.8


class SoundingColumns(NamedTuple):
    """Soundings as compiled functions read them: places, depths and their standard deviations, metres, (n,) each."""

    east: FloatArray
    north: FloatArray
    depth: FloatArray
    sd: FloatArray


class RasterFrame(NamedTuple):
    """Where a raster lies: its south-western corner and the side of its cells, metres."""

    west: float
    south: float
    cell: float


class PowerLaw(NamedTuple):
    """Half the squared difference of depths (m^2) at a distance (m) is ``factor`` times distance to ``exponent``."""

    factor: float
    exponent: float


class Surface(NamedTuple):
    """The bottom as soundings tell it.

    Attributes
    ----------
    value, doubt, nearest : (rows, cols)
        Depth (m), its variance (m^2) and the distance to the nearest sounding (m); NaN where nothing is known.
    """

    value: FloatArray
    doubt: FloatArray
    nearest: FloatArray


class CellWeights(NamedTuple):
    """Which soundings each cell was predicted from, -1 for none, and their weights; (rows, cols, NEIGHBOURS) each."""

    who: IntArray
    share: FloatArray


class _Bins(NamedTuple):
    """Soundings by the cell that they lie in, of a raster widened by ``border`` cells on all sides, ``wide`` in a row.

    ``member[start[b]:start[b + 1]]`` are those of cell b.
    """

    start: IntArray
    member: IntArray
    border: int
    wide: int


@njit(cache=True, nogil=True)
def half_squares(section: IntArray, soundings: SoundingColumns, lags: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return sums of half the squared differences of depth within sections, less their noise, and counts, by lag."""
    east, north, depth, noise = soundings
    total, count = np.zeros(len(lags)), np.zeros(len(lags))
    for i in range(len(east)):
        for j in range(i + 1, min(i + 200, len(east))):
            if section[j] != section[i]:
                break
            away = np.hypot(east[i] - east[j], north[i] - north[j])
            if away > lags[-1]:
                continue
            at = np.searchsorted(lags, away)
            total[at] += 0.5 * ((depth[i] - depth[j]) ** 2 - noise[i] ** 2 - noise[j] ** 2)
            count[at] += 1.0
    return total, count


def variogram(section: IntArray, soundings: SoundingColumns) -> PowerLaw:
    """Return the power law that half the squared differences of depth follow within sections (n,)."""
    total, count = half_squares(section, soundings, LAGS_M)
    used = (count > 20) & (total > 0.0)
    if used.sum() < 3:
        return PowerLaw(1e-6, 1.0)
    gamma = total[used] / count[used]
    middle = np.concatenate([[0.25], 0.5 * (LAGS_M[1:] + LAGS_M[:-1])])[used]
    slope, level = np.polyfit(np.log(middle), np.log(gamma), 1)
    exponent = float(np.clip(slope, LEAST_EXPONENT, LARGEST_EXPONENT))
    level = float(np.mean(np.log(gamma) - exponent * np.log(middle)))
    return PowerLaw(float(np.exp(level)), exponent)


@njit(cache=True, nogil=True)
def _solve(a: FloatArray, b: FloatArray, n: int) -> bool:
    """Solve a symmetric system in place by elimination with pivots; False where it is singular."""
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[p, k]):
                p = i
        if abs(a[p, k]) < 1e-14:
            return False
        if p != k:
            for j in range(k, n):
                a[k, j], a[p, j] = a[p, j], a[k, j]
            b[k], b[p] = b[p], b[k]
        for i in range(k + 1, n):
            f = a[i, k] / a[k, k]
            if f != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= f * a[k, j]
                b[i] -= f * b[k]
    for k in range(n - 1, -1, -1):
        s = b[k]
        for j in range(k + 1, n):
            s -= a[k, j] * b[j]
        b[k] = s / a[k, k]
    return True


@njit(cache=True, nogil=True)
def _binned(soundings: SoundingColumns, raster: RasterFrame, rows: int, cols: int, reach: float) -> _Bins:
    """Sort soundings into cells, those within ``reach`` metres of a raster among them."""
    east, north = soundings.east, soundings.north
    border = int(np.ceil(reach / raster.cell))
    wide, high = cols + 2 * border, rows + 2 * border
    bins = np.full(len(east), -1, dtype=np.int64)
    start = np.zeros(wide * high + 1, dtype=np.int64)
    for i in range(len(east)):
        c = int(np.floor((east[i] - raster.west) / raster.cell)) + border
        r = int(np.floor((north[i] - raster.south) / raster.cell)) + border
        if 0 <= c < wide and 0 <= r < high:
            bins[i] = r * wide + c
            start[bins[i] + 1] += 1
    for b in range(wide * high):
        start[b + 1] += start[b]
    filled = start[:-1].copy()
    member = np.empty(start[-1], dtype=np.int64)
    for i in range(len(east)):
        if bins[i] >= 0:
            member[filled[bins[i]]] = i
            filled[bins[i]] += 1
    return _Bins(start, member, border, wide)


@njit(cache=True, nogil=True)
def _nearest_by_quadrant(
    soundings: SoundingColumns,
    raster: RasterFrame,
    bins: _Bins,
    r: int,
    c: int,
    reach: float,
    found: IntArray,
    away: FloatArray,
) -> None:
    """Write the nearest soundings of a cell in each quadrant and how far they are, (4, PER_QUADRANT); -1 and inf: none.

    Only those within ``reach`` metres count.
    """
    east, north = soundings.east, soundings.north
    e0, n0 = raster.west + (c + 0.5) * raster.cell, raster.south + (r + 0.5) * raster.cell
    away[:] = np.inf
    found[:] = -1
    for ring in range(bins.border + 1):
        # A ring holds nothing nearer than this: quadrants that are filled with nearer ones are done.
        closest = (ring - 0.5) * raster.cell
        done = True
        for q in range(4):
            if away[q, PER_QUADRANT - 1] > closest:
                done = False
        if done:
            break
        for dr in range(-ring, ring + 1):
            step = 1 if abs(dr) == ring else 2 * ring
            for dc in range(-ring, ring + 1, max(step, 1)):
                b = (r + bins.border + dr) * bins.wide + c + bins.border + dc
                for k in range(bins.start[b], bins.start[b + 1]):
                    i = bins.member[k]
                    de, dn = east[i] - e0, north[i] - n0
                    d = np.hypot(de, dn)
                    if d > reach:
                        continue
                    q = (1 if de >= 0.0 else 0) + (2 if dn >= 0.0 else 0)
                    if d < away[q, 0]:
                        away[q, 1], found[q, 1] = away[q, 0], found[q, 0]
                        away[q, 0], found[q, 0] = d, i
                    elif d < away[q, 1]:
                        away[q, 1], found[q, 1] = d, i


@njit(cache=True, nogil=True)
def _kriging_system(
    soundings: SoundingColumns, near: IntArray, e0: float, n0: float, relief: PowerLaw, a: FloatArray, x: FloatArray
) -> None:
    """Write the matrix (m + 1, m + 1) and right side (m + 1,) of ordinary kriging from soundings ``near`` (m,)."""
    east, north, sd = soundings.east, soundings.north, soundings.sd
    factor, exponent = relief
    m = len(near)
    for i in range(m):
        for j in range(i):
            h = np.hypot(east[near[i]] - east[near[j]], north[near[i]] - north[near[j]])
            a[i, j] = factor * h**exponent
            a[j, i] = a[i, j]
        a[i, i] = -(sd[near[i]] ** 2)
        a[i, m], a[m, i] = 1.0, 1.0
        x[i] = factor * np.hypot(east[near[i]] - e0, north[near[i]] - n0) ** exponent
    a[m, m] = 0.0
    x[m] = 1.0


@njit(cache=True, nogil=True)
def surface(
    soundings: SoundingColumns, raster: RasterFrame, wanted: BoolArray, relief: PowerLaw, reach: float
) -> tuple[Surface, CellWeights]:
    """Predict the depth at the centres of a raster's cells by ordinary kriging, from soundings within ``reach`` metres.

    Only cells that are ``wanted`` (rows, cols) are predicted.
    """
    rows, cols = wanted.shape
    bins = _binned(soundings, raster, rows, cols, reach)
    value = np.full((rows, cols), np.nan)
    variance = np.full((rows, cols), np.nan)
    nearest = np.full((rows, cols), np.nan)
    who = np.full((rows, cols, NEIGHBOURS), -1, dtype=np.int64)
    share = np.zeros((rows, cols, NEIGHBOURS))
    found = np.empty((4, PER_QUADRANT), dtype=np.int64)
    away = np.empty((4, PER_QUADRANT))
    a = np.empty((NEIGHBOURS + 1, NEIGHBOURS + 1))
    x = np.empty(NEIGHBOURS + 1)
    near = np.empty(NEIGHBOURS, dtype=np.int64)
    for r in range(rows):
        for c in range(cols):
            if not wanted[r, c]:
                continue
            _nearest_by_quadrant(soundings, raster, bins, r, c, reach, found, away)
            m = 0
            least = np.inf
            for q in range(4):
                for k in range(PER_QUADRANT):
                    if found[q, k] >= 0:
                        near[m] = found[q, k]
                        m += 1
                        least = min(least, away[q, k])
            if m == 0:
                continue
            e0, n0 = raster.west + (c + 0.5) * raster.cell, raster.south + (r + 0.5) * raster.cell
            _kriging_system(soundings, near[:m], e0, n0, relief, a, x)
            right = x[: m + 1].copy()
            if not _solve(a, x, m + 1):
                continue
            z, v = 0.0, 0.0
            for i in range(m):
                z += x[i] * soundings.depth[near[i]]
                v += x[i] * right[i]
                who[r, c, i], share[r, c, i] = near[i], x[i]
            value[r, c], variance[r, c], nearest[r, c] = z, max(v + x[m], 0.0), least
    return Surface(value, variance, nearest), CellWeights(who, share)


@njit(cache=True, nogil=True)
def near_track(
    east: FloatArray, north: FloatArray, raster: RasterFrame, rows: int, cols: int, aside: float
) -> BoolArray:
    """Return which cells are within some distance east and north of a sounding, (rows, cols)."""
    west, south, cell = raster
    wanted = np.zeros((rows, cols), dtype=np.bool_)
    k = int(np.ceil(aside / cell)) + 1
    # A square is widened along rows, then along columns.
    seen = np.zeros((rows, cols), dtype=np.bool_)
    for i in range(len(east)):
        c, r = int((east[i] - west) / cell), int((north[i] - south) / cell)
        if 0 <= r < rows and 0 <= c < cols:
            seen[r, c] = True
    across = np.zeros((rows, cols), dtype=np.bool_)
    for r in range(rows):
        for c in range(cols):
            if seen[r, c]:
                across[r, max(c - k, 0) : c + k + 1] = True
    for r in range(rows):
        for c in range(cols):
            if across[r, c]:
                wanted[max(r - k, 0) : r + k + 1, c] = True
    return wanted
