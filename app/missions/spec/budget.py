"""How long a mission is: by time, by way or by steps."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from app.missions.spec.base import Model

MOST_STEPS = 100_000
Steps = Annotated[int, Field(ge=1, le=MOST_STEPS)]


@dataclass(frozen=True)
class Allowance:
    """What one vehicle may fly: a number of legs, or a way in metres."""

    legs: int | None = None
    metres: float | None = None

    def most_m(self, leg_m: float) -> float:
        """Return how far that is in metres when legs are as long as ``leg_m``."""
        return self.metres if self.metres is not None else (self.legs or 0) * leg_m

    def most_legs(self, leg_m: float) -> int:
        """Return how many legs that is, the last one whole, when legs are as long as ``leg_m``; 1 to MOST_STEPS."""
        # Not one more because of how numbers are rounded.
        return self.legs or min(max(math.ceil(self.most_m(leg_m) / leg_m - 1e-9), 1), MOST_STEPS)


def _is_absent(value: Any) -> bool:
    return value is None


class Budget(Model):
    """How long a mission is; exactly one of these."""

    minutes: float | None = Field(
        default=None,
        gt=0,
        le=10_080,
        exclude_if=_is_absent,
        description="Minutes in which each vehicle surveys, by its own clock: turns and waiting for others count, the "
        "way there and home and fixes at the surface do not",
        examples=[60.0],
    )
    km_per_vehicle: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        exclude_if=_is_absent,
        description="Kilometres of legs that each vehicle flies, however long its turns are",
        examples=[2.0],
    )
    steps: Steps | None = Field(default=None, exclude_if=_is_absent, description="Legs that each vehicle flies")

    @model_validator(mode="after")
    def _is_exactly_one(self) -> Self:
        given = [name for name, value in self if value is not None]
        if len(given) != 1:
            raise ValueError(
                f"{' and '.join(given) or 'nothing'} given: give exactly one of {', '.join(type(self).model_fields)}"
            )
        return self

    @property
    def unit(self) -> str:
        """The name of what is given."""
        return next(name for name, value in self if value is not None)

    @property
    def words(self) -> str:
        """How long that is, as it is told."""
        if self.minutes is not None:
            return f"{self.minutes:g} min"
        return f"{self.steps} steps" if self.km_per_vehicle is None else f"{self.km_per_vehicle:g} km per vehicle"

    def allowance(self, speed_mps: float) -> Allowance:
        """Return what a vehicle of this speed may fly."""
        if self.minutes is not None:
            return Allowance(metres=self.minutes * 60 * speed_mps)
        if self.km_per_vehicle is not None:
            return Allowance(metres=self.km_per_vehicle * 1000)
        return Allowance(legs=self.steps)
