"""The last check before anything is sent to a vehicle: depth of travel, and every limit of the mission."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient
from shapely.ops import nearest_points, unary_union

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.motion.turning import ahead_of_end
from imc_bridge.control.plans import CIRCLE_RADIUS_M

LEG_SAMPLES = 9
MOST_LEG_SAMPLES = 200
CLIMB = 0.1
"""Metres a metre that a vehicle is trusted to rise while it turns into its next leg: half of what a LAUV is seen to."""
WAY_SPACING_M = 5.0
LEAST_LEG_M = 0.5
ENTRY_POINTS = 400
LEAD_CLEARANCE_M = 0.5
WAITING_CIRCLE_M = 10.0
"""How far from its waypoint a vehicle comes that waits there in circles: 7.5 m of radius, and what it overshoots."""
CIRCLE_M = CIRCLE_RADIUS_M + 2.5
"""Radius of the room for a circle: it is not flown on rails."""
DEPTH_TOLERANCE_M = 0.25
"""A vehicle that keeps its layer may be this much deeper than asked."""
CIRCLE_WITHIN = 2.5
"""A circle farther from the target than so many radii is none of its leg's."""
START_OUTSIDE_M = 2.0
"""A vehicle drifts at the surface: so far outside the area it may be when its leg begins."""
UNCERTAINTY_FACTOR = 2.0
"""The bottom is taken to be this many standard deviations shallower than estimated."""


@dataclass(frozen=True)
class CheckedStep:
    """What may be sent.

    Attributes
    ----------
    positions : (n_vehicles, 3)
        Allowed waypoints; rows of vehicles with a refusal mean nothing.
    refusals : dict
        Vehicles that get no waypoint, with the reason.
    corrections : dict
        Vehicles whose waypoint was changed, with the reason.
    """

    positions: FloatArray
    refusals: dict[str, str]
    corrections: dict[str, str]


def travel_depth_m(
    origin: FloatArray, target: FloatArray, wanted_m: float, bottom: Bottom, min_altitude_m: float
) -> float:
    """Return the depth for a leg: as wanted, or shallower where the bottom leaves less room; 0 is the surface.

    Parameters
    ----------
    origin, target : (2,)
        Ends of the leg, east and north.
    bottom : Bottom
        Pessimistic sea floor: estimate minus its uncertainty. NaN where nothing is known.
    """
    along = np.linspace(0.0, 1.0, LEG_SAMPLES)[:, None]
    return _least(wanted_m, bottom.at(origin + along * (target - origin)) - min_altitude_m)


def depth_above_bottom_m(
    origin: FloatArray,
    target: FloatArray,
    altitude_m: float,
    otherwise_m: float,
    bottom: Bottom,
    constraints: Constraints,
    turn_radius_m: float = 0.0,
) -> float:
    """Return the depth for a leg of a vehicle that keeps a height above the bottom; 0 is the surface.

    Where part of the leg is over ground that nobody knows, it travels as deep as if it kept a depth, if that is less.
    Beyond its end it turns, no one knows yet whereto: it is so high that it can rise in time wherever the bottom does.

    Parameters
    ----------
    origin, target : (2,)
        Ends of the leg, east and north.
    altitude_m
        Height above the shallowest ground on the leg, if it is not less than the least.
    otherwise_m
        Depth of travel over unknown ground.
    bottom : Bottom
        Pessimistic sea floor: estimate minus its uncertainty. NaN where nothing is known.
    turn_radius_m
        Of its turning circle.
    """
    height_m = max(altitude_m, constraints.min_altitude_m)
    leg_m = target - origin
    length_m = float(np.hypot(*leg_m))
    pieces = max(LEG_SAMPLES, min(math.ceil(length_m / bottom.cell_m), MOST_LEG_SAMPLES))
    depths = bottom.at(origin + np.linspace(0.0, 1.0, pieces)[:, None] * leg_m)
    known = np.isfinite(depths)
    deepest_m = constraints.max_depth_m if known.all() else otherwise_m
    if length_m > 0.0 and turn_radius_m > 0.0:
        beyond_m, away_m = ahead_of_end(target, float(np.arctan2(*leg_m)), turn_radius_m)
        deepest_m = _least(deepest_m, bottom.at(beyond_m) - height_m + CLIMB * away_m)
    return _least(deepest_m, depths - height_m)


def depth_over_m(depth_m: float, ways: Sequence[FloatArray], bottom: Bottom, min_altitude_m: float) -> float:
    """Return the depth over places that a vehicle passes: as wanted, or shallower where the bottom leaves less room.

    Parameters
    ----------
    ways : sequence of (n, 2)
        The places.
    """
    for places in ways:
        depth_m = _least(depth_m, bottom.at(places) - min_altitude_m)
    return depth_m


def _least(depth_m: float, room_m: FloatArray) -> float:
    """Return a depth, or the least room (n,) that is known where that is less; 0 is the surface."""
    known = room_m[np.isfinite(room_m)]
    return depth_m if len(known) == 0 else float(min(depth_m, max(known.min(), 0.0)))


def too_deep(layer_m: float, safe_m: float) -> str:
    """Return why a vehicle whose console sends it at its layer's depth, whatever it is told, has to stay; '' if not."""
    if safe_m >= layer_m - DEPTH_TOLERANCE_M:
        return ""
    return (
        f"its console sends it at {layer_m:g} m whatever it is told, and there {safe_m:.1f} m is the deepest that is "
        "safe: it stays where it is"
    )


def bottom_on_way(way: FloatArray, bottom: Bottom) -> FloatArray:
    """Return what is known of the bottom on a way: rows of east, north, depth.

    Parameters
    ----------
    way : (n, 2)
        Its corners.
    bottom : Bottom
        Pessimistic sea floor.
    """
    legs = []
    for a, b in pairwise(way):
        pieces = max(math.ceil(float(np.linalg.norm(b - a)) / WAY_SPACING_M), 1)
        legs.append(a + np.linspace(0.0, 1.0, pieces + 1)[:, None] * (b - a))
    places = np.concatenate(legs)
    depths = bottom.at(places)
    known = np.isfinite(depths)
    return np.column_stack([places[known], depths[known]])


def check_step(
    vehicles: tuple[str, ...],
    origin: FloatArray,
    proposed: FloatArray,
    constraints: Constraints,
    bottom: Bottom,
) -> CheckedStep:
    """Return the part of a proposal that breaks no limit.

    A vehicle whose waypoint breaks one holds its place instead; one that cannot even hold gets no waypoint at all.

    Parameters
    ----------
    vehicles
        Names, in the order of the rows.
    origin, proposed : (n_vehicles, 3)
        Where the vehicles are and where the planner wants them.
    bottom : Bottom
        The sea floor as estimated now.
    """
    positions = np.array(proposed, dtype=float)
    corrections: dict[str, str] = {}
    refusals: dict[str, str] = {}
    for i, name in enumerate(vehicles):
        if not np.isfinite(positions[i]).all():
            corrections[name] = f"the planner proposed {positions[i].tolist()}, which is no place; the vehicle holds"
            positions[i] = origin[i]
    # Holding one vehicle can bring it too close to another's waypoint: repeat until nothing changes.
    for _ in range(len(vehicles) + 1):
        broken = {v.vehicle: v.reason for v in constraints.violations(vehicles, origin, positions, bottom)}
        fresh = [name for name in broken if name not in corrections]
        for name in fresh:
            corrections[name] = f"{broken[name]}; the vehicle holds instead"
            positions[vehicles.index(name)] = origin[vehicles.index(name)]
        if not fresh:
            refusals = broken
            break
    return CheckedStep(positions, refusals, {n: r for n, r in corrections.items() if n not in refusals})


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


def below_surface_m(depth_m: FloatArray, water_level_m: float) -> FloatArray:
    """Return depths below the datum as depths below the water's surface now, on the safe side.

    Vehicles count their depth from the surface. Water below the datum leaves them less room; the room that water above
    it would give is not used, for it goes again.

    Parameters
    ----------
    depth_m
        Below the datum, positive down.
    water_level_m
        How high the water stands above the datum: :meth:`.Corrections.water_level_m`, which
        knows of tide tables and datum offsets.
    """
    return depth_m + min(water_level_m, 0.0)


def widened(zone: FloatArray, margin_m: float) -> FloatArray:
    """Return a keep-out zone (n, 2) with a margin around it, (m, 2), counter-clockwise and not closed."""
    wide = orient(Polygon(zone).buffer(margin_m, join_style="mitre"))
    return np.asarray(wide.exterior.coords)[:-1]


def nearest_inside(area: Polygon, place: FloatArray) -> FloatArray:
    """Return the point of the area that is nearest to ``place`` (2,)."""
    goal, _ = nearest_points(area, Point(place))
    return np.array([goal.x, goal.y])


def way_in(
    constraints: Constraints, place: FloatArray, inset_m: float, taken: Sequence[FloatArray]
) -> FloatArray | None:
    """Return the nearest point of the area that a vehicle outside of it may go straight to; None when there is none.

    Parameters
    ----------
    place : (2,)
        Where the vehicle is.
    inset_m
        How far inside the border the point should lie.
    taken : sequence of (2,)
        Places of other vehicles, from which the point keeps the least separation.
    """
    zones = [Polygon(zone) for zone in constraints.keep_out]
    ahead = [zone for zone in zones if not zone.contains(Point(place))]
    free: BaseGeometry = Polygon(constraints.area).buffer(-inset_m)
    if free.is_empty:
        free = Polygon(constraints.area)
    for zone in zones:
        free = free.difference(zone.buffer(LEAD_CLEARANCE_M))
    if free.is_empty:
        return None
    border = free.boundary
    spacing = max(border.length / ENTRY_POINTS, inset_m)
    along = np.arange(0.0, border.length, spacing)
    points = [nearest_points(free, Point(place))[0], *(border.interpolate(distance) for distance in along)]
    for goal in sorted(points, key=Point(place).distance):
        leg = LineString(np.array([place, (goal.x, goal.y)]))
        apart = all(goal.distance(Point(other)) >= constraints.min_separation_m for other in taken)
        if apart and not any(zone.intersects(leg) for zone in ahead):
            return np.array([goal.x, goal.y])
    return None


def distance_outside_m(area: Polygon, place: FloatArray) -> float:
    """Return how far a place (2,) lies outside the area; 0 inside."""
    return float(shapely.distance(area, Point(place)))
