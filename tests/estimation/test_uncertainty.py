"""What makes soundings uncertain adds up as errors that are really made do."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from app.arrays import FloatArray
from app.estimation.uncertainty import COMPONENTS, SOUND_SPEED_MPS, BeamPaths, SoundingErrors, uncertainty

DRAWN = 40_000


def beam(angle_deg: float, down_m: float = 20.0, pitch_deg: float = 0.0, count: int = 1) -> BeamPaths:
    return BeamPaths(
        np.full(count, np.radians(angle_deg)), np.full(count, down_m), np.full(count, np.radians(pitch_deg))
    )


def only(**errors: float) -> SoundingErrors:
    """These errors and no other ones."""
    return SoundingErrors(**(dict.fromkeys(COMPONENTS, 0.0) | errors))


def test_every_error_has_its_part_and_only_those() -> None:
    assert set(COMPONENTS) == set(SoundingErrors.model_fields)
    for component in COMPONENTS.values():
        at = beam(45.0)
        assert component.down(at).shape == component.aside(at).shape == (1,)


def test_the_usual_errors_are_those_of_surveys() -> None:
    usual = SoundingErrors()
    assert (usual.heave_m, usual.waterline_m, usual.roll_patch_deg) == (0.05, 0.02, 0.1)
    assert (usual.surface_sound_speed_mps, usual.position_m) == (0.5, 1.5)
    with pytest.raises(ValidationError, match="heave_m"):
        SoundingErrors(heave_m=-1.0)


@pytest.mark.parametrize("angle_deg", [-60.0, -30.0, 0.0, 45.0])
@pytest.mark.parametrize("name", ["range_m", "range_pct", "beam_angle_deg", "roll_deg", "roll_patch_deg"])
def test_errors_across_the_track_are_those_of_drawn_beams(name: str, angle_deg: float) -> None:
    size = 0.2
    off = np.random.default_rng(1).normal(0.0, size, DRAWN)
    angle, slant = np.full(DRAWN, np.radians(angle_deg)), np.full(DRAWN, 20.0 / np.cos(np.radians(angle_deg)))
    match name:
        case "range_m":
            slant += off
        case "range_pct":
            slant *= 1.0 + off / 100.0
        case _:
            angle += np.radians(off)
    found = uncertainty(beam(angle_deg), only(**{name: size}))
    assert found.vertical_sd_m[0] == pytest.approx((slant * np.cos(angle)).std(), rel=0.02, abs=3e-4)
    aside = (slant * np.sin(angle)).std()
    assert np.sqrt(2.0) * found.horizontal_sd_m[0] == pytest.approx(aside, rel=0.02, abs=3e-4)


def test_a_beam_is_steered_wrong_by_the_sound_speed_at_the_sonar() -> None:
    angle, off_mps = np.radians(50.0), 2.0
    steered = np.arcsin(np.sin(angle) * (SOUND_SPEED_MPS + off_mps) / SOUND_SPEED_MPS)
    slant = 20.0 / np.cos(angle)
    found = uncertainty(beam(50.0), only(surface_sound_speed_mps=off_mps))
    assert found.vertical_sd_m[0] == pytest.approx(abs(slant * np.cos(steered) - 20.0), rel=0.01)


def test_pitch_and_heading_move_soundings_along_the_track() -> None:
    turned = uncertainty(beam(45.0), only(heading_deg=1.0))
    assert turned.vertical_sd_m[0] == 0.0
    assert np.sqrt(2.0) * turned.horizontal_sd_m[0] == pytest.approx(20.0 * np.radians(1.0))
    level, pitched = (uncertainty(beam(0.0, pitch_deg=pitch), only(pitch_deg=1.0)) for pitch in (0.0, 10.0))
    assert level.vertical_sd_m[0] == 0.0
    assert pitched.vertical_sd_m[0] == pytest.approx(20.0 * np.tan(np.radians(10.0)) * np.radians(1.0))


@given(st.floats(-70.0, 70.0), st.floats(1.0, 200.0))
def test_variances_add(angle_deg: float, down_m: float) -> None:
    usual, at = SoundingErrors(), beam(angle_deg, down_m)
    parts = [uncertainty(at, only(**{name: getattr(usual, name)})) for name in COMPONENTS]
    whole = uncertainty(at, usual)

    def together(values: list[FloatArray]) -> float:
        return float(np.sqrt(sum(value[0] ** 2 for value in values)))

    assert whole.vertical_sd_m[0] == pytest.approx(together([part.vertical_sd_m for part in parts]))
    assert whole.horizontal_sd_m[0] == pytest.approx(together([part.horizontal_sd_m for part in parts]))
    assert whole.vertical_sd_m[0] == pytest.approx(np.hypot(whole.scattered_sd_m[0], whole.shared_sd_m[0]))


def test_soundings_are_less_sure_to_the_sides_and_far_below() -> None:
    usual = SoundingErrors()
    inner, outer, deep = (uncertainty(at, usual) for at in (beam(0.0), beam(60.0), beam(0.0, 100.0)))
    assert inner.vertical_sd_m[0] < outer.vertical_sd_m[0]
    assert inner.vertical_sd_m[0] < deep.vertical_sd_m[0]
    assert inner.vertical_sd_m[0] == pytest.approx(0.118, abs=0.01), "in 20 m below the sonar"


def test_what_a_vehicle_says_of_its_place_counts() -> None:
    usual, at = SoundingErrors(), beam(0.0, 5.0, count=2)
    found = uncertainty(at, usual, np.array([np.nan, 12.0]))
    assert found.horizontal_sd_m == pytest.approx([1.5, 12.0], abs=0.01)
