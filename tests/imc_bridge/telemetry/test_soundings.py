"""From a Distance to a place on the bottom."""

import math
from typing import Any

import imcpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from imcpy.coordinates import WGS84

from app.arrays import FloatArray
from imc_bridge.events import Sounding, SoundingRefused
from imc_bridge.settings import AltimeterGeometry
from imc_bridge.telemetry.soundings import (
    Beam,
    SoundingIntake,
    StateHistory,
    StateSample,
    beam_table,
    footprint,
    interpolate,
    offer_distance,
    rotate_to_local,
    told_direction,
)

LAT, LON = math.radians(41.185), math.radians(-8.705)
angles = st.floats(-3.1, 3.1)


def state(
    time_s: float = 0.0,
    depth_m: float = 2.0,
    roll: float = 0.0,
    pitch: float = 0.0,
    yaw: float = 0.0,
    north_m: float = 0.0,
    east_m: float = 0.0,
) -> StateSample:
    lat, lon = WGS84.displace(LAT, LON, north_m, east_m)
    return StateSample(time_s, lat, lon, depth_m, roll, pitch, yaw)


def offset_of(lat_deg: float, lon_deg: float) -> tuple[float, float]:
    """North and east (m) of a footprint."""
    return WGS84.displacement(LAT, LON, 0.0, math.radians(lat_deg), math.radians(lon_deg), 0.0)[:2]


def rotation(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Independent reference: the product of the three elementary rotations."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return about_z @ about_y @ about_x


@given(angles, st.floats(-1.5, 1.5), angles, st.tuples(angles, angles, angles))
def test_rotation_is_the_product_of_yaw_pitch_and_roll(roll: float, pitch: float, yaw: float, vector: Any) -> None:
    local = rotate_to_local(state(roll=roll, pitch=pitch, yaw=yaw), *vector)
    assert np.allclose(local, rotation(roll, pitch, yaw) @ vector, atol=1e-9)


def test_vertical_range_lands_below_the_vehicle_whatever_its_attitude() -> None:
    beam = beam_table("vertical")["Altimeter"]
    lat, lon, depth = footprint(state(roll=0.3, pitch=-0.2, yaw=1.0), beam, 10.0)
    assert np.allclose(offset_of(lat, lon), 0.0, atol=1e-3)
    assert depth == pytest.approx(12.0)


def test_body_fixed_altimeter_looks_ahead_when_the_bow_is_up() -> None:
    beam = beam_table("body")["Altimeter"]
    pitch = math.radians(10.0)
    lat, lon, depth = footprint(state(pitch=pitch, yaw=math.pi / 2), beam, 10.0)
    north, east = offset_of(lat, lon)
    assert (north, east) == pytest.approx((0.0, 10.0 * math.sin(pitch)), abs=1e-3)
    assert depth == pytest.approx(2.0 + 10.0 * math.cos(pitch))


@pytest.mark.parametrize(
    ("beam", "direction"),
    [(0, (1, 0)), (1, (0, 1)), (2, (-1, 0)), (3, (0, -1))],
    ids=["bow", "starboard", "stern", "port"],
)
def test_dvl_beams_point_all_around_at_22_and_a_half_degrees(beam: int, direction: tuple[int, int]) -> None:
    lat, lon, depth = footprint(state(), beam_table("vertical")[f"DVL Beam {beam}"], 20.0)
    reach = 20.0 * math.sin(math.radians(22.5))
    assert np.allclose(offset_of(lat, lon), np.multiply(direction, reach), atol=1e-3)
    assert depth == pytest.approx(2.0 + 20.0 * math.cos(math.radians(22.5)))


@pytest.mark.parametrize(
    ("theta_deg", "psi_deg", "direction"),
    [
        (-90.0, 0.0, (0.0, 0.0)),
        (-67.5, 90.0, (90.0, 22.5)),
        (-60.0, -90.0, (-90.0, 30.0)),
        (-100.0, 0.0, (180.0, 10.0)),
        (-450.0, 0.0, (0.0, 0.0)),
        (22.5, 180.0, (180.0, 22.5)),
    ],
    ids=["straight down", "starboard beam", "port beam", "astern", "a turn too many", "device left at zero"],
)
def test_a_device_tells_where_its_beam_points(theta_deg: float, psi_deg: float, direction: tuple[float, float]) -> None:
    told = told_direction(device(theta_deg, psi_deg))
    assert told is not None
    azimuth, off_nadir = np.radians(direction)
    expected = math.sin(off_nadir) * np.array([math.cos(azimuth), math.sin(azimuth)])
    assert math.sin(told[1]) * math.cos(told[0]) == pytest.approx(expected[0], abs=1e-5)
    assert math.sin(told[1]) * math.sin(told[0]) == pytest.approx(expected[1], abs=1e-5)
    assert told[1] == pytest.approx(off_nadir, abs=1e-5)


@pytest.mark.parametrize(
    ("theta_deg", "psi_deg"),
    [(0.0, 0.0), (0.0, 45.0), (-5.0, 0.0), (90.0, 0.0), (math.nan, 0.0), (-90.0, math.inf)],
    ids=["nothing entered", "heading alone", "to the horizon", "sideways", "no number", "no heading"],
)
def test_an_orientation_in_which_no_bottom_is_measured_tells_nothing(theta_deg: float, psi_deg: float) -> None:
    assert told_direction(device(theta_deg, psi_deg)) is None


def test_a_beam_is_placed_where_its_vehicle_says_that_it_points() -> None:
    g = Gate("body")
    offer_distance(g.intake, "DVL Beam 1", distance(1.0, 20.0, device(-67.5, 180.0)))
    offer_distance(g.intake, "DVL - Beam 3", distance(1.0, 20.0, device(-60.0, 90.0)))
    offer_distance(g.intake, "Altimeter", distance(1.0, 30.0, device(-60.0, 0.0)))
    offer_distance(g.intake, "DVL Beam 2", distance(1.0, 20.0, device(0.0, 0.0)))
    astern, starboard, tilted, by_name = g.resolve()
    reach = 20.0 * math.sin(math.radians(22.5))
    assert np.allclose(offset_of(astern.lat_deg, astern.lon_deg), (1.0 - reach, 0.0), atol=1e-3)
    assert np.allclose(offset_of(starboard.lat_deg, starboard.lon_deg), (1.0, 10.0), atol=1e-3)
    assert starboard.beam == 3
    assert tilted.bottom_depth_m == pytest.approx(1.0 + 30.0 * math.cos(math.radians(30.0)))
    assert np.allclose(offset_of(by_name.lat_deg, by_name.lon_deg), (1.0 - reach, 0.0), atol=1e-3)


def test_a_range_that_is_the_height_above_the_bottom_has_no_direction() -> None:
    g = Gate("vertical")
    offer_distance(g.intake, "Altimeter", distance(1.0, 30.0, device(-60.0, 0.0)))
    (sounding,) = g.resolve()
    assert sounding.bottom_depth_m == pytest.approx(31.0)


def test_beams_whose_makes_differ_are_refused_while_nobody_tells_where_they_point() -> None:
    g = Gate()
    refused = offer_distance(g.intake, "DVL - Beam 1", distance(1.0, 20.0, device(0.0, 0.0)))
    assert refused is not None
    assert refused.reason == "its vehicle does not tell where the beam points"


def device(theta_deg: float, psi_deg: float) -> imcpy.DeviceState:
    told = imcpy.DeviceState()
    told.theta, told.psi = math.radians(theta_deg), math.radians(psi_deg)
    return told


def distance(time_s: float, range_m: float, location: imcpy.DeviceState) -> imcpy.Distance:
    message = imcpy.Distance()
    message.timestamp, message.value = time_s, range_m
    message.validity = imcpy.Distance.ValidityEnum.VALID
    message.location.append(location)
    return message


def test_lever_arm_turns_with_the_vehicle() -> None:
    lat, lon, depth = footprint(state(yaw=math.pi / 2), Beam(body_fixed=False), 5.0, (1.0, 0.0, 0.5))
    assert np.allclose(offset_of(lat, lon), (0.0, 1.0), atol=1e-3)
    assert depth == pytest.approx(7.5)


def test_angles_are_interpolated_the_short_way_round() -> None:
    middle = interpolate(state(0.0, yaw=3.1), state(1.0, yaw=-3.1), 0.5)
    assert abs(middle.yaw_rad) == pytest.approx(math.pi)


@given(st.floats(0.0, 1.0), st.floats(0.0, 50.0), st.floats(0.0, 50.0))
def test_interpolation_stays_between_its_ends(w: Any, depth_a: Any, depth_b: Any) -> None:
    middle = interpolate(state(0.0, depth_a), state(1.0, depth_b), w)
    assert min(depth_a, depth_b) - 1e-9 <= middle.depth_m <= max(depth_a, depth_b) + 1e-9


def test_history_puts_late_states_in_their_place_and_drops_repeats() -> None:
    history = StateHistory()
    assert [history.add(state(t)) for t in (1.0, 3.0, 2.0, 3.0)] == [True, True, True, False]
    before, after = history.around(2.5)
    assert (before.time_s, after.time_s) == (2.0, 3.0)
    assert history.around(0.5)[0] is None
    assert history.around(3.5)[1] is None


class Gate:
    """A gate with states at whole seconds, sinking 1 m/s while going north at 1 m/s."""

    def __init__(self, altimeter: AltimeterGeometry = "vertical") -> None:
        self.intake = SoundingIntake("v", beam_table(altimeter), 200.0)
        self.history = StateHistory()
        for t in range(4):
            self.add_state(float(t))

    def add_state(self, t: float) -> None:
        self.history.add(state(t, depth_m=t, north_m=t))

    def resolve(self) -> list[Any]:
        return list(self.intake.resolve(self.history, 0.3))


def test_sounding_takes_the_state_at_its_own_time() -> None:
    g = Gate()
    assert g.intake.offer(1.5, "Altimeter", True, 10.0) is None
    (sounding,) = g.resolve()
    assert isinstance(sounding, Sounding)
    assert sounding.bottom_depth_m == pytest.approx(11.5)
    assert sounding.vehicle_depth_m == pytest.approx(1.5)
    assert offset_of(sounding.lat_deg, sounding.lon_deg)[0] == pytest.approx(1.5, abs=1e-3)
    assert (sounding.source, sounding.range_m, sounding.position_sd_m) == ("Altimeter", 10.0, 0.3)


def test_sounding_waits_for_the_state_after_it() -> None:
    g = Gate()
    g.intake.offer(3.4, "Altimeter", True, 10.0)
    assert g.resolve() == []
    g.add_state(4.0)
    (sounding,) = g.resolve()
    assert sounding.bottom_depth_m == pytest.approx(13.4)


@pytest.mark.parametrize(
    ("source", "valid", "range_m", "reason"),
    [
        ("Altimeter", False, 10.0, "invalid"),
        ("Altimeter", True, 0.0, "zero"),
        ("Altimeter", True, -1.0, "zero or negative"),
        ("Altimeter", True, math.nan, "not a number"),
        ("Altimeter", True, math.inf, "not a number"),
        ("DVL Beam 2", True, 500.0, "beyond 200 m"),
        (None, True, 10.0, "names not known"),
    ],
)
def test_bad_ranges_are_refused_with_their_reason(source: str | None, valid: bool, range_m: float, reason: str) -> None:
    g = Gate()
    refused = g.intake.offer(1.5, source, valid, range_m)
    assert isinstance(refused, SoundingRefused)
    assert reason in refused.reason
    assert g.intake.refused.total() == 1
    assert g.resolve() == []


def test_forward_looking_echo_sounder_is_ignored() -> None:
    g = Gate()
    assert g.intake.offer(1.5, "Echo Sounder", True, 10.0) is None
    assert g.resolve() == []
    assert g.intake.ignored["Echo Sounder"] == 1


def test_repeated_distance_is_refused_and_a_late_one_is_not() -> None:
    g = Gate()
    assert g.intake.offer(1.5, "Altimeter", True, 10.0) is None
    assert g.intake.offer(1.5, "Altimeter", True, 10.0).reason == "repeated"
    assert g.intake.offer(1.2, "Altimeter", True, 10.0) is None
    assert len(g.resolve()) == 2


def test_distance_in_a_gap_of_the_states_is_refused() -> None:
    g = Gate()
    g.intake.offer(5.0, "Altimeter", True, 10.0)
    g.add_state(30.0)
    (refused,) = g.resolve()
    assert isinstance(refused, SoundingRefused)
    assert "no state" in refused.reason


def test_distance_without_a_later_state_is_given_up_in_bounded_memory() -> None:
    g = Gate()
    refusals = [g.intake.offer(10.0 + k, "Altimeter", True, 5.0) for k in range(300)]
    assert sum(r is not None for r in refusals) == 300 - 256
