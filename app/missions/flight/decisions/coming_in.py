"""Vehicles outside the area: who is sent in, and from where the others are planned for."""

import math
from dataclasses import replace

import numpy as np
from shapely.geometry import Point, Polygon

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.missions.flight.decisions.leg import Leg, Place
from app.missions.safety import room
from app.missions.safety.zone_clearance import clear_of_zones
from app.missions.spec.mission import MissionSpec
from app.missions.task.constraints import INSET_M, arrival_room_m, from_outside


def planned_for(
    places: list[Place], spec: MissionSpec, constraints: Constraints, site_unknown: bool
) -> tuple[list[Place], list[Leg], list[str]]:
    """Return whom the planner plans for, the legs of those that come in from far outside, and what is to be said.

    Who is a little outside is planned for from the border, and who waits too near to a zone is taken to wait beside it.
    Nobody is sent over what a search does not know.
    """
    polygon = Polygon(constraints.area)
    notes: list[str] = []
    team: list[Place] = []
    legs: list[Leg] = []
    for place in places:
        outside_m = room.distance_outside_m(polygon, place.en_m)
        border = room.nearest_inside(polygon, place.en_m)
        # No leg may end in a zone's margin: who is beyond one at the border is planned for from beside it.
        begins = clear_of_zones(constraints, border) if outside_m > 0.0 else place.en_m
        # Who is beyond a zone at the border is not planned for as if it were there.
        cut_off = outside_m > arrival_room_m(spec) and room.barred(constraints, place.en_m, border)
        if outside_m > 0.0 and not np.array_equal(begins, border):
            cut_off |= math.dist(place.en_m, begins) > constraints.max_step_m
        far = cut_off or from_outside(place.en_m, polygon, spec)
        if far and not place.moving:
            continue
        if far and site_unknown:
            refusal = (
                f"it is {outside_m:.0f} m outside the site, and what lies between is not known: bring it to the entry"
            )
            notes.append(f"{place.vehicle}: {refusal}")
            legs.append(Leg(place.vehicle, np.append(place.en_m, 0.0), refusal))
        elif far:
            others = [p.en_m for p in places if p is not place] + [other.target_m[:2] for other in legs]
            leg = _come_in(place, constraints, others, arrival_room_m(spec))
            inside = polygon.contains(Point(leg.target_m[:2]))
            what = leg.refusal or ("it is sent to the border" if inside else "it is sent round a keep-out zone")
            notes.append(f"{place.vehicle} is {outside_m:.0f} m outside the area: {what}")
            legs.append(leg)
        else:
            # Nobody may stay where a limit is broken: who gets no leg there would keep all others from theirs.
            team.append(replace(place, en_m=begins if place.moving else clear_of_zones(constraints, begins)))
    return team, legs, notes


def _come_in(place: Place, constraints: Constraints, taken: list[FloatArray], room_m: float) -> Leg:
    """Send a vehicle that is far outside to the area's border, clear of keep-out zones and of others (n of (2,)).

    Where no straight way leads there it is sent to the first corner of a way round zones, ``room_m`` from them.
    """
    goal = room.way_in(constraints, place.en_m, INSET_M, taken, room_m)
    if goal is None:
        return Leg(place.vehicle, np.append(place.en_m, 0.0), "a keep-out zone or a vehicle bars every way in")
    # The bottom on the way is unknown: it comes at the surface.
    return Leg(place.vehicle, np.append(goal, 0.0), unplanned=True)
