"""The model of several surveys against slow accounts of the same."""

import math
from dataclasses import replace
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.mapping.sites import SiteFusion, Survey, fuse_surveys
from app.mapping.sites.model import CHANGED, NONE, YEAR_S
from app.mapping.types import Grid

GRID = Grid(0.0, 0.0, 1.0, 3, 4)
NOW_S = 40 * YEAR_S


def survey(depth_m: FloatArray | float, sd_m: FloatArray | float, years: float, shared_sd_m: float = 0.0) -> Survey:
    depth = np.broadcast_to(np.asarray(depth_m, float), (GRID.rows, GRID.cols))
    sd = np.where(np.isfinite(depth), sd_m, np.nan)
    return Survey(GRID, depth.copy(), sd, np.isfinite(depth), years * YEAR_S, shared_sd_m)


@st.composite
def seen(draw: st.DrawFn) -> list[Survey]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    found = []
    for years in sorted(rng.uniform(0.0, 39.0, draw(st.integers(1, 5)))):
        depth = 10.0 + rng.standard_normal((GRID.rows, GRID.cols)) * draw(st.sampled_from([0.1, 1.0]))
        depth[rng.uniform(size=depth.shape) < 0.3] = np.nan
        found.append(survey(depth, rng.uniform(0.05, 0.5, depth.shape), years, draw(st.sampled_from([0.0, 0.2]))))
    return found


def slow_model(surveys: list[Survey], yearly_m: float, row: int, col: int) -> tuple[float, float, int, int]:
    """Depth, variance, newest survey and how many count, of one cell, in plain words."""
    depth, variance, newest, number, then_s = math.nan, math.nan, NONE, 0, 0.0
    for index, one in enumerate(sorted(surveys, key=lambda item: item.time_s)):
        z, noise = one.depth_m[row, col], one.sd_m[row, col] ** 2 + one.shared_sd_m**2
        if math.isnan(z):
            continue
        foretold = variance + yearly_m**2 * (one.time_s - then_s) / YEAR_S
        if number == 0 or abs(z - depth) > CHANGED * math.sqrt(foretold + noise):
            depth, variance, number = z, noise, 1
        else:
            weight, old = 1.0 / noise, 1.0 / foretold
            depth, variance, number = (weight * z + old * depth) / (weight + old), 1.0 / (weight + old), number + 1
        newest, then_s = index, one.time_s
    return depth, variance + yearly_m**2 * (NOW_S - then_s) / YEAR_S, newest, number


@given(seen(), st.sampled_from([0.0, 0.03, 0.4]), st.randoms(use_true_random=False))
def test_every_cell_is_that_of_a_slow_account_in_whatever_order_surveys_come(
    surveys: list[Survey], yearly_m: float, random: Random
) -> None:
    random.shuffle(surveys)
    model = fuse_surveys(GRID, surveys, yearly_m, NOW_S)
    for row in range(GRID.rows):
        for col in range(GRID.cols):
            depth, variance, newest, number = slow_model(surveys, yearly_m, row, col)
            assert model.depth_m[row, col] == pytest.approx(depth, nan_ok=True)
            assert model.sd_m[row, col] ** 2 == pytest.approx(variance, nan_ok=True)
            assert (model.newest[row, col], model.surveys[row, col]) == (newest, number)


def test_surveys_that_agree_make_what_all_of_them_at_once_say() -> None:
    """Against the joint normal distribution of the floor at every time, given all depths at once."""
    times, sds, yearly_m = np.array([0.0, 2.0, 9.0, 30.0]), np.array([0.1, 0.3, 0.2, 0.15]), 0.05
    depths = 7.0 + 0.3 * sds * np.array([1.0, -1.0, 0.5, -0.5])
    model = fuse_surveys(GRID, [survey(d, s, t) for d, s, t in zip(depths, sds, times, strict=True)], yearly_m, NOW_S)
    ages = np.append(times, NOW_S / YEAR_S)
    floor = 1e8 + yearly_m**2 * np.minimum.outer(ages, ages)
    weights = np.linalg.solve(floor[:4, :4] + np.diag(sds**2), floor[:4, 4])
    np.testing.assert_allclose(model.depth_m, 7.0 + weights @ (depths - 7.0), atol=1e-5)
    np.testing.assert_allclose(model.sd_m**2, floor[4, 4] - floor[4, :4] @ weights, rtol=1e-4)


def test_ground_that_never_changes_is_the_mean_weighted_by_precision_however_old() -> None:
    model = fuse_surveys(GRID, [survey(10.0, 0.1, 0.0), survey(10.1, 0.2, 20.0)], 0.0, NOW_S)
    np.testing.assert_allclose(model.depth_m, (100 * 10.0 + 25 * 10.1) / 125)
    np.testing.assert_allclose(model.sd_m, 125**-0.5)
    assert (model.surveys == 2).all()


def test_what_nobody_measured_stays_unknown() -> None:
    depth = np.full((3, 4), np.nan)
    depth[0, 0] = 5.0
    model = fuse_surveys(GRID, [survey(depth, 0.1, 1.0), survey(depth + 0.01, 0.1, 2.0)], 0.1, NOW_S)
    assert model.known.sum() == 1
    assert np.isfinite(model.depth_m).sum() == np.isfinite(model.sd_m).sum() == 1
    assert not fuse_surveys(GRID, [], 0.1, NOW_S).known.any()


def test_a_dredged_pit_is_as_deep_as_the_newer_survey_says() -> None:
    dredged = np.full((3, 4), 10.0)
    dredged[1, 1:3] = 12.0
    model = fuse_surveys(GRID, [survey(10.0, 0.1, 1.0), survey(dredged, 0.2, 2.0)], 0.0, NOW_S)
    np.testing.assert_allclose(model.depth_m[1, 1:3], 12.0)
    np.testing.assert_allclose(model.sd_m[1, 1:3], 0.2)
    assert model.surveys.tolist() == [[2, 2, 2, 2], [2, 1, 1, 2], [2, 2, 2, 2]]


@given(seen(), st.integers(0, 11), st.sampled_from([0.0, 0.1]))
def test_a_survey_that_is_taken_away_leaves_no_trace(surveys: list[Survey], cell: int, yearly_m: float) -> None:
    row, col = divmod(cell, GRID.cols)
    without = fuse_surveys(GRID, surveys[1:], yearly_m, NOW_S)
    depth = surveys[0].depth_m.copy()
    depth[row, col] = np.nan
    there = fuse_surveys(GRID, [replace(surveys[0], depth_m=depth), *surveys[1:]], yearly_m, NOW_S)
    assert there.depth_m[row, col] == pytest.approx(without.depth_m[row, col], nan_ok=True)
    assert there.sd_m[row, col] == pytest.approx(without.sd_m[row, col], nan_ok=True)


def test_older_surveys_are_less_certain_by_the_square_root_of_their_age() -> None:
    for years in (0.0, 1.0, 4.0):
        model = fuse_surveys(GRID, [survey(10.0, 0.3, 40.0 - years)], 0.2, NOW_S)
        np.testing.assert_allclose(model.sd_m, math.hypot(0.3, 0.2 * math.sqrt(years)))


def test_a_survey_on_another_grid_is_refused() -> None:
    other = replace(survey(1.0, 0.1, 0.0), grid=replace(GRID, cell_m=2.0))
    with pytest.raises(ValueError, match="resample it first"):
        fuse_surveys(GRID, [other], 0.0, NOW_S)


def test_a_survey_out_of_turn_is_refused() -> None:
    fusion = SiteFusion(GRID, 0.0)
    fusion.add(survey(1.0, 0.1, 2.0))
    with pytest.raises(ValueError, match="older ones first"):
        fusion.add(survey(1.0, 0.1, 1.0))


def test_each_survey_tells_how_much_of_what_was_known_it_found_changed() -> None:
    fusion = SiteFusion(GRID, 0.0)
    assert math.isnan(fusion.add(survey(10.0, 0.1, 1.0)))
    depth = np.full((3, 4), 10.1)
    depth[0, :3], depth[2, 1:] = 11.0, np.nan
    assert fusion.add(survey(depth, 0.1, 2.0)) == pytest.approx(3 / 9)
