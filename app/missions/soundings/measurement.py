"""What vehicles post."""

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from app.missions.spec.base import Name


class Measurement(BaseModel):
    """One measurement posted by a vehicle: its position, and a sounding or a range to a target where it has one."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    vehicle: Name
    time_s: float = Field(description="The vehicle's clock, Unix seconds", ge=0, lt=1e11, examples=[1795225140.5])
    lat_deg: float = Field(description="Latitude of the vehicle, WGS84 degrees")
    lon_deg: float = Field(description="Longitude of the vehicle, WGS84 degrees")
    depth_m: float = Field(description="Depth of the vehicle below the surface, metres")
    range_m: float | None = Field(
        default=None,
        description="Range from the vehicle to the bottom: vertical, or along the beam where beam_off_nadir_deg is "
        "given; null: position report only",
    )
    beam: int = Field(default=0, ge=0, lt=4096)
    beam_off_nadir_deg: float | None = Field(
        default=None,
        ge=0,
        lt=90,
        description="Angle of the beam from straight down in the vehicle; the footprint is then computed from it and "
        "the vehicle's attitude",
    )
    beam_azimuth_deg: float = Field(
        default=0.0, ge=-360, le=360, description="Direction of the beam in the vehicle, from the bow to starboard"
    )
    roll_deg: float = Field(default=0.0, ge=-180, le=180, description="Starboard down is positive")
    pitch_deg: float = Field(default=0.0, ge=-90, le=90, description="Nose up is positive")
    range_sd_m: float | None = Field(default=None, gt=0)
    position_sd_m: float | None = Field(default=None, ge=0)
    target: str | None = Field(
        default=None, min_length=1, max_length=64, description="The moving target that target_range_m was measured to"
    )
    target_range_m: float | None = Field(default=None, description="Range from the vehicle to that target, metres")
    heading_deg: float | None = None
    speed_mps: float | None = Field(default=None, ge=0)
    battery_pct: float | None = Field(default=None, ge=0, le=100)

    @model_validator(mode="after")
    def _slanted_beams_have_a_heading(self) -> Self:
        if self.beam_off_nadir_deg is not None and self.heading_deg is None:
            raise ValueError("beam_off_nadir_deg is given but heading_deg is not: a slanted beam needs both")
        return self

    @model_validator(mode="after")
    def _ranges_to_targets_stand_alone(self) -> Self:
        if (self.target is None) != (self.target_range_m is None):
            raise ValueError(
                f"target is {self.target!r} and target_range_m is {self.target_range_m}: a range to a target needs both"
            )
        if self.target is not None and self.range_m is not None:
            raise ValueError("range_m and target_range_m are given: a sounding and a range to a target are two items")
        return self
