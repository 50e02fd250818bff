"""Total propagated uncertainty of a swath sonar's soundings, after Hare (1995).

R. Hare, "Depth and position error budgets for multibeam echosounding", International Hydrographic Review 72(2), 1995.
Each source of error moves a sounding up or down and aside by its standard deviation times a sensitivity that depends on
where the beam went; variances add.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from app.arrays import FloatArray

SOUND_SPEED_MPS = 1500.0
"""Errors are small beside what it differs from place to place."""


class SoundingErrors(BaseModel):
    """Standard deviations (1 sigma) of what makes soundings of swath sonars uncertain."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    range_m: float = Field(default=0.03, ge=0, le=10, description="Range: the part that is the same at all ranges, m")
    range_pct: float = Field(default=0.5, ge=0, le=20, description="Range: the part that grows with it, %")
    beam_angle_deg: float = Field(default=0.1, ge=0, le=10, description="Direction of a beam in the sonar, degrees")
    roll_deg: float = Field(default=0.05, ge=0, le=10, description="Roll as it is measured, degrees")
    pitch_deg: float = Field(default=0.05, ge=0, le=10, description="Pitch as it is measured, degrees")
    heading_deg: float = Field(default=0.5, ge=0, le=45, description="Heading as it is measured, degrees")
    roll_patch_deg: float = Field(
        default=0.1, ge=0, le=10, description="Roll of the sonar in the vehicle, as a patch test leaves it, degrees"
    )
    heave_m: float = Field(
        default=0.05, ge=0, le=10, description="Depth of the vehicle from moment to moment: heave, waves, m"
    )
    waterline_m: float = Field(
        default=0.02, ge=0, le=10, description="Depth of the sonar below the water level as a whole: draught, m"
    )
    surface_sound_speed_mps: float = Field(
        default=0.5, ge=0, le=50, description="Sound speed at the sonar, by which it steers its beams, m/s"
    )
    sound_speed_profile_mps: float = Field(
        default=0.5, ge=0, le=50, description="Sound speed between the sonar and the bottom, m/s"
    )
    position_m: float = Field(
        default=1.5,
        ge=0,
        le=1000,
        description="East and north of a vehicle that does not say how well it knows its place, m each",
    )


@dataclass(frozen=True)
class BeamPaths:
    """Where beams went, arrays (n,).

    Attributes
    ----------
    angle_rad
        From straight down, across the track.
    down_m
        From the sonar to the bottom, positive.
    pitch_rad
        Of the vehicle.
    """

    angle_rad: FloatArray
    down_m: FloatArray
    pitch_rad: FloatArray

    @property
    def slope(self) -> FloatArray:
        """Tangent of the angle; beams along the horizon count as very flat ones."""
        return np.asarray(np.tan(np.clip(np.abs(self.angle_rad), 0.0, 1.45)))

    @property
    def across_m(self) -> FloatArray:
        """How far aside the bottom was met."""
        return self.down_m * self.slope


Sensitivity = Callable[[BeamPaths], FloatArray]
Deviation = Callable[[SoundingErrors], float]


@dataclass(frozen=True)
class Component:
    """A source of error.

    Attributes
    ----------
    sd
        Returns its standard deviation, in ``unit``.
    down, aside
        How far the sounding moves for an error of one unit, metres.
    scatters
        Whether it differs from beam to beam, so that the mean of many knows it better; else they share it.
    """

    title: str
    unit: str
    sd: Deviation
    down: Sensitivity
    aside: Sensitivity
    scatters: bool = False


def _none(beams: BeamPaths) -> FloatArray:
    return np.zeros_like(beams.down_m)


def _one(beams: BeamPaths) -> FloatArray:
    return np.ones_like(beams.down_m)


def _turned_down(beams: BeamPaths) -> FloatArray:
    return np.radians(beams.across_m)


def _turned_aside(beams: BeamPaths) -> FloatArray:
    return np.radians(beams.down_m)


COMPONENTS = {
    "range_m": Component(
        "Range",
        "m",
        lambda e: e.range_m,
        lambda b: 1.0 / np.hypot(1.0, b.slope),
        lambda b: b.slope / np.hypot(1.0, b.slope),
        scatters=True,
    ),
    "range_pct": Component(
        "Range, by its length",
        "%",
        lambda e: e.range_pct,
        lambda b: b.down_m / 100.0,
        lambda b: b.across_m / 100.0,
        scatters=True,
    ),
    "beam_angle_deg": Component(
        "Beam angle", "degree", lambda e: e.beam_angle_deg, _turned_down, _turned_aside, scatters=True
    ),
    "roll_deg": Component("Roll", "degree", lambda e: e.roll_deg, _turned_down, _turned_aside),
    "pitch_deg": Component(
        "Pitch",
        "degree",
        lambda e: e.pitch_deg,
        lambda b: np.radians(b.down_m * np.tan(np.abs(b.pitch_rad))),
        _turned_aside,
    ),
    "heading_deg": Component("Heading", "degree", lambda e: e.heading_deg, _none, lambda b: np.radians(b.across_m)),
    "roll_patch_deg": Component(
        "Roll of the mounting", "degree", lambda e: e.roll_patch_deg, _turned_down, _turned_aside
    ),
    "heave_m": Component("Heave", "m", lambda e: e.heave_m, _one, _none),
    "waterline_m": Component("Waterline", "m", lambda e: e.waterline_m, _one, _none),
    "surface_sound_speed_mps": Component(
        "Sound speed at the sonar",
        "m/s",
        lambda e: e.surface_sound_speed_mps,
        # The beam is steered aside by tan(angle) dc / c.
        lambda b: b.across_m * b.slope / SOUND_SPEED_MPS,
        lambda b: b.across_m / SOUND_SPEED_MPS,
    ),
    "sound_speed_profile_mps": Component(
        "Sound speed profile",
        "m/s",
        lambda e: e.sound_speed_profile_mps,
        # The range is too long, and the beam is bent by half of what steering it does; Hare takes both as independent.
        lambda b: b.down_m * np.hypot(1.0, 0.5 * b.slope**2) / SOUND_SPEED_MPS,
        lambda b: b.across_m * np.hypot(1.0, 0.5) / SOUND_SPEED_MPS,
    ),
    "position_m": Component("Position", "m", lambda e: e.position_m, _none, lambda b: np.sqrt(2.0) * _one(b)),
}
"""Every source of error by its name in ``SoundingErrors``."""


@dataclass(frozen=True)
class Uncertainty:
    """Standard deviations of soundings, arrays (n,), metres.

    Attributes
    ----------
    scattered_sd_m
        Of the depth, different from beam to beam.
    shared_sd_m
        Of the depth, the same for the beams of a line.
    horizontal_sd_m
        Of each of both horizontal coordinates.
    """

    scattered_sd_m: FloatArray
    shared_sd_m: FloatArray
    horizontal_sd_m: FloatArray

    @property
    def vertical_sd_m(self) -> FloatArray:
        """Of the depth of a single sounding over level ground."""
        return np.asarray(np.hypot(self.scattered_sd_m, self.shared_sd_m))


def uncertainty(beams: BeamPaths, errors: SoundingErrors, position_sd_m: FloatArray | None = None) -> Uncertainty:
    """Return how uncertain the soundings of beams are.

    Parameters
    ----------
    position_sd_m : (n,)
        What the vehicles say of how well they know their place, each coordinate; NaN: they do not say.
    """
    scattered, shared, aside = (np.zeros_like(beams.down_m) for _ in range(3))
    for name, component in COMPONENTS.items():
        sd: FloatArray | float = component.sd(errors)
        if name == "position_m" and position_sd_m is not None:
            sd = np.where(np.isfinite(position_sd_m), position_sd_m, sd)
        part = scattered if component.scatters else shared
        part += (sd * component.down(beams)) ** 2
        aside += (sd * component.aside(beams)) ** 2
    return Uncertainty(np.sqrt(scattered), np.sqrt(shared), np.sqrt(0.5 * aside))
