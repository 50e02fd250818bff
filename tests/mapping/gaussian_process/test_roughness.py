"""Cross-validation across holes against a plain search, and the smoothing of its scores."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from app.mapping.gaussian_process.roughness import HoleErrors, hole_errors, local_ratio, neighbours_beyond
from app.mapping.kriging.kernels import KERNEL_CODES
from app.mapping.kriging.scales import uniform_scales


@settings(deadline=None)
@given(seed=st.integers(0, 200), radius=st.floats(0.0, 12.0), k=st.integers(1, 30))
def test_neighbours_beyond_a_radius_are_the_nearest_ones_there(seed: int, radius: float, k: int) -> None:
    points = np.random.default_rng(seed).uniform(0, 10, (60, 2))
    rows = np.array([0, 7, 59])
    found = neighbours_beyond(cKDTree(points), rows, radius, k)
    for row, near in zip(rows, found, strict=True):
        distance = np.linalg.norm(points - points[row], axis=1)
        expected = [i for i in np.argsort(distance) if distance[i] >= radius][:k]
        np.testing.assert_array_equal(near[near >= 0], expected)


def test_scores_are_about_one_when_the_model_holds() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 60, (500, 2))
    r = np.sqrt(3) * np.linalg.norm(points[:, None] - points[None], axis=-1) / 8.0
    covariance = (1 + r) * np.exp(-r) + 0.05**2 * np.eye(500)
    residual = np.linalg.cholesky(covariance) @ rng.standard_normal(500)
    errors = hole_errors(
        KERNEL_CODES["matern32"],
        cKDTree(points),
        residual,
        np.full(500, 0.05**2),
        uniform_scales(500).scaled_metric(8.0),
        np.ones(500),
        np.arange(500),
        4.0,
    )
    assert errors.score.mean() == pytest.approx(1.0, abs=0.25)


def test_noise_hides_relief() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 60, (200, 2))
    quiet, loud = (
        hole_errors(
            0,
            cKDTree(points),
            rng.standard_normal(200),
            np.full(200, v),
            uniform_scales(200).scaled_metric(8.0),
            np.ones(200),
            np.arange(200),
            4.0,
        )
        for v in (1e-4, 100.0)
    )
    assert loud.weight.max() < 0.01 < 0.9 < quiet.weight.min()


def test_ratio_follows_the_scores_nearby_and_returns_to_one_far_away() -> None:
    points = np.random.default_rng(0).uniform(0, 100, (600, 2))
    score = np.where(points[:, 0] < 50, 0.2, 1.8)
    errors = HoleErrors(points, score, np.ones(600))
    ratio = local_ratio(errors, np.array([[10.0, 50.0], [90.0, 50.0], [900.0, 50.0]]), reach_m=10.0)
    assert ratio[0] < 0.6
    assert ratio[1] > 1.4
    assert ratio[2] == pytest.approx(1.0, abs=1e-6)


def test_without_errors_every_place_is_ordinary() -> None:
    none = HoleErrors(np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    np.testing.assert_array_equal(local_ratio(none, np.zeros((3, 2)), 5.0), 1.0)
