"""Landmarks with fixed (x, y): the posterior of their depth, and the sets A, B, V, B_hat (AURO15 sec. 3.4)."""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from app.arrays import BoolArray, FloatArray, IntArray
from app.estimation.depth_posterior import CELLS, estimate, from_neighbours, lay_out, take_range
from app.estimation.sensors import RangeSensor, Ranging

NEIGHBOURS = 8
"""Landmarks round about that tell of a landmark's depth, the closest ones."""

SURE = 3.0
"""Deviations, in those that are asked for, below which a landmark is known well enough to tell of its neighbours."""


@dataclass(frozen=True)
class DepthGrids:
    """What the ranges say of each landmark's depth, on grids of its own; see :mod:`app.estimation.depth_posterior`.

    Attributes
    ----------
    lowest_m, spacing_m : (n,)
        First depth of each grid and the spacing; a spacing of 0 where the landmark was never seen.
    fit : (n, CELLS)
        Logarithm of the likelihood, 0 at the best depth.
    steepness : (n, CELLS)
        Slope by which the floor must rise from where a vehicle was to reach that depth.
    own_depth_m, own_variance_m2 : (n,)
        Depth and variance by the landmark's own ranges alone.
    neighbours, apart_m : (n, NEIGHBOURS)
        The landmarks round about and their distances; infinite where there are fewer.
    """

    lowest_m: FloatArray
    spacing_m: FloatArray
    fit: NDArray[np.float32]
    steepness: NDArray[np.float32]
    own_depth_m: FloatArray
    own_variance_m2: FloatArray
    neighbours: IntArray
    apart_m: FloatArray

    @classmethod
    def unknown(cls, xy_m: FloatArray) -> "DepthGrids":
        """Return grids of landmarks at ``xy_m`` (n, 2) that are still unseen."""
        n = len(xy_m)
        blank = np.zeros((n, CELLS), dtype=np.float32)
        apart, neighbours = np.full((n, NEIGHBOURS), np.inf), np.zeros((n, NEIGHBOURS), dtype=np.int64)
        count = min(NEIGHBOURS, n - 1)
        if count > 0:
            # Of landmarks at one place, any may come first: the row's own number is left out, not the first column.
            distance, index = (np.asarray(found) for found in cKDTree(xy_m).query(xy_m, k=count + 1))
            others = index != np.arange(n)[:, None]
            others[others.all(axis=1), -1] = False
            apart[:, :count] = distance[others].reshape(n, count)
            neighbours[:, :count] = index[others].reshape(n, count)
        return cls(np.zeros(n), np.zeros(n), blank, blank.copy(), np.zeros(n), np.zeros(n), neighbours, apart)

    def copy(self) -> "DepthGrids":
        """Return grids that can be changed; neighbours stay what they are."""
        return DepthGrids(
            self.lowest_m.copy(), self.spacing_m.copy(), self.fit.copy(), self.steepness.copy(),
            self.own_depth_m.copy(), self.own_variance_m2.copy(), self.neighbours, self.apart_m,
        )  # fmt: skip

    def take(
        self, xy_m: FloatArray, position: FloatArray, index: IntArray, ranges: FloatArray, sensor: Ranging
    ) -> None:
        """Take in, in place, ranges (k,) from ``position`` (3,) to the landmarks ``index`` (k,)."""
        _take(
            self.lowest_m, self.spacing_m, self.fit, self.steepness, index,
            ((xy_m[index] - position[:2]) ** 2).sum(axis=1), float(position[2]), ranges, sensor.relative_noise,
            not isinstance(sensor, RangeSensor),
        )  # fmt: skip

    def beside(self, index: IntArray, wanted: BoolArray) -> IntArray:
        """Return which of the ``wanted`` landmarks (n,) have neighbours among ``index`` (k,) but are not among them."""
        looked_at = np.zeros(len(wanted), dtype=np.bool_)
        looked_at[index] = True
        candidates = np.flatnonzero(wanted & ~looked_at)
        near = looked_at[self.neighbours[candidates]] & np.isfinite(self.apart_m[candidates])
        return candidates[near.any(axis=1)]

    def estimates(self, index: IntArray, known: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Return depths and variances (k,) of the landmarks ``index`` (k,) beside neighbours that are ``known`` (n,).

        What these are by their own ranges alone is noted in place, after all neighbours were asked.
        """
        around = known[self.neighbours[index]] & np.isfinite(self.apart_m[index])
        depth, variance, own_depth, own_variance = _estimates(
            self.lowest_m, self.spacing_m, self.fit, self.steepness, index, self.neighbours, self.apart_m,
            self.own_depth_m, self.own_variance_m2, around,
        )  # fmt: skip
        self.own_depth_m[index], self.own_variance_m2[index] = own_depth, own_variance
        return depth, variance


@dataclass(frozen=True)
class Landmarks:
    """What is known of the landmarks; every update returns a new object.

    Attributes
    ----------
    xy_m : (n, 2)
        Fixed positions.
    depth_m : (n,)
        Estimates, the likeliest where several are possible; NaN where never seen.
    variance_m2 : (n,)
        The confidence ``c_L``: posterior variance of the depth, other possibilities included; inf where never seen.
    looks : (n,)
        How often each landmark was measured.
    accurate : (n,)
        The set ``A``; only grows.
    credited : (n,)
        Number of the vehicle that brought the landmark into ``A`` (``A_j``); -1 where none did.
    grids : DepthGrids
        The posteriors that depths and variances are taken from.
    """

    xy_m: FloatArray
    depth_m: FloatArray
    variance_m2: FloatArray
    looks: IntArray
    accurate: BoolArray
    credited: IntArray
    grids: DepthGrids

    @classmethod
    def unknown(cls, xy_m: FloatArray) -> "Landmarks":
        """Return landmarks at ``xy_m`` (n, 2) that are still unseen."""
        n = len(xy_m)
        return cls(
            np.ascontiguousarray(xy_m, dtype=np.float64),
            np.full(n, np.nan),
            np.full(n, np.inf),
            np.zeros(n, dtype=np.int64),
            np.zeros(n, dtype=np.bool_),
            np.full(n, -1, dtype=np.int64),
            DepthGrids.unknown(xy_m),
        )

    @property
    def seen(self) -> BoolArray:
        """Which landmarks were ever measured."""
        return np.asarray(self.looks > 0, dtype=np.bool_)


@dataclass(frozen=True)
class LandmarkEstimator:
    """The exact posterior of the depths of landmarks whose (x, y) are known, from noisy ranges.

    The measurement is ``y = r (1 + noise xi)`` with ``r^2 = h^2 + (z - z_vehicle)^2``, ``h`` the horizontal distance.
    A sensor that sees all round may have seen a landmark above the vehicle; beams look down. Near its best depth the
    posterior is the papers' weighted least squares with weights ``1 / (noise r)^2``.

    Attributes
    ----------
    sensor : Ranging
        Gives the noise.
    accuracy_sd_m : float
        A landmark whose standard deviation falls below this belongs to ``A``, for ever.
    visit_cap : int
        A landmark measured more often than this counts as accurate too (AURO15 footnote 3).
    """

    sensor: Ranging = RangeSensor()  # noqa: RUF009 - frozen
    accuracy_sd_m: float = 0.02
    visit_cap: int = 200

    def update(
        self, landmarks: Landmarks, vehicle: int, position: FloatArray, index: IntArray, ranges: FloatArray
    ) -> Landmarks:
        """Take in the ranges that one vehicle measured.

        Parameters
        ----------
        vehicle : int
            Number of the vehicle, to be credited with the landmarks it completes; the same for as long as it lives.
        position : (3,)
            Where it measured.
        index : (k,)
            Which landmarks it measured, each at most once.
        ranges : (k,)
            The noisy ranges.
        """
        sure = (SURE * self.accuracy_sd_m) ** 2
        grids = landmarks.grids.copy()
        grids.take(landmarks.xy_m, np.asarray(position), index, ranges, self.sensor)
        depth_m, variance_m2 = landmarks.depth_m.copy(), landmarks.variance_m2.copy()
        looks, accurate, credited = landmarks.looks.copy(), landmarks.accurate.copy(), landmarks.credited.copy()
        looks[index] += 1
        # Neighbours count as they were known before the look, in whatever order the landmarks stand.
        depth_m[index], variance_m2[index] = grids.estimates(index, landmarks.variance_m2 < sure)
        beside = grids.beside(index, (looks > 0) & ~accurate)
        depth_m[beside], variance_m2[beside] = grids.estimates(beside, variance_m2 < sure)
        judged = np.concatenate([index, beside])
        done = (variance_m2[judged] < self.accuracy_sd_m**2) | (looks[judged] > self.visit_cap)
        fresh = judged[done & ~accurate[judged]]
        accurate[fresh] = True
        credited[fresh] = vehicle
        return replace(
            landmarks,
            depth_m=depth_m,
            variance_m2=variance_m2,
            looks=looks,
            accurate=accurate,
            credited=credited,
            grids=grids,
        )


@njit(cache=True, nogil=True, error_model="numpy")
def _take(
    lowest: FloatArray,
    spacing: FloatArray,
    fit: NDArray[np.float32],
    steepness: NDArray[np.float32],
    index: IntArray,
    h2: FloatArray,
    vehicle_depth: float,
    ranges: FloatArray,
    noise: float,
    below: bool,
) -> None:
    """Take one range each into the grids of the landmarks ``index`` (k,), in place."""
    for k in range(len(index)):
        m = index[k]
        grid = (lowest[m], spacing[m])
        if spacing[m] == 0.0:
            grid = lay_out(vehicle_depth, ranges[k], noise, below, h2[k])
        lowest[m], spacing[m] = take_range(fit[m], steepness[m], grid, h2[k], vehicle_depth, ranges[k], noise, below)


@njit(cache=True, nogil=True, error_model="numpy")
def _estimates(
    lowest: FloatArray,
    spacing: FloatArray,
    fit: NDArray[np.float32],
    steepness: NDArray[np.float32],
    index: IntArray,
    neighbours: IntArray,
    apart: FloatArray,
    own_depth: FloatArray,
    own_variance: FloatArray,
    known: BoolArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return depths and variances (k,) of the landmarks ``index``, and both by their own ranges alone.

    ``known`` (k, NEIGHBOURS) are the neighbours that count.
    """
    depths, variances = np.empty(len(index)), np.empty(len(index))
    own_depths, own_variances = np.empty(len(index)), np.empty(len(index))
    for k in range(len(index)):
        m, near = index[k], neighbours[index[k]]
        around = from_neighbours(own_depth[near], own_variance[near], apart[m], known[k])
        depths[k], variances[k], own_depths[k], own_variances[k] = estimate(
            fit[m], steepness[m], (lowest[m], spacing[m]), around
        )
    return depths, variances, own_depths, own_variances


@dataclass(frozen=True)
class LandmarkSets:
    """The sets of AURO15 definitions 1-3 at one time, as masks.

    Attributes
    ----------
    accurate : (n,)
        ``A``.
    accurate_count_by : (n_vehicles,)
        ``|A_j|``.
    visible_by : (n_vehicles, n)
        ``V_j``.
    pending : (n,)
        ``B_hat``: seen in the past, not visible now, not accurate; when there is none, every landmark that is neither
        visible nor accurate.
    """

    accurate: BoolArray
    accurate_count_by: IntArray
    visible_by: BoolArray
    pending: BoolArray

    @property
    def visible(self) -> BoolArray:
        """``V``."""
        return np.asarray(self.visible_by.any(axis=0), dtype=np.bool_)

    @property
    def unfinished_by(self) -> BoolArray:
        """``B_j``: visible to vehicle j, not accurate."""
        return np.asarray(self.visible_by & ~self.accurate, dtype=np.bool_)

    @property
    def unfinished(self) -> BoolArray:
        """``B``: visible to anyone, not accurate."""
        return np.asarray(self.visible & ~self.accurate, dtype=np.bool_)


def landmark_sets(landmarks: Landmarks, visible_by: BoolArray, vehicles: IntArray | None = None) -> LandmarkSets:
    """Return the sets for the visibility ``visible_by`` (n_vehicles, n).

    ``vehicles`` (n_vehicles,) are the numbers under which the rows' vehicles are credited: a team that lost some has
    others than 0, 1, 2 ... (the default).
    """
    hidden = ~visible_by.any(axis=0) & ~landmarks.accurate
    seen_before = hidden & landmarks.seen
    numbers = np.arange(len(visible_by)) if vehicles is None else vehicles
    count = (landmarks.credited[None, :] == numbers[:, None]).sum(axis=1).astype(np.int64)
    return LandmarkSets(landmarks.accurate, count, visible_by, seen_before if seen_before.any() else hidden)
