"""The limits that a mission is decided by, in its local frame, and where its area begins for those outside."""

from dataclasses import replace

import numpy as np
from shapely.geometry import Polygon

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.planner.base import PlannerBase
from app.missions.safety import room, travel_depth
from app.missions.safety.zone_clearance import room_around
from app.missions.spec.mission import MissionSpec

REACTS_WITHIN_M = 0.5
"""So far a vehicle goes on past the radius in which it arrives until its next leg is sent."""

NEARBY_OUTSIDE_M = 10.0
"""A vehicle that drifted or overshot this little is planned for as if it were at the border."""

INSET_M = 1.0
"""Vehicles that come from outside are sent to a point this far inside the border."""


def make_constraints(spec: MissionSpec) -> Constraints:
    """Return a mission's limits in its local frame."""
    limits = spec.limits
    zones = [spec.to_local(zone) for zone in spec.keep_out]
    margins = [room.widened(zone, limits.keep_out_margin_m) for zone in zones if limits.keep_out_margin_m > 0]
    area = spec.local_inner_area()
    # A search keeps off everything by more than a vehicle's arrival radius.
    room_m = arrival_room_m(spec) if spec.search is None else 0.0
    return Constraints(
        area=area,
        # A vehicle that came too near by turning may leave the margin by any way but one through the zone itself.
        keep_out=(*zones, *margins),
        around=room_around(area, margins or zones, room_m),
        max_step_m=limits.max_step_m,
        # Depths are chosen here and may be shallower than asked where the water is; see travel_depth.travel_depth_m.
        min_depth_m=0.0,
        max_depth_m=limits.max_depth_m,
        min_altitude_m=limits.min_altitude_m,
        com_range_m=limits.com_range_m if limits.com_range_m is not None else np.inf,
        min_separation_m=limits.min_separation_m,
        min_vertical_separation_m=limits.min_vertical_separation_m,
        climb=travel_depth.RISE,
    )


def limits_of_decisions(constraints: Constraints, planner: PlannerBase) -> Constraints:
    """Return the limits that legs are decided by where every vehicle flies its own.

    Lines are as they are: whether vehicles meet on them is looked at in time, leg by leg. A vehicle at the end of its
    last leg is in nobody's way for good.
    """
    return replace(constraints, min_separation_m=0.0) if planner.flies_lines else constraints


def arrival_room_m(spec: MissionSpec) -> float:
    """Return how far at most a vehicle is from where its leg ends when it begins the next one."""
    return spec.arrival_radius_m + REACTS_WITHIN_M


def from_outside(place_m: FloatArray, area: Polygon, spec: MissionSpec) -> bool:
    """Return whether a vehicle is so far outside the area, without its margin, that it is sent to its border first."""
    return room.distance_outside_m(area, place_m) > NEARBY_OUTSIDE_M + spec.limits.border_margin_m
