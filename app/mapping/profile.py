"""A map cut along a line: depth and deviation where the line goes, and the soundings beside it."""

from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.mapping.types import BathymetricMap, Grid


@dataclass(frozen=True)
class ProfileLine:
    """A line of straight pieces in the local frame, cut into equal steps.

    Attributes
    ----------
    corners_m
        East and north of its corners, shape (k, 2); neighbours differ.
    along_m
        How far along the line its points are, shape (n,), from 0 to its length.
    points_m
        East and north of the points, shape (n, 2).
    """

    corners_m: FloatArray
    along_m: FloatArray
    points_m: FloatArray

    @property
    def length_m(self) -> float:
        """From its first corner to its last."""
        return float(self.along_m[-1])


@dataclass(frozen=True)
class Profile:
    """What a map says along a line; NaN outside of it. All arrays have shape (n,).

    Attributes
    ----------
    depth_m, sd_m
        Depth between the four cells around each point (bilinear), and the largest standard deviation among them: their
        errors hang together, so a mean of them is no surer.
    sounded
        Whether the cell that the point lies in was sounded.
    """

    depth_m: FloatArray
    sd_m: FloatArray
    sounded: BoolArray


@dataclass(frozen=True)
class Beside:
    """Soundings near a line, in the order of the line.

    Attributes
    ----------
    along_m, across_m
        Where each lies along the line, and how far to starboard of it (to port: negative), shape (m,).
    rows
        Which of the soundings that were looked at they are, shape (m,).
    """

    along_m: FloatArray
    across_m: FloatArray
    rows: np.ndarray


def line_through(corners_m: FloatArray, spacing_m: float) -> ProfileLine:
    """Return the line through corners, shape (k, 2), with points at most ``spacing_m`` apart, its ends among them.

    Corners that repeat the one before are left out.

    Raises
    ------
    ValueError
        When fewer than two different corners are left, or ``spacing_m`` is not positive.
    """
    if not spacing_m > 0.0:
        raise ValueError(f"spacing_m is {spacing_m}; it must be positive")
    corners = np.asarray(corners_m, float)
    moved = np.concatenate([[True], np.any(np.diff(corners, axis=0) != 0.0, axis=1)])
    corners = corners[moved]
    if len(corners) < 2:
        raise ValueError("a line needs two different corners")
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    steps = max(1, int(np.ceil(at[-1] / spacing_m - 1e-9)))
    along = np.linspace(0.0, at[-1], steps + 1)
    points = np.column_stack([np.interp(along, at, corners[:, axis]) for axis in (0, 1)])
    return ProfileLine(corners, along, points)


def profile_along(bathymetry: BathymetricMap, line: ProfileLine) -> Profile:
    """Return depth and deviation of a map along a line."""
    inside, row, col = cells_of(bathymetry.grid, line.points_m)
    sounded = np.zeros(len(line.along_m), dtype=bool)
    sounded[inside] = bathymetry.sounded[row[inside], col[inside]]
    return Profile(
        _between(bathymetry.grid, bathymetry.depth_m, line.points_m),
        _largest(bathymetry.grid, bathymetry.sd_m, line.points_m),
        sounded,
    )


def layer_along(grid: Grid, values: FloatArray, line: ProfileLine) -> FloatArray:
    """Return a layer's value in the cell that each point lies in, shape (n,); NaN outside."""
    inside, row, col = cells_of(grid, line.points_m)
    found = np.full(len(line.along_m), np.nan)
    found[inside] = values[row[inside], col[inside]]
    return found


def cells_of(grid: Grid, points_m: FloatArray) -> tuple[BoolArray, np.ndarray, np.ndarray]:
    """Return which points lie on the grid, and each one's row and column."""
    col = np.floor((points_m[:, 0] - grid.west_m) / grid.cell_m).astype(int)
    row = np.floor((points_m[:, 1] - grid.south_m) / grid.cell_m).astype(int)
    return (row >= 0) & (row < grid.rows) & (col >= 0) & (col < grid.cols), row, col


def beside(line: ProfileLine, places_m: FloatArray, within_m: float) -> Beside:
    """Return which places, shape (p, 2), lie at most ``within_m`` from the line, each beside its nearest piece.

    Places beyond the line's ends are not beside it.
    """
    best = np.full(len(places_m), np.inf)
    along, across = np.zeros(len(places_m)), np.zeros(len(places_m))
    begun = 0.0
    for start, end in zip(line.corners_m[:-1], line.corners_m[1:], strict=True):
        piece = end - start
        length = float(np.hypot(*piece))
        east, north = piece / length
        offset = places_m - start
        forward = offset @ np.array([east, north])
        starboard = offset @ np.array([north, -east])
        # A place off a corner is as far from the pieces as from the corner between them.
        nearest = np.clip(forward, 0.0, length)
        distance = np.hypot(forward - nearest, starboard)
        first, last = begun == 0.0, begun + length >= line.length_m - 1e-9
        beyond = ((forward < 0.0) & first) | ((forward > length) & last)
        closer = (distance < best) & ~beyond
        best[closer] = distance[closer]
        along[closer] = begun + nearest[closer]
        across[closer] = np.where(starboard < 0.0, -distance, distance)[closer]
        begun += length
    rows = np.flatnonzero(best <= within_m)
    rows = rows[np.argsort(along[rows], kind="stable")]
    return Beside(along[rows], across[rows], rows)


def _corners_of(grid: Grid, points_m: FloatArray) -> tuple[np.ndarray, np.ndarray, FloatArray, FloatArray]:
    """Return row and column of the cell south-west of each point, and how far the point is on to the next ones."""
    x = (points_m[:, 0] - grid.west_m) / grid.cell_m - 0.5
    y = (points_m[:, 1] - grid.south_m) / grid.cell_m - 0.5
    col, row = np.floor(x).astype(int), np.floor(y).astype(int)
    return row, col, y - row, x - col


def _around(grid: Grid, values: FloatArray, points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the values of the four cells around each point and their bilinear weights, both (4, n)."""
    row, col, up, right = _corners_of(grid, points_m)
    found, weights = [], []
    for down, left in ((0, 0), (0, 1), (1, 0), (1, 1)):
        at_row, at_col = row + down, col + left
        inside = (at_row >= 0) & (at_row < grid.rows) & (at_col >= 0) & (at_col < grid.cols)
        one = np.full(len(points_m), np.nan)
        one[inside] = values[at_row[inside], at_col[inside]]
        found.append(one)
        weights.append((up if down else 1.0 - up) * (right if left else 1.0 - right))
    return np.array(found), np.array(weights)


def _own(grid: Grid, values: FloatArray, points_m: FloatArray) -> BoolArray:
    """Return which points lie in a cell that has a value."""
    inside, row, col = cells_of(grid, points_m)
    known = np.zeros(len(points_m), dtype=bool)
    known[inside] = np.isfinite(values[row[inside], col[inside]])
    return known


def _between(grid: Grid, values: FloatArray, points_m: FloatArray) -> FloatArray:
    """Return values between cells; at the edge of what is known only known cells count, and none in an unknown one."""
    found, weights = _around(grid, values, points_m)
    weights = np.where(np.isnan(found), 0.0, weights)
    total = weights.sum(axis=0)
    usable = _own(grid, values, points_m) & (total > 0.0)
    mean = np.full(len(points_m), np.nan)
    mean[usable] = (np.nan_to_num(found) * weights).sum(axis=0)[usable] / total[usable]
    return mean


def _largest(grid: Grid, values: FloatArray, points_m: FloatArray) -> FloatArray:
    """Return the largest value among the known cells that a point lies between."""
    found, weights = _around(grid, values, points_m)
    counted = np.where(np.isnan(found) | (weights <= 0.0), -np.inf, found).max(axis=0)
    return np.where(_own(grid, values, points_m) & np.isfinite(counted), counted, np.nan)
