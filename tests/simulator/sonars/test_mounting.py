"""What a simulated sonar that is mounted askew measures, and that the service's own reckoning puts it right."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.mounting import Mounting, StatedTrack, mounted
from app.mapping.swath.pings import Pings, placed
from simulator.equipment import Equipment
from simulator.floors.terrain import Terrain
from simulator.sonars.mounting import SonarMounting
from simulator.sonars.sensors import SensorKind
from simulator.sonars.swath import EXACT, SwathSonar, SwathSounder
from simulator.vehicles.vehicle import Motion
from simulator.world import SimulatedVehicle, SwathPing

SONAR = SwathSonar(aperture_deg=90.0, beams=32)


def plane(slope_east: float, slope_north: float) -> Terrain:
    at = np.arange(300) + 0.5
    return Terrain(30.0 + slope_east * (at[None, :] - 150) + slope_north * (at[:, None] - 150), 1.0, 41.0, -8.7)


def on_plane(slopes: tuple[float, float], east_m: FloatArray, north_m: FloatArray) -> FloatArray:
    return 30.0 + slopes[0] * (east_m - 150.0) + slopes[1] * (north_m - 150.0)


def known(mounting: SonarMounting) -> Mounting:
    return Mounting(
        roll_rad=math.radians(mounting.roll_deg),
        pitch_rad=math.radians(mounting.pitch_deg),
        heading_rad=math.radians(mounting.heading_deg),
        latency_s=mounting.latency_s,
        offset_m=mounting.offset_m,
    )


def columns(terrain: Terrain, pings: list[SwathPing]) -> Pings:
    lat, lon = np.array([terrain.frame.to_geodetic(p.position.east_m, p.position.north_m) for p in pings]).T
    return Pings(
        time_s=np.array([p.time_s for p in pings]),
        lat_deg=lat,
        lon_deg=lon,
        depth_m=np.array([p.position.depth_m for p in pings]),
        roll_rad=np.array([p.roll_rad for p in pings]),
        pitch_rad=np.array([p.pitch_rad for p in pings]),
        heading_rad=np.array([p.heading_rad for p in pings]),
        position_sd_m=np.full(len(pings), np.nan),
        angle_rad=np.array([p.angles_rad for p in pings], np.float32),
        range_m=np.array([p.ranges_m for p in pings], np.float32),
    )


@settings(max_examples=60, deadline=None)
@given(
    slopes=st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)),
    attitude=st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-3.1, 3.1)),
    angles=st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-180, 180)),
    offset=st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-1, 1)),
)
def test_the_mounting_that_was_simulated_puts_every_footprint_onto_the_floor(
    slopes: tuple[float, float],
    attitude: tuple[float, float, float],
    angles: tuple[float, float, float],
    offset: tuple[float, float, float],
) -> None:
    terrain, mounting = plane(*slopes), SonarMounting(*angles, offset_m=offset)
    roll, pitch, heading = attitude
    motion = Motion(150.0, 150.0, 5.0, heading, pitch, roll)
    sounder = SwathSounder(SONAR, EXACT, np.random.default_rng(0), mounting)
    lat, lon = terrain.frame.to_geodetic(150.0, 150.0)
    one = [np.array([value]) for value in (0.0, lat, lon, 5.0, roll, pitch, heading, np.nan)]
    beams = [a[None].astype(np.float32) for a in (sounder.angles_rad, sounder.ping(terrain, motion))]
    frame = LocalFrame(terrain.frame.lat_deg, terrain.frame.lon_deg)
    found = placed(mounted(Pings(*one, *beams), known(mounting), frame), frame)
    assert len(found) > 20
    np.testing.assert_allclose(found.depth_m, on_plane(slopes, found.east_m, found.north_m), atol=5e-3)


def flown(terrain: Terrain, sensor: SensorKind, mounting: SonarMounting) -> SimulatedVehicle:
    equipment = Equipment(sensor=sensor, swath=replace(SONAR, rate_hz=2.0), mounting=mounting)
    vehicle = SimulatedVehicle("a", terrain, (100.0, 100.0, 2.0), np.random.default_rng(1), equipment, heading_rad=0.7)
    vehicle.go_to(180.0, 190.0, 4.0, 1.5)
    return vehicle


SLOPES = (0.15, -0.1)


def test_a_survey_with_late_positions_is_off_by_the_way_and_right_once_that_is_known() -> None:
    terrain, mounting = plane(*SLOPES), SonarMounting(2.0, -3.0, 4.0, 0.7, (1.0, 0.5, 0.2))
    pings = columns(terrain, flown(terrain, SensorKind.MULTIBEAM, mounting).advance_swath(40.0))
    frame = LocalFrame(terrain.frame.lat_deg, terrain.frame.lon_deg)

    def off_m(by: Mounting) -> FloatArray:
        found = placed(mounted(pings, by, frame, StatedTrack()), frame)
        later = found.ping > 20  # it sets out, and turns
        return (found.depth_m - on_plane(SLOPES, found.east_m, found.north_m))[later]

    assert np.abs(off_m(known(mounting))).max() < 0.005
    assert np.abs(off_m(Mounting())).max() > 0.5
    assert np.abs(off_m(replace(known(mounting), latency_s=0.0))).max() > 0.02, "0.7 s, nearly along the slope"


@pytest.mark.parametrize("sensor", [SensorKind.SINGLE, SensorKind.DVL])
def test_sonars_of_few_beams_sit_askew_too(sensor: SensorKind) -> None:
    terrain = plane(*SLOPES)

    def ranges(mounting: SonarMounting) -> FloatArray:
        return np.array([m.range_m for m in flown(terrain, sensor, mounting).advance(20.0)])

    straight, askew = ranges(SonarMounting()), ranges(SonarMounting(roll_deg=5.0, offset_m=(0.0, 0.0, 0.5)))
    assert len(straight) == len(askew)
    if sensor is SensorKind.SINGLE:
        np.testing.assert_allclose(askew, straight - 0.5, atol=0.03)
    else:
        assert np.abs(askew - straight).max() > 0.7


@pytest.mark.parametrize(
    "wrong",
    [lambda: SonarMounting(latency_s=-0.1), lambda: SonarMounting(roll_deg=math.nan)],
)
def test_a_mounting_that_cannot_be_is_refused(wrong: Callable[[], SonarMounting]) -> None:
    with pytest.raises(ValueError, match="sonar mounting"):
        wrong()
