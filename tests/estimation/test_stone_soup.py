"""Our filter beside Stone Soup's, an independent implementation, where both models are the same.

They are the same for noise of a fixed size and while the second order of a range does not matter: at distances that are
large beside the target's deviation.
"""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from app.estimation.range_filter import update_by_range
from app.estimation.targets import TargetEstimator, TargetTrack

stonesoup = pytest.importorskip("stonesoup", reason="pip install stonesoup, which the extra 'dev' does")

ACCELERATION, NOISE_M = 0.02, 2.0
START = np.array([120.0, -80.0, 30.0, 0.4, 0.1, 0.0])
PRIOR = np.diag([25.0, 25.0, 25.0, 0.04, 0.04, 0.04])
BUOYS = np.array([[-3000.0, -1500.0, 0.0], [4000.0, 200.0, 5.0], [300.0, 3800.0, 10.0], [900.0, 700.0, 2500.0]])


def test_the_filter_agrees_with_stone_soups_step_by_step() -> None:
    from stonesoup.models.measurement.nonlinear import CartesianToElevationBearingRange
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.array import CovarianceMatrix, StateVector
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    ours = TargetEstimator(acceleration_sd=ACCELERATION)
    track = TargetTrack(START[None], PRIOR[None], np.ones(1))
    F = np.eye(6)
    F[:3, 3:] = np.eye(3)
    Q = ours.process_noise()
    begin = datetime(2026, 1, 1, tzinfo=UTC)
    predictor = KalmanPredictor(
        LinearGaussianTimeInvariantTransitionModel(transition_matrix=F, covariance_matrix=CovarianceMatrix(Q))
    )
    updater = ExtendedKalmanUpdater(None)
    theirs = GaussianState(StateVector(START), CovarianceMatrix(PRIOR), timestamp=begin)
    rng = np.random.default_rng(3)
    truth = START + np.array([4.0, -3.0, 2.0, 0.1, 0.05, 0.0])
    for step in range(1, 21):
        truth = F @ truth
        when = begin + timedelta(seconds=step)
        track = ours.predict(track)
        mean, covariance = track.means[0].copy(), track.covariances[0].copy()
        theirs = predictor.predict(theirs, timestamp=when)
        for buoy in BUOYS:
            y = float(np.linalg.norm(truth[:3] - buoy) + NOISE_M * rng.standard_normal())
            # Angles whose noise is immense tell nothing: what is left of the model is the range.
            model = CartesianToElevationBearingRange(
                ndim_state=6,
                mapping=(0, 1, 2),
                noise_covar=CovarianceMatrix(np.diag([1e9, 1e9, NOISE_M**2])),
                translation_offset=StateVector(buoy),
            )
            angles = model.function(theirs, noise=False)
            measured = StateVector([angles[0, 0], angles[1, 0], y])
            detection = Detection(measured, timestamp=when, measurement_model=model)
            theirs = updater.update(SingleHypothesis(theirs, detection))
            update_by_range(mean, covariance, buoy, y, 0.0, np.full(3, NOISE_M**2))
        track = TargetTrack(mean[None], covariance[None], np.ones(1))
        np.testing.assert_allclose(mean, np.ravel(theirs.state_vector).astype(float), rtol=0, atol=0.02)
        np.testing.assert_allclose(covariance, theirs.covar, rtol=2e-3, atol=2e-3)
    assert np.linalg.norm(mean[:3] - truth[:3]) < 3.0
