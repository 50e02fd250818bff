from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from app.arrays import FloatArray
from app.estimation import CooperativeLocalizer, Fading
from app.estimation.localization import TeamPosition, radius

START = np.array([[0.0, 0.0, 0.5], [0.3, 0.0, 0.5], [0.0, 0.3, 0.4]])


def dive(seed: int, steps: int, fading: Any, *, ranges: bool = False, surface: Any = None) -> Iterator[Any]:
    """Three vehicles wander as their own dead reckoning says; yields the truth and what the filter says."""
    rng = np.random.default_rng(seed)
    localizer = CooperativeLocalizer(fading)
    truth, drift = START.copy(), fading.drift * rng.standard_normal((3, 2))
    truth[:, :2] += fading.fix_sd_m * rng.standard_normal((3, 2))
    team = localizer.begin(START)
    for step in range(steps):
        legs = rng.standard_normal((3, 3))
        legs *= 0.05 / np.linalg.norm(legs, axis=1, keepdims=True)
        truth = truth + legs
        truth[:, :2] += 0.05 * drift
        kept = fading.kept(np.full((3, 1), 0.05))
        drift = kept * drift + np.sqrt(1.0 - kept**2) * fading.drift * rng.standard_normal((3, 2))
        team = localizer.move(team, legs)
        if surface is not None and step % surface == surface - 1:
            team = localizer.fix(team, 0, truth[0, :2] + fading.fix_sd_m * rng.standard_normal(2))
        if ranges:
            for i, j in ((0, 1), (0, 2), (1, 2)):
                r = np.linalg.norm(truth[i] - truth[j]) * (1.0 + fading.range_noise * rng.standard_normal())
                team = localizer.meet(team, i, j, r)
        yield truth, team


def nees(truth: FloatArray, team: TeamPosition) -> float:
    error = (truth - team.positions_m)[:, :2].ravel()
    at = np.array([[4 * i, 4 * i + 1] for i in range(3)]).ravel()
    return float(error @ np.linalg.solve(team.covariance[np.ix_(at, at)], error))


@pytest.mark.parametrize("how", [{}, {"ranges": True}, {"ranges": True, "surface": 20}], ids=["alone", "ranges", "gps"])
def test_errors_are_as_large_as_the_filter_says(how: dict[str, Any]) -> None:
    runs = 100
    values = [nees(*list(dive(seed, 40, Fading(), **how))[-1]) for seed in range(runs)]
    low, high = chi2.ppf(np.array([0.025, 0.975]), 6 * runs) / runs
    assert low < np.mean(values) < high


def test_the_error_grows_in_proportion_to_the_distance_while_the_drift_lasts() -> None:
    fading = Fading(memory_m=np.inf, fix_sd_m=1e-9)
    sd = [team.sd_m[0] for _, team in dive(0, 40, fading)]
    np.testing.assert_allclose(sd, fading.drift * 0.05 * np.arange(1, 41), rtol=1e-5)


def test_what_is_foretold_is_what_comes() -> None:
    fading = Fading()
    localizer = CooperativeLocalizer(fading)
    team = localizer.begin(START)
    for _ in range(40):
        team = localizer.move(team, np.tile([0.05, 0.0, 0.0], (3, 1)))
    told = localizer.foretold_sd_m(team, 1.0)
    for _ in range(20):
        team = localizer.move(team, np.tile([0.0, 0.05, 0.0], (3, 1)))
    np.testing.assert_allclose(told, team.sd_m, rtol=0.05)


def test_a_fix_of_one_helps_those_that_range_to_it_and_nobody_else() -> None:
    alone = list(dive(1, 60, Fading()))[-1][1]
    together = list(dive(1, 60, Fading(), ranges=True))[-1][1]
    localizer = CooperativeLocalizer()
    fixed_alone = localizer.fix(alone, 0, alone.positions_m[0, :2])
    fixed_together = localizer.fix(together, 0, together.positions_m[0, :2])
    assert fixed_alone.sd_m[0] < 0.0021
    np.testing.assert_allclose(fixed_alone.sd_m[1:], alone.sd_m[1:])
    assert (fixed_together.sd_m[1:] < 0.8 * together.sd_m[1:]).all()


def test_a_joint_update_is_that_of_a_slow_reference() -> None:
    """Information form, with the filter's own linearisation."""
    localizer = CooperativeLocalizer(Fading(range_noise=0.02))
    team = list(dive(3, 30, Fading()))[-1][1]
    team = replace(team, covariance=team.covariance + 1e-10 * np.eye(12))
    d = team.positions_m[0] - team.positions_m[1]
    r = np.linalg.norm(d)
    after = localizer.meet(team, 0, 1, float(r) + 0.01)
    H = np.zeros(12)
    H[[0, 1, 4, 5]] = [*d[:2] / r, *-d[:2] / r]
    information = np.linalg.inv(team.covariance) + np.outer(H, H) / (0.02 * r) ** 2
    np.testing.assert_allclose(after.covariance, np.linalg.inv(information), rtol=0.02, atol=1e-9)


def test_the_radius_holds_95_per_cent() -> None:
    drawn = np.linalg.norm(np.random.default_rng(0).standard_normal((100_000, 2)), axis=1)
    assert np.mean(drawn < radius(np.array(1.0), 0.95)) == pytest.approx(0.95, abs=0.005)
