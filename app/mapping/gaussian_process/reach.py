"""How far from its soundings a map may be believed: what the soundings themselves allow to be checked.

A process that was learned on a short or straight track is sure of ground that nobody has seen: the track tells neither
how far the sea floor goes on like that nor how it lies across. So claims about the map rest on checks. Soundings are
predicted as if those around them were missing, over longer and longer distances; as far as there are enough separate
places to do that, in several directions, the map's deviations are believed, times a factor that the checks leave
possible. Beyond that the sea floor may slope away.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.gaussian_process.calibration import HeldOutSoundings
from app.mapping.kriging.levels import TwoLevels
from app.mapping.kriging.neighbours import nearest

RADIUS_STEP, FACTOR_STEP = 1.5, 2.25
"""Each distance that is looked at over the one before: for whether predictions can be checked, and to check them."""

LEAST_PLACES = 20
"""Separate places at which a distance must be checked, to count as checked."""

LEAST_SHARE = 0.5
"""Part of the surveyed places at which it must be so: a survey of long lines also turns here and there."""

DIRECTIONS, LEAST_DIRECTIONS = 4, 3
"""Of so many directions (to both sides each), in so many there must be soundings at that distance."""

RING = 3.0
"""At that distance: between it and this many times as much."""

RING_POINTS = 128  # squares of half the distance that a ring has, and some more
TESTS = 250
AXIS_NEIGHBOURS = 10
STRIP_NEIGHBOURS, STRIP_CANDIDATES, LEAST_IN_STRIP = 24, 200, 6
LEAST_GROUPS = 4

CONFIDENCE = 2.0
"""Standard errors by which the checks' mean square is raised: what it may be without surprise."""

UNCHECKED_FACTOR = 2.0
"""The factor where nothing could be checked."""

LARGEST_FACTOR = 5.0

SLOPE = 0.1
"""How steep unseen sea floor is taken to be (root mean square, m/m), unless that along the survey lines is steeper: a
line that follows a slope does not show it."""

RELIEF = 0.5
"""Standard deviation of unseen depths as a share of the mean depth."""

LEAST_CELLS = 1.0
"""So many cells from a sounding are supported in any case."""

MOST_SQUARES_EACH = 16
"""Up to so many squares for each point are kept in a table; more are found by sorting."""

ROUNDING = 1e-9
"""Of a square's side: a point at its edge lies in the same square wherever the origin is."""


@dataclass(frozen=True)
class Reach:
    """What is believed at a distance from the soundings.

    Attributes
    ----------
    checked_m
        The longest distance over which predictions could be checked at enough places and in enough directions.
    factor
        On the deviation: what the checks leave possible.
    slope, relief_m
        Beyond ``checked_m`` the depth is uncertain by at least ``slope`` times the rest of the way, up to ``relief_m``.
    shallowest_m, deepest_m
        What was sounded, single soundings of a square merged.
    """

    checked_m: float
    factor: float
    slope: float
    relief_m: float
    shallowest_m: float
    deepest_m: float

    def deviation(self, sd_m: FloatArray, distance_m: FloatArray) -> FloatArray:
        """Return the deviation at a distance from the soundings where the process says ``sd_m``."""
        return np.maximum(sd_m, self._unseen_m(distance_m))

    def bound(self, sd_m: FloatArray, distance_m: FloatArray, cell_m: float) -> FloatArray:
        """Return what the deviation hardly exceeds; infinite where no sounding supports it."""
        supported = self._supported(distance_m, cell_m)
        likely = np.maximum(sd_m * self.factor, self._unseen_m(distance_m))
        return np.where(np.isnan(sd_m) | supported, likely, np.inf)

    def plausible(self, depth_m: FloatArray, distance_m: FloatArray, cell_m: float) -> tuple[FloatArray, FloatArray]:
        """Return depths that soundings allow to be told, and what that adds to their deviation, metres.

        A process goes on with every trend, up through the water line and down without end. Where no sounding supports
        a cell its depth stays between the shallowest and the deepest one sounded, and nowhere is it above the map's
        datum where no sounding was. As far as a depth was moved it is less certain, up to the relief of unseen ground.
        """
        bounded = np.maximum(depth_m, min(self.shallowest_m, 0.0))
        within = np.clip(depth_m, self.shallowest_m, self.deepest_m)
        bounded = np.where(self._supported(distance_m, cell_m), bounded, within)
        return bounded, np.minimum(np.abs(bounded - depth_m), self.relief_m)

    def _supported(self, distance_m: FloatArray, cell_m: float) -> BoolArray:
        return np.asarray(distance_m <= max(self.checked_m, LEAST_CELLS * cell_m))

    def _unseen_m(self, distance_m: FloatArray) -> FloatArray:
        return np.minimum(self.slope * np.maximum(distance_m - self.checked_m, 0.0), self.relief_m)


def reach(levels: TwoLevels, unit_m: float, factor: float) -> Reach:
    """Return how far the soundings can be believed.

    Parameters
    ----------
    unit_m
        Side of the squares of single soundings.
    factor
        On the deviation, from checks of the process, see :func:`likely_factor`.
    """
    fine = levels.fine
    slope, relief = _steepness(levels), RELIEF * abs(float(fine.depth_m.mean()))
    relief = max(relief, float(fine.depth_m.std()))
    shallowest, deepest = float(fine.depth_m.min()), float(fine.depth_m.max())
    return Reach(_checked_m(levels, unit_m), factor, slope, relief, shallowest, deepest)


def radii(levels: TwoLevels, unit_m: float, step: float = RADIUS_STEP) -> list[float]:
    """Return the distances to check, from the squares of single soundings to half the extent of all."""
    tree = levels.fine_tree
    extent = float((tree.maxes - tree.mins).max())
    found, radius = [], unit_m
    while radius < extent / 2.0:
        found.append(radius)
        radius *= step
    return found


def _checked_m(levels: TwoLevels, unit_m: float) -> float:
    points = levels.points[: levels.n_fine]
    return next((r for r in reversed(radii(levels, unit_m)) if _checkable(points, r)), 0.0)


def _checkable(points: FloatArray, radius_m: float) -> bool:
    """Whether predictions over ``radius_m`` can be checked at enough places, in enough directions each."""
    thinned = points[_first_of_each(_squares(points, 0.5 * radius_m))]
    places = _spread(thinned, TESTS)
    distance, index = nearest(cKDTree(thinned), places, RING_POINTS)
    offset = thinned[index] - places[:, None]
    ring = (distance >= radius_m) & (distance <= RING * radius_m)
    direction = (
        np.floor(np.arctan2(offset[..., 1], offset[..., 0]) / (np.pi / DIRECTIONS)).astype(np.int64) % DIRECTIONS
    )
    seen = np.array([(ring & (direction == k)).any(axis=1) for k in range(DIRECTIONS)]).sum(axis=0)
    around = _count(places[seen >= LEAST_DIRECTIONS], 2.0 * radius_m)
    return around >= max(LEAST_PLACES, LEAST_SHARE * _count(places, 2.0 * radius_m))


def _spread(points: FloatArray, count: int) -> FloatArray:
    rows = np.unique(np.linspace(0, len(points) - 1, min(len(points), count)).astype(np.int64))
    return points[rows]


def _count(points: FloatArray, side_m: float) -> int:
    return len(np.unique(_squares(points, side_m), axis=0)) if len(points) else 0


def _squares(points: FloatArray, side_m: float) -> IntArray:
    """Return the squares that points lie in, (n, 2), counted from their own corner: the origin does not matter."""
    return np.asarray(np.floor((points - points.min(axis=0)) / side_m + ROUNDING), dtype=np.int64)


def _first_of_each(squares: IntArray) -> IntArray:
    """Return the first point of each square that holds one, ascending; ``squares`` is (n, 2)."""
    columns = int(squares[:, 0].max()) + 1
    number = squares[:, 1] * columns + squares[:, 0]
    total = (int(squares[:, 1].max()) + 1) * columns
    if total > MOST_SQUARES_EACH * max(len(number), 1):
        return np.sort(np.unique(number, return_index=True)[1])
    first = np.full(total, -1, np.int64)
    # Backwards: the first one is written last.
    first[number[::-1]] = np.arange(len(number))[::-1]
    return np.sort(first[first >= 0])


def _steepness(levels: TwoLevels) -> float:
    """Return how steep unseen sea floor is taken to be, m/m."""
    merged = levels.soundings.take(np.arange(levels.n_fine, len(levels.soundings)))
    if len(merged) < LEAST_PLACES:
        return SLOPE
    distance, index = nearest(levels.coarse_tree, np.asarray(levels.coarse_tree.data), 2)
    other, away = index[:, 1], np.maximum(distance[:, 1], 1e-6)
    rise = (merged.depth_m - merged.depth_m[other]) ** 2 - merged.sd_m**2 - merged.sd_m[other] ** 2
    return max(SLOPE, float(np.sqrt(np.mean(np.maximum(rise, 0.0) / away**2))))


def strip_neighbours(levels: TwoLevels, rows: IntArray, half_width_m: float) -> IntArray:
    """Choose neighbours of the fine soundings ``rows`` as if their own survey line had not been flown.

    Left out is what lies within ``half_width_m`` of the straight line along which their nearest soundings lie. Returns
    rows of merged soundings, (h, k), -1 for none.
    """
    points = levels.points[: levels.n_fine]
    at = points[rows]
    _, close = nearest(levels.fine_tree, at, AXIS_NEIGHBOURS)
    away = points[close] - points[close].mean(axis=1, keepdims=True)
    xx, yy, xy = ((away[..., i] * away[..., j]).sum(axis=1) for i, j in ((0, 0), (1, 1), (0, 1)))
    course = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    across = np.column_stack([-np.sin(course), np.cos(course)])
    _, near = nearest(levels.coarse_tree, at, STRIP_CANDIDATES)
    offset = np.asarray(levels.coarse_tree.data)[near] - at[:, None]
    outside = np.abs((offset * across[:, None]).sum(axis=-1)) >= half_width_m
    rank = np.cumsum(outside, axis=1)
    row, col = np.nonzero(outside & (rank <= STRIP_NEIGHBOURS))
    found = np.full((len(rows), STRIP_NEIGHBOURS), -1, np.int64)
    found[row, rank[row, col] - 1] = levels.n_fine + near[row, col]
    return found


def likely_square(held_out: HeldOutSoundings, factor: FloatArray, log_scale: float, side_m: float) -> float | None:
    """Return how large the mean square of errors over their deviations may be; None where too few soundings tell.

    Parameters
    ----------
    factor : (h,)
        Factor on the variance that the calibration gives these places.
    log_scale
        Of the calibration.
    side_m
        Errors in one square of this side count as one.
    """
    if len(held_out.error_m) == 0:
        return None
    variance = held_out.own_variance + held_out.map_variance * factor * np.exp(2.0 * log_scale)
    score = held_out.error_m**2 / variance
    _, group = np.unique(_squares(held_out.points_m, side_m), axis=0, return_inverse=True)
    mean = np.bincount(group.ravel(), score) / np.bincount(group.ravel())
    if len(mean) < LEAST_GROUPS:
        return None
    middle = float(mean.mean())
    error = max(float(mean.std(ddof=1)), np.sqrt(2.0) * middle) / np.sqrt(len(mean))
    return float(middle + CONFIDENCE * error)


def likely_factor(squares: list[float]) -> float:
    """Return the factor on deviations from the checks over all distances: their mean, since each alone is uncertain."""
    if not squares:
        return UNCHECKED_FACTOR
    return float(np.clip(np.sqrt(np.mean(squares)), 1.0, LARGEST_FACTOR))
