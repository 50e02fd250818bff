"""What thorough maps take, in pieces that can be done anywhere."""

import pickle

import numpy as np

from app.mapping.gaussian_process.gp import GaussianProcessMap
from app.mapping.gaussian_process.surveys import judged, mapped
from app.mapping.types import Grid, Soundings

GRID = Grid(0.0, 0.0, 2.0, 15, 15)
EVERYWHERE = np.ones((15, 15), dtype=bool)


def rows(count: int = 150) -> np.ndarray:
    east, north = np.random.default_rng(4).uniform(0.0, 30.0, (2, count))
    return np.column_stack([east, north, 6.0 + 0.1 * east + np.sin(north / 4.0), np.full(count, 0.05)])


def test_what_was_learned_predicts_the_same_without_the_soundings() -> None:
    fitted = GaussianProcessMap(reject_outliers=False).fit(Soundings.of_rows(rows()))
    bare = fitted.learned()
    assert len(pickle.dumps(bare)) < 5000
    expected = fitted.fit(Soundings.of_rows(rows()), learn=False).predict(GRID, EVERYWHERE)
    found, model = mapped(rows(), np.ones(150, dtype=bool), bare, GRID, EVERYWHERE)
    np.testing.assert_array_equal(found.depth_m, expected.depth_m)
    np.testing.assert_array_equal(found.claim_sd_m, expected.claim_sd_m)
    assert model.hyperparameters_ == fitted.hyperparameters_


def test_outliers_are_named_by_number_but_for_those_that_are_trusted() -> None:
    wrong = rows()
    wrong[[20, 70], 2] -= 4.0
    trusted = np.zeros(len(wrong), dtype=bool)
    model = GaussianProcessMap(reject_outliers=False)
    assert sorted(judged(wrong, trusted, model)[1]) == [20, 70]
    trusted[70] = True
    learned, reasons, made = judged(wrong, trusted, model, GRID, EVERYWHERE)
    assert list(reasons) == [20]
    assert reasons[20]
    assert made is not None
    assert judged(wrong, trusted, model)[2] is None
    assert not hasattr(model, "hyperparameters_")
    assert hasattr(learned, "hyperparameters_")
