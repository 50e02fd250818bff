"""Where there is room in the area: beside zones and other vehicles, for circles, ways in and what lies beyond a leg."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient
from shapely.ops import nearest_points, unary_union

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from imc_bridge.control.orders import FLOWN_STRAIGHT_M
from imc_bridge.control.plans import CIRCLE_RADIUS_M

LEAST_LEG_M = 0.5
ENTRY_POINTS = 400
LEAD_CLEARANCE_M = 0.5
WAITING_CIRCLE_M = 10.0
"""How far from its waypoint a vehicle comes that waits there in circles: 7.5 m of radius, and what it overshoots."""
CIRCLE_M = CIRCLE_RADIUS_M + 2.5
"""Radius of the room for a circle: it is not flown on rails."""
CIRCLE_WITHIN = 2.5
"""A circle farther from the target than so many radii is none of its leg's."""
START_OUTSIDE_M = 2.0
"""A vehicle drifts at the surface: so far outside the area it may be when its leg begins."""
BEYOND_M = 20.0
"""So far beside the ground that straight ways into the area lead over may a way round zones lead."""
NEARER = 0.9
"""A way may lead as near to a zone as this part of how near a vehicle is already."""
CLEAR, NARROW = 0.9, 0.4
"""Parts of the room beside a zone with which a way is clear of it, and with which a straight way is still better than
one round it: who is a little beside where its way was to begin would cross the zone otherwise."""
DIRECTIONS, PARTS = 16, (1.0, 0.5)
"""Places that a vehicle may go to instead lie in so many directions, and these parts of its reach away."""
ROUND_TO = 40
"""Of the places where a vehicle may come in, about so many are looked at for a way round zones."""


def lead_point(constraints: Constraints, start: FloatArray, target: FloatArray, lead_m: float) -> FloatArray:
    """Return how far a leg may be followed beyond its target, at most ``lead_m``: inside the area, clear of keep-outs.

    Parameters
    ----------
    start, target : (2,)
        Ends of the leg. The target itself is returned when the leg has no direction.
    """
    along = target - start
    length = float(np.linalg.norm(along))
    if length < LEAST_LEG_M:
        return target
    ray = LineString([target, target + along / length * lead_m])
    free: BaseGeometry = Polygon(constraints.area)
    for zone in constraints.keep_out:
        free = free.difference(Polygon(zone).buffer(LEAD_CLEARANCE_M))
    part = ray.intersection(free.buffer(-LEAD_CLEARANCE_M))
    pieces = [piece for piece in getattr(part, "geoms", [part]) if isinstance(piece, LineString) and not piece.is_empty]
    first = next((piece for piece in pieces if piece.distance(Point(target)) < LEAD_CLEARANCE_M), None)
    if first is None:
        return target
    ends = np.array(first.coords)
    return np.asarray(ends[np.argmax(np.linalg.norm(ends - target, axis=1))])


def circling_room(
    constraints: Constraints, start: FloatArray, target: FloatArray, radius_m: float, taken: Sequence[FloatArray]
) -> FloatArray | None:
    """Return the centre of a circle near a leg's target in which a vehicle may descend; None where there is no room.

    The circle lies inside the area, clear of keep-outs and of other vehicles, and so does every straight way from the
    leg's start to it and from it to the target, but for a start at the border.

    Parameters
    ----------
    start, target : (2,)
        Ends of the leg.
    radius_m
        Of the circle as it is flown.
    taken : sequence of (n, 2)
        Ways of other vehicles, from which the circle keeps the least separation.
    """
    area = Polygon(constraints.area)
    zones = [Polygon(zone).buffer(LEAD_CLEARANCE_M) for zone in constraints.keep_out]
    free: BaseGeometry = area
    for zone in zones:
        free = free.difference(zone)
    others = [LineString(way) if len(way) > 1 else Point(way[0]) for way in taken]
    for way in others:
        free = free.difference(way.buffer(constraints.min_separation_m))
    centres = free.buffer(-radius_m)
    if centres.is_empty:
        return None
    centre, _ = nearest_points(centres, Point(target))
    if centre.distance(Point(target)) > CIRCLE_WITHIN * radius_m:
        return None
    swept = unary_union([centre.buffer(radius_m), Point(start), Point(target)]).convex_hull
    ahead = [zone for zone in zones if not zone.contains(Point(start))]
    if any(barrier.intersects(swept) for barrier in [*ahead, *others]) or not area.buffer(START_OUTSIDE_M).contains(
        swept
    ):
        return None
    return np.array([centre.x, centre.y])


def widened(zone: FloatArray, margin_m: float) -> FloatArray:
    """Return a keep-out zone (n, 2) with a margin around it, (m, 2), counter-clockwise and not closed."""
    wide = orient(Polygon(zone).buffer(margin_m, join_style="mitre"))
    return np.asarray(wide.exterior.coords)[:-1]


def nearest_inside(area: Polygon, place: FloatArray) -> FloatArray:
    """Return the point of the area that is nearest to ``place`` (2,)."""
    goal, _ = nearest_points(area, Point(place))
    return np.array([goal.x, goal.y])


def way_in(
    constraints: Constraints, place: FloatArray, inset_m: float, taken: Sequence[FloatArray], room_m: float
) -> FloatArray | None:
    """Return where a vehicle outside the area goes first that is to come into it; None when there is no way.

    That is the nearest point of the area that it may go straight to. Where keep-out zones bar all of them, it is the
    first corner of a way round these, hardly outside the ground that straight ways lead over: the next one is found
    from there.

    Parameters
    ----------
    place : (2,)
        Where the vehicle is.
    inset_m
        How far inside the border the point should lie.
    taken : sequence of (2,)
        Places of other vehicles, from which the point keeps the least separation.
    room_m
        How far from zones corners lie: farther than a vehicle is from where it should be when it arrives.
    """
    entries = [entry for entry in _entries(constraints, place, inset_m) if _apart(constraints, entry, taken)]
    for part in (CLEAR, NARROW):
        for entry in entries:
            if not barred(constraints, place, entry, part * room_m):
                return entry
    corner = _first_corner(constraints, place, entries[:: max(1, len(entries) // ROUND_TO)], taken, room_m)
    if corner is not None:
        return corner
    return next((entry for entry in entries if not barred(constraints, place, entry)), None)


def ways_in(constraints: Constraints, place: FloatArray, inset_m: float) -> list[FloatArray]:
    """Return all places of the area, (n of (2,)), that a vehicle outside may go straight to, the nearest first.

    Parameters as in :func:`way_in`.
    """
    return [entry for entry in _entries(constraints, place, inset_m) if not barred(constraints, place, entry)]


def places_around(place: FloatArray, reach_m: float) -> FloatArray:
    """Return places (n, 2) all around another one (2,), at most ``reach_m`` away."""
    course = np.arange(0.0, 2 * np.pi, 2 * np.pi / DIRECTIONS)
    unit = np.column_stack([np.sin(course), np.cos(course)])
    return np.concatenate([place + part * reach_m * unit for part in PARTS])


def ways_beside(constraints: Constraints, place: FloatArray, reach_m: float) -> FloatArray:
    """Return where else a vehicle outside the area may go straight to, (n, 2), at most ``reach_m`` away.

    In all directions that lead no farther from the area, and clear of keep-out zones.

    Parameters
    ----------
    place : (2,)
        Where the vehicle is.
    """
    area, ends = Polygon(constraints.area), places_around(place, reach_m)
    outside_m = shapely.distance(area, shapely.points(ends))
    zones = shapely.union_all([Polygon(zone) for zone in constraints.keep_out])
    near = ends[(outside_m <= distance_outside_m(area, place) + LEAST_LEG_M) & ~shapely.contains_xy(zones, ends)]
    free = [end for end in near if not barred(constraints, place, end, LEAD_CLEARANCE_M)]
    return np.array(free).reshape(-1, 2)


def barred(constraints: Constraints, place: FloatArray, goal: FloatArray, room_m: float = 0.0) -> bool:
    """Return whether a keep-out zone that a vehicle is not in lies between it and a goal, both (2,).

    Or closer than ``room_m`` to the way, where the vehicle is not that close itself.
    """
    leg, here = LineString([place, goal]), Point(place)
    for zone in map(Polygon, constraints.keep_out):
        if not zone.contains(here) and zone.distance(leg) <= min(room_m, NEARER * zone.distance(here)):
            return True
    return False


def _entries(constraints: Constraints, place: FloatArray, inset_m: float) -> list[FloatArray]:
    """Return places at the area's border, and at that of its zones, (n of (2,)), the nearest one first."""
    free: BaseGeometry = Polygon(constraints.area).buffer(-inset_m)
    if free.is_empty:
        free = Polygon(constraints.area)
    for zone in constraints.keep_out:
        free = free.difference(Polygon(zone).buffer(LEAD_CLEARANCE_M))
    if free.is_empty:
        return []
    border = free.boundary
    spacing = max(border.length / ENTRY_POINTS, inset_m)
    along = np.arange(0.0, border.length, spacing)
    points = [nearest_points(free, Point(place))[0], *(border.interpolate(distance) for distance in along)]
    return [np.array([goal.x, goal.y]) for goal in sorted(points, key=Point(place).distance)]


def _apart(constraints: Constraints, goal: FloatArray, taken: Sequence[FloatArray]) -> bool:
    return all(np.linalg.norm(goal - other) >= constraints.min_separation_m for other in taken)


def _first_corner(
    constraints: Constraints,
    place: FloatArray,
    entries: Sequence[FloatArray],
    taken: Sequence[FloatArray],
    room_m: float,
) -> FloatArray | None:
    """Return how far a vehicle goes straight along a way round zones to the first of the entries that has one, (2,)."""
    ground = (
        Polygon(constraints.area).union(Point(place)).convex_hull.buffer(BEYOND_M + 0.5 * room_m, join_style="mitre")
    )
    ahead = tuple(zone for zone in constraints.keep_out if not Polygon(zone).contains(Point(place)))
    # Free space keeps off zones by twice its margin, off the border by once.
    free = FreeSpace(replace(constraints, area=np.array(ground.exterior.coords)[:-1], keep_out=ahead), 0.5 * room_m)
    for entry in entries:
        stops = [place, *free.way(place, entry)]
        if any(barred(constraints, *leg) for leg in pairwise(stops)):
            continue
        # From where it was to be it sees the first one clear of zones; from beside it, at least clear enough.
        corners = [_flown_to(place, stop, room_m) for stop in stops[:0:-1]]
        for part in (CLEAR, 0.0):
            for corner in corners:
                if not barred(constraints, place, corner, part * room_m):
                    return corner if _apart(constraints, corner, taken) else None
    return None


def _flown_to(place: FloatArray, goal: FloatArray, room_m: float) -> FloatArray:
    """Return a goal, (2,), that a vehicle at the surface flies to: where it is close it would drift, motor off."""
    way, least_m = goal - place, FLOWN_STRAIGHT_M + room_m
    far_m = float(np.hypot(*way))
    return goal if far_m >= least_m or far_m == 0.0 else place + way * (least_m / far_m)


def distance_outside_m(area: Polygon, place: FloatArray) -> float:
    """Return how far a place (2,) lies outside the area; 0 inside."""
    return float(shapely.distance(area, Point(place)))
