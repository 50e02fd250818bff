"""The lines of the checklist about coming home."""

import math
from collections.abc import Iterator

import numpy as np
from shapely.geometry import Point, Polygon
from shapely.ops import nearest_points

from app.arrays import FloatArray
from app.missions.live.mission import LiveMission
from app.missions.live.watchers.vehicles import local_place
from app.missions.recovery.berths import berth_spacing_m, farthest_m, home_of
from app.missions.recovery.energy import EnergyLeft
from app.missions.recovery.failsafes import with_reserve_s
from app.missions.recovery.way_home import WaysHome, way_time_s
from app.missions.search.state import Search
from app.missions.spec.mission import MissionSpec
from app.missions.task.constraints import make_constraints
from app.missions.team import Member
from app.missions.views.mission import CheckStatus, CheckView

OK, NOTE, WARNING, PROBLEM = CheckStatus.OK, CheckStatus.NOTE, CheckStatus.WARNING, CheckStatus.PROBLEM
STILL = (0.0, 0.0)


def recovery_checks(live: LiveMission) -> Iterator[CheckView]:
    """Return what there is to say of every vehicle's way home, and of what its energy lasts for."""
    homeless = [m.name for m in live.team if live.spec.recovery_of(m.spec) is None and not m.capabilities.simulated]
    if homeless:
        yield CheckView(
            id="recovery",
            title="Coming home",
            status=NOTE,
            message=f"no recovery point for {', '.join(homeless)}: they stop where they are",
            remedy="Give recovery.point to have them come home",
        )
    yield from _room(live)
    for member in live.team:
        yield from _way(live, member)


def _room(live: LiveMission) -> Iterator[CheckView]:
    """Say how far about their recovery point vehicles wait where that is farther than the mission says."""
    recovery = live.spec.recovery
    slots = [member.slot for member in live.team if member.spec.recovery_point is None]
    if recovery is None or not slots:
        return
    reach_m = farthest_m(live.spec, slots, live.team.specs)
    if len(slots) > 1 and reach_m > recovery.radius_m:
        apart_m = berth_spacing_m(live.spec, live.team.specs)
        yield CheckView(
            id="recovery.room",
            title="Room at the recovery point",
            status=NOTE,
            message=f"{len(slots)} vehicles wait up to {reach_m:.0f} m from it, with {apart_m:.0f} m between their "
            f"places: recovery.radius_m is {recovery.radius_m:g} m",
            remedy="Look for them there, or give some of them a recovery_point of their own",
        )


def _way(live: LiveMission, member: Member) -> Iterator[CheckView]:
    home_m = home_of(member.spec, member.slot, live.spec, live.team.specs)
    if home_m is None:
        return
    name, title = f"recovery.{member.name}", f"Way home of {member.name}"
    if live.search is not None:
        yield _way_of_search(live.search, member, live.spec, home_m)
        return
    constraints = make_constraints(live.spec)
    ways_home = WaysHome(constraints, home_m)
    speed_mps = live.spec.speed_of(member.spec)
    corners = [np.asarray(corner) for corner in constraints.area]
    ways = [(corner, ways_home.way(corner)) for corner in corners]
    if any(way is None for _, way in ways):
        yield CheckView(
            id=name,
            title=title,
            status=PROBLEM,
            message="no way leads home from all of the area that keeps clear of the keep-out zones",
            remedy="Move the recovery point, or change the zones",
        )
        return
    farthest_s = max(way_time_s(corner, way, speed_mps, STILL) for corner, way in ways if way is not None)
    left, words = member.energy.left, f"at most {math.ceil(farthest_s / 60):.0f} min"
    if left is None:
        yield CheckView(
            id=name,
            title=title,
            status=NOTE,
            message=f"{words}; how long its energy lasts is not known",
            remedy="Give its endurance_min: without it the vehicle does not turn back in time",
        )
        return
    short = _never_surveys(live, member, ways_home, left, speed_mps)
    if short:
        yield CheckView(
            id=name,
            title=title,
            status=PROBLEM,
            message=f"{words}; {short}",
            remedy="Charge it, or launch it and have it come home nearer to the area",
        )
        return
    way_m = live.spec.allowance(member.spec).most_m(live.spec.limits.max_step_m)
    needs_s = way_m / speed_mps + with_reserve_s(farthest_s)
    status = OK if left.time_s >= needs_s else WARNING
    if left.time_s < with_reserve_s(farthest_s):
        status = PROBLEM
    yield CheckView(
        id=name,
        title=title,
        status=status,
        message=f"{words}; its energy lasts {left.time_s / 60:.0f} min, and {needs_s / 60:.0f} min are asked for",
        remedy="" if status is OK else "Charge it or make the mission shorter: it turns back before its part is done",
    )


def _never_surveys(live: LiveMission, member: Member, ways: WaysHome, left: EnergyLeft, speed_mps: float) -> str:
    """Return why a vehicle would turn home before its first line; '' where it would not, or its place is not known."""
    report = member.report or live.hub.info(member.key).report
    here = None if report is None else local_place(live.frame, report.position)
    if here is None:
        return ""
    entry, _ = nearest_points(Polygon(live.area), Point(here))
    first_m = np.array([entry.x, entry.y])
    way_home = ways.way(first_m)
    if way_home is None:
        return ""
    in_s = math.dist(here, first_m) / speed_mps
    needs_s = in_s + with_reserve_s(way_time_s(first_m, way_home, speed_mps, STILL))
    if left.safe_s > needs_s:
        return ""
    return (
        f"it turns home before its first line: its energy lasts {left.safe_s / 60:.1f} min for sure, and the way to "
        f"the area ({in_s / 60:.1f} min) and home from there, with the reserve, takes {needs_s / 60:.1f} min"
    )


def _way_of_search(search: Search, member: Member, spec: MissionSpec, home_m: FloatArray) -> CheckView:
    """Return whether a vehicle's place at its recovery point can be got to, and its energy lasts for the window."""
    left, lasts_s = member.energy.left, with_reserve_s(search.spec.window_s)
    status, remedy = OK, ""
    if not search.may_be_open(home_m):
        status, remedy = NOTE, "Move the recovery point, or look for the vehicle nearby"
        words = (
            f"its place there lies outside the site, or within {search.spec.safety_m:g} m of what is known to stand "
            "there: it comes as near as that goes"
        )
    elif left is None:
        words = "where somebody has looked; how long its energy lasts is not known"
        status, remedy = NOTE, "Give its endurance_min: without it the vehicle does not turn back in time"
    else:
        words = f"where somebody has looked; its energy lasts {left.time_s / 60:.0f} min"
        if left.time_s < lasts_s:
            status, remedy = WARNING, "Charge it or make search.window_s shorter: it turns back before the time is up"
    return CheckView(
        id=f"recovery.{member.name}", title=f"Way home of {member.name}", status=status, message=words, remedy=remedy
    )
