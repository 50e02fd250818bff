import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.estimation.depth_least_squares import fit_depth


def kalman(
    prior: float, variance: float, position: FloatArray, xy: FloatArray, y: float, noise: float
) -> tuple[float, float]:
    """One range, one landmark, written out: an iterated extended Kalman filter with a scalar state."""
    h2 = float(((xy - position[:2]) ** 2).sum())
    z = prior
    for _ in range(3):
        drop = z - position[2]
        r = np.sqrt(h2 + drop * drop)
        slope = drop / r
        gain = variance * slope / (slope * variance * slope + (noise * r) ** 2)
        z = prior + gain * (y - r - slope * (prior - z))
    return z, 1.0 / (1.0 / variance + (slope / (noise * r)) ** 2)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_agrees_with_an_iterated_kalman_filter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = np.array([*rng.uniform(-0.15, 0.15, 2), rng.uniform(0.55, 0.7)])
    depth, variance = np.nan, np.inf
    for k in range(6):
        position = np.array([*rng.uniform(-0.1, 0.1, 2), 0.3])
        y = float(np.linalg.norm(truth - position)) * (1.0 + 0.1 * rng.standard_normal())
        h2 = float(((truth - position)[:2] ** 2).sum())
        after = fit_depth(depth, variance, h2, 0.3, y, 0.1)
        if k > 0:
            z, expected = kalman(depth, variance, position, truth[:2], y, 0.1)
            assert after[0] == pytest.approx(z, abs=1e-3)
            assert after[1] == pytest.approx(expected, rel=0.02)
        depth, variance = after
