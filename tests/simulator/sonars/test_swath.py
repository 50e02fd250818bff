"""Swath sonars: exact without errors, and with errors those that were asked for."""

import math
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.pings import Footprints, Pings, placed
from simulator.floors import seafloors
from simulator.floors.terrain import Terrain
from simulator.sonars.sensors import SonarNoise
from simulator.sonars.swath import EXACT, SwathErrors, SwathSonar, SwathSounder
from simulator.vehicles.vehicle import Motion

FLAT = seafloors.generate("flat", 0, width_m=200, height_m=200)
ABOVE = Motion(100.0, 100.0, 2.0)
HEIGHT_M = FLAT.max_depth_m - 2.0


def plane(slope_east: float, slope_north: float, depth: float) -> Terrain:
    at = np.arange(300) + 0.5
    return Terrain(depth + slope_east * (at[None, :] - 150) + slope_north * (at[:, None] - 150), 1.0, 41.0, -8.7)


def sounder(sonar: SwathSonar | None = None, seed: int = 0, **errors: Any) -> SwathSounder:
    return SwathSounder(sonar or SwathSonar(), replace(EXACT, **errors), np.random.default_rng(seed))


def footprints(terrain: Terrain, motion: Motion, sonar: SwathSounder) -> Footprints:
    """Where beams met the bottom, east and north in the terrain's frame, by another reckoning than the simulator's."""
    lat, lon = terrain.frame.to_geodetic(motion.east_m, motion.north_m)
    angle, ranges = sonar.angles_rad[None], sonar.ping(terrain, motion)[None]
    pings = Pings(
        time_s=np.zeros(1),
        lat_deg=np.array([lat]),
        lon_deg=np.array([lon]),
        depth_m=np.array([motion.depth_m]),
        roll_rad=np.array([motion.roll_rad]),
        pitch_rad=np.array([motion.pitch_rad]),
        heading_rad=np.array([motion.heading_rad]),
        position_sd_m=np.full(1, np.nan),
        angle_rad=angle.astype(np.float32),
        range_m=ranges.astype(np.float32),
    )
    return placed(pings, LocalFrame(terrain.frame.lat_deg, terrain.frame.lon_deg))


def test_beams_look_from_port_to_starboard_at_equal_angles() -> None:
    angles = SwathSonar(aperture_deg=120.0, beams=9).angles_rad
    np.testing.assert_allclose(np.degrees(angles), np.linspace(-60, 60, 9), atol=1e-9)
    slope = plane(-0.2, 0.0, 20.0)
    port, starboard = sounder().ping(slope, Motion(150.0, 150.0, 1.0))[[0, -1]]
    assert starboard < port, "heading north the bottom rises to starboard"


@settings(max_examples=40, deadline=None)
@given(
    slopes=st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)),
    heading=st.floats(-3.1, 3.1),
    pitch=st.floats(-0.2, 0.2),
    roll=st.floats(-0.2, 0.2),
)
def test_without_errors_every_footprint_lies_on_a_tilted_plane(
    slopes: tuple[float, float], heading: float, pitch: float, roll: float
) -> None:
    terrain = plane(*slopes, 30.0)
    motion = Motion(150.0, 150.0, 5.0, heading)
    motion.pitch_rad, motion.roll_rad = pitch, roll
    found = footprints(terrain, motion, sounder(SwathSonar(aperture_deg=90.0, beams=64)))
    assert len(found) == 64
    bottom = 30.0 + slopes[0] * (found.east_m - 150.0) + slopes[1] * (found.north_m - 150.0)
    np.testing.assert_allclose(found.depth_m, bottom, atol=5e-3)


def test_no_noise_means_no_error_at_all() -> None:
    assert SwathErrors.of(SonarNoise()) == EXACT
    typical = SwathErrors.of(SonarNoise(relative_sd=0.01))
    assert (typical.relative_sd, typical.roll_offset_deg) == (0.01, 0.1)
    assert SwathErrors.of(SonarNoise(0.01, 0.3, 0.4)).false_rate == 0.3


def many(sonar: SwathSounder, count: int = 400, terrain: Terrain = FLAT) -> FloatArray:
    return np.array([sonar.ping(terrain, ABOVE) for _ in range(count)])


def relative(sonar: SwathSounder, **kwargs: Any) -> FloatArray:
    """Ranges of many pings over flat ground in parts of the true ones."""
    return many(sonar, **kwargs) * np.cos(sonar.angles_rad) / HEIGHT_M - 1.0


def test_ranges_scatter_as_much_as_stated_and_more_at_the_sides() -> None:
    sd = relative(sounder(relative_sd=0.01, outer_relative_sd=0.03)).std(axis=0)
    assert sd[120:136].mean() == pytest.approx(0.01, rel=0.05)
    assert sd[:4].mean() == pytest.approx(math.hypot(0.01, 0.03), rel=0.1)
    assert sd[-4:].mean() == pytest.approx(math.hypot(0.01, 0.03), rel=0.1)


def test_a_roll_offset_tilts_the_bottom_and_sound_speed_bends_it() -> None:
    def seen(**errors: Any) -> FloatArray:
        sonar = sounder(**errors)
        depths: FloatArray = sonar.ping(FLAT, ABOVE) * np.cos(sonar.angles_rad)
        return depths - HEIGHT_M

    tan60 = math.tan(math.radians(60.0))
    tilted, bent = seen(roll_offset_deg=0.5), seen(sound_speed_error_mps=6.0)
    assert tilted[-1] == pytest.approx(HEIGHT_M * math.radians(0.5) * tan60, rel=0.05)
    assert tilted[0] == pytest.approx(-tilted[-1], rel=0.1)
    assert bent[-1] == pytest.approx(HEIGHT_M * 6.0 / 1500.0 * tan60**2, rel=0.05)
    assert bent[0] == pytest.approx(bent[-1], abs=3e-3)
    assert bent[128] == pytest.approx(0.0, abs=3e-3)


def test_beams_drop_out_more_at_the_sides_and_at_the_end_of_the_range() -> None:
    lost = np.isnan(relative(sounder(dropout_rate=0.2))).mean(axis=0)
    assert lost[-8:].mean() == pytest.approx(0.2, abs=0.03)
    assert lost[124:132].mean() < 0.01
    short = SwathSonar(range_m=1.9 * HEIGHT_M)
    assert np.isnan(many(sounder(short)))[:, [0, -1]].all(), "2 heights away at 60 degrees"
    late = np.isnan(many(sounder(short, dropout_rate=0.02))).mean(axis=0)
    assert late[10] > 4 * lost[10] / 10
    assert not np.isnan(many(sounder(short), 1)[0, 20:-20]).any()


def test_some_beams_meet_what_swims_above_the_bottom() -> None:
    off = relative(sounder(false_rate=0.05))
    wrong = np.abs(off) > 1e-3
    assert wrong.mean() == pytest.approx(0.05, abs=0.005)
    assert (off[wrong] < 0.0).all()


def test_a_wide_beam_blurs_a_step() -> None:
    z = np.where(np.arange(200) < 100, 20.0, 15.0)[None, :].repeat(200, axis=0)
    step = Terrain(z, 1.0)
    sharp, wide = (sounder(beam_width_deg=width).ping(step, ABOVE) for width in (0.0, 10.0))
    assert np.abs(np.diff(wide)).max() < 0.7 * np.abs(np.diff(sharp)).max()


@pytest.mark.parametrize(
    ("change", "message"),
    [({"aperture_deg": 180.0}, "below 180"), ({"beams": 1}, "2 or more"), ({"rate_hz": 0.0}, "rate_hz is 0.0")],
)
def test_an_impossible_sonar_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SwathSonar(**change)


def test_a_ping_costs_little() -> None:
    sonar = SwathSounder(SwathSonar(), SwathErrors(), np.random.default_rng(0))
    harbour = seafloors.generate("harbour", 0, width_m=200, height_m=200)
    sonar.ping(harbour, ABOVE)
    began_s = time.process_time()
    for _ in range(50):
        sonar.ping(harbour, ABOVE)
    assert (time.process_time() - began_s) / 50 < 0.01
