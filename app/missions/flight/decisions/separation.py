"""Keeps vehicles that fly on their own time apart: whole planned motions are held against each other, in time."""

import math

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import TOLERANCE_M, Constraints, Limit
from app.exploration.motion.timeline import Approach, Timeline, closest_approach, speed_over_ground_mps
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.steering import steered_motion
from app.missions.live.mission import LiveMission
from app.missions.recovery.energy import ASCENT_MPS
from app.missions.safety import room
from app.missions.spec.limits import Limits
from app.missions.spec.mission import MissionSpec
from app.missions.task.planner import turn_radius_m
from app.missions.team import OUT_OF_REACH, Member

LIMITS_OF_PLACES = (Limit.AREA, Limit.KEEP_OUT)
"""What the end of a leg can break by where it is."""


def too_close(decision: Decision, live: LiveMission, spec: MissionSpec) -> dict[str, str]:
    """Return the vehicles whose new leg would bring them too close to another one, and how close.

    A vehicle is taken to fly its committed legs at its speed, in the current, and to stay where the last one ends. Of
    those with a new leg the one that is too close to most others does without it, then the next, until nobody is too
    close. One that sets out turns before it is on its leg, and keeps apart on that way, too, from those that move or
    stand aside. One that was led aside for another to pass stands there: were it taken to fly on, the other one would
    wait for it, too.
    """
    limits = spec.limits
    if limits.min_separation_m <= 0.0:
        return {}
    before = {m.name: planned_motion(m, live) for m in live.team if m.controllable}
    new = {leg.vehicle: leg.target_m for leg in decision.legs if not leg.refusal and leg.vehicle in before}
    speeds, current_mps = {m.name: spec.speed_of(m.spec) for m in live.team if m.controllable}, live.team.current_mps
    setting_out = {
        m.name: steered_ahead(live, m, [*planned_places(m, live)[:1], new[m.name]], math.inf)
        for m in live.team
        if m.name in new and not m.ordered and not m.ahead
    }
    aside = {m.name: _stays_aside(m, live) for m in live.team if m.name in before and m.lets_pass}
    refused: dict[str, str] = {}
    while True:
        moving = {name: _continued(before[name], end, speeds[name], current_mps) for name, end in new.items()}
        turning = {name: setting_out.get(name, motion) for name, motion in moving.items()}
        under_way = {name: motion for name, motion in (before | turning | aside).items() if len(motion.time_s) > 1}
        begins_s = {name: float(before[name].time_s[-1]) for name in new}
        close = [
            (name, other, approach)
            for motions, others in ((moving, before | moving | aside), (setting_out, under_way))
            for name in sorted(motions.keys() & new.keys())
            for other, motion in others.items()
            if other != name
            if (approach := _approach(motions[name], begins_s[name], motion, limits)) is not None
        ]
        if not close:
            return refused
        involved = [name for name, other, _ in close] + [other for _, other, _ in close if other in moving]
        waits = max(sorted(set(involved) & moving.keys()), key=involved.count)
        other, approach = next(
            (other if name == waits else name, approach) for name, other, approach in close if waits in (name, other)
        )
        refused[waits] = (
            f"its next leg passes {other} at {approach.distance_m:.1f} m, closer than {limits.min_separation_m:g} m, "
            f"{approach.time_s:.0f} s from now"
        )
        del new[waits]


def passes_above(member: Member, live: LiveMission, spec: MissionSpec) -> str:
    """Return who is above a vehicle and passes it while it would come up where it is; '' where nobody does.

    It circles while it comes up.
    """
    limits = spec.limits
    if member.report is None or limits.min_separation_m <= 0.0:
        return ""
    here, depth_m = member.place_m(live.frame), member.report.position.depth_m
    up = np.array([[*here, depth_m], [*here, 0.0]])
    rise = Timeline(np.array([0.0, max(depth_m / ASCENT_MPS, 1e-3)]), up)
    for other in live.team:
        ended = other.withdrawal is not None and other.withdrawal.over
        if other is member or ended or not other.controllable or other.report is None:
            continue
        if other.report.position.depth_m > depth_m - limits.min_vertical_separation_m:
            continue
        nearest = closest_approach(rise, planned_motion(other, live), until_s=float(rise.time_s[-1]))
        if nearest.distance_m < limits.min_separation_m + room.CIRCLE_M:
            return other.name
    return ""


def ways_aside(
    start: FloatArray, target: FloatArray, constraints: Constraints, bottom: Bottom, *, or_nearer: bool = False
) -> FloatArray:
    """Return where a vehicle may go in place of its target, (k, 3): in all directions, the nearest to the target first.

    All lie inside the area and outside zones, wherever the vehicle is; but for ``or_nearer``.

    Parameters
    ----------
    start, target : (3,)
        East, north and depth of travel.
    bottom
        Pessimistic sea floor.
    or_nearer
        Have a vehicle that cannot get there in one leg come nearer to where it may be.
    """
    reach_m = constraints.max_step_m * (1 - 1e-9)
    around = room.places_around(start[:2], reach_m)
    ends = np.column_stack([around, np.full(len(around), start[2])])
    beyond_m = constraints.excess(start[None], ends[:, None], bottom)[:, 0, LIMITS_OF_PLACES]
    begins_m = constraints.excess(start[None], start[None, None], bottom)[0, 0, LIMITS_OF_PLACES]
    allowed = ((beyond_m <= TOLERANCE_M) | (or_nearer & (begins_m > reach_m))).all(axis=1)
    free = ends[allowed & constraints.feasible(start[None], ends[:, None], bottom)]
    return np.asarray(free[np.argsort(np.hypot(*(free - target)[:, :2].T), kind="stable")])


def _approach(leg: Timeline, begins_s: float, other: Timeline, limits: Limits) -> Approach | None:
    """Return how close a vehicle's last leg comes to another motion, if that is too close."""
    nearest = closest_approach(leg.since(begins_s), other, limits.min_vertical_separation_m)
    if nearest.distance_m >= limits.min_separation_m:
        return None
    # Whoever is too close already may go farther away.
    apart = leg.at(np.array([begins_s]))[0] - other.at(np.array([begins_s]))[0]
    return nearest if nearest.distance_m < float(np.hypot(*apart[:2])) - 1e-6 else None


def planned_motion(member: Member, live: LiveMission) -> Timeline:
    """Return a vehicle's motion from when it was heard last to the end of its last committed leg."""
    return motion_along(planned_places(member, live), live.spec.speed_of(member.spec), live.team.current_mps)


def planned_places(member: Member, live: LiveMission) -> list[FloatArray]:
    """Return where a vehicle was last, and where its committed legs end, each (3,): east, north and depth.

    One that is out of reach flies the leg that it was sent, and goes on with none.
    """
    depth_m = member.cruise_depth_m(live.spec.limits) if member.report is None else member.report.position.depth_m
    places = [np.append(member.place_m(live.frame), depth_m)]
    if member.order is not None and member.target_m is not None and member.ordered:
        places.append(np.append(member.target_m, member.order.position.depth_m))
    if member.link not in OUT_OF_REACH:
        places += [np.append(leg.target_m, leg.position.depth_m) for leg in member.ahead]
    return places


def _stays_aside(member: Member, live: LiveMission) -> Timeline:
    """Return the motion of a vehicle to where it lets others pass."""
    here = planned_places(member, live)[0]
    there = here if member.waits_m is None else np.append(member.waits_m, here[2])
    return motion_along([here, there], live.spec.speed_of(member.spec), live.team.current_mps)


def motion_along(places: list[FloatArray], speed_mps: float, current_mps: tuple[float, float]) -> Timeline:
    """Return the motion of a vehicle from the first of some places (3,) to the last; it is at the first at 0 s."""
    motion = Timeline(np.zeros(1), places[0][None])
    for place in places[1:]:
        motion = _continued(motion, place, speed_mps, current_mps)
    return motion


def steered_ahead(live: LiveMission, member: Member, places: list[FloatArray], until_s: float) -> Timeline:
    """Return how a vehicle will steer for one place (3,) after the other in the current, from where it heads now."""
    heading_rad = None if member.report is None else member.report.heading_rad
    return steered_motion(
        places,
        math.nan if heading_rad is None else heading_rad,
        live.spec.speed_of(member.spec),
        turn_radius_m(live.spec, member.spec),
        live.team.current_mps,
        until_s,
    )


def _continued(
    motion: Timeline, target_m: FloatArray, speed_mps: float, current_mps: tuple[float, float] = (0.0, 0.0)
) -> Timeline:
    way = target_m - motion.place_m[-1]
    takes_s = float(np.linalg.norm(way)) / speed_over_ground_mps(way, speed_mps, current_mps)
    arrives_s = motion.time_s[-1] + max(takes_s, 1e-3)
    return Timeline(np.append(motion.time_s, arrives_s), np.vstack([motion.place_m, target_m]))
