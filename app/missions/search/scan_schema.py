"""Scans as they are posted."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, FailFast, Field

from app.missions.spec.base import Latitude, Longitude, Name

MOST_BEAMS = 3600


class Scan(BaseModel):
    """One look round from a vehicle: a laser scanner's turn, or a sweep of an imaging sonar."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    vehicle: Name
    time_s: float = Field(description="The vehicle's clock, Unix seconds", ge=0, lt=1e11, examples=[1795225140.5])
    lat_deg: Latitude
    lon_deg: Longitude
    depth_m: float = Field(default=0.0, ge=0, le=12_000, description="Depth of the vehicle below the surface")
    first_bearing_deg: float = Field(
        default=0.0, ge=-360, le=360, description="Bearing of the first beam, clockwise from true north"
    )
    bearing_step_deg: float = Field(
        gt=0, le=360, description="By how much further clockwise each next beam looks", examples=[1.0]
    )
    reach_m: float = Field(gt=0, le=1000, description="Within this range it tells of everything", examples=[12.0])
    ranges_m: Annotated[list[float | None], FailFast()] = Field(
        min_length=1,
        max_length=MOST_BEAMS,
        description="Range of each beam's first echo; null, or more than reach_m: there was none within reach",
        examples=[[7.2, 7.1, None]],
    )
