"""The likelihood of single soundings given their neighbours, against the joint density."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import approx_fprime
from scipy.spatial import cKDTree
from scipy.stats import multivariate_normal

from app.arrays import FloatArray
from app.mapping.kriging.conditionals import RANKS, conditional_terms, families
from app.mapping.kriging.kernels import KERNEL_CODES, KernelName
from app.mapping.kriging.likelihood import RestrictedLikelihood, scaled_distances, spread_subset
from app.mapping.kriging.scales import local_scales, uniform_scales

RNG = np.random.default_rng(1)
POINTS = RNG.uniform(0, 30, (120, 2))
DEPTH = np.sin(POINTS[:, 0] / 4) + 0.1 * RNG.standard_normal(120)
NOISE = RNG.uniform(0.005, 0.02, 120)
SCALES = local_scales(RNG.uniform(0.3, 3, 120), RNG.uniform(-0.4, 0.4, (2, 120)))
THETA = np.array([1.6, -0.3, 0.4])


def terms(kernel: KernelName, theta: FloatArray) -> tuple[float, FloatArray]:
    members = families(cKDTree(POINTS), 30)
    assert members is not None
    distance, prefactor = scaled_distances(POINTS[members], SCALES.metric[members])
    return conditional_terms(KERNEL_CODES[kernel], distance, prefactor, NOISE[members], DEPTH[members], theta)


def test_nobody_is_at_no_distance() -> None:
    distance, prefactor = scaled_distances(np.zeros((0, 2)), np.zeros((0, 4)))
    assert distance.shape == prefactor.shape == (0, 0)


def test_each_term_is_the_joint_density_over_that_of_the_neighbours() -> None:
    """By Bayes: log p(first | others) = log p(all) - log p(others), for the Matern 3/2 kernel."""
    chosen = families(cKDTree(POINTS), 30)
    assert chosen is not None
    plain = 0.0
    for members in chosen:
        distance, prefactor = scaled_distances(POINTS[members], SCALES.metric[members])
        t = np.sqrt(3) * distance / np.exp(THETA[0])
        k = np.exp(2 * THETA[1]) * prefactor * (1 + t) * np.exp(-t) + np.exp(THETA[2]) * np.diag(NOISE[members])
        y = DEPTH[members]
        plain -= multivariate_normal.logpdf(y, cov=k) - multivariate_normal.logpdf(y[1:], cov=k[1:, 1:])
    assert terms("matern32", THETA)[0] == pytest.approx(plain, rel=1e-6)


@pytest.mark.parametrize("kernel", list(KERNEL_CODES))
def test_gradient_is_the_derivative(kernel: KernelName) -> None:
    _, gradient = terms(kernel, THETA)

    def value(theta: FloatArray) -> float:
        return float(terms(kernel, theta)[0])

    numeric = approx_fprime(THETA, value, 1e-6)
    np.testing.assert_allclose(gradient, numeric, rtol=1e-3, atol=1e-3)


@given(n=st.integers(0, 200), count=st.integers(1, 60), twins=st.booleans())
def test_a_family_is_a_sounding_with_others_and_never_with_itself(n: int, count: int, *, twins: bool) -> None:
    points = np.random.default_rng(n).uniform(0, 1, (n, 2))
    if twins:
        points[n // 2 :] = points[: n - n // 2]
    chosen = families(cKDTree(points), count)
    if n <= 3:
        assert chosen is None
        return
    assert chosen is not None
    assert 1 <= len(chosen) <= count
    assert chosen.shape[1] == 1 + sum(rank < n for rank in RANKS)
    for members in chosen:
        assert len(set(members.tolist())) == len(members)


def test_close_soundings_tell_noise_from_fine_relief() -> None:
    """Survey lines, of which a spread subset holds hardly any close pairs."""
    rng = np.random.default_rng(5)
    east, north = (x.ravel() for x in np.meshgrid(np.arange(0, 60, 6.0), np.arange(0, 60, 0.5)))
    points = np.column_stack([east, north])
    r = np.sqrt(3) * np.linalg.norm(points[:, None] - points[None], axis=-1) / 4.0
    relief = np.linalg.cholesky((1 + r) * np.exp(-r) + 1e-9 * np.eye(len(r))) @ rng.standard_normal(len(r))
    depth = 10 + relief + 0.1 * rng.standard_normal(len(r))
    rows = spread_subset(cKDTree(points), 60)
    stated, scales = np.full(len(points), 0.01), uniform_scales(len(points))

    def alone() -> RestrictedLikelihood:
        return RestrictedLikelihood("matern32", points[rows], depth[rows], stated[rows], scales.take(rows))

    chosen = families(cKDTree(points), 300)
    assert chosen is not None
    without, _ = alone().maximise(None)
    found, _ = alone().also(chosen, points, depth, stated, scales).maximise(None)
    assert found.noise_scale == pytest.approx(1.0, rel=0.15)
    assert abs(np.log(found.noise_scale)) < abs(np.log(without.noise_scale))
    assert found.length_m == pytest.approx(4.0, rel=0.25)
