import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from simulator.floors import seafloors
from simulator.floors.terrain import Terrain
from simulator.sonars.frames import to_local_frame
from simulator.sonars.sensors import SensorKind, Sonar, SonarNoise, beams_of, cast_rays
from simulator.vehicles.vehicle import Motion

FLAT = seafloors.generate("flat", 0)
RUGGED = seafloors.generate("rugged", 0)
PERFECT = SonarNoise()


def plane(slope_east: float, slope_north: float, depth: float) -> Terrain:
    at = np.arange(200) + 0.5
    return Terrain(depth + slope_east * (at[None, :] - 100) + slope_north * (at[:, None] - 100), 1.0)


def slow_range(terrain: Terrain, origin: tuple[float, float, float], direction: FloatArray, limit: float) -> float:
    """March in steps of a centimetre."""
    for r in np.arange(0.0, limit, 0.01):
        e, n, d = (o + r * u for o, u in zip(origin, direction, strict=True))
        if d >= terrain.depth_at_point(e, n):
            return r
    return math.nan


@settings(max_examples=60, deadline=None)
@given(
    slopes=st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)),
    tilt=st.floats(0, math.radians(60)),
    azimuth=st.floats(0, 2 * math.pi),
)
def test_rays_meet_a_plane_where_geometry_says(slopes: tuple[float, float], tilt: float, azimuth: float) -> None:
    terrain = plane(slopes[0], slopes[1], 30.0)
    u = np.array([math.sin(tilt) * math.sin(azimuth), math.sin(tilt) * math.cos(azimuth), math.cos(tilt)])
    expected = 30.0 / (u[2] - slopes[0] * u[0] - slopes[1] * u[1]) * 0.9
    found = cast_rays(terrain, 100.0, 100.0, 3.0, u[None, :], 200.0)[0]
    assert found == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_rays_on_rugged_ground_agree_with_a_slow_march(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tilt, azimuth = rng.uniform(0, 1.2, 12), rng.uniform(0, 2 * math.pi, 12)
    u = np.column_stack([np.sin(tilt) * np.sin(azimuth), np.sin(tilt) * np.cos(azimuth), np.cos(tilt)])
    found = cast_rays(RUGGED, 50.0, 50.0, 1.0, u, 60.0)
    expected = [slow_range(RUGGED, (50.0, 50.0, 1.0), row, 60.0) for row in u]
    np.testing.assert_allclose(found, expected, atol=0.011)


def test_rays_that_meet_nothing_return_nothing() -> None:
    up_and_away = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = cast_rays(FLAT, 50.0, 50.0, 1.0, up_and_away, 10.0)
    assert np.isnan(found).all(), "surface, water, and a bottom out of range"


def test_rays_leave_unknown_floor_alone() -> None:
    z = np.full((50, 50), 10.0)
    z[:, 20:30] = np.nan
    terrain = Terrain(z, 1.0)
    down = np.array([[0.0, 0.0, 1.0]])
    assert np.isnan(cast_rays(terrain, 25.0, 25.0, 1.0, down, 50.0)[0])
    assert cast_rays(terrain, 10.0, 25.0, 1.0, down, 50.0)[0] == pytest.approx(9.0, abs=1e-3)


@pytest.mark.parametrize(
    ("beam", "heading_deg", "towards"),
    [(0, 0, "north"), (1, 0, "east"), (2, 0, "south"), (3, 0, "west"), (0, 90, "east"), (1, 90, "south")],
)
def test_dvl_beams_point_along_the_heading_and_at_right_angles(beam: int, heading_deg: int, towards: str) -> None:
    e, n, d = to_local_frame(beams_of(SensorKind.DVL).body, math.radians(heading_deg), 0.0, 0.0)[beam]
    side = {"north": (0, 1), "east": (1, 0), "south": (0, -1), "west": (-1, 0)}[towards]
    tilt = math.radians(22.5)
    assert (e, n) == pytest.approx((math.sin(tilt) * side[0], math.sin(tilt) * side[1]), abs=1e-12)
    assert d == pytest.approx(math.cos(tilt))


def test_pitching_up_lifts_the_bow_beam_and_rolling_to_starboard_lifts_the_port_beam() -> None:
    body = beams_of(SensorKind.DVL).body
    level, up, rolled = (to_local_frame(body, 0.3, pitch, roll) for pitch, roll in ((0, 0), (0.1, 0), (0, 0.1)))
    assert up[0, 2] < level[0, 2]
    assert up[2, 2] > level[2, 2]
    assert rolled[1, 2] > level[1, 2], "the keel swings to port and the starboard beam under the hull"
    assert rolled[3, 2] < level[3, 2]


@given(h=st.floats(-3, 3), p=st.floats(-1, 1), r=st.floats(-1, 1))
def test_turning_keeps_lengths_and_angles(h: Any, p: Any, r: Any) -> None:
    turned = to_local_frame(np.eye(3), h, p, r)
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("kind", [SensorKind.SINGLE, SensorKind.DVL])
def test_a_perfect_sonar_sees_the_floor(kind: SensorKind) -> None:
    sonar = Sonar(kind, PERFECT, np.random.default_rng(0))
    ranges = sonar.ping(FLAT, Motion(50.0, 50.0, 2.0, 0.7))
    expected = (FLAT.max_depth_m - 2.0) / np.cos(sonar.beams.tilt_rad)
    np.testing.assert_allclose(ranges, expected, atol=2e-3)


def pings(noise: SonarNoise, n: int = 4000) -> FloatArray:
    sonar = Sonar(SensorKind.SINGLE, noise, np.random.default_rng(1))
    motion = Motion(50.0, 50.0, 2.0)
    true = FLAT.max_depth_m - 2.0
    return np.array([sonar.ping(FLAT, motion)[0] for _ in range(n)]) / true


def test_noise_is_multiplicative() -> None:
    ratio = pings(SonarNoise(relative_sd=0.1))
    assert ratio.mean() == pytest.approx(1.0, abs=0.01)
    assert ratio.std() == pytest.approx(0.1, abs=0.01)


def test_outliers_come_short_or_double_at_their_rate() -> None:
    ratio = pings(SonarNoise(outlier_rate=0.2))
    wrong = np.abs(ratio - 1.0) > 1e-9
    assert wrong.mean() == pytest.approx(0.2, abs=0.03)
    assert set(np.round(ratio[ratio > 1.0 + 1e-9], 9)) == {2.0}
    assert (ratio[wrong] < 1.0).mean() == pytest.approx(0.5, abs=0.08)


def test_dropouts_return_nothing_at_their_rate() -> None:
    assert np.isnan(pings(SonarNoise(dropout_rate=0.3))).mean() == pytest.approx(0.3, abs=0.03)


def test_out_of_range_is_no_return() -> None:
    sonar = Sonar(SensorKind.SINGLE, PERFECT, np.random.default_rng(0), max_range_m=5.0)
    assert np.isnan(sonar.ping(FLAT, Motion(50.0, 50.0, 0.0))[0])
    assert np.isnan(sonar.ping(FLAT, Motion(-50.0, 50.0, 0.0))[0]), "nothing is known out there"


def test_a_multibeam_is_no_sonar_of_few_beams() -> None:
    with pytest.raises(ValueError, match="it must be single or dvl"):
        Sonar(SensorKind.MULTIBEAM, PERFECT, np.random.default_rng(0))


@pytest.mark.parametrize("field", ["relative_sd", "outlier_rate", "dropout_rate"])
def test_impossible_noise_is_refused(field: str) -> None:
    with pytest.raises(ValueError, match=f"{field} is -0.1"):
        SonarNoise(**{field: -0.1})
