from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.estimation import Attitude, Dvl, Multibeam

LEVEL = Attitude()
angles = st.floats(-0.3, 0.3)


def flat(depth: float) -> Callable[..., Any]:
    return lambda xy: np.full(xy.shape[:-1], depth)


def slope(xy: FloatArray) -> FloatArray:
    """Deepens by 0.2 per metre to the east."""
    return 20.0 + 0.2 * xy[..., 0]


def test_level_dvl_beams_point_to_the_four_sides() -> None:
    echoes = Dvl(relative_noise=0.0).sound(np.array([5.0, 7.0, 10.0]), LEVEL, flat(20.0), 0.5, np.random.default_rng(0))
    aside = 10.0 * np.tan(np.radians(22.5))
    np.testing.assert_allclose(echoes.east_m - 5.0, [0.0, aside, 0.0, -aside], atol=1e-4)
    np.testing.assert_allclose(echoes.north_m - 7.0, [aside, 0.0, -aside, 0.0], atol=1e-4)
    np.testing.assert_allclose(echoes.depth_m, 20.0, atol=1e-4)


def test_a_swath_lies_across_the_heading() -> None:
    sonar = Multibeam(relative_noise=0.0, count=31)
    east = Attitude(heading_rad=np.pi / 2)
    echoes = sonar.sound(np.array([0.0, 0.0, 0.0]), east, flat(10.0), 0.5, np.random.default_rng(0))
    np.testing.assert_allclose(echoes.east_m, 0.0, atol=1e-4)
    half = 10.0 * np.tan(np.radians(60.0))
    np.testing.assert_allclose(echoes.north_m[[0, 15, -1]], [half, 0.0, -half], atol=1e-3)
    assert (np.diff(echoes.north_m) < 0.0).all()


def test_nose_up_looks_ahead_and_starboard_down_looks_to_port() -> None:
    def footprint(attitude: Any) -> Any:
        sonar = Multibeam(relative_noise=0.0, count=1)
        echoes = sonar.sound(np.zeros(3), attitude, flat(10.0), 0.5, np.random.default_rng(0))
        return echoes.east_m[0], echoes.north_m[0]

    shift = 10.0 * np.tan(0.1)
    assert footprint(Attitude(pitch_rad=0.1)) == pytest.approx((0.0, shift), abs=1e-3)
    assert footprint(Attitude(roll_rad=0.1)) == pytest.approx((-shift, 0.0), abs=1e-3)
    assert footprint(Attitude(np.pi / 2, 0.1)) == pytest.approx((shift, 0.0), abs=1e-3)


@given(heading=st.floats(0.0, 2 * np.pi), pitch=angles, roll=angles)
def test_beams_end_on_the_sea_floor_whatever_the_attitude(heading: float, pitch: float, roll: float) -> None:
    attitude = Attitude(heading, pitch, roll)
    np.testing.assert_allclose(attitude.rotation @ attitude.rotation.T, np.eye(3), atol=1e-12)
    position = np.array([3.0, -2.0, 5.0])
    echoes = Dvl(relative_noise=0.0).sound(position, attitude, slope, 1.0, np.random.default_rng(0))
    xy = np.column_stack([echoes.east_m, echoes.north_m])
    np.testing.assert_allclose(echoes.depth_m, slope(xy), atol=1e-4)
    # Independent of any marching: the plane 20 + 0.2 east = depth, along each beam.
    directions = Dvl().beams @ attitude.rotation.T
    exact = (20.0 + 0.2 * position[0] - position[2]) / (directions[:, 2] - 0.2 * directions[:, 0])
    np.testing.assert_allclose(Dvl().ranges(position, attitude, slope, 1.0), exact, atol=1e-4)


def test_no_echo_from_too_far_away_or_from_unknown_ground() -> None:
    def half_known(xy: FloatArray) -> Any:
        return np.where(xy[..., 0] < 0.0, 10.0, np.nan)

    echoes = Dvl().sound(np.zeros(3), LEVEL, half_known, 0.5, np.random.default_rng(0))
    assert 3 in echoes.beam
    assert 1 not in echoes.beam
    assert np.isnan(Dvl(max_range_m=9.0).ranges(np.zeros(3), LEVEL, flat(10.0), 0.5)).all()


def test_a_ridge_hides_what_lies_behind_it() -> None:
    def ridge(xy: FloatArray) -> Any:
        return np.where(np.abs(xy[..., 0] - 5.0) < 0.5, 4.0, 10.0)

    ranges = Multibeam(relative_noise=0.0, count=3, swath_rad=2 * np.arctan(0.9)).ranges(np.zeros(3), LEVEL, ridge, 0.2)
    assert ranges[1] == pytest.approx(10.0, abs=1e-3)
    assert ranges[0] == pytest.approx(10.0 * np.hypot(1.0, 0.9), abs=1e-3)
    assert ranges[2] < 8.0


def test_the_stated_deviation_is_that_of_the_soundings() -> None:
    rng = np.random.default_rng(2)
    sonar = Multibeam(relative_noise=0.02, count=11)
    pings = [sonar.sound(np.zeros(3), LEVEL, flat(10.0), 0.5, rng) for _ in range(2000)]
    depth = np.array([p.depth_m for p in pings])
    np.testing.assert_allclose(depth.std(axis=0), np.mean([p.sd_m for p in pings], axis=0), rtol=0.08)


def test_beams_meet_landmarks_in_their_cone_and_range_only() -> None:
    sonar = Multibeam(count=3, swath_rad=np.radians(60.0), beam_width_rad=np.radians(4.0), max_range_m=12.0)
    down, aside = [0.0, 0.0, 10.0], [10.0 * np.tan(np.radians(31.0)), 0.0, 10.0]
    landmarks = np.array([down, aside, [3.0, 0.0, 10.0], [0.0, 1.0, 10.0], [0.0, 0.0, 12.5], [0.0, 0.0, np.nan]])
    assert sonar.meets(np.zeros(3), LEVEL, landmarks).tolist() == [True, True, False, False, False, False]
    turned = Attitude(heading_rad=np.pi / 2)
    assert sonar.meets(np.zeros(3), turned, landmarks).tolist() == [True, False, False, False, False, False]
