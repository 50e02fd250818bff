"""What vehicles post."""

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, FailFast, Field, model_validator

from app.missions.spec.base import Name

MAX_BEAMS = 1024
"""Of one ping."""


class PostedBeams(BaseModel):
    """What a swath sonar measured with one ping: angle and range of each beam, in the same order."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    # Of very many wrong numbers the first one is told.
    angles_deg: Annotated[list[Annotated[float, Field(gt=-90, lt=90)]], FailFast()] = Field(
        min_length=1,
        max_length=MAX_BEAMS,
        description="Across the track, from straight down in the vehicle; positive to starboard",
        examples=[[-60.0, -30.0, 0.0, 30.0, 60.0]],
    )
    ranges_m: Annotated[list[float | None], FailFast()] = Field(
        min_length=1,
        max_length=MAX_BEAMS,
        description="Slant ranges, metres; null, 0 or less: nothing was detected",
        examples=[[19.8, 11.6, 10.1, 11.7, None]],
    )

    @model_validator(mode="after")
    def _each_beam_has_both(self) -> Self:
        if len(self.angles_deg) != len(self.ranges_m):
            raise ValueError(
                f"angles_deg has {len(self.angles_deg)} entries and ranges_m {len(self.ranges_m)}: as many of both"
            )
        return self


class Measurement(BaseModel):
    """One measurement posted by a vehicle: its position, and a sounding, a ping or a range to a target, if any."""

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
    beams: PostedBeams | None = Field(
        default=None,
        description="One ping of a swath sonar, of vehicles with sensor multibeam; it needs heading_deg and comes "
        "without range_m",
    )
    target: str | None = Field(
        default=None, min_length=1, max_length=64, description="The moving target that target_range_m was measured to"
    )
    target_range_m: float | None = Field(default=None, description="Range from the vehicle to that target, metres")
    sound_speed_mps: float | None = Field(
        default=None,
        description="Speed of sound in the water about the vehicle, by its probe, m/s: what it measures becomes casts "
        "that can be added. Ignored where no water has it (below 1350 or above 1650)",
    )
    heading_deg: float | None = None
    speed_mps: float | None = Field(default=None, ge=0)
    battery_pct: float | None = Field(default=None, ge=0, le=100)

    @model_validator(mode="after")
    def _slanted_beams_have_a_heading(self) -> Self:
        if self.beam_off_nadir_deg is not None and self.heading_deg is None:
            raise ValueError("beam_off_nadir_deg is given but heading_deg is not: a slanted beam needs both")
        return self

    @model_validator(mode="after")
    def _pings_stand_alone(self) -> Self:
        if self.beams is None:
            return self
        for name in ("range_m", "beam_off_nadir_deg", "target_range_m"):
            if getattr(self, name) is not None:
                raise ValueError(f"beams and {name} are given: beams without {name}, which makes an item of its own")
        if self.heading_deg is None:
            raise ValueError("beams is given but heading_deg is not: both of them")
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
