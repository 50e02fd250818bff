"""When vehicles come up for a GPS fix."""

import math
from typing import Self

from pydantic import Field, model_validator

from app.missions.spec.base import Model


class SurfacePolicy(Model):
    """When a vehicle comes up for a GPS fix: by how well it says that it knows where it is, by the clock, or both."""

    max_position_sd_m: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="Standard deviation of its position (position_sd_m) that a vehicle should not exceed; it comes up "
        "at 90 % of it. null: never because of it",
        examples=[3.0],
    )
    every_min: float | None = Field(
        default=None,
        gt=0,
        le=60 * 24,
        description="Minutes after which a vehicle comes up, also one that does not say how well it knows where it is. "
        "null: never because of the clock",
    )
    stay_s: float = Field(
        default=60.0, gt=0, le=3600, description="How long a vehicle stays up that comes up by the clock"
    )
    good_position_sd_m: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="It stays at the surface until its position is known this well; null: a third of the limit",
    )

    @model_validator(mode="after")
    def _can_be_reached(self) -> Self:
        if self.max_position_sd_m is None:
            if self.every_min is None:
                raise ValueError("neither max_position_sd_m nor every_min is given: give one of them")
            if self.good_position_sd_m is not None:
                raise ValueError("good_position_sd_m is given without max_position_sd_m: it has no meaning")
            return self
        if self.until_sd_m >= self.max_position_sd_m:
            raise ValueError(
                f"good_position_sd_m is {self.good_position_sd_m} but max_position_sd_m is {self.max_position_sd_m}: "
                "a good position must be known better than the limit"
            )
        return self

    @property
    def until_sd_m(self) -> float:
        """What counts as a good position again."""
        if self.max_position_sd_m is None:
            return math.inf
        return self.max_position_sd_m / 3.0 if self.good_position_sd_m is None else self.good_position_sd_m
