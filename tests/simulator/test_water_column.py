"""Simulated water: beams are bent and late as Snell has it, and the service's ray tracing puts them right again."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.mapping.water.sound_speed import SoundSpeedProfile
from simulator.equipment import Equipment
from simulator.floors.terrain import Terrain
from simulator.sonars.sensors import SensorKind, Sonar, SonarNoise, told_ranges
from simulator.sonars.swath import EXACT, SwathSonar, SwathSounder
from simulator.vehicles.vehicle import Motion
from simulator.water_column import ASSUMED_MPS, WaterColumn
from simulator.world import SimulatedVehicle

SUMMER = WaterColumn(((0.0, 1524.0), (6.0, 1521.0), (9.0, 1496.0), (40.0, 1493.0)))
SONAR = SwathSonar(aperture_deg=130.0, beams=65)


def plane(slope_east: float = 0.0, slope_north: float = 0.0) -> Terrain:
    at = np.arange(300) + 0.5
    return Terrain(30.0 + slope_east * (at[None, :] - 150) + slope_north * (at[:, None] - 150), 1.0, 41.0, -8.7)


def stepped_down(water: WaterColumn, launch_rad: float, depth_m: float, down_m: float) -> tuple[float, float]:
    """The same as ``WaterColumn.beams``, by small steps of Snell's law."""
    edges = np.linspace(depth_m, depth_m + down_m, 40_001)
    speeds = np.array([water.speed_mps(float(middle)) for middle in 0.5 * (edges[1:] + edges[:-1])])
    sines = math.sin(launch_rad) * speeds / water.speed_mps(depth_m)
    cosines = np.sqrt(1.0 - sines**2)
    step_m = down_m / len(speeds)
    across_m, time_s = float((step_m * sines / cosines).sum()), float((step_m / speeds / cosines).sum())
    return math.atan2(across_m, down_m), ASSUMED_MPS * time_s


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 1.2), st.floats(0.0, 45.0), st.floats(0.1, 40.0))
def test_beams_are_those_of_small_steps(launch_rad: float, depth_m: float, down_m: float) -> None:
    bent, told_m = SUMMER.beams(np.array([launch_rad]), depth_m, np.array([down_m]))
    assert [bent[0], told_m[0]] == pytest.approx(stepped_down(SUMMER, launch_rad, depth_m, down_m), rel=1e-5, abs=1e-7)


def test_water_turns_flat_beams_back_where_sound_is_faster_below() -> None:
    duct = WaterColumn(((0.0, 1480.0), (20.0, 1520.0)))
    flat = math.asin(1480.0 / 1500.0)  # level where sound is as fast as 1500 m/s: 10 m down
    _, told_m = duct.beams(np.full(2, flat), 0.0, np.array([9.9, 10.1]))
    assert np.isfinite(told_m).tolist() == [True, False]


@settings(max_examples=40, deadline=None)
@given(
    slopes=st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)),
    attitude=st.tuples(st.floats(-0.15, 0.15), st.floats(-0.15, 0.15), st.floats(-3.1, 3.1)),
    depth_m=st.floats(0.0, 12.0),
    speeds=st.lists(st.floats(1470.0, 1530.0), min_size=1, max_size=5),
)
def test_the_service_traces_beams_back_onto_the_floor(
    slopes: tuple[float, float], attitude: tuple[float, float, float], depth_m: float, speeds: list[float]
) -> None:
    water = WaterColumn(tuple((7.0 * k, speed) for k, speed in enumerate(speeds)))
    terrain, (roll, pitch, heading) = plane(*slopes), attitude
    sounder = SwathSounder(SONAR, EXACT, np.random.default_rng(0), water=water)
    down, away, azimuth = pointed(sounder.angles_rad, roll, pitch, heading)
    told_m = sounder.ping(terrain, Motion(150.0, 150.0, depth_m, heading, pitch, roll))
    heard = np.isfinite(told_m)
    assume(heard.sum() > 10)
    depths, speeds_mps = (np.array(column) for column in zip(*water.entries, strict=True))
    across_m, down_m = SoundSpeedProfile(depths, speeds_mps, ASSUMED_MPS).trace(
        np.full(heard.sum(), depth_m), (told_m * away)[heard], (told_m * down)[heard]
    )
    east_m, north_m = across_m * np.sin(azimuth[heard]), across_m * np.cos(azimuth[heard])
    floor_m = 30.0 + slopes[0] * east_m + slopes[1] * north_m
    np.testing.assert_allclose(depth_m + down_m, floor_m, atol=0.02)


def pointed(
    angles_rad: FloatArray, roll_rad: float, pitch_rad: float, heading_rad: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of beams across the track how steep they are, sine and cosine from level, and their azimuth."""
    starboard, below = np.sin(angles_rad), np.cos(angles_rad)
    starboard, below = (
        starboard * math.cos(roll_rad) - below * math.sin(roll_rad),
        starboard * math.sin(roll_rad) + below * math.cos(roll_rad),
    )
    ahead, down = below * math.sin(pitch_rad), below * math.cos(pitch_rad)
    azimuth = heading_rad + np.arctan2(starboard, ahead)
    return down, np.hypot(ahead, starboard), azimuth


def test_under_warm_water_a_level_floor_seems_to_rise_to_both_sides() -> None:
    """Sound that grows slower on its way down is bent to the vertical: it meets the floor earlier than it seems to."""
    sounder = SwathSounder(SONAR, EXACT, np.random.default_rng(0), water=SUMMER)
    seen_m = 2.0 + sounder.ping(plane(), Motion(150.0, 150.0, 2.0)) * np.cos(sounder.angles_rad)
    middle, outermost = seen_m[len(seen_m) // 2], seen_m[0]
    assert abs(middle - 30.0) < 0.2
    assert middle - outermost > 0.5


def test_an_altimeter_takes_slow_water_for_more_of_it() -> None:
    slow = WaterColumn(((0.0, 1470.0),))
    for kind in (SensorKind.SINGLE, SensorKind.DVL):
        motion = Motion(150.0, 150.0, 10.0)
        straight = Sonar(kind, SonarNoise(), np.random.default_rng(0)).exact_ranges(plane(), motion)
        late = Sonar(kind, SonarNoise(), np.random.default_rng(0), water=slow).exact_ranges(plane(), motion)
        np.testing.assert_allclose(late, straight * ASSUMED_MPS / 1470.0, rtol=1e-4)


def test_beams_that_go_up_are_told_by_the_speed_at_the_sonar() -> None:
    wall = Terrain(np.where(np.arange(300)[None, :] < 200, 30.0, 0.0) * np.ones((300, 1)), 1.0, 41.0, -8.7)
    up = np.array([[math.cos(0.1), 0.0, -math.sin(0.1)]])
    motion = Motion(150.0, 150.0, 20.0)
    straight, late = (told_ranges(wall, motion, up, 100.0, water) for water in (None, SUMMER))
    assert np.isfinite(straight).all()
    np.testing.assert_allclose(late, straight * ASSUMED_MPS / SUMMER.speed_mps(20.0))


def test_a_vehicle_that_dives_measures_the_water_it_is_in() -> None:
    vehicle = SimulatedVehicle("a", plane(), (100, 100, 0), np.random.default_rng(3), Equipment(), water=SUMMER)
    vehicle.go_to(180.0, 190.0, 14.0)
    off = []
    for _ in range(600):
        vehicle.advance(0.1)
        measured = vehicle.measure_sound_speed()
        assert measured is not None
        off.append(measured - SUMMER.speed_mps(vehicle.position.depth_m))
    assert vehicle.position.depth_m > 12.0
    assert 0.03 < np.std(off) < 0.07
    assert SimulatedVehicle("b", plane(), (100, 100, 0), np.random.default_rng(3)).measure_sound_speed() is None


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        (((0.0, 1500.0), (0.0, 1490.0)), "below the entry before"),
        (((-1.0, 1500.0),), "0 or more"),
        (((0.0, 150.0),), "1350 to 1650"),
        (((0.0, math.nan),), "1350 to 1650"),
        ((), "0 entries"),
    ],
)
def test_water_that_cannot_be_is_refused(entries: tuple[tuple[float, float], ...], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        WaterColumn(entries)
