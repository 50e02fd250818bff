import numpy as np
import pytest

from app.arrays import FloatArray
from app.estimation import Attitude, Dvl, LandmarkEstimator, Landmarks, Multibeam, RangeSensor, SensorTeam

NAMES = ("a", "b", "c")
POSITIONS = np.array([[0.0, 0.0, 0.3], [0.1, 0.0, 0.3], [0.1, 0.1, 0.35]])
ATTITUDES = (Attitude(), Attitude(heading_rad=1.0), Attitude(heading_rad=2.0))
TEAM = SensorTeam(
    {
        "a": RangeSensor(0.4, 0.1),
        "b": Multibeam(0.02, 0.5, np.radians(20.0), count=9),
        "c": Dvl(0.05, 0.5, np.radians(25.0)),
    }
)


def landmarks(n: int = 60) -> FloatArray:
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(-0.2, 0.3, (n, 2)), rng.uniform(0.5, 0.6, n)])


def test_each_vehicle_sees_what_its_own_sensor_sees() -> None:
    truth = landmarks()
    visible_by = TEAM.visible(NAMES, POSITIONS, ATTITUDES, truth)
    assert visible_by.shape == (3, 60)
    np.testing.assert_array_equal(visible_by[0], np.linalg.norm(truth - POSITIONS[0], axis=1) < 0.4)
    assert 0 < visible_by[2].sum() < visible_by[0].sum()
    np.testing.assert_array_equal(visible_by[1], TEAM.sensors["b"].meets(POSITIONS[1], ATTITUDES[1], truth))


def test_ranges_weigh_by_the_noise_of_the_sensor_that_took_them() -> None:
    truth = np.array([[0.1, 0.0, 0.5]])
    team = SensorTeam({"a": RangeSensor(0.4, 0.1), "b": Multibeam(0.02, 0.5, count=1)})
    known = Landmarks.unknown(truth[:, :2])
    at = np.array([[0.1, 0.0, 0.3], [0.1, 0.0, 0.3]])
    rng = np.random.default_rng(1)
    sd = {}
    for name in ("a", "b"):
        alone = team.look(known, truth, (name,), at[:1], ATTITUDES[:1], LandmarkEstimator(), rng)
        sd[name] = np.sqrt(alone.variance_m2[0])
    assert sd["a"] == pytest.approx(0.1 * 0.2, rel=0.4)
    assert sd["b"] == pytest.approx(0.02 * 0.2, rel=0.2)
    both = team.look(known, truth, ("a", "b"), at, ATTITUDES[:2], LandmarkEstimator(), rng)
    assert both.variance_m2[0] < sd["b"] ** 2
    assert both.credited[0] in (0, 1)


class Noiseless(np.random.Generator):
    """A generator without any error, so that the order of draws cannot matter."""

    def __init__(self) -> None:
        super().__init__(np.random.PCG64())

    def standard_normal(self, n: int) -> FloatArray:  # type: ignore[override]
        return np.zeros(n)


def test_the_order_of_vehicles_hardly_changes_what_their_ranges_say() -> None:
    truth = landmarks()
    known = Landmarks.unknown(truth[:, :2])
    estimator = LandmarkEstimator()
    order = [2, 0, 1]
    straight = TEAM.look(known, truth, NAMES, POSITIONS, ATTITUDES, estimator, Noiseless())
    names, attitudes = [NAMES[k] for k in order], [ATTITUDES[k] for k in order]
    mixed = TEAM.look(known, truth, names, POSITIONS[order], attitudes, estimator, Noiseless())
    seen, one, other = straight.seen, straight.grids, mixed.grids
    # Grids narrow at other looks, and what neighbours know at the time may count another depth as possible.
    apart = np.abs(one.own_depth_m - other.own_depth_m)[seen] / np.sqrt(one.own_variance_m2[seen])
    ratio = one.own_variance_m2[seen] / other.own_variance_m2[seen]
    assert np.median(apart) < 0.01
    assert apart.max() < 0.2
    assert np.median(np.abs(np.log(ratio))) < 0.02
    np.testing.assert_array_equal(straight.looks, mixed.looks)
