"""What a vehicle's reports say beside where it is."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Swath:
    """How far a ping met the bottom to port and to starboard, metres; ``time_s`` by the vehicle's clock."""

    time_s: float
    port_m: float
    starboard_m: float


@dataclass
class FixTimes:
    """Fixes of a vehicle at the surface, times by its clock.

    Attributes
    ----------
    submerged_s
        How long it has been under water since its last one.
    surfaced_s
        How long it has been at the surface now.
    risings
        How often it was sent up for one.
    """

    submerged_s: float = 0.0
    surfaced_s: float = 0.0
    risings: int = 0

    def pass_time(self, passed_s: float, *, at_surface: bool, stay_s: float) -> None:
        """Count time under water, or at the surface; ``stay_s``: how long it stays there until it has a fix."""
        if not at_surface:
            self.surfaced_s = 0.0
            self.submerged_s += passed_s
            return
        self.surfaced_s += passed_s
        if self.surfaced_s >= stay_s:
            self.submerged_s = 0.0
