"""The compiled predictions against every landmark looked at for every candidate."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.exploration.cao.regressors import landmark_predictions
from app.exploration.cao.regressors.landmark_predictions import Listed, predict, within_reach

VISIBILITY, NOISE, STEP = 0.4, 0.1, 0.05


def slow(candidates: FloatArray, points: FloatArray, needed: Any, goals: Any) -> Any:
    out = []
    for team in candidates:
        information = np.zeros(len(points))
        left = 0.0
        for i, x in enumerate(team):
            r2 = ((points - x) ** 2).sum(axis=1)
            slope2 = (points[:, 2] - x[2]) ** 2 / r2
            information += np.where(r2 < VISIBILITY**2, slope2 / (NOISE**2 * r2), 0.0)
            left += np.sqrt((((points if goals is None else goals[i : i + 1]) - x) ** 2).sum(axis=1).min()) / STEP
        share = information / needed
        out.append([np.minimum(share, 1.0).sum(), (share >= 1.0).sum(), -left])
    return np.array(out)


@given(seed=st.integers(0, 10_000), vehicles=st.integers(1, 4), landmarks=st.integers(1, 300), far=st.booleans())
@settings(max_examples=60, deadline=None)
def test_short_lists_change_nothing(seed: int, vehicles: Any, landmarks: FloatArray, far: Any) -> None:
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-1, 1, (landmarks, 2)), rng.uniform(0.4, 1.0, landmarks)])
    now = np.column_stack([rng.uniform(-1, 1, (vehicles, 2)) + 3.0 * far, rng.uniform(0.0, 0.35, vehicles)])
    candidates = now + rng.uniform(-0.03, 0.03, (20, vehicles, 3))
    needed = rng.uniform(100.0, 3000.0, landmarks)
    reach = np.linalg.norm(candidates - now, axis=2).max(axis=0)
    starts, index = within_reach(now, points, reach, VISIBILITY)
    listed = Listed(points[index], index, starts, needed)
    for goals in (None, rng.uniform(-1, 1, (vehicles, 3))):
        result = predict(now, candidates, listed, goals, VISIBILITY, NOISE, STEP)
        np.testing.assert_allclose(result, slow(candidates, points, needed, goals), rtol=1e-4, atol=1e-4)


def test_threads_that_share_the_candidates_return_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-1, 1, (500, 2)), rng.uniform(0.4, 1.0, 500)])
    now = np.array([[0.0, 0.0, 0.2], [0.2, 0.0, 0.2]])
    candidates = now + rng.uniform(-0.03, 0.03, (101, 2, 3))
    starts, index = within_reach(now, points, np.full(2, 0.06), VISIBILITY)
    arguments = (candidates, Listed(points[index], index, starts, np.full(500, 900.0)), None, VISIBILITY, NOISE, STEP)
    alone = predict(now, *arguments)
    monkeypatch.setattr(landmark_predictions, "WORTH_SHARING", 0)
    np.testing.assert_array_equal(predict(now, *arguments), alone)
