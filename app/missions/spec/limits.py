"""What no waypoint may break."""

from typing import Self

from pydantic import Field, model_validator

from app.missions.spec.base import Model


class Limits(Model):
    """What no waypoint may break. Checked before anything is sent to a vehicle."""

    max_step_m: float = Field(default=10.0, gt=0, le=2000, description="Largest distance a vehicle moves in one step")
    min_depth_m: float = Field(default=2.0, ge=0, le=6000, description="Shallowest depth of travel under water")
    max_depth_m: float = Field(default=30.0, gt=0, le=6000, description="Deepest depth of travel")
    min_altitude_m: float = Field(default=1.0, ge=0, le=1000, description="Least clearance above the sea floor")
    keep_out_margin_m: float = Field(
        default=10.0,
        ge=0,
        le=1000,
        description="Legs stay this far from keep-out zones: vehicles turn in circles and drift. With less "
        "than 10 m the circle in which one waits for its next waypoint can reach into a zone",
    )
    border_margin_m: float = Field(
        default=0.0,
        ge=0,
        le=1000,
        description="Waypoints stay this far inside the area: vehicles turn in circles at them and drift",
    )
    com_range_m: float | None = Field(
        default=None, gt=0, description="Every vehicle keeps another one within this range; null: unlimited"
    )
    min_separation_m: float = Field(
        default=5.0,
        ge=0,
        le=10_000,
        description="Least horizontal distance between vehicles at similar depth",
    )
    min_vertical_separation_m: float = Field(
        default=1.0,
        gt=0,
        le=1000,
        description="Difference in depth that makes horizontal separation unnecessary",
    )

    @model_validator(mode="after")
    def _depth_band_is_not_empty(self) -> Self:
        if self.max_depth_m < self.min_depth_m:
            raise ValueError(
                f"max_depth_m is {self.max_depth_m} but min_depth_m is {self.min_depth_m}: "
                "max_depth_m must be at least min_depth_m"
            )
        return self
