"""What the swath sonar of a vehicle can do."""

from pydantic import Field

from app.missions.spec.base import Model


class SwathSonarSpec(Model):
    """A multibeam sonar, looking down, across the vehicle's heading."""

    aperture_deg: float = Field(
        default=120.0, ge=10, le=170, description="Angle between its outermost beams, half of it to each side, degrees"
    )
    beams: int = Field(default=256, ge=2, le=4096, description="How many beams a ping has, at equal angles")
    rate_hz: float = Field(default=5.0, gt=0, le=50, description="Pings a second, Hz")
    range_m: float = Field(default=100.0, gt=0, le=2000, description="Longest slant range, metres")
