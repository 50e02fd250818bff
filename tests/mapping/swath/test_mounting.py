"""Mountings of sonars against an independent reckoning, one beam after the other, and what must always hold."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.swath.mounting import (
    GAP_S,
    STRAIGHT,
    BeamVectors,
    Mounting,
    StatedTrack,
    displaced,
    mounted,
)
from app.mapping.swath.pings import Footprints, Pings, placed

FRAME = LocalFrame(41.185, -8.705)

angle = st.floats(-0.3, 0.3)
mountings = st.builds(
    Mounting,
    roll_rad=st.floats(-1.0, 1.0),
    pitch_rad=st.floats(-0.7, 0.7),
    heading_rad=st.floats(-3.1, 3.1),
    offset_m=st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-2, 2)),
)


def pings_at(
    time_s: FloatArray, east_m: FloatArray, north_m: FloatArray, attitude_rad: tuple[float, float, float]
) -> Pings:
    """Pings of five beams; attitude: roll, pitch, heading."""
    n = len(time_s)
    lat, lon = FRAME.to_geographic(east_m, north_m)
    roll, pitch, heading = (np.full(n, one) for one in attitude_rad)
    angles = np.tile(np.radians([-60.0, -30.0, 0.0, 30.0, 60.0]), (n, 1)).astype(np.float32)
    ranges = np.tile(np.array([20.0, 12.0, 10.0, 12.0, 20.0]), (n, 1)).astype(np.float32)
    return Pings(time_s, lat, lon, np.full(n, 3.0), roll, pitch, heading, np.full(n, np.nan), angles, ranges)


def one_ping(attitude_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Pings:
    return pings_at(np.zeros(1), np.array([50.0]), np.array([60.0]), attitude_rad)


def axis_turn(axis: int, by_rad: float) -> list[list[float]]:
    """A right-handed turn about one axis of forward, starboard, down."""
    c, s = math.cos(by_rad), math.sin(by_rad)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = [[float(row == col) for col in range(3)] for row in range(3)]
    matrix[i][i], matrix[i][j], matrix[j][i], matrix[j][j] = c, -s, s, c
    return matrix


def times(matrix: list[list[float]], vector: list[float]) -> list[float]:
    return [sum(a * b for a, b in zip(row, vector, strict=True)) for row in matrix]


def turned(vector: list[float], heading: float, pitch: float, roll: float) -> list[float]:
    """Roll first, then pitch, then heading."""
    for axis, by in ((0, roll), (1, pitch), (2, heading)):
        vector = times(axis_turn(axis, by), vector)
    return vector


def by_hand(pings: Pings, mounting: Mounting) -> FloatArray:
    """Footprints of the first ping (b, 3): east, north, depth."""
    east, north = (float(one[0]) for one in FRAME.to_local(pings.lat_deg, pings.lon_deg))
    attitude = [float(getattr(pings, f"{name}_rad")[0]) for name in ("heading", "pitch", "roll")]
    found = []
    for beam, slant in zip(pings.angle_rad[0].tolist(), pings.range_m[0].tolist(), strict=True):
        in_sonar = [0.0, slant * math.sin(beam), slant * math.cos(beam)]
        in_vehicle = turned(in_sonar, mounting.heading_rad, mounting.pitch_rad, mounting.roll_rad)
        n, e, d = turned([a + b for a, b in zip(in_vehicle, mounting.offset_m, strict=True)], *attitude)
        found.append([east + e, north + n, float(pings.depth_m[0]) + d])
    return np.array(found)


def table(found: Footprints) -> FloatArray:
    return np.column_stack([found.east_m, found.north_m, found.depth_m])


@settings(max_examples=200, deadline=None)
@given(mounting=mountings, attitude=st.tuples(angle, angle, st.floats(-3.1, 3.1)))
def test_beams_are_where_turning_them_axis_by_axis_puts_them(
    mounting: Mounting, attitude: tuple[float, float, float]
) -> None:
    pings = one_ping(attitude)
    found = placed(mounted(pings, mounting, FRAME), FRAME)
    np.testing.assert_allclose(table(found), by_hand(pings, mounting), atol=1e-6)


def test_a_straight_mounting_changes_nothing_at_all() -> None:
    pings = one_ping((0.1, -0.05, 1.0))
    same = mounted(pings, Mounting(), FRAME)
    for column in fields(Pings):
        np.testing.assert_array_equal(getattr(same, column.name), getattr(pings, column.name))
    assert mounted(pings, STRAIGHT, FRAME) is pings


def test_signs_are_those_that_are_documented() -> None:
    pings = one_ping()
    straight = table(placed(pings, FRAME))[2]

    def middle(**fields: float | tuple[float, float, float]) -> FloatArray:
        return table(placed(mounted(pings, replace(STRAIGHT, **fields), FRAME), FRAME))[2] - straight  # type: ignore[arg-type]

    assert middle(roll_rad=0.1)[0] == pytest.approx(-10.0 * math.sin(0.1), abs=1e-6), "heading north, to port is west"
    assert middle(pitch_rad=0.1)[1] == pytest.approx(10.0 * math.sin(0.1), abs=1e-6), "bow up looks ahead"
    np.testing.assert_allclose(middle(heading_rad=0.1), 0.0, atol=1e-6)
    starboard = table(placed(mounted(pings, Mounting(heading_rad=0.1), FRAME), FRAME))[4]
    assert starboard[1] < straight[1], "clockwise brings the starboard side astern"
    np.testing.assert_allclose(middle(offset_m=(1.0, 2.0, 0.5)), [2.0, 1.0, 0.5], atol=1e-6)


@settings(max_examples=50, deadline=None)
@given(mounting=mountings, attitude=st.tuples(angle, angle, st.floats(-3.1, 3.1)))
def test_a_mounting_keeps_the_ranges_of_beams(mounting: Mounting, attitude: tuple[float, float, float]) -> None:
    pings = mounted(one_ping(attitude), mounting, FRAME)
    east, north = FRAME.to_local(pings.lat_deg, pings.lon_deg)
    away = table(placed(pings, FRAME)) - np.array([east[0], north[0], pings.depth_m[0]])
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), pings.range_m[0], atol=1e-6)


def way(time_s: FloatArray) -> FloatArray:
    """A bent way, (n, 2)."""
    return np.column_stack([40.0 + 1.5 * time_s, 30.0 + 5.0 * np.sin(time_s / 5.0)])


@pytest.mark.parametrize("latency_s", [0.4, -0.4, 1.3])
@pytest.mark.parametrize("piece", [1, 7, 100])
def test_late_positions_are_put_right_however_many_pings_come_together(latency_s: float, piece: int) -> None:
    time_s = np.arange(0.0, 20.0, 0.2)
    east_m, north_m = way(time_s - latency_s).T
    pings = pings_at(time_s, east_m, north_m, (0.0, 0.0, 0.0))
    track, found = StatedTrack(), []
    for start in range(0, len(pings), piece):
        part = mounted(pings.take(slice(start, start + piece)), Mounting(latency_s=latency_s), FRAME, track)
        found.append(np.column_stack(FRAME.to_local(part.lat_deg, part.lon_deg)))
    off_m = np.hypot(*(np.concatenate(found) - way(time_s)).T)
    # The first ping of all tells of no speed, and the last ones are gone on straight from.
    first = 0 if piece > 1 else 1
    assert off_m[first:].max() < 0.5 * 0.2 * (abs(latency_s) + 0.2) ** 2 + 0.01
    if piece == 100:
        known = (time_s + latency_s >= 0.0) & (time_s + latency_s <= time_s[-1])
        assert off_m[known].max() < 0.002, "between positions the way is as good as straight"


def test_a_latency_is_not_read_across_gaps_of_the_track() -> None:
    one, other = np.arange(0.0, 5.0, 0.5), 100.0 + np.arange(0.0, 5.0, 0.5)
    time_s = np.concatenate([one, other])
    at = np.column_stack([np.where(time_s < 50.0, time_s, 300.0 - time_s), np.zeros(len(time_s))])
    found = StatedTrack().later(time_s, at, 1.0)
    np.testing.assert_allclose(found[:, 0] - at[:, 0], np.where(time_s < 50.0, 1.0, -1.0), atol=1e-9)
    assert other[0] - one[-1] > GAP_S


def test_a_jump_of_the_last_position_is_not_carried_far() -> None:
    time_s = np.arange(0.0, 4.01, 0.05)
    at = np.column_stack([1.5 * time_s, np.where(time_s > 3.99, 2.0, 0.0)])
    found = StatedTrack().later(time_s, at, 0.5)
    assert abs(found[-1, 1] - 2.0) <= 2.1, "as it went for half a second, not as it jumped in a twentieth"
    np.testing.assert_allclose(found[:, 0], 1.5 * (time_s + 0.5), atol=1e-9)


def test_a_position_alone_stays_and_two_of_one_time_tell_no_speed() -> None:
    at = np.array([[3.0, 4.0]])
    np.testing.assert_array_equal(StatedTrack().later(np.array([7.0]), at, 0.5), at)
    both = np.array([[3.0, 4.0], [3.5, 4.0]])
    np.testing.assert_array_equal(StatedTrack().later(np.array([7.0, 7.0]), both, 0.5), both)


def vectors(attitude: tuple[float, float, float], azimuth: float, off_nadir: float, range_m: float) -> BeamVectors:
    roll, pitch, heading = (np.array([one]) for one in attitude)
    return BeamVectors(roll, pitch, heading, np.array([azimuth]), np.array([off_nadir]), np.array([range_m]))


@settings(max_examples=100, deadline=None)
@given(
    mounting=mountings,
    attitude=st.tuples(angle, angle, st.floats(-3.1, 3.1)),
    azimuth=st.floats(-3.1, 3.1),
    off_nadir=st.floats(0.0, 1.2),
)
def test_single_beams_move_as_turning_them_axis_by_axis_says(
    mounting: Mounting, attitude: tuple[float, float, float], azimuth: float, off_nadir: float
) -> None:
    found = displaced(vectors(attitude, azimuth, off_nadir, 15.0), mounting)
    roll, pitch, heading = attitude
    aside = 15.0 * math.sin(off_nadir)
    beam = [aside * math.cos(azimuth), aside * math.sin(azimuth), 15.0 * math.cos(off_nadir)]
    real = turned(beam, mounting.heading_rad, mounting.pitch_rad, mounting.roll_rad)
    real = [a + b for a, b in zip(real, mounting.offset_m, strict=True)]
    n, e, d = (
        a - b for a, b in zip(turned(real, heading, pitch, roll), turned(beam, heading, pitch, roll), strict=True)
    )
    np.testing.assert_allclose(found.footprint_m[0], [e, n, d], atol=1e-9)
    n, e, d = turned(list(mounting.offset_m), heading, pitch, roll)
    np.testing.assert_allclose(found.sonar_m[0], [e, n, d], atol=1e-9)


def test_a_vertical_range_moves_with_its_sonar_and_does_not_tilt() -> None:
    mounting = Mounting(roll_rad=0.2, pitch_rad=0.1, offset_m=(1.0, 0.0, 0.3))
    north = displaced(vectors((0.0, 0.0, 0.0), np.nan, np.nan, 10.0), mounting)
    np.testing.assert_allclose(north.footprint_m[0], [0.0, 1.0, 0.3], atol=1e-12)
    unknown = displaced(vectors((np.nan, np.nan, np.nan), np.nan, np.nan, 10.0), mounting)
    np.testing.assert_allclose(unknown.footprint_m[0], [0.0, 0.0, 0.3], atol=1e-12)


def test_no_pings_are_none() -> None:
    assert len(mounted(one_ping().take(slice(0, 0)), Mounting(roll_rad=0.1, latency_s=1.0), FRAME)) == 0
