"""Soundings as beams: footprints are where the file has its soundings."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.multibeam.beams import beams_of
from app.mapping.readers.multibeam.types import FilePing
from app.mapping.swath.pings import Pings, placed

FRAME = LocalFrame(41.1850, -8.7040)
BEAMS = 64


def file_ping(
    heading_deg: float = 0.0, sonar_m: float = 2.0, level_m: float = 0.0, shape: tuple[float, float, float] = (0, 0, 0)
) -> FilePing:
    """A ping over uneven ground; ``shape``: how far ahead the swath is, how it is turned and tilted."""
    rng = np.random.default_rng(5)
    starboard = np.linspace(-40.0, 40.0, BEAMS)
    depth = 25.0 + 0.1 * starboard + rng.normal(0.0, 2.0, BEAMS)
    no = np.zeros(BEAMS, bool)
    return FilePing(
        number=1,
        time_s=1.7e9,
        lat_deg=41.185,
        lon_deg=-8.704,
        heading_deg=heading_deg,
        sonar_depth_m=sonar_m,
        level_m=level_m,
        forward_m=shape[0] + shape[1] * starboard + shape[2] * (depth - np.nan_to_num(sonar_m)),
        starboard_m=starboard,
        depth_m=depth + level_m,
        sd_m=np.full(BEAMS, np.nan),
        detection_sd_m=np.zeros(BEAMS),
        rejected=no,
        detected=~no,
    )


def footprints(ping: FilePing) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """East, north and depth of a ping's beams, and how far they were moved."""
    beams = beams_of(ping)
    assert beams is not None
    found = placed(
        Pings(
            time_s=np.array([ping.time_s]),
            lat_deg=np.array([beams.lat_deg]),
            lon_deg=np.array([beams.lon_deg]),
            depth_m=np.array([beams.depth_m]),
            roll_rad=np.zeros(1),
            pitch_rad=np.array([beams.pitch_rad]),
            heading_rad=np.array([beams.heading_rad]),
            position_sd_m=np.full(1, np.nan),
            angle_rad=beams.angle_rad.astype(np.float32)[None],
            range_m=beams.range_m.astype(np.float32)[None],
        ),
        FRAME,
    )
    return found.east_m, found.north_m, found.depth_m, beams.moved_m


def expected(ping: FilePing) -> tuple[np.ndarray, np.ndarray]:
    east, north = FRAME.to_local(ping.lat_deg, ping.lon_deg)
    heading = math.radians(ping.heading_deg)
    return (
        east + math.sin(heading) * ping.forward_m + math.cos(heading) * ping.starboard_m,
        north + math.cos(heading) * ping.forward_m - math.sin(heading) * ping.starboard_m,
    )


@settings(max_examples=60, deadline=None)
@given(
    heading_deg=st.floats(0.0, 360.0),
    shape=st.tuples(st.floats(-20.0, 20.0), st.floats(-0.25, 0.25), st.floats(-0.4, 0.4)),
    level_m=st.floats(-3.0, 3.0),
    sonar_m=st.sampled_from([0.0, 2.0, 15.0, math.nan]),
)
def test_turned_and_tilted_swaths_keep_their_footprints(
    heading_deg: float, shape: tuple[float, float, float], level_m: float, sonar_m: float
) -> None:
    ping = file_ping(heading_deg, sonar_m, level_m, shape)
    east, north, depth, moved_m = footprints(ping)
    assert moved_m < 1e-6
    np.testing.assert_allclose(np.stack([east, north]), expected(ping), atol=2e-3)
    np.testing.assert_allclose(depth, ping.depth_m - level_m, atol=1e-4)


def test_a_swath_that_is_bent_is_moved_along_the_track_only_and_says_how_far() -> None:
    ping = replace(file_ping(), forward_m=0.002 * np.linspace(-40.0, 40.0, BEAMS) ** 2)  # up to 3.2 m ahead at its ends
    east, north, depth, moved_m = footprints(ping)
    right = expected(ping)
    assert 1.0 < moved_m < 2.5
    np.testing.assert_allclose(east, right[0], atol=0.2)
    assert np.abs(north - right[1]).max() == pytest.approx(moved_m, abs=0.05)
    np.testing.assert_allclose(depth, ping.depth_m, atol=1e-4)


def test_a_flat_bottom_tells_nothing_of_the_tilt() -> None:
    ping = file_ping()
    flat = replace(ping, depth_m=np.full(BEAMS, 20.0) + 1e-4 * ping.starboard_m**2 / 40, forward_m=np.full(BEAMS, 1.5))
    beams = beams_of(flat)
    assert beams is not None
    assert abs(beams.pitch_rad) < 1e-6
    east, north, *_ = footprints(flat)
    np.testing.assert_allclose(np.stack([east, north]), expected(flat), atol=2e-3)


def test_what_is_rejected_or_not_below_the_sonar_is_no_beam() -> None:
    ping = file_ping()
    depth, rejected = ping.depth_m.copy(), ping.rejected.copy()
    depth[3], rejected[5] = 1.0, True
    beams = beams_of(replace(ping, depth_m=depth, rejected=rejected))
    assert beams is not None
    assert set(np.flatnonzero(np.isnan(beams.range_m))) == {3, 5}
    assert beams_of(replace(ping, rejected=~rejected | True)) is None
    one = beams_of(replace(ping, rejected=np.arange(BEAMS) != 7))
    assert one is not None
    assert np.isfinite(one.range_m).sum() == 1
