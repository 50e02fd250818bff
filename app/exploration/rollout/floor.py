"""The sea floor that a rollout flies over: estimated from the landmarks seen so far, on a small raster."""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.problem import Belief

CELLS_PER_VISIBILITY = 8.0
MAX_CELLS_PER_SIDE = 96
NEIGHBOURS = 6
FADE = 2.5
"""Distance, in visibilities, over which what the seen landmarks say fades to their mean."""

ENVELOPE_SLOPE = 1.2
"""Steepest climb that plans rely on: rise over run."""


STEEPEST_DIVE = 6.0
"""The same for vehicles that go straight down and up again beside bottom that was felt."""

MARGIN = 0.1
"""Clearance that plans add to the required one, in visibilities, because the floor is an estimate."""

MARGIN_OF_ROOM = 0.25
"""The same as a part of what visibility leaves above the required clearance, where that is less."""

UNEVEN = 3.0
"""How much shoaler than estimated the floor may be between landmarks: deviations of depths nearby from a plane."""

ROUGHLY = 0.1
"""Deviation, in visibilities, up to which the depth of a landmark counts as estimated."""

LEVEL = 1e-6
"""What draws the plane through landmarks nearby towards level, so that three in a row have one."""

HELD_NEAR = 0.3
"""How far the height that a vehicle holds by its altimeter says something of the floor, in visibilities."""


class HeldTo(NamedTuple):
    """How deep the constraints let vehicles be: the same all over a cell. Row 0 is south, column 0 is west.

    Attributes
    ----------
    west_m, south_m, cell_m : float
        Outer corner of the first cell, side of a cell.
    deepest_m : (rows, cols)
        Deepest that a vehicle may be; inf where the sea floor is unknown.
    felt_m : (k, 3)
        East, north and deepest that a vehicle may be where altimeters felt the sea floor.
    """

    west_m: float
    south_m: float
    cell_m: float
    deepest_m: FloatArray
    felt_m: FloatArray


class FloorEstimate(NamedTuple):
    """Rasters over the area; the first row is the southernmost, the first column the westernmost.

    Attributes
    ----------
    west_m, south_m, cell_m : float
        Centre of the first cell, and the distance between cells.
    depth_m : (rows, cols)
        Estimated depth.
    smooth_m : (rows, cols)
        The same without detail: what a team keeps its height above.
    deepest_m : (rows, cols)
        Deepest that a vehicle may be, so that it clears the floor here and can climb every rise ahead.
    shoal_m : (rows, cols)
        As deep as altimeters let vehicles be where the floor is as shoal between landmarks as it may be.
    held_to : HeldTo
        Deepest that a vehicle may be that goes straight down and up again, by the constraints' own cells: rasters that
        are interpolated smooth the steps between these.
    """

    west_m: float
    south_m: float
    cell_m: float
    depth_m: FloatArray
    smooth_m: FloatArray
    deepest_m: FloatArray
    shoal_m: FloatArray
    held_to: HeldTo


def held_to(bottom: Bottom, felt_m: FloatArray, clearance_m: float) -> HeldTo:
    """Return how deep vehicles may be over a sea floor that altimeters have felt at some points (k, 3)."""
    deepest = np.where(np.isnan(bottom.depth_m), np.inf, bottom.depth_m - clearance_m)
    felt = np.ascontiguousarray(felt_m - [0.0, 0.0, clearance_m])
    return HeldTo(float(bottom.west_m), float(bottom.south_m), float(bottom.cell_m), deepest, felt)


def margin_m(visibility_m: float, clearance_m: float) -> float:
    """Return the clearance that plans add to the required one."""
    return max(0.0, min(MARGIN * visibility_m, MARGIN_OF_ROOM * (visibility_m - clearance_m)))


def estimate_floor(
    belief: Belief,
    bottom: Bottom,
    felt_m: FloatArray,
    area: FloatArray,
    visibility_m: float,
    clearance_m: float,
    unknown_m: float,
    held_m: float = 0.0,
    deeper_m: FloatArray | None = None,
    *,
    follows: bool = False,
) -> FloorEstimate:
    """Estimate the floor from a belief.

    Parameters
    ----------
    bottom : Bottom
        What the constraints hold for the sea floor; vehicles must clear it as well.
    felt_m : (k, 3)
        Points of the bottom that altimeters have felt, where landmarks did not show it.
    area : (n, 2)
        Polygon whose bounding box the raster covers.
    visibility_m : float
        Sets the raster's cell and how far estimates reach.
    clearance_m : float
        Least distance of vehicles above the floor.
    unknown_m : float
        Depth to presume while nothing was seen.
    held_m : float
        Height above the floor below which vehicles never are, whatever the command.
    deeper_m : (k, 3) or None
        Landmarks that must lie deeper than their surroundings, for they were not seen from close by, with the least
        depth that they can have.
    follows : bool
        Whether plans follow the floor closely: estimates need no margin for detail where altimeters hold the clearance.
    """
    deeper = np.zeros((0, 3)) if deeper_m is None else deeper_m
    low, high = area.min(axis=0), area.max(axis=0)
    cell = max(visibility_m / CELLS_PER_VISIBILITY, float((high - low).max()) / MAX_CELLS_PER_SIDE)
    cols, rows = (max(2, int(k)) for k in np.ceil((high - low) / cell) + 1)
    east, north = np.meshgrid(low[0] + cell * np.arange(cols), low[1] + cell * np.arange(rows))
    known = np.isfinite(belief.depth_m)
    trust = belief.sd_m
    if belief.covariance_m2 is not None:
        # Where the estimate says less than that, others have filled the depth in.
        trust = np.minimum(np.sqrt(belief.covariance_m2[:, 2, 2]), ROUGHLY * visibility_m)
    if known.any():
        sure = np.vstack([felt_m, belief.sounded_m])
        depth, spread = _from_neighbours(
            np.vstack([belief.xy_m[known], sure[:, :2], deeper[:, :2]]),
            np.concatenate([belief.depth_m[known], sure[:, 2], deeper[:, 2]]),
            np.concatenate([trust[known], np.zeros(len(sure)), np.full(len(deeper), ROUGHLY * visibility_m)]),
            np.column_stack([east.ravel(), north.ravel()]),
            visibility_m,
        )
    else:
        depth, spread = np.full(rows * cols, unknown_m), np.zeros(rows * cols)
    depth, spread = depth.reshape(rows, cols), spread.reshape(rows, cols)
    here = bottom.at(np.stack([east, north], axis=-1))
    limit = depth - clearance_m - margin_m(visibility_m, clearance_m)
    if follows:
        smooth, slope = depth.copy(), STEEPEST_DIVE
        limit = np.fmin(limit, here - clearance_m)
    else:
        smooth, slope = gaussian_filter(depth, 0.12 * visibility_m / cell, mode="nearest"), ENVELOPE_SLOPE
        # The constraints' sea floor has steps between cells: whatever lies within a cell of a node counts there.
        looks = int(np.ceil(2.0 * cell / bottom.cell_m)) + 1  # no cell of the constraints' sea floor is skipped
        shifts = np.stack(np.meshgrid(*[np.linspace(-cell, cell, looks)] * 2), axis=-1).reshape(-1, 1, 1, 2)
        around = bottom.at(np.stack([east, north], axis=-1) + shifts)
        limit = np.minimum(limit, np.where(np.isnan(around), np.inf, around).min(axis=0) - clearance_m)
        _keep_above(limit, east, north, felt_m, clearance_m + margin_m(visibility_m, clearance_m), slope)
    return FloorEstimate(
        float(low[0]), float(low[1]), float(cell), depth, smooth,
        np.minimum(_envelope(limit, cell, slope), depth - held_m),
        np.minimum(depth - UNEVEN * spread - clearance_m, depth - held_m),
        held_to(bottom, felt_m, max(clearance_m, held_m)),
    )  # fmt: skip


def _from_neighbours(
    seen_m: FloatArray, depth_m: FloatArray, sd_m: FloatArray, at_m: FloatArray, visibility_m: float
) -> tuple[FloatArray, FloatArray]:
    """Weigh the closest seen landmarks by distance and trust; return their mean and how uneven they lie.

    That is the deviation from the plane that fits them best: slopes are not uneven. Far from all of them the mean is
    that of all, and even.
    """
    k = min(NEIGHBOURS, len(seen_m))
    found = cKDTree(seen_m).query(at_m, k=k)
    distance, index = (np.asarray(part).reshape(len(at_m), k) for part in found)
    weight = 1.0 / ((distance / visibility_m) ** 2 + 0.01) / (sd_m[index] ** 2 + (0.05 * visibility_m) ** 2)
    local = (weight * depth_m[index]).sum(axis=1) / weight.sum(axis=1)
    trust = np.exp(-np.maximum(0.0, distance[:, 0] / visibility_m - 0.25) / FADE)
    offset = np.concatenate([np.ones((*index.shape, 1)), (seen_m[index] - at_m[:, None]) / visibility_m], axis=2)
    share = weight / weight.sum(axis=1, keepdims=True)
    normal = np.einsum("nki,nk,nkj->nij", offset, share, offset) + LEVEL * np.eye(3)
    plane = np.linalg.solve(normal, np.einsum("nki,nk,nk->ni", offset, share, depth_m[index])[..., None])
    off = depth_m[index] - (offset @ plane)[..., 0]
    spread = np.sqrt((share * off**2).sum(axis=1))
    return np.asarray(trust * local + (1.0 - trust) * depth_m.mean()), np.asarray(trust * spread)


@njit(cache=True, nogil=True)
def let_stay(floor: FloorEstimate, positions: FloatArray, height_m: float, reach_m: float) -> None:
    """Lower the estimate in place where vehicles at ``positions`` (n, 3) are closer to it than their altimeters allow.

    A vehicle that holds its height above the sea floor need not climb because an estimate says that it is too low.
    """
    rows, cols = floor.depth_m.shape
    for k in range(len(positions)):
        x, y, z = positions[k, 0], positions[k, 1], positions[k, 2]
        smooth = z - sample(floor.smooth_m, floor.west_m, floor.south_m, floor.cell_m, x, y) + height_m
        deepest = z - sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, x, y)
        for r in range(rows):
            for c in range(cols):
                away = np.hypot(floor.west_m + c * floor.cell_m - x, floor.south_m + r * floor.cell_m - y) / reach_m
                fading = np.exp(-away * away)
                floor.smooth_m[r, c] += max(0.0, smooth) * fading
                floor.deepest_m[r, c] += max(0.0, deepest) * fading


@njit(cache=True, nogil=True)
def hold_to(floor: FloorEstimate, sounded_m: FloatArray, reach_m: float) -> None:
    """Shift the estimate in place so that it is right where altimeters have just found the floor, (n, 3)."""
    rows, cols = floor.depth_m.shape
    for k in range(len(sounded_m)):
        x, y = sounded_m[k, 0], sounded_m[k, 1]
        off = sounded_m[k, 2] - sample(floor.depth_m, floor.west_m, floor.south_m, floor.cell_m, x, y)
        for r in range(rows):
            for c in range(cols):
                away = np.hypot(floor.west_m + c * floor.cell_m - x, floor.south_m + r * floor.cell_m - y) / reach_m
                fading = np.exp(-away * away)
                floor.depth_m[r, c] += off * fading
                floor.smooth_m[r, c] += off * fading
                floor.deepest_m[r, c] += off * fading


@njit(cache=True, nogil=True)
def _keep_above(
    limit: FloatArray, east: FloatArray, north: FloatArray, felt_m: FloatArray, above_m: float, slope: float
) -> None:
    """Lower ``limit`` (rows, cols) in place so that vehicles clear the felt points (k, 3) and can climb to them."""
    rows, cols = limit.shape
    for k in range(len(felt_m)):
        for r in range(rows):
            for c in range(cols):
                away = np.hypot(east[r, c] - felt_m[k, 0], north[r, c] - felt_m[k, 1])
                limit[r, c] = min(limit[r, c], felt_m[k, 2] - above_m + slope * away)


@njit(cache=True, nogil=True, inline="always")
def sample(raster: FloatArray, west: float, south: float, cell: float, x: float, y: float) -> float:
    """Interpolate a raster bilinearly at (x, y); beyond its border the border's value counts."""
    rows, cols = raster.shape
    u = min(max((x - west) / cell, 0.0), cols - 1.000001)
    v = min(max((y - south) / cell, 0.0), rows - 1.000001)
    c = int(u)
    r = int(v)
    u -= c
    v -= r
    lower = raster[r, c] * (1.0 - u) + raster[r, c + 1] * u
    upper = raster[r + 1, c] * (1.0 - u) + raster[r + 1, c + 1] * u
    return float(lower * (1.0 - v) + upper * v)


@njit(cache=True, nogil=True)
def deepest_dive_m(floor: FloorEstimate, x: float, y: float) -> float:
    """Return how deep a vehicle may be at (x, y) that goes straight down and up again."""
    held = floor.held_to
    col = int(np.floor((x - held.west_m) / held.cell_m))
    row = int(np.floor((y - held.south_m) / held.cell_m))
    deepest = np.inf
    if 0 <= row < held.deepest_m.shape[0] and 0 <= col < held.deepest_m.shape[1]:
        deepest = held.deepest_m[row, col]
    if deepest == np.inf:
        deepest = sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, x, y)
    for k in range(len(held.felt_m)):
        away = np.hypot(x - held.felt_m[k, 0], y - held.felt_m[k, 1])
        deepest = min(deepest, held.felt_m[k, 2] + STEEPEST_DIVE * away)
    return float(deepest)


@njit(cache=True, nogil=True)
def fill_depths(xyz: FloatArray, floor: FloorEstimate) -> None:
    """Give points (n, 3) whose depth is not known (NaN) the floor's."""
    for k in range(len(xyz)):
        if np.isnan(xyz[k, 2]):
            xyz[k, 2] = sample(floor.depth_m, floor.west_m, floor.south_m, floor.cell_m, xyz[k, 0], xyz[k, 1])


@njit(cache=True, nogil=True)
def _envelope(limit: FloatArray, cell: float, slope: float) -> FloatArray:
    """Return min over p' of limit(p') + slope |p - p'|, by sweeps there and back over the raster."""
    rows, cols = limit.shape
    out = limit.copy()
    near = slope * cell
    far = slope * cell * np.sqrt(2.0)
    for _ in range(2):
        for r in range(rows):
            for c in range(cols):
                best = out[r, c]
                if c > 0:
                    best = min(best, out[r, c - 1] + near)
                if r > 0:
                    best = min(best, out[r - 1, c] + near)
                    if c > 0:
                        best = min(best, out[r - 1, c - 1] + far)
                    if c < cols - 1:
                        best = min(best, out[r - 1, c + 1] + far)
                out[r, c] = best
        for r in range(rows - 1, -1, -1):
            for c in range(cols - 1, -1, -1):
                best = out[r, c]
                if c < cols - 1:
                    best = min(best, out[r, c + 1] + near)
                if r < rows - 1:
                    best = min(best, out[r + 1, c] + near)
                    if c > 0:
                        best = min(best, out[r + 1, c - 1] + far)
                    if c < cols - 1:
                        best = min(best, out[r + 1, c + 1] + far)
                out[r, c] = best
    return out
