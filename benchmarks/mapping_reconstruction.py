"""Reconstruction from the same soundings: our map, scikit-learn's Gaussian process, scipy's thin-plate spline.

    python benchmarks/mapping_reconstruction.py [--terrains FOLDER] [--only NAME ...] [--spacing 8] [--seeds 1]

Two samplings of every terrain of 1 m cells: 1000 random soundings, and a lawnmower with a sounding every 0.5 m.
Noise is 1 % of the range to a vehicle 2.5 m deep. Printed per method: RMSE in metres, processor seconds (learning
and prediction), and for methods that state a deviation how many true depths lie in the 68 and 95 % intervals.
"""

import argparse
import os
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.ndimage import map_coordinates
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from app.mapping.compare import difference, interval_coverage
from app.mapping.gaussian import GaussianInterpolator, choose_width
from app.mapping.gp import GaussianProcessMap, warm_up
from app.mapping.supersoundings import merge_soundings
from app.mapping.types import FloatArray, Grid, Soundings

Method = Callable[[Soundings, Grid], tuple[FloatArray, FloatArray | None]]


def ours(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    result = GaussianProcessMap().fit(s).predict(grid)
    return result.depth_m, result.sd_m


def ours_stationary(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    result = GaussianProcessMap(nonstationary=False).fit(s).predict(grid)
    return result.depth_m, result.sd_m


def ours_gaussian(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    live = GaussianInterpolator(grid, choose_width(s, grid))
    live.add(s)
    known = np.isfinite(live.depth_m)
    return np.where(known, live.depth_m, s.depth_m.mean()), live.sd_m


def scikit_learn(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    """Matern 3/2, linear trend taken out, maximum likelihood on 350 soundings, prediction from at most 1500."""
    thin, _ = merge_soundings(s, 1.0)
    if len(thin) > 1500:
        thin, _ = merge_soundings(s, 1.5)
    points = np.column_stack([thin.east_m, thin.north_m])
    basis = np.column_stack([np.ones(len(thin)), points])
    plane, *_ = np.linalg.lstsq(basis, thin.depth_m, rcond=None)
    residual = thin.depth_m - basis @ plane
    subset = np.random.default_rng(0).permutation(len(thin))[:350]
    kernel = ConstantKernel(float(residual.var()) + 1e-6, (1e-8, 1e4)) * Matern(8.0, (0.2, 300.0), nu=1.5)
    learned = GaussianProcessRegressor(kernel, alpha=thin.sd_m[subset] ** 2).fit(points[subset], residual[subset])
    model = GaussianProcessRegressor(learned.kernel_, alpha=thin.sd_m**2, optimizer=None).fit(points, residual)
    mean, sd = model.predict(grid.centres_m, return_std=True)
    trend = np.column_stack([np.ones(len(mean)), grid.centres_m]) @ plane
    return (mean + trend).reshape(grid.rows, grid.cols), sd.reshape(grid.rows, grid.cols)


def thin_plate(s: Soundings, grid: Grid) -> tuple[FloatArray, FloatArray | None]:
    thin, _ = merge_soundings(s, 1.0)
    points = np.column_stack([thin.east_m, thin.north_m])
    spline = RBFInterpolator(points, thin.depth_m, neighbors=60, smoothing=1.0)
    return spline(grid.centres_m).reshape(grid.rows, grid.cols), None


METHODS: dict[str, Method] = {
    "map": ours,
    "stationary": ours_stationary,
    "gaussian": ours_gaussian,
    "sklearn": scikit_learn,
    "thin plate": thin_plate,
}


def random_track(grid: Grid, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    return rng.uniform(0, grid.cols, 1000), rng.uniform(0, grid.rows, 1000)


def lawnmower(grid: Grid, spacing_m: float) -> tuple[FloatArray, FloatArray]:
    n = max(1, round(grid.cols / spacing_m))
    east, north = np.meshgrid((np.arange(n) + 0.5) * grid.cols / n, np.arange(0.25, grid.rows, 0.5))
    return east.ravel(), north.ravel()


def load(path: Path) -> FloatArray | None:
    with np.load(path) as file:
        z, cell = np.asarray(file["z"], float), float(file["cell_m"])
    if cell == 0.5:
        z = z[: z.shape[0] // 2 * 2, : z.shape[1] // 2 * 2]
        z = z.reshape(z.shape[0] // 2, 2, z.shape[1] // 2, 2).mean(axis=(1, 3))
    elif cell != 1.0:
        return None
    fits = max(z.shape) <= 120 and np.isfinite(z).all() and z.min() > 0.0
    return z if fits else None


def main() -> None:
    folder = os.environ.get("BATHYFLEET_TERRAINS", str(Path(__file__).resolve().parents[2] / "shared" / "terrains"))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--terrains", type=Path, default=Path(folder))
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--spacing", type=float, default=8.0, help="between lawnmower lines, metres")
    parser.add_argument("--seeds", type=int, default=1)
    options = parser.parse_args()
    paths = [p for p in sorted(options.terrains.glob("*.npz")) if not options.only or p.stem in options.only]
    if not paths:
        parser.error(f"no terrain files in {options.terrains}; give the folder with --terrains")
    warnings.simplefilter("ignore", ConvergenceWarning)  # a bound reached is part of the comparison
    warm_up()
    rows: list[tuple[str, str, FloatArray]] = []
    print(f"{'terrain':27}{'sampling':11}" + "".join(f"{name:>12}" for name in METHODS) + "   RMSE, m")
    for path in paths:
        truth = load(path)
        if truth is None:
            continue
        grid = Grid(0.0, 0.0, 1.0, *truth.shape)
        for sampling in ("random", "lawnmower"):
            figures = np.full((options.seeds, len(METHODS), 4), np.nan)
            for seed in range(options.seeds):
                rng = np.random.default_rng(seed)
                turned = np.ascontiguousarray(np.rot90(truth, seed))
                grid = Grid(0.0, 0.0, 1.0, *turned.shape)
                east, north = random_track(grid, rng) if sampling == "random" else lawnmower(grid, options.spacing)
                depth = map_coordinates(turned, [north - 0.5, east - 0.5], order=1, mode="nearest")
                sd = 0.01 * np.maximum(depth - 2.5, 1.0)
                s = Soundings(east, north, depth + sd * rng.standard_normal(len(depth)), sd)
                for m, method in enumerate(METHODS.values()):
                    start = time.process_time()
                    estimate, spread = method(s, grid)
                    seconds = time.process_time() - start
                    figures[seed, m, :2] = difference(estimate, turned).rmse_m, seconds
                    if spread is not None:
                        figures[seed, m, 2:] = [interval_coverage(estimate, spread, turned, p) for p in (0.68, 0.95)]
            mean = figures.mean(axis=0)
            rows.append((path.stem, sampling, mean))
            print(f"{path.stem:27}{sampling:11}" + "".join(f"{x:12.4f}" for x in mean[:, 0]), flush=True)
    for sampling in ("random", "lawnmower"):
        table = np.array([figures for _, kind, figures in rows if kind == sampling])
        ratio = np.exp(np.log(table[:, :, 0] / table[:, :1, 0]).mean(axis=0))
        print(f"\n{sampling}: geometric mean of RMSE relative to ours, seconds, 68 % and 95 % coverage")
        for m, name in enumerate(METHODS):
            seconds, c68, c95 = table[:, m, 1:].mean(axis=0)
            print(f"  {name:12}{ratio[m]:8.3f}{seconds:9.2f} s{c68:8.2f}{c95:8.2f}")


if __name__ == "__main__":
    main()
