"""Moving targets that a mission keeps track of, as an operator describes them."""

from typing import Self

from pydantic import Field, model_validator

from app.missions.spec.base import Latitude, Longitude, Model, Name

MOST_TARGETS = 20


class SimulatedTarget(Model):
    """A target that moves about in the service's own simulation; vehicles of kind ``sim`` range to it."""

    start: tuple[Longitude, Latitude] = Field(description="Where it starts, [longitude, latitude]")
    depth_m: float = Field(default=2.0, ge=0, le=6000)
    course_deg: float = Field(default=0.0, ge=0, le=360, description="Clockwise from north; it turns at the sea's edge")
    speed_mps: float = Field(default=0.3, ge=0, le=10)


class TargetSpec(Model):
    """A moving target with something on it that vehicles range to by sound."""

    name: Name = Field(description="Its name", examples=["tag-1"])
    acoustic_name: str | None = Field(
        default=None,
        min_length=1,
        max_length=64,
        description="What vehicles' modems call it; lbl-7 is transponder 7 of a long base line; null: its name",
    )
    max_speed_mps: float = Field(default=1.0, gt=0, le=10, description="How fast it may be")
    velocity_change_mps: float = Field(
        default=0.1,
        gt=0,
        le=10,
        description="Standard deviation by which its velocity along east and along north changes within a minute",
    )
    min_depth_m: float = Field(default=0.0, ge=0, le=6000, description="Shallowest depth at which it may be found")
    max_depth_m: float | None = Field(
        default=None, gt=0, le=6000, description="Deepest; null: limits.max_depth_m of the vehicles"
    )
    simulated: SimulatedTarget | None = Field(
        default=None, description="Let it move about in the service's own simulation; null: it is a real one"
    )

    @model_validator(mode="after")
    def _depths_are_in_order(self) -> Self:
        if self.max_depth_m is not None and self.max_depth_m <= self.min_depth_m:
            raise ValueError(
                f"max_depth_m is {self.max_depth_m} but min_depth_m is {self.min_depth_m}: max_depth_m must be larger"
            )
        return self

    @property
    def called(self) -> str:
        """What vehicles' modems call it."""
        return self.acoustic_name or self.name


class Tracking(Model):
    """How well targets are to be known, and how well vehicles range to them."""

    accuracy_m: float = Field(
        default=5.0,
        gt=0,
        le=1000,
        description="A target counts as accurately known while its standard deviations along east, north and depth are "
        "below this",
    )
    range_noise: float = Field(
        default=0.01, gt=0, le=0.5, description="Standard deviation of a range to a target as a fraction of it"
    )
    range_sd_m: float = Field(
        default=0.5, ge=0, le=100, description="The part of it that is the same at any range, metres"
    )
    hearing_m: float | None = Field(
        default=None, gt=0, le=20_000, description="Farther than this no target is heard; null: unlimited"
    )
    pursue: bool = Field(
        default=True,
        description="Whether a vehicle leaves the mapping for a target that is not known well enough: one of three, "
        "none of a team of one",
    )
    standoff_m: float = Field(
        default=10.0, ge=0, le=1000, description="A vehicle that goes for a target comes no closer to any"
    )
