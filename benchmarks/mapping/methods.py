"""What is compared: our maps, and what a user would pick instead, each as a function of soundings and grid."""

import importlib.util
import warnings
from collections.abc import Callable

import numpy as np
from scipy.interpolate import RBFInterpolator

from app.arrays import FloatArray
from app.mapping.gaussian import GaussianInterpolator, choose_width
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.kriging.supersoundings import merge_soundings
from app.mapping.types import Grid, Soundings

Method = Callable[[Soundings, Grid], tuple[FloatArray, FloatArray | None]]
"""Depth and, where the method states one, deviation, (rows, cols) each."""

SKLEARN_LEARNS_FROM = 1000
SKLEARN_PREDICTS_FROM = 1500


def ours(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    result = GaussianProcessMap().fit(s).predict(grid)
    return result.depth_m, result.sd_m


def ours_stationary(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    result = GaussianProcessMap("matern32", nonstationary=False).fit(s).predict(grid)
    return result.depth_m, result.sd_m


def ours_gaussian(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    live = GaussianInterpolator(grid, choose_width(s, grid))
    live.add(s)
    known = np.isfinite(live.depth_m)
    return np.where(known, live.depth_m, s.depth_m.mean()), live.sd_m


def _thinned(s: Soundings, most: int) -> Soundings:
    side = 1.0
    thin, _ = merge_soundings(s, side)
    while len(thin) > most:
        side *= 1.2
        thin, _ = merge_soundings(s, side)
    return thin


def _without_plane(s: Soundings) -> tuple[FloatArray, FloatArray]:
    """Return depths minus their least-squares plane, and its coefficients (3,)."""
    basis = np.column_stack([np.ones(len(s)), s.east_m, s.north_m])
    plane, *_ = np.linalg.lstsq(basis, s.depth_m, rcond=None)
    return s.depth_m - basis @ plane, np.asarray(plane, float)


def _plane_on(grid: Grid, plane: FloatArray) -> FloatArray:
    trend = np.column_stack([np.ones(grid.rows * grid.cols), grid.centres_m]) @ plane
    return np.asarray(trend).reshape(grid.rows, grid.cols)


def scikit_learn(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    """Matern 3/2 with the stated noise, linear trend taken out, maximum likelihood."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern

    thin = s if len(s) <= SKLEARN_LEARNS_FROM else _thinned(s, SKLEARN_PREDICTS_FROM)
    points = np.column_stack([thin.east_m, thin.north_m])
    residual, plane = _without_plane(thin)
    subset = np.random.default_rng(0).permutation(len(thin))[:SKLEARN_LEARNS_FROM]
    kernel = ConstantKernel(float(residual.var()) + 1e-6, (1e-8, 1e4)) * Matern(8.0, (0.2, 300.0), nu=1.5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a bound reached is part of the comparison
        learned = GaussianProcessRegressor(kernel, alpha=thin.sd_m[subset] ** 2).fit(points[subset], residual[subset])
    model = GaussianProcessRegressor(learned.kernel_, alpha=thin.sd_m**2, optimizer=None).fit(points, residual)
    mean, sd = model.predict(grid.centres_m, return_std=True)
    return mean.reshape(grid.rows, grid.cols) + _plane_on(grid, plane), sd.reshape(grid.rows, grid.cols)


def thin_plate(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    thin, _ = merge_soundings(s, 1.0)
    points = np.column_stack([thin.east_m, thin.north_m])
    spline = RBFInterpolator(points, thin.depth_m, neighbors=60, smoothing=1.0)
    return spline(grid.centres_m).reshape(grid.rows, grid.cols), None


def verde_spline(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    """Biharmonic spline on a plane; damping by cross-validation."""
    import verde

    thin = s if len(s) <= SKLEARN_LEARNS_FROM else _thinned(s, SKLEARN_PREDICTS_FROM)
    chain = verde.Chain([("trend", verde.Trend(1)), ("spline", verde.SplineCV(dampings=(1e-6, 1e-4, 1e-2, 1.0)))])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # deprecations inside the library
        chain.fit((thin.east_m, thin.north_m), thin.depth_m, weights=thin.sd_m**-2.0)
    east, north = grid.centres_m.T
    return np.asarray(chain.predict((east, north))).reshape(grid.rows, grid.cols), None


def pykrige_ordinary(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    """Ordinary kriging about a plane, with a spherical variogram fitted by the library."""
    from pykrige.ok import OrdinaryKriging

    thin = s if len(s) <= SKLEARN_LEARNS_FROM else _thinned(s, SKLEARN_PREDICTS_FROM)
    residual, plane = _without_plane(thin)
    kriging = OrdinaryKriging(thin.east_m, thin.north_m, residual, variogram_model="spherical")
    mean, variance = kriging.execute("grid", grid.east_m, grid.north_m)
    return np.asarray(mean) + _plane_on(grid, plane), np.sqrt(np.maximum(np.asarray(variance), 0.0))


METHODS: dict[str, Method] = {
    "map": ours,
    "stationary": ours_stationary,
    "gaussian": ours_gaussian,
    "scikit-learn": scikit_learn,
    "scipy RBF": thin_plate,
}
if importlib.util.find_spec("verde"):
    METHODS["verde"] = verde_spline
if importlib.util.find_spec("pykrige"):
    METHODS["PyKrige"] = pykrige_ordinary
