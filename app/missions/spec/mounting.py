"""How the sonar of a vehicle is mounted, as a patch test tells it."""

import math
from typing import Annotated

from pydantic import Field

from app.mapping.swath.mounting import Mounting
from app.missions.spec.base import Model

Arm = Annotated[float, Field(ge=-50, le=50)]


class MountingSpec(Model):
    """How a sonar is mounted in its vehicle, in the vehicle's frame: forward, starboard, down, right-handed."""

    roll_deg: float = Field(
        default=0.0,
        ge=-80,
        le=80,
        description="Roll of the sonar in the vehicle, degrees, positive: its starboard side is lower, so that a beam "
        "said to point straight down points to port",
    )
    pitch_deg: float = Field(
        default=0.0,
        ge=-45,
        le=45,
        description="Pitch of the sonar in the vehicle, degrees, positive: its bow side is higher, so that a beam said "
        "to point straight down points ahead",
    )
    heading_deg: float = Field(
        default=0.0,
        ge=-180,
        le=180,
        description="Heading (yaw) of the sonar in the vehicle, degrees, positive: turned clockwise as seen from above",
    )
    latency_s: float = Field(
        default=0.0,
        ge=-10,
        le=10,
        description="How late positions are, seconds: one that is stated for a time is where the vehicle was so much "
        "earlier. Depth and attitude are taken as they are",
    )
    offset_m: tuple[Arm, Arm, Arm] = Field(
        default=(0.0, 0.0, 0.0),
        description="[forward, starboard, down] from the point that position and depth are stated for to the sonar, "
        "metres",
    )
    source: str = Field(default="", max_length=200, description="Where these come from, for example a patch test")

    @property
    def mounting(self) -> Mounting:
        """Return it in radians, for the computation."""
        return Mounting(
            roll_rad=math.radians(self.roll_deg),
            pitch_rad=math.radians(self.pitch_deg),
            heading_rad=math.radians(self.heading_deg),
            latency_s=self.latency_s,
            offset_m=self.offset_m,
        )

    @property
    def is_ideal(self) -> bool:
        """Whether the sonar sits at the reference point along the vehicle's axes, with positions in time."""
        return self.mounting.is_ideal

    @property
    def statement(self) -> str:
        """Return in words what is corrected, for products and the log."""
        angles = (("roll", self.roll_deg), ("pitch", self.pitch_deg), ("heading", self.heading_deg))
        parts = [f"{name} {value:+.2f} degrees" for name, value in angles if value]
        if self.latency_s:
            parts.append(f"latency {self.latency_s:+.3f} s")
        if any(self.offset_m):
            forward, starboard, down = self.offset_m
            parts.append(f"{forward:+.2f} m forward, {starboard:+.2f} m starboard, {down:+.2f} m down")
        return ", ".join(parts) or "none"
