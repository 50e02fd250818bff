"""Where one vehicle's next leg begins, and where it leads."""

import math
from dataclasses import dataclass

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.missions.safety import travel_depth


@dataclass(frozen=True)
class Place:
    """Where one vehicle's next leg begins, and the depth it should travel at."""

    vehicle: str
    en_m: FloatArray
    heading_rad: float
    cruise_depth_m: float
    position_sd_m: float = math.nan
    """How well it says that it knows where it is; NaN: it does not say."""
    surfacing_depth_m: float = math.nan
    """Its depth, when its last waypoint brought it up for a fix; NaN when not."""
    keeps_depth: bool = False
    """Whether it travels at the depth that its mission began with, whatever it is told."""
    moving: bool = True
    """Whether it gets a leg now; where not, it has enough of them and ``en_m`` is where they end."""
    left_m: float = math.nan
    """How far it may still fly; NaN: as many steps as the mission has left."""
    submerged_s: float = 0.0
    """How long it has been under water since its last fix at the surface, by its clock."""
    altitude_m: float = math.nan
    """Height above the bottom that it is to keep; NaN: it keeps its depth."""
    turn_radius_m: float = 0.0
    """Of its turning circle."""
    at_rest: bool = False
    """Whether it flew all its legs so long ago that what it measured there is known."""

    @property
    def surfacing(self) -> bool:
        """Whether its last waypoint brought it up for a fix."""
        return math.isfinite(self.surfacing_depth_m)

    def travel_depth_m(
        self, origin_m: FloatArray, target_m: FloatArray, bottom: Bottom, constraints: Constraints
    ) -> float:
        """Return how deep it travels from one place (2,) to another over a pessimistic sea floor.

        Where it ends it may rise over whatever is known within its next leg, wherever that goes.
        """
        least_m = constraints.min_altitude_m
        if self.keeps_depth:
            return travel_depth.travel_depth_m(origin_m, target_m, self.cruise_depth_m, bottom, least_m)
        if math.isnan(self.altitude_m):
            depth_m = travel_depth.travel_depth_m(origin_m, target_m, self.cruise_depth_m, bottom, least_m)
        else:
            depth_m = travel_depth.depth_above_bottom_m(
                origin_m, target_m, self.altitude_m, self.cruise_depth_m, bottom, constraints, self.turn_radius_m
            )
        to_leave_m = bottom.deepest_to_leave_m(target_m, least_m, constraints.climb, constraints.max_step_m)
        return min(depth_m, max(to_leave_m, 0.0))


@dataclass(frozen=True)
class Leg:
    """Where one vehicle is sent, or why it is not sent anywhere."""

    vehicle: str
    target_m: FloatArray
    refusal: str = ""
    surfacing: bool = False
    """Whether it comes up, or stays up, for a fix."""
    unplanned: bool = False
    """Whether it leads to where a vehicle can be planned for, into the area from far outside or off a shoal: where
    ways are counted it takes nothing of the one that is to be flown."""
