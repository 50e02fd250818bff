"""Where vehicles may be, on a fine raster: moves waypoints to allowed places, finds ways round what is forbidden."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, distance_transform_edt
from shapely import Polygon

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints, inside_area
from app.exploration.rollout.flight import Plan

CELLS_PER_SIDE = 160
DETOURS = 6
"""Most waypoints inserted to bring the team round what lies in the way."""

PUSH_CELLS = 2
"""Cells by which places to be moved to lie within what is allowed."""

CLOSED_UP = (1.0, 0.5, 0.2)
"""Sizes of the team, in those of the wish, that are tried where it does not fit."""


class AllowedRaster(NamedTuple):
    """Raster of allowed cells.

    Attributes
    ----------
    west_m, south_m, cell_m : float
        Outer corner of the first cell, side of a cell.
    allowed : (rows, cols)
        Cells whose surroundings are allowed too.
    nearest : (rows, cols, 2)
        Row and column of the closest cell that is well within what is allowed.
    everywhere : bool
        Whether straight legs between allowed places never leave them: a convex area without zones.
    """

    west_m: float
    south_m: float
    cell_m: float
    allowed: NDArray[np.bool_]
    nearest: NDArray[np.int64]
    everywhere: bool


def allowed_raster(constraints: Constraints) -> AllowedRaster:
    """Rasterise the area without its keep-out zones."""
    area = constraints.area
    low, high = area.min(axis=0), area.max(axis=0)
    cell = float((high - low).max()) / CELLS_PER_SIDE
    cols, rows = (max(1, int(k)) for k in np.ceil((high - low) / cell - 1e-9))
    east, north = np.meshgrid(low[0] + cell * (np.arange(cols) + 0.5), low[1] + cell * (np.arange(rows) + 0.5))
    allowed = inside_area(constraints, np.column_stack([east.ravel(), north.ravel()])).reshape(rows, cols)
    polygon = Polygon(area)
    everywhere = not constraints.keep_out and bool(np.isclose(polygon.area, polygon.convex_hull.area))
    if not everywhere:
        eroded = binary_erosion(allowed, np.ones((3, 3), dtype=bool), border_value=1)
        allowed = eroded if eroded.any() else allowed
    if not allowed.any():
        allowed = np.ones_like(allowed)
    # A vehicle that is moved is moved well clear of corners, so that the ways there and back are allowed too.
    clear = binary_erosion(allowed, np.ones((3, 3), dtype=bool), iterations=PUSH_CELLS, border_value=1)
    goal = clear if not everywhere and clear.any() else allowed
    index = distance_transform_edt(~goal, return_distances=False, return_indices=True)
    return AllowedRaster(
        float(low[0]), float(low[1]), cell, allowed, np.ascontiguousarray(np.moveaxis(index, 0, -1)).astype(np.int64),
        everywhere,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def is_allowed(free: AllowedRaster, x: float, y: float) -> bool:
    """Whether the cell around (x, y) is allowed."""
    c = int(np.floor((x - free.west_m) / free.cell_m))
    r = int(np.floor((y - free.south_m) / free.cell_m))
    return 0 <= r < free.allowed.shape[0] and 0 <= c < free.allowed.shape[1] and bool(free.allowed[r, c])


@njit(cache=True, nogil=True)
def push(free: AllowedRaster, at: FloatArray) -> None:
    """Move positions (n_vehicles, 2) that are not allowed to the closest allowed cell."""
    rows, cols = free.allowed.shape
    for i in range(len(at)):
        c = min(max(int(np.floor((at[i, 0] - free.west_m) / free.cell_m)), 0), cols - 1)
        r = min(max(int(np.floor((at[i, 1] - free.south_m) / free.cell_m)), 0), rows - 1)
        if free.allowed[r, c] and is_allowed(free, at[i, 0], at[i, 1]):
            continue
        at[i, 0] = free.west_m + (free.nearest[r, c, 1] + 0.5) * free.cell_m
        at[i, 1] = free.south_m + (free.nearest[r, c, 0] + 0.5) * free.cell_m


@njit(cache=True, nogil=True)
def pull_together(at: FloatArray, chain: NDArray[np.int64], link: float) -> bool:
    """Bring neighbours in the chain that are farther apart than ``link`` closer; False when that does not succeed."""
    n = len(chain)
    for _ in range(6):
        worst = 0.0
        for e in range(n - 1):
            i, j = chain[e], chain[e + 1]
            dx = at[j, 0] - at[i, 0]
            dy = at[j, 1] - at[i, 1]
            d = np.hypot(dx, dy)
            worst = max(worst, d)
            if d > link:
                f = 0.5 * (d - 0.999 * link) / d
                at[i, 0] += f * dx
                at[i, 1] += f * dy
                at[j, 0] -= f * dx
                at[j, 1] -= f * dy
        if worst <= link:
            return True
    return False


@njit(cache=True, nogil=True)
def settle_waypoint(free: AllowedRaster, at: FloatArray, chain: NDArray[np.int64], link: float) -> bool:
    """Make a team waypoint (n_vehicles, 2) obey area, zones and links; False when that does not succeed.

    Where the team does not fit as it is (zones may drive it apart) it is tried closed up.
    """
    n = len(at)
    wish = at.copy()
    x = 0.0
    y = 0.0
    for i in range(n):
        x += at[i, 0] / n
        y += at[i, 1] / n
    for scale in CLOSED_UP:
        for i in range(n):
            at[i, 0] = x + scale * (wish[i, 0] - x)
            at[i, 1] = y + scale * (wish[i, 1] - y)
        for _ in range(3):
            push(free, at)
            if pull_together(at, chain, link):
                ok = True
                for i in range(n):
                    ok = ok and is_allowed(free, at[i, 0], at[i, 1])
                if ok:
                    return True
    return False


@njit(cache=True, nogil=True)
def _worst_place(free: AllowedRaster, a: FloatArray, b: FloatArray) -> float:
    """Return where on the way from a to b (n_vehicles, 2) a vehicle gets deepest into what is forbidden.

    As a fraction of the way; -1 when the whole way is allowed. Until a vehicle first comes to an allowed place it is
    on its way out, and that is no offence.
    """
    rows, cols = free.allowed.shape
    deepest = 0
    place = -1.0
    for i in range(len(a)):
        pieces = max(1, int(np.ceil(2.0 * np.hypot(b[i, 0] - a[i, 0], b[i, 1] - a[i, 1]) / free.cell_m)))
        been = False
        for k in range(pieces + 1):
            f = k / pieces
            x = a[i, 0] + f * (b[i, 0] - a[i, 0])
            y = a[i, 1] + f * (b[i, 1] - a[i, 1])
            if is_allowed(free, x, y):
                been = True
                continue
            if not been and k < pieces:
                continue
            c = min(max(int(np.floor((x - free.west_m) / free.cell_m)), 0), cols - 1)
            r = min(max(int(np.floor((y - free.south_m) / free.cell_m)), 0), rows - 1)
            d2 = 1 + (free.nearest[r, c, 0] - r) ** 2 + (free.nearest[r, c, 1] - c) ** 2
            if d2 > deepest:
                deepest = d2
                place = f
    return place


@njit(cache=True, nogil=True)
def insert(plan: Plan, count: int, k: int) -> None:
    """Make room for a waypoint at ``k``; the caller fills it."""
    for i in range(count, k, -1):
        plan.at_m[i] = plan.at_m[i - 1]
        plan.height_m[i] = plan.height_m[i - 1]
        plan.sinking[i] = plan.sinking[i - 1]


@njit(cache=True, nogil=True)
def clear_ways(
    free: AllowedRaster, plan: Plan, count: int, start: FloatArray, first: int, last: int, link: float
) -> int:
    """Make the legs that lead to the waypoints ``first`` .. ``last`` allowed, inserting detours where needed.

    Returns the new number of waypoints; -1 when some leg stays forbidden.
    """
    if free.everywhere:
        return count
    room = len(plan.height_m)
    k = max(0, first)
    inserted = 0
    while k <= min(last, count - 1):
        before = start if k == 0 else plan.at_m[k - 1]
        place = _worst_place(free, before, plan.at_m[k])
        if place < 0.0:
            k += 1
            continue
        if inserted >= DETOURS or count >= room:
            return -1
        round_it = before + place * (plan.at_m[k] - before)
        if not settle_waypoint(free, round_it, plan.chain, link):
            return -1
        insert(plan, count, k)
        plan.at_m[k] = round_it
        plan.sinking[k] = min(plan.sinking[k], 1.0) if plan.sinking[k] < 1.5 else 0.0
        count += 1
        last += 1
        inserted += 1
    return count
