"""Time and memory of large maps, each in a process of its own; how near local kriging is to the exact answer."""

import multiprocessing
import resource
import time
from collections.abc import Callable, Iterable

import numpy as np

from app.arrays import FloatArray
from app.mapping.compare import difference, interval_coverage
from app.mapping.gaussian import GaussianInterpolator, choose_width
from app.mapping.gaussian_process.gp import GaussianProcessMap, warm_up
from app.mapping.kriging.likelihood import SLOPE_SD, Hyperparameters
from app.mapping.types import Grid, Soundings
from benchmarks.mapping.terrains import sound, wide_floor

Table = Callable[[Iterable[str], Iterable[Iterable[str]]], list[str]]
CHECKED_EVERY = 3  # rows and columns of large maps


def large_survey(n: int, cells: int) -> tuple[Grid, Soundings]:
    rng = np.random.default_rng(0)
    east, north = rng.uniform(0, cells, (2, n))
    sd = np.full(n, 0.1)
    s = Soundings(east, north, wide_floor(east, north) + sd * rng.standard_normal(n), sd)
    return Grid(0.0, 0.0, 1.0, cells, cells), s


def _megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def live_grid(n: int, cells: int) -> dict[str, float]:
    grid, s = large_survey(n, cells)
    few = s.take(np.arange(1000))
    width = choose_width(s, grid)
    GaussianInterpolator(grid, width).add(few)  # compiled now
    before = _megabytes()
    start, cpu = time.perf_counter(), time.process_time()
    live = GaussianInterpolator(grid, width)
    live.add(s)
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    start = time.perf_counter()
    for _ in range(20):
        live.add(few)
    more = (time.perf_counter() - start) / 20.0
    return {"seconds": seconds, "cpu": cpu, "more_ms": 1e3 * more, "mb": _megabytes() - before, "width": width}


def process_map(n: int, cells: int) -> dict[str, float]:
    warm_up()
    grid, s = large_survey(n, cells)
    before = _megabytes()
    start, cpu = time.perf_counter(), time.process_time()
    model = GaussianProcessMap().fit(s)
    fitted = time.perf_counter() - start
    result = model.predict(grid)
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    memory = _megabytes() - before
    every = np.s_[::CHECKED_EVERY, ::CHECKED_EVERY]
    truth = wide_floor(*np.meshgrid(grid.east_m[::CHECKED_EVERY], grid.north_m[::CHECKED_EVERY]))
    inside = [interval_coverage(result.depth_m[every], result.sd_m[every], truth, p) for p in (0.68, 0.95)]
    return {
        "seconds": seconds,
        "fit": fitted,
        "cpu": cpu,
        "mb": memory,
        "rmse": difference(result.depth_m[every], truth).rmse_m,
        "in68": inside[0],
        "in95": inside[1],
    }


def _alone(work: Callable[[int, int], dict[str, float]], n: int, cells: int) -> dict[str, float]:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(work, (n, cells))


def speed(table: Table, *, huge: bool) -> list[str]:
    out = [
        "## Speed",
        "",
        "Seconds by the clock (of the processor in brackets), all cores; memory beyond the soundings.",
        "",
    ]
    live = _alone(live_grid, 1_000_000, 1000)
    out += table(
        ["live Gaussian grid", "seconds", "1000 more, ms", "memory, MB", "kernel width, cells"],
        [
            [
                "1 000 000 soundings onto 1000 x 1000",
                f"{live['seconds']:.2f} ({live['cpu']:.2f})",
                f"{live['more_ms']:.1f}",
                f"{live['mb']:.0f}",
                f"{live['width']:.2f}",
            ]
        ],
    )
    sizes = [(100_000, 1000)] + ([(5_000_000, 4000)] if huge else [])
    rows = []
    for n, cells in sizes:
        f = _alone(process_map, n, cells)
        rows.append(
            [
                f"{n} soundings onto {cells} x {cells}",
                f"{f['seconds']:.1f} ({f['cpu']:.1f})",
                f"{f['fit']:.1f}",
                f"{f['mb']:.0f}",
                f"{f['rmse']:.4f}",
                f"{100 * f['in68']:.0f} / {100 * f['in95']:.0f}",
            ]
        )
        print("speed", *rows[-1], flush=True)
    head = ["default map, outliers judged and model learned", "seconds", "of these learning", "memory, MB", "RMSE, m"]
    return out + table([*head, "cells within 68 / 95 %"], rows)


def exact(s: Soundings, hyper: Hyperparameters, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and deviation at ``targets`` (m, 2) from all soundings at once, Matern 3/2, the plane in the covariance."""
    at = np.column_stack([s.east_m, s.north_m])
    centre, level = at.mean(axis=0), float(s.depth_m.mean())

    def covariance(a: FloatArray, b: FloatArray) -> FloatArray:
        r = np.sqrt(3.0) * np.hypot(*(a[:, None, i] - b[None, :, i] for i in (0, 1))) / hyper.length_m
        plane = 1e4 + SLOPE_SD**2 * (a - centre) @ (b - centre).T
        return np.asarray(hyper.amplitude_m**2 * (1.0 + r) * np.exp(-r) + plane)

    k = covariance(at, at) + np.diag(hyper.noise_scale * s.sd_m**2)
    cross = covariance(targets, at)
    solved = np.linalg.solve(k, np.column_stack([s.depth_m - level, cross.T]))
    prior = hyper.amplitude_m**2 + 1e4 + SLOPE_SD**2 * ((targets - centre) ** 2).sum(axis=1)
    variance = prior - np.einsum("ij,ji->i", cross, solved[:, 1:])
    return cross @ solved[:, 0] + level, np.sqrt(np.maximum(variance, 0.0))


def exactness(floors: list[tuple[str, FloatArray]], table: Table) -> list[str]:
    rows = []
    for name, floor in floors:
        for design in ("random", "lines 4.2 m"):
            grid, _, s = sound(floor, design, 0)
            s = s.take(np.arange(min(len(s), 1000)))
            model = GaussianProcessMap("matern32", nonstationary=False, reject_outliers=False, calibrate=False).fit(s)
            result = model.predict(grid)
            some = np.arange(0, grid.rows * grid.cols, 5)
            mean, sd = exact(s, model.hyperparameters_, grid.centres_m[some])
            off = (result.depth_m.ravel()[some] - mean) / sd
            wider = result.sd_m.ravel()[some] / sd
            rms = float(np.sqrt(np.mean(off**2)))
            rows.append([name, design, f"{rms:.3f}", f"{np.abs(off).max():.2f}", f"{np.median(wider):.3f}"])
            print("exactness", *rows[-1], flush=True)
    head = ["terrain", "soundings", "RMS of the difference / deviation", "largest", "deviation over the exact, median"]
    text = "Local kriging of the stationary process against the exact process with the same hyperparameters:"
    return ["## Exactness", "", text, "", *table(head, rows)]
