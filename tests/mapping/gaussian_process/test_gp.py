"""The Gaussian-process map against the exact dense answer and against what any map must do."""

import pickle
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.mapping.compare import difference
from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.kriging.likelihood import SLOPE_SD, Hyperparameters
from app.mapping.types import Grid, Soundings

GRID = Grid(west_m=0.0, south_m=0.0, cell_m=2.0, rows=20, cols=25)


COMPILED = """
import pkgutil
from importlib import import_module

import numpy as np
from numba.core.dispatcher import Dispatcher

import app.mapping
from app.mapping.gaussian_process.gp import GaussianProcessMap, warm_up
from app.mapping.types import Grid, Soundings

rooms = [f"app.mapping.{room}" for room in ("gaussian_process", "gross_errors", "kriging")]
paths = [(room, import_module(room).__path__) for room in rooms]
modules = [import_module(found.name) for room, path in paths for found in pkgutil.iter_modules(path, f"{room}.")]
compiled = {id(f): f for module in modules for f in vars(module).values() if isinstance(f, Dispatcher)}
warm_up()
before = {key: len(f.signatures) for key, f in compiled.items()}
rng = np.random.default_rng(0)
east, north = rng.uniform(0.0, 60.0, (2, 900))
soundings = Soundings(east, north, 10.0 + np.sin(east / 9.0) + 0.1 * rng.standard_normal(900), np.full(900, 0.1))
GaussianProcessMap().fit(soundings).predict(Grid(0.0, 0.0, 1.0, 60, 60))
print([f.__name__ for key, f in compiled.items() if len(f.signatures) > before[key]])
"""
"""Prints which compiled functions of the map a warm-up forgot."""


def scattered(n: int, seed: int = 0, sd_m: float = 0.05) -> Soundings:
    rng = np.random.default_rng(seed)
    east, north = rng.uniform(0, 50, n), rng.uniform(0, 40, n)
    depth = 10 + 0.05 * east + np.sin(east / 5) + np.cos(north / 4)
    return Soundings(east, north, depth + sd_m * rng.standard_normal(n), np.full(n, sd_m))


def lines(
    terrain: Callable[[FloatArray, FloatArray], FloatArray],
    *,
    spacing_m: float,
    seed: int = 0,
    size_m: float = 100.0,
    relative_sd: float = 0.01,
) -> Soundings:
    """A sounding every 0.5 m along lines ``spacing_m`` apart."""
    east, north = (
        a.ravel() for a in np.meshgrid(np.arange(spacing_m / 2, size_m, spacing_m), np.arange(0.0, size_m, 0.5))
    )
    depth = terrain(east, north)
    sd = relative_sd * depth
    return Soundings(east, north, depth + sd * np.random.default_rng(seed).standard_normal(len(east)), sd)


def patchy(east: FloatArray, north: FloatArray) -> FloatArray:
    """A flat floor with one rough corner."""
    rough = 1.0 / (1.0 + np.exp(-(east + north - 110.0) / 5.0))
    return 12.0 + 0.02 * east + 0.8 * rough * np.sin(east / 2.5) * np.sin(north / 2.0)


def dense_universal_kriging(s: Soundings, hyper: Hyperparameters, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Exact posterior from all soundings at once; the plane is part of the covariance."""
    at = np.column_stack([s.east_m, s.north_m])
    centre = at.mean(axis=0)

    def covariance(a: FloatArray, b: FloatArray) -> FloatArray:
        r = np.sqrt(3) * np.linalg.norm(a[:, None] - b[None], axis=-1) / hyper.length_m
        plane = 1e6 + SLOPE_SD**2 * (a - centre) @ (b - centre).T
        return hyper.amplitude_m**2 * (1 + r) * np.exp(-r) + plane

    k = covariance(at, at) + np.diag(hyper.noise_scale * s.sd_m**2)
    cross = covariance(targets, at)
    mean = cross @ np.linalg.solve(k, s.depth_m - 10.0) + 10.0
    variance = np.diag(covariance(targets, targets) - cross @ np.linalg.solve(k, cross.T))
    return mean, variance


def test_with_all_soundings_as_neighbours_it_is_exact() -> None:
    s = scattered(120)
    gp = GaussianProcessMap(
        "matern32", nonstationary=False, neighbours=(200, 0), merge_m=1e-6, reject_outliers=False, calibrate=False
    ).fit(s)
    result = gp.predict(GRID)
    mean, variance = dense_universal_kriging(s, gp.hyperparameters_, GRID.centres_m)
    np.testing.assert_allclose(result.depth_m.ravel(), mean, atol=1e-4)
    np.testing.assert_allclose(result.sd_m.ravel(), np.sqrt(variance), atol=1e-3)


def test_local_prediction_stays_close_to_the_exact_one() -> None:
    s = scattered(800, sd_m=0.1)
    gp = GaussianProcessMap("matern32", nonstationary=False, reject_outliers=False, calibrate=False).fit(s)
    result = gp.predict(GRID)
    mean, variance = dense_universal_kriging(s, gp.hyperparameters_, GRID.centres_m)
    off = (result.depth_m.ravel() - mean) / np.sqrt(variance)
    assert np.sqrt(np.mean(off**2)) < 0.2
    np.testing.assert_allclose(result.sd_m.ravel(), np.sqrt(variance), rtol=0.2)


@settings(max_examples=15, deadline=None)
@given(depth=st.floats(0.5, 3000.0), seed=st.integers(0, 99), n=st.integers(1, 80))
def test_a_constant_sea_floor_is_reproduced(depth: float, seed: int, n: int) -> None:
    s = scattered(n, seed)
    result = GaussianProcessMap().fit(Soundings(s.east_m, s.north_m, np.full(n, depth), s.sd_m)).predict(GRID)
    np.testing.assert_allclose(result.depth_m, depth, atol=1e-3)


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(east=st.floats(-1e5, 1e5), north=st.floats(-1e5, 1e5), depth=st.floats(-5, 200))
def test_the_origin_and_the_datum_do_not_matter(east: float, north: float, depth: float) -> None:
    s = scattered(150)
    moved = Soundings(s.east_m + east, s.north_m + north, s.depth_m + depth, s.sd_m)
    grid = Grid(GRID.west_m + east, GRID.south_m + north, GRID.cell_m, GRID.rows, GRID.cols)
    here, there = GaussianProcessMap().fit(s).predict(GRID), GaussianProcessMap().fit(moved).predict(grid)
    np.testing.assert_allclose(there.depth_m - depth, here.depth_m, atol=2e-3)
    np.testing.assert_allclose(there.sd_m, here.sd_m, atol=2e-3)


@pytest.mark.slow
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 1000))
def test_the_order_of_soundings_does_not_matter(seed: int) -> None:
    s = scattered(200)
    shuffled = s.take(np.random.default_rng(seed).permutation(200))
    a, b = (GaussianProcessMap().fit(x).predict(GRID) for x in (s, shuffled))
    np.testing.assert_allclose(a.depth_m, b.depth_m, atol=2e-3)
    np.testing.assert_allclose(a.sd_m, b.sd_m, atol=2e-3)
    np.testing.assert_array_equal(a.count, b.count)


def test_the_same_soundings_give_the_same_map() -> None:
    a, b = (GaussianProcessMap().fit(scattered(200)).predict(GRID) for _ in range(2))
    np.testing.assert_array_equal(a.depth_m, b.depth_m)


@pytest.mark.parametrize("nonstationary", [False, True])
def test_deviation_grows_away_from_the_soundings(nonstationary: bool) -> None:
    s = scattered(150)
    west = s.take(s.east_m < 12)
    result = GaussianProcessMap(nonstationary=nonstationary).fit(west).predict(GRID)
    mean_per_column = result.sd_m.mean(axis=0)
    assert np.all(np.diff(mean_per_column[6:]) > -1e-3)
    assert mean_per_column[-1] > 3 * mean_per_column[2]


def test_cells_outside_the_mask_are_unknown_and_the_others_unchanged() -> None:
    mask = np.zeros((GRID.rows, GRID.cols), bool)
    mask[3:9, 4:20] = True
    gp = GaussianProcessMap().fit(scattered(150))
    masked, full = gp.predict(GRID, mask), gp.predict(GRID)
    for name in ("depth_m", "sd_m"):
        assert np.isnan(getattr(masked, name)[~mask]).all()
        np.testing.assert_array_equal(getattr(masked, name)[mask], getattr(full, name)[mask])
    assert np.isnan(masked.roughness[~mask]).all()


def test_counts_tell_sounded_cells() -> None:
    s = scattered(150)
    result = GaussianProcessMap(reject_outliers=False).fit(s).predict(GRID)
    assert result.count.sum() == 150
    np.testing.assert_array_equal(result.sounded, result.count > 0)


def test_roughness_shows_the_rough_corner() -> None:
    grid = Grid(0.0, 0.0, 1.0, 100, 100)
    roughness = GaussianProcessMap().fit(lines(patchy, spacing_m=6.0)).predict(grid).roughness
    assert roughness.mean() == pytest.approx(1.0)
    assert roughness[70:, 70:].mean() > 4 * roughness[:30, :30].mean()


def test_roughness_is_neutral_where_nothing_was_sounded() -> None:
    grid = Grid(0.0, 0.0, 1.0, 100, 300)
    roughness = GaussianProcessMap().fit(lines(patchy, spacing_m=6.0)).predict(grid).roughness
    far = roughness[:, 200:]
    np.testing.assert_allclose(far, far[0, 0], rtol=0.02)
    assert roughness[:, :100].min() < far[0, 0] < roughness[:, :100].max()


def test_rough_corner_is_mapped_better_than_by_a_stationary_process() -> None:
    grid = Grid(0.0, 0.0, 1.0, 100, 100)
    truth = patchy(*grid.centres_m.T).reshape(100, 100)
    rmse = {
        nonstationary: difference(
            GaussianProcessMap(nonstationary=nonstationary).fit(lines(patchy, spacing_m=4.0)).predict(grid).depth_m,
            truth,
        ).rmse_m
        for nonstationary in (False, True)
    }
    assert rmse[True] < 0.97 * rmse[False]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "at_most"),
    [
        ("leixoes_sharp_wall_sw", 0.92),
        ("leixoes_sharp_diagonal", 0.95),
        ("leixoes_slope", 1.02),
        ("fortbragg_plateau", 1.03),
        ("jd211_pit", 1.02),
    ],
)
def test_real_sea_floors_are_mapped_no_worse_than_by_a_stationary_process(
    name: str, at_most: float, real_terrain: Callable[[str], FloatArray]
) -> None:
    truth = real_terrain(name)[:100, :100]

    def terrain(east: FloatArray, north: FloatArray) -> FloatArray:
        return truth[np.minimum(north.astype(int), 99), np.minimum(east.astype(int), 99)]

    s = lines(terrain, spacing_m=10.0)
    grid = Grid(0.0, 0.0, 1.0, 100, 100)
    ours, stationary = (
        difference(GaussianProcessMap(nonstationary=x).fit(s).predict(grid).depth_m, truth).rmse_m
        for x in (True, False)
    )
    assert ours < at_most * stationary


@pytest.mark.parametrize("n", [1, 2, 3, 5, 12])
def test_a_mission_may_start_with_very_few_soundings(n: int) -> None:
    track = np.arange(n, dtype=float)
    s = Soundings(track, np.full(n, 5.0), 10 + 0.1 * track, np.full(n, 0.1))
    result = GaussianProcessMap().fit(s).predict(Grid(0.0, 0.0, 1.0, 12, 12))
    assert np.isfinite(result.depth_m).all()
    assert np.all(result.sd_m > 0)
    assert result.depth_m[5, 0] == pytest.approx(10.0, abs=0.2)


def test_taking_in_soundings_without_learning_keeps_the_hyperparameters() -> None:
    s = scattered(300)
    gp = GaussianProcessMap().fit(s.take(np.arange(200)))
    learned = gp.hyperparameters_
    before = gp.predict(GRID)
    after = gp.fit(s, learn=False).predict(GRID)
    assert gp.hyperparameters_ == learned
    assert after.count.sum() == before.count.sum() + 100
    assert after.sd_m.mean() < before.sd_m.mean()


def test_what_was_learned_makes_the_same_map_without_the_soundings_it_was_learned_on() -> None:
    soundings = scattered(300)
    whole = GaussianProcessMap().fit(soundings)
    kept = whole.learned()
    assert not hasattr(kept, "soundings_")
    assert len(pickle.dumps(kept)) < 10_000 < len(pickle.dumps(whole))
    with pytest.raises(ValueError, match="call fit"):
        kept.predict(GRID)
    again = kept.fit(soundings, learn=False).predict(GRID)
    expected = whole.predict(GRID)
    np.testing.assert_array_equal(again.depth_m, expected.depth_m)
    np.testing.assert_array_equal(again.sd_m, expected.sd_m)
    np.testing.assert_array_equal(again.claim_sd_m, expected.claim_sd_m)


@pytest.mark.slow
def test_many_soundings_of_one_cell_count_as_one_and_the_map_stays_as_good() -> None:
    rng = np.random.default_rng(1)
    east, north = rng.uniform(0, 20, (2, 40_000))
    depth = 8.0 + np.sin(east / 4.0) + 0.1 * north
    soundings = Soundings(east, north, depth + rng.normal(0.0, 0.1, len(east)), np.full(len(east), 0.1))
    grid = Grid(0.0, 0.0, 1.0, 20, 20)
    centre = grid.centres_m
    truth = (8.0 + np.sin(centre[:, 0] / 4.0) + 0.1 * centre[:, 1]).reshape(20, 20)
    whole, limited = GaussianProcessMap(), GaussianProcessMap(least_merge_m=0.5)
    fine, merged = (model.fit(soundings).predict(grid) for model in (whole, limited))
    off = [float(np.sqrt(np.mean((found.depth_m - truth) ** 2))) for found in (fine, merged)]
    assert off[1] <= 1.2 * off[0] < 0.05
    np.testing.assert_array_equal(merged.count, fine.count)


def test_learning_again_starts_from_what_was_learned() -> None:
    s = scattered(300)
    fresh = GaussianProcessMap().fit(s)
    twice = GaussianProcessMap().fit(s.take(np.arange(150))).fit(s)
    np.testing.assert_allclose(twice.predict(GRID).depth_m, fresh.predict(GRID).depth_m, atol=0.02)


@pytest.mark.parametrize("kernel", ["matern32", "matern52", "exponential", "gaussian"])
def test_every_kernel_maps_a_smooth_floor(kernel: str) -> None:
    s = scattered(300)
    result = GaussianProcessMap(kernel).fit(s).predict(GRID)  # type: ignore[arg-type]
    east, north = GRID.centres_m.T
    truth = (10 + 0.05 * east + np.sin(east / 5) + np.cos(north / 4)).reshape(GRID.rows, GRID.cols)
    assert difference(result.depth_m, truth).rmse_m < 0.12


def test_an_unknown_kernel_is_refused() -> None:
    with pytest.raises(ValueError, match="auto or one of matern32, matern52"):
        GaussianProcessMap("cubic")  # type: ignore[arg-type]


def test_predicting_before_fitting_is_refused() -> None:
    with pytest.raises(ValueError, match="call fit"):
        GaussianProcessMap().predict(GRID)


def test_a_mask_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"mask has shape \(2, 2\)"):
        GaussianProcessMap().fit(scattered(20)).predict(GRID, np.ones((2, 2), bool))


def test_no_soundings_are_refused() -> None:
    empty = np.zeros(0)
    with pytest.raises(ValueError, match="at least one sounding"):
        GaussianProcessMap().fit(Soundings(empty, empty, empty, empty))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [("sd_m", 0.0, r"sd_m\[3\] is 0.0; it must be positive"), ("east_m", np.nan, r"east_m\[3\] is nan")],
)
def test_bad_soundings_are_named(field: str, value: float, message: str) -> None:
    s = scattered(20)
    getattr(s, field)[3] = value
    with pytest.raises(ValueError, match=message):
        GaussianProcessMap().fit(s)


@pytest.mark.slow
def test_warm_up_leaves_nothing_to_compile() -> None:
    # A process of its own: the tests before this one have compiled everything.
    found = subprocess.run([sys.executable, "-c", COMPILED], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.slow
def test_a_relief_below_the_noise_is_mapped_as_well_as_its_soundings_allow() -> None:
    def floor(east: FloatArray, north: FloatArray) -> FloatArray:
        return 50.0 + 0.1 * np.sin(east / 9.0) * np.cos(north / 11.0) + 0.08 * np.sin((east + north) / 15.0)

    north, east = np.tile(np.arange(0.0, 100.0, 0.25), 10), np.repeat(np.arange(5.0, 100.0, 10.0), 400)
    grid = Grid(0.0, 0.0, 2.0, 50, 50)
    for seed in (3, 4):
        depth = floor(east, north) + 0.5 * np.random.default_rng(seed).standard_normal(len(east))
        soundings = Soundings(east, north, depth, np.full(len(east), 0.5))
        error = GaussianProcessMap(claims=False).fit(soundings).predict(grid).depth_m.ravel() - floor(*grid.centres_m.T)
        assert np.sqrt(np.mean(error**2)) < 0.052
