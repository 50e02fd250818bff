"""The restricted likelihood and the nonstationary kernel against plain formulas."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime
from scipy.spatial import cKDTree
from scipy.stats import multivariate_normal

from app.arrays import FloatArray
from app.mapping.kriging.kernels import KERNEL_CODES, KernelName, paciorek
from app.mapping.kriging.likelihood import (
    LN_AMPLITUDE_SD,
    LN_LENGTH_SD,
    LN_NOISE_SCALE_SD,
    SLOPE_SD,
    RestrictedLikelihood,
    spread_subset,
)
from app.mapping.kriging.scales import LocalScales, local_scales, uniform_scales

RNG = np.random.default_rng(0)
POINTS = RNG.uniform(0, 30, (40, 2))
DEPTH = 8 + np.sin(POINTS[:, 0] / 4) + 0.1 * RNG.standard_normal(40)
NOISE = np.full(40, 0.01)
SCALES = local_scales(RNG.uniform(0.3, 3, 40), RNG.uniform(-0.4, 0.4, (2, 40)))


def plain_paciorek(d: FloatArray, a: FloatArray, b: FloatArray) -> float:
    """The published formula with matrices and determinants, Matern 3/2."""
    A, B = np.array([[a[0], a[1]], [a[1], a[2]]]), np.array([[b[0], b[1]], [b[1], b[2]]])
    M = (A + B) / 2
    t = np.sqrt(3 * d @ np.linalg.inv(M) @ d)
    det = np.linalg.det
    return float(det(A) ** 0.25 * det(B) ** 0.25 / det(M) ** 0.5 * (1 + t) * np.exp(-t))


@settings(deadline=None)  # the first call compiles
@given(st.integers(0, 39), st.integers(0, 39))
def test_paciorek_kernel_is_the_published_formula(i: int, j: int) -> None:
    d = POINTS[i] - POINTS[j]
    a, b = SCALES.scaled_metric(6.0)[[i, j]]
    assert paciorek(KERNEL_CODES["matern32"], d[0], d[1], a, b) == pytest.approx(plain_paciorek(d, a, b), rel=1e-9)


def test_length_matrices_have_the_stated_determinant() -> None:
    xx, xy, yy, fourth_root = SCALES.metric.T
    np.testing.assert_allclose((xx * yy - xy**2) ** 0.25, fourth_root, rtol=1e-9)


def likelihood(kernel: KernelName, scales: LocalScales) -> RestrictedLikelihood:
    return RestrictedLikelihood(kernel, POINTS, DEPTH, NOISE, scales)


@pytest.mark.parametrize("kernel", list(KERNEL_CODES))
@pytest.mark.parametrize("scales", [uniform_scales(40), SCALES], ids=["stationary", "nonstationary"])
def test_gradient_is_the_derivative(kernel: KernelName, scales: LocalScales) -> None:
    function = likelihood(kernel, scales)
    theta = function.prior_mean + np.array([-0.3, 0.2, 0.4])
    _, gradient = function.value_and_gradient(theta)

    def value(theta: FloatArray) -> float:
        return float(function.value_and_gradient(theta)[0])

    numeric = approx_fprime(theta, value, 1e-6)
    np.testing.assert_allclose(gradient, numeric, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("scales", [uniform_scales(40), SCALES], ids=["stationary", "nonstationary"])
def test_value_is_the_density_with_the_plane_in_the_covariance(scales: LocalScales) -> None:
    """A flat intercept is the limit of a vague one, up to a constant that differences do not see."""
    function = likelihood("matern32", scales)
    centred = POINTS - POINTS.mean(axis=0)
    plane = 1e6 + SLOPE_SD**2 * centred @ centred.T

    def plain(theta: FloatArray) -> float:
        metric = scales.scaled_metric(np.exp(theta[0]))
        k = np.array(
            [[plain_paciorek(POINTS[i] - POINTS[j], metric[i], metric[j]) for j in range(40)] for i in range(40)]
        )
        k *= np.exp(2 * theta[1]) * np.outer(scales.amplitude, scales.amplitude)
        total = k + np.exp(theta[2]) * np.diag(NOISE) + plane
        z = (theta - function.prior_mean) / [LN_LENGTH_SD, LN_AMPLITUDE_SD, LN_NOISE_SCALE_SD]
        return float(-multivariate_normal.logpdf(DEPTH - DEPTH.mean(), cov=total) + 0.5 * z @ z)

    a, b = function.prior_mean, function.prior_mean + np.array([-0.4, 0.3, 0.5])
    ours = function.value_and_gradient(b)[0] - function.value_and_gradient(a)[0]
    assert ours == pytest.approx(plain(b) - plain(a), abs=1e-3)


def test_known_hyperparameters_are_found_again() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(0, 60, (350, 2))
    r = np.sqrt(3) * np.linalg.norm(points[:, None] - points[None], axis=-1) / 7.0
    covariance = 1.5**2 * (1 + r) * np.exp(-r) + 0.1**2 * np.eye(350)
    depth = 10 + np.linalg.cholesky(covariance) @ rng.standard_normal(350)
    found, _ = RestrictedLikelihood("matern32", points, depth, np.full(350, 0.01), uniform_scales(350)).maximise(None)
    assert found.length_m == pytest.approx(7.0, rel=0.35)
    assert found.amplitude_m == pytest.approx(1.5, rel=0.35)
    assert found.noise_scale == pytest.approx(1.0, rel=0.5)


@given(n=st.integers(1, 400), size=st.integers(3, 60))
def test_a_subset_is_bounded_and_without_repetition(n: int, size: int) -> None:
    rows = spread_subset(cKDTree(np.random.default_rng(n).uniform(0, 1, (n, 2))), size)
    assert len(rows) <= size
    assert len(set(rows.tolist())) == len(rows)
    assert len(rows) >= min(n, size // 2)
