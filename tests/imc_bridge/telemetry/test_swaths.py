"""From SonarData to pings: what was written is what is read, and nothing that is damaged raises."""

import math
from typing import Any

import imcpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from imcpy.coordinates import WGS84

from imc_bridge.events import PingRefused, SwathPing
from imc_bridge.telemetry.soundings import StateHistory, StateSample
from imc_bridge.telemetry.swaths import (
    LONGEST_SLANT_M,
    MAX_BEAMS,
    MAX_PENDING,
    PingIntake,
    SwathError,
    bottom_below,
    looks_down,
    read_swath,
)
from tests.support.imc.sonar_data import WIDTH_RAD, sonar_data

LAT, LON = math.radians(41.185), math.radians(-8.705)
BITS = (8, 16, 24, 32)
NAME = "Multibeam"


def over_the_wire(message: imcpy.Message) -> Any:
    return imcpy.Packet.deserialize(message.serialize())


@st.composite
def swaths(draw: st.DrawFn) -> dict[str, Any]:
    """Everything that a SonarData of a multibeam can say, beams within a quarter turn to either side."""
    count, bits = draw(st.integers(2, 300)), draw(st.sampled_from(BITS))
    values = st.lists(st.integers(0, 2**bits - 1), min_size=count, max_size=count)
    steps = draw(st.none() | st.lists(st.integers(0, 65535), min_size=count, max_size=count))
    return {
        "points": draw(values),
        "bits": bits,
        "scale": draw(st.floats(2**-13, 10.0, width=32)),
        "start_rad": draw(st.floats(-1.5, 0.0, width=32)),
        "width_rad": draw(st.floats(2**-13, 2**-8, width=32)),
        "steps": steps,
        "step_scale": 1.5 / max(sum(steps or ()), 1),
        "intensities": draw(st.none() | values),
    }


@given(swaths())
def test_what_was_written_is_read(swath: dict[str, Any]) -> None:
    read = read_swath(over_the_wire(sonar_data(**swath)))
    if swath["steps"] is None:
        angles = [swath["start_rad"] + k * swath["width_rad"] for k in range(len(swath["points"]))]
    else:
        angles = [
            swath["start_rad"] + sum(swath["steps"][: k + 1]) * swath["step_scale"] for k in range(len(swath["points"]))
        ]
    np.testing.assert_allclose(read.angles_rad, angles, atol=1e-5)
    ranges = [point * swath["scale"] for point in swath["points"]]
    ranges = [r if 0.0 < r <= LONGEST_SLANT_M else math.nan for r in ranges]
    np.testing.assert_allclose(read.ranges_m, ranges, rtol=1e-5)


@given(swaths(), st.data())
def test_damaged_data_never_raises_anything_else(swath: dict[str, Any], data: st.DataObject) -> None:
    message = sonar_data(**swath)
    damaged = bytearray(message.data)
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, min(len(damaged) - 1, 16)))] = data.draw(st.integers(0, 255))
    message.data = bytes(damaged[: data.draw(st.integers(0, len(damaged)))])
    message.bits_per_point = data.draw(st.integers(0, 255))
    message.scale_factor = data.draw(st.floats(width=32))
    message.beam_config[0].beam_width = data.draw(st.floats(width=32))
    try:
        read = read_swath(message)
    except SwathError:
        return
    assert len(read.angles_rad) == len(read.ranges_m) <= MAX_BEAMS
    assert np.isfinite(read.angles_rad).all()
    assert not (read.ranges_m <= 0.0).any()
    assert not (read.ranges_m > LONGEST_SLANT_M).any()


@given(st.binary(max_size=400), st.sampled_from(BITS))
def test_any_bytes_are_read_or_refused(data: bytes, bits: int) -> None:
    message = sonar_data([100], bits=bits)
    message.data = data
    intake = PingIntake("v")
    message.timestamp = 1.0
    intake.offer(NAME, message)
    assert sum(intake.refused.values()) <= 1


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"data": b"\x01"}, "shorter than its header"),
        ({"points": []}, f"no beams, or more than {MAX_BEAMS}"),
        ({"points": [1] * (MAX_BEAMS + 1)}, f"no beams, or more than {MAX_BEAMS}"),
        ({"bits_per_point": 12}, "bits per point other than 8, 16, 24 or 32"),
        ({"bits_per_point": 0}, "bits per point other than 8, 16, 24 or 32"),
        ({"bits_per_point": 64}, "bits per point other than 8, 16, 24 or 32"),
        ({"bits_per_point": 8}, "data of another length than its header says"),
        ({"scale_factor": 0.0}, "scaling factor is no positive number"),
        ({"scale_factor": math.nan}, "scaling factor is no positive number"),
        ({"start_rad": math.nan}, "angles that are none"),
        ({"start_rad": 4.0}, "angles that are none"),
        ({"steps": [0, 9], "step_scale": math.inf}, "angles that are none"),
        ({"width_rad": -1.0}, "neither angle steps nor the width of a beam"),
        ({"data": bytes(6) + b"\xf0" + bytes(400)}, "flags that are not known"),
        ({"points": [0, 0]}, "nothing detected"),
        ({"points": [100, 200], "range_m": (5, 50)}, "nothing detected"),
        ({"points": [100, 200], "start_rad": 2.0}, "nothing detected"),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_reason(changes: dict[str, Any], reason: str) -> None:
    fields = {name: changes[name] for name in ("data", "bits_per_point", "scale_factor") if name in changes}
    written = {name: value for name, value in changes.items() if name not in fields}
    message = sonar_data(**({"points": [100, 200]} | written))
    for name, value in fields.items():
        setattr(message, name, value)
    intake, refused = intake_with(message)
    assert refused == [PingRefused("v", message.timestamp, NAME, reason)]
    assert intake.refused == {reason: 1}


def test_beams_outside_of_the_sonars_own_range_heard_nothing() -> None:
    swath = read_swath(sonar_data([50, 101, 4999, 5001, 0], range_m=(1, 50)))
    np.testing.assert_array_equal(np.isnan(swath.ranges_m), [True, False, False, True, True])


def test_any_message_may_stand_where_a_beam_configuration_belongs() -> None:
    message = sonar_data([100, 200])
    message.beam_config.clear()
    with pytest.raises(SwathError, match="neither angle steps"):
        read_swath(message)
    assert len(read_swath(sonar_data([100], width_rad=-1.0)).angles_rad) == 1, "a single beam needs no width"


def state(time_s: float, **changes: float) -> StateSample:
    north_m = changes.pop("north_m", 0.0)
    lat, lon = WGS84.displace(LAT, LON, north_m, 0.0)
    attitude = {"roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": 0.0} | changes
    return StateSample(time_s, lat, lon, 2.0, **attitude)


def at(time_s: float, points: list[int] | None = None) -> imcpy.Message:
    message = sonar_data(points or [1000, 1100, 1200])
    message.timestamp = time_s
    return message


def intake_with(*messages: imcpy.Message, source: str | None = NAME) -> tuple[PingIntake, list[Any]]:
    intake = PingIntake("v")
    return intake, [refused for message in messages if (refused := intake.offer(source, message)) is not None]


def test_a_ping_gets_the_state_interpolated_at_its_time() -> None:
    intake, _ = intake_with(at(10.25))
    history = StateHistory()
    history.add(state(10.0, roll_rad=0.1, yaw_rad=3.1))
    assert not list(intake.resolve(history)), "no state after it yet"
    history.add(state(10.5, roll_rad=0.2, yaw_rad=-3.1, north_m=4.0))
    (ping,) = intake.resolve(history, 1.5)
    assert isinstance(ping, SwathPing)
    north_m = WGS84.displacement(LAT, LON, 0.0, math.radians(ping.lat_deg), math.radians(ping.lon_deg), 0.0)[0]
    assert north_m == pytest.approx(2.0, abs=1e-3)
    assert (ping.roll_rad, abs(ping.yaw_rad)) == pytest.approx((0.15, math.pi), abs=1e-9)
    assert (ping.vehicle, ping.source, ping.time_s, ping.depth_m, ping.position_sd_m) == ("v", NAME, 10.25, 2.0, 1.5)
    np.testing.assert_allclose(ping.angles_rad, -1.0 + np.arange(3) * WIDTH_RAD, atol=1e-6)
    np.testing.assert_allclose(ping.ranges_m, [10.0, 11.0, 12.0], rtol=1e-6)
    assert (intake.accepted, intake.heard) == (1, {NAME: 1})


def test_a_ping_comes_once_and_only_from_what_looks_down() -> None:
    intake, refused = intake_with(at(1.0), at(1.0))
    assert [r.reason for r in refused] == ["repeated"]
    assert intake_with(at(1.0), source=None)[1][0].reason == "entity names not known yet"
    intake, refused = intake_with(at(1.0), source="Forward Multibeam")
    assert [r.reason for r in refused] == ["its entity is not called a multibeam, or looks ahead"]
    assert intake.heard == {}
    assert all(looks_down(name) for name in ("Multibeam", "Multi-Beam Sonar", "MBES", "Bathymetry", "swath"))
    assert not any(looks_down(name) for name in ("Sidescan", "FLS multibeam", "entity 7", "Obstacle Multibeam"))
    sidescan = at(1.0)
    sidescan.type = imcpy.SonarData.TypeEnum.SIDESCAN
    intake, refused = intake_with(sidescan)
    assert (refused, intake.heard) == ([], {})


def test_a_ping_without_a_state_is_given_up() -> None:
    intake, _ = intake_with(at(100.0), at(151.0))
    history = StateHistory()
    for time_s in (0.0, 150.0):
        history.add(state(time_s))
    assert [r.reason for r in intake.resolve(history)] == ["no state of the vehicle around its time"]
    history.add(state(151.5))
    assert len(list(intake.resolve(history))) == 1
    intake, refused = intake_with(*(at(float(k)) for k in range(MAX_PENDING + 1)))
    assert [r.time_s for r in refused] == [0.0], "the oldest one"
    assert len(list(intake.give_up())) == MAX_PENDING
    intake, _ = intake_with(at(1.0))
    intake.clear()
    assert intake.offer(NAME, at(1.0)) is None, "its clock has jumped, times may come again"


def test_the_bottom_below_is_where_the_steepest_beam_met_it() -> None:
    angles = np.array([-1.0, -0.2, 0.1, 1.0], np.float32)
    ranges = np.array([20.0, 10.0, math.nan, 20.0], np.float32)
    ping = SwathPing("v", 0.0, math.degrees(LAT), math.degrees(LON), 2.0, 0.0, 0.0, 0.0, angles, ranges, NAME)
    lat, lon, depth = bottom_below(ping)
    north, east, _ = WGS84.displacement(LAT, LON, 0.0, math.radians(lat), math.radians(lon), 0.0)
    assert (north, east) == pytest.approx((0.0, -10.0 * math.sin(0.2)), abs=1e-3)
    assert depth == pytest.approx(2.0 + 10.0 * math.cos(0.2), abs=1e-5)
