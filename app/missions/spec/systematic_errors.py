"""What is always wrong in the same way with a mission's sonars and water levels, and is taken out of every depth."""

from itertools import pairwise
from typing import Annotated, Self

from pydantic import FailFast, Field, model_validator

from app.missions.spec.base import Model, Name


class InstrumentErrors(Model):
    """How one vehicle's sonar is wrong."""

    depth_m: float = Field(default=0.0, ge=-20, le=20, description="By how much its depths are too large, metres")
    roll_offset_deg: float = Field(
        default=0.0,
        ge=-20,
        le=20,
        description="How far the beams of its swath sonar point to starboard of where they are said to, degrees: the "
        "roll of a patch test",
    )
    sound_speed_mps: float = Field(
        default=0.0,
        ge=-100,
        le=100,
        description="How much faster sound is at its swath sonar than it assumes when it steers its beams, m/s: bent "
        "swaths",
    )

    @property
    def has_swath_errors(self) -> bool:
        """Whether beams point elsewhere than they are said to."""
        return self.roll_offset_deg != 0.0 or self.sound_speed_mps != 0.0


class SystematicErrors(Model):
    """Errors that are the same for many soundings; they are taken out of every depth beside tide and sound speed."""

    vehicles: dict[Name, InstrumentErrors] = Field(
        default_factory=dict, max_length=100, description="By vehicle; one that is missing is right"
    )
    water_level: Annotated[list[tuple[float, float]], FailFast()] = Field(
        default_factory=list,
        max_length=1000,
        description="By how much depths are still too large at some times, beside the tide: [Unix seconds of the "
        "vehicles' clocks, metres], in order; linear between them, and as at the nearest before and after",
    )
    source: str = Field(default="", max_length=200, description="Where these come from, kept with the product")

    @model_validator(mode="after")
    def _times_ascend(self) -> Self:
        for index, (before, after) in enumerate(pairwise(time_s for time_s, _ in self.water_level)):
            if after <= before:
                raise ValueError(f"water_level: entry {index + 1} is at {after:.1f} s, not after {before:.1f} s")
        for time_s, level_m in self.water_level:
            if not (0 <= time_s < 1e11 and abs(level_m) <= 20):
                raise ValueError(f"water_level: [{time_s}, {level_m}] is not [Unix seconds, metres up to 20]")
        return self

    @property
    def is_empty(self) -> bool:
        """Whether nothing is taken out."""
        return not self.water_level and all(one == InstrumentErrors() for one in self.vehicles.values())
