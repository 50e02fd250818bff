"""Sound speeds of vehicles: of where the vehicle was, from a probe or a CTD, and nothing that no water has."""

import math

import gsw
import imcpy
import pytest

from imc_bridge.events import SoundSpeedSample
from imc_bridge.telemetry.soundings import StateHistory, StateSample
from imc_bridge.telemetry.water import MAX_PENDING, WaterIntake, sound_speed_mps

LAT_DEG, LON_DEG = 41.185, -8.705


def sinking() -> StateHistory:
    """A vehicle that goes down 1 m each second from the surface, from second 0 on."""
    history = StateHistory()
    for second in range(21):
        history.add(
            StateSample(float(second), math.radians(LAT_DEG), math.radians(LON_DEG), float(second), 0.0, 0.0, 0.0)
        )
    return history


def told(kind: type[imcpy.Message], time_s: float, value: float) -> imcpy.Message:
    message = kind()
    message.timestamp, message.value = time_s, value
    return message


def taken(*messages: tuple[str, str, float, float]) -> tuple[WaterIntake, list[SoundSpeedSample]]:
    """What becomes of messages: name, entity, time, value."""
    intake = WaterIntake("noptilus-1")
    for name, entity, time_s, value in messages:
        intake.offer(name, entity, told(getattr(imcpy, name), time_s, value))
    return intake, list(intake.resolve(sinking()))


@pytest.mark.parametrize(
    ("salinity", "temperature", "pressure", "speed"),
    # Check values of TEOS-10 for gsw_sound_speed_t_exact (teos-10.org): absolute salinity, in-situ temperature, dbar.
    [
        (34.7118, 28.7856, 10.0, 1542.615803587414),
        (34.8915, 28.4329, 50.0, 1542.703534065789),
        (35.0256, 22.8103, 125.0, 1530.844979136360),
        (34.8472, 10.2600, 250.0, 1494.409996920661),
        (34.7366, 6.8863, 600.0, 1487.377102518027),
        (34.7324, 4.4036, 1000.0, 1483.934609078705),
    ],
)
def test_the_equation_of_state_gives_its_published_values(
    salinity: float, temperature: float, pressure: float, speed: float
) -> None:
    # Back from what the publication states to what a CTD at a depth tells.
    depth_m, practical = -_height_m(pressure), salinity * 35.0 / 35.16504
    assert sound_speed_mps(temperature, practical, depth_m, 0.0) == pytest.approx(speed, abs=1e-6)


def _height_m(pressure_dbar: float) -> float:
    return float(gsw.z_from_p(pressure_dbar, 0.0))


def test_a_probe_tells_of_where_the_vehicle_was() -> None:
    _, (one,) = taken(("SoundSpeed", "CTD", 7.25, 1507.5))
    assert (one.vehicle, one.source, one.time_s, one.speed_mps) == ("noptilus-1", "CTD", 7.25, 1507.5)
    assert one.depth_m == pytest.approx(7.25)
    assert (one.lat_deg, one.lon_deg) == pytest.approx((LAT_DEG, LON_DEG))


def test_temperature_and_salinity_of_one_entity_tell_it_where_no_probe_does() -> None:
    _, (one,) = taken(
        ("Temperature", "Battery", 5.0, 30.0), ("Temperature", "CTD", 5.0, 14.0), ("Salinity", "CTD", 5.1, 35.5)
    )
    assert one.source == "CTD"
    assert one.speed_mps == pytest.approx(sound_speed_mps(14.0, 35.5, 5.1, LAT_DEG))
    _, probes = taken(
        ("SoundSpeed", "CTD", 5.0, 1500.0), ("Temperature", "CTD", 5.0, 14.0), ("Salinity", "CTD", 5.0, 35.5)
    )
    assert [one.speed_mps for one in probes] == [1500.0]
    _, apart = taken(("Temperature", "CTD", 2.0, 14.0), ("Salinity", "CTD", 9.0, 35.5))
    assert apart == []


@pytest.mark.parametrize(
    "message",
    [
        ("SoundSpeed", "CTD", 5.0, math.nan),
        ("SoundSpeed", "CTD", 5.0, math.inf),
        ("SoundSpeed", "CTD", 5.0, -1.0),
        ("SoundSpeed", "CTD", 5.0, 343.0),
        ("SoundSpeed", "CTD", 5.0, 1e30),
        ("Temperature", "CTD", 5.0, 80.0),
        ("Salinity", "CTD", 5.0, -3.0),
        ("SoundSpeed", "CTD", 1e9, 1500.0),
        ("SoundSpeed", "CTD", -1e9, 1500.0),
    ],
)
def test_what_no_water_has_or_no_state_is_near_is_left_out(message: tuple[str, str, float, float]) -> None:
    intake, found = taken(message)
    assert found == []
    assert intake.refused == 1


def test_a_flood_is_bounded_and_what_comes_twice_counts_once() -> None:
    flood = [("SoundSpeed", "CTD", 5.0 + k * 1e-4, 1500.0) for k in range(10_000)]
    _, found = taken(*flood)
    assert len(found) == MAX_PENDING
    _, twice = taken(*[("SoundSpeed", "CTD", 5.0, 1500.0)] * 3)
    assert len(twice) == 1
    _, made_up = taken(*[("SoundSpeed", f"probe {k}", 5.0, 1500.0) for k in range(200)])
    assert len({one.source for one in made_up}) <= 32
