"""What a vehicle's word on how well it knows its place is worth."""

from app.missions.spec.mission import SurfacePolicy
from app.missions.views.mission import PositionQuality


def position_quality(sd_m: float | None, policy: SurfacePolicy | None) -> PositionQuality:
    """Return how good a position of this deviation is by the mission's policy."""
    if sd_m is None:
        return PositionQuality.UNTOLD
    if policy is None:
        return PositionQuality.STATED
    if sd_m <= policy.until_sd_m:
        return PositionQuality.GOOD
    return PositionQuality.FADING if sd_m <= policy.max_position_sd_m else PositionQuality.POOR
