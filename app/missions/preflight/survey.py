"""The checklist before a start: what would be refused, what would go wrong, and what is only good to know."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from shapely.geometry import MultiPolygon, Point, Polygon
from shapely.ops import unary_union

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.mapping.coordinates.distances import horizontal_distance_m
from app.missions.clock import now
from app.missions.fleet.interface import LinkState, Position, VehicleRefusedError
from app.missions.live.mission import LiveMission
from app.missions.live.watchers.vehicles import local_place
from app.missions.preflight.doctor import doctor_checks
from app.missions.preflight.neighbours import neighbour_checks
from app.missions.preflight.positions import position_checks
from app.missions.preflight.recovery import recovery_checks
from app.missions.preflight.search import search_checks
from app.missions.preflight.swath import swath_checks
from app.missions.safety.room import WAITING_CIRCLE_M, way_in
from app.missions.spec.mission import MissionSpec
from app.missions.spec.vehicle import VehicleSpec
from app.missions.task.constraints import INSET_M, arrival_room_m, from_outside, make_constraints
from app.missions.task.planner import turn_radius_m
from app.missions.views.doctor import VehicleDiagnosis
from app.missions.views.mission import BatteryState, CheckStatus, CheckView, PreflightView
from app.storage.models import MissionRow

FAR_M = 500.0
"""A vehicle that starts farther from the area than this may have been put into the wrong mission."""

OK, NOTE, WARNING, PROBLEM = CheckStatus.OK, CheckStatus.NOTE, CheckStatus.WARNING, CheckStatus.PROBLEM
_BATTERIES = {BatteryState.OK: OK, BatteryState.LOW: WARNING, BatteryState.CRITICAL: PROBLEM}


def preflight(
    live: LiveMission, at_sea: Sequence[MissionRow] = (), diagnosed: Sequence[VehicleDiagnosis] = ()
) -> PreflightView:
    """Return what stands before the start of a mission, beside those that are at sea and what the doctor found."""
    checks = [
        *_vehicles(live),
        *doctor_checks(live, diagnosed),
        *_batteries(live),
        *recovery_checks(live),
        *_places(live),
        *position_checks(live),
        *neighbour_checks(live, at_sea),
        *_depths(live),
        *_room(live),
        *_waiting(live),
        *_water_level(live),
        *_known_bottom(live),
        *swath_checks(live),
        *search_checks(live),
        *([_duration(live)] if live.search is None else []),
    ]
    return PreflightView(ready=all(check.status is not PROBLEM for check in checks), checks=checks)


def expected_s(live: LiveMission) -> float:
    """Return how long the mission takes at most when nothing stops it: every step as long as its largest leg."""
    spec = live.spec
    longest_s = max([_way_m(spec, m.spec) / spec.speed_of(m.spec) for m in live.team], default=0.0)
    return _share_left(live) * min(longest_s, spec.steps * spec.step_deadline_s)


def _way_m(spec: MissionSpec, vehicle: VehicleSpec) -> float:
    """Return how far a vehicle flies at most in the whole mission, metres."""
    return spec.allowance(vehicle).most_m(spec.limits.max_step_m)


def _share_left(live: LiveMission) -> float:
    return 1 - live.header.step / live.spec.steps


def _vehicles(live: LiveMission) -> Iterator[CheckView]:
    if not list(live.team):
        yield CheckView(
            id="vehicles", title="Vehicles", status=PROBLEM, message="no vehicle takes part", remedy="Add a vehicle"
        )
    for member in live.team:
        info = live.hub.info(member.key)
        title = f"Link to {member.name}"
        owner = live.hub.claimed_by(member.key)
        if owner not in (None, live.id):
            yield CheckView(
                id=f"link.{member.name}",
                title=title,
                status=PROBLEM,
                message=f"it takes part in mission {live.hub.owner_of(member.key)}",
                remedy="This mission follows that one, and begins by itself when that one is flown to its end"
                if owner == live.spec.after
                else "Finish or abort that mission, or take the vehicle out of one of them",
            )
            continue
        status, message, remedy = OK, f"{info.state}".replace("_", " "), ""
        if member.capabilities.simulated:
            message = "simulated inside the service, starts with the mission"
            try:
                live.hub.check_deployment(member.key)
            except VehicleRefusedError as error:
                status, message, remedy = PROBLEM, error.reason, error.remedy
        elif info.state not in (LinkState.READY, LinkState.ENGAGED):
            must = member.capabilities.ready_before_start
            status = PROBLEM if must else WARNING
            message = info.reason or message
            remedy = (
                "See Links for what is missing, or take the vehicle out"
                if must
                else "Let it ask for a waypoint or post a measurement; the mission waits for it otherwise"
            )
        yield CheckView(id=f"link.{member.name}", title=title, status=status, message=message, remedy=remedy)


def _batteries(live: LiveMission) -> Iterator[CheckView]:
    for member in live.team:
        report = member.report or live.hub.info(member.key).report
        level = report.battery_pct if report is not None else None
        if level is None:
            if not member.capabilities.simulated:
                yield CheckView(
                    id=f"battery.{member.name}",
                    title=f"Battery of {member.name}",
                    status=NOTE,
                    message="it has not told its battery's level",
                    remedy="Look at the vehicle",
                )
            continue
        status = _BATTERIES[BatteryState.of(level)]
        yield CheckView(
            id=f"battery.{member.name}",
            title=f"Battery of {member.name}",
            status=status,
            message=f"{level:.0f} %",
            remedy="" if status is OK else "Charge it, or take it out of the mission",
        )


def _places(live: LiveMission) -> Iterator[CheckView]:
    area = Polygon(live.area)
    zones = [Polygon(live.spec.to_local(zone)) for zone in live.spec.keep_out]
    constraints = make_constraints(live.spec)
    inner = Polygon(constraints.area)
    for member in live.team:
        report = member.report or live.hub.info(member.key).report
        if report is None:
            continue
        name, title = f"place.{member.name}", f"Place of {member.name}"
        en = local_place(live.frame, report.position)
        if en is None:
            yield _far_away(live, report.position, name, title)
            continue
        place = Point(en)
        distance = area.distance(place)
        if any(zone.contains(place) for zone in zones):
            yield CheckView(
                id=name,
                title=title,
                status=PROBLEM,
                message="it lies in a keep-out zone",
                remedy="Bring it out of there, or change the zone",
            )
        elif from_outside(_en_m(place), inner, live.spec) and not _comes_in(live.spec, constraints, _en_m(place)):
            yield CheckView(
                id=name,
                title=title,
                status=PROBLEM,
                message=f"it is {distance:.0f} m from the area, and a keep-out zone bars every way in",
                remedy="Bring it to another side of the area, or change the zone",
            )
        elif distance > FAR_M:
            yield CheckView(
                id=name,
                title=title,
                status=WARNING,
                message=f"it is {distance:.0f} m from the area",
                remedy="Is it the right vehicle, and the right area?",
            )
        else:
            words = "in the area" if distance == 0 else f"{distance:.0f} m from the area"
            yield CheckView(id=name, title=title, status=OK, message=words)


def _comes_in(spec: MissionSpec, constraints: Constraints, en_m: FloatArray) -> bool:
    return way_in(constraints, en_m, INSET_M, [], arrival_room_m(spec)) is not None


def _en_m(place: Point) -> FloatArray:
    return np.array([place.x, place.y])


def _far_away(live: LiveMission, position: Position, name: str, title: str) -> CheckView:
    """Return what is told of a vehicle so far away that the mission's flat frame does not reach it."""
    frame = live.frame
    away_m = horizontal_distance_m((frame.origin_lat_deg, frame.origin_lon_deg), position.lat_lon)
    return CheckView(
        id=name,
        title=title,
        status=WARNING,
        message=f"it is {away_m / 1000.0:.0f} km from the area",
        remedy="Is it the right vehicle, and the right area? It may also have no fix yet",
    )


def _depths(live: LiveMission) -> Iterator[CheckView]:
    limits = live.spec.limits
    depths = {member.name: member.cruise_depth_m(limits) for member in live.team}
    if not depths:
        return
    above = {member.name: member.altitude_m for member in live.team if not math.isnan(member.altitude_m)}
    ordered = sorted(depth for name, depth in depths.items() if name not in above)
    close = len(ordered) > 1 and min(np.diff(ordered)) < limits.min_vertical_separation_m - 1e-9
    said = ", ".join(
        f"{name} {max(above[name], limits.min_altitude_m):g} m above the bottom, {depth:g} m deep where it is not known"
        if name in above
        else f"{name} at {depth:g} m"
        for name, depth in depths.items()
    )
    if above and len(depths) > 1:
        yield CheckView(
            id="depths",
            title="Depths of travel",
            status=NOTE,
            message=f"{said}: some may travel at the same depth, {limits.min_separation_m:g} m apart sideways",
        )
    elif close:
        yield CheckView(
            id="depths",
            title="Depths of travel",
            status=WARNING,
            message=f"{said}: vehicles at similar depth are kept {limits.min_separation_m:g} m apart sideways",
            remedy="Raise limits.max_depth_m, so that every vehicle has a depth of its own",
        )
    else:
        yield CheckView(id="depths", title="Depths of travel", status=OK, message=said)


def _room(live: LiveMission) -> Iterator[CheckView]:
    area = Polygon(live.area)
    low, high = live.area.min(axis=0), live.area.max(axis=0)
    side, limits = float(min(high - low)), live.spec.limits
    words = f"{high[0] - low[0]:.0f} x {high[1] - low[1]:.0f} m, {area.area / 1e4:.2f} ha"
    if live.spec.keep_out:
        margin_m = limits.keep_out_margin_m
        zones = unary_union([Polygon(live.spec.to_local(zone)).buffer(margin_m) for zone in live.spec.keep_out])
        free = area.difference(zones)
        taken = 100 * (1 - free.area / area.area)
        words += f", keep-out zones with their margin of {margin_m:g} m take {taken:.0f} %"
        if free.is_empty or taken > 99:
            yield CheckView(
                id="area",
                title="Area",
                status=PROBLEM,
                message=f"{words}: nothing is left to map",
                remedy="Make the zones or limits.keep_out_margin_m smaller",
            )
            return
        if isinstance(free, MultiPolygon):
            yield CheckView(
                id="area",
                title="Area",
                status=WARNING,
                message=f"{words} and divide it into {len(free.geoms)} parts",
                remedy="A vehicle stays in the part that it starts in; leave a passage, or a smaller margin",
            )
            return
    if limits.max_step_m > side:
        yield CheckView(
            id="area",
            title="Area",
            status=WARNING,
            message=f"{words}; the largest step, {limits.max_step_m:g} m, is longer than its shorter side",
            remedy="Make limits.max_step_m smaller",
        )
        return
    yield CheckView(id="area", title="Area", status=OK, message=words + _turns(live))


def _turns(live: LiveMission) -> str:
    """Return how far outside the area turns at its border lead, as words; '' where they do not."""
    widest_m = max((2.0 * turn_radius_m(live.spec, member.spec) for member in live.team), default=0.0)
    outside_m = widest_m - live.spec.limits.border_margin_m
    if live.search is not None or outside_m < 1.0:
        return ""
    return f"; turns at its border lead up to {outside_m:.0f} m outside (limits.border_margin_m can keep them in)"


def _waiting(live: LiveMission) -> Iterator[CheckView]:
    margin_m = live.spec.limits.keep_out_margin_m
    if not live.spec.keep_out or live.search is not None or margin_m >= WAITING_CIRCLE_M:
        return
    yield CheckView(
        id="waiting",
        title="Waiting",
        status=WARNING,
        message=f"vehicles wait for their next waypoint in circles of up to {WAITING_CIRCLE_M:g} m, which a margin of "
        f"{margin_m:g} m lets into a keep-out zone",
        remedy=f"Make limits.keep_out_margin_m {WAITING_CIRCLE_M:g} m or more, unless the vehicles can stop",
    )


def _water_level(live: LiveMission) -> Iterator[CheckView]:
    table = live.gate.corrections.table
    if table is None:
        applied = live.spec.tide.is_applied
        yield CheckView(
            id="tide",
            title="Tide",
            status=OK if applied else NOTE,
            message=f"constant level {live.spec.tide.level_m:+.2f} m, {live.spec.tide.source}"
            if applied
            else "no tide is applied: depths are below the water's surface as it is",
            remedy="" if applied else "Send a tide table or a level; that can be done afterwards, too",
        )
        return
    begin = now().timestamp()
    end = begin + expected_s(live)
    why_now, why_then = table.why_not(begin), table.why_not(end)
    if not why_then and (hole := table.hole_between(begin, end)):
        why_then = f"the tide table {table.name!r} tells nothing from {hole}"
    yield CheckView(
        id="tide",
        title="Tide",
        status=PROBLEM if why_now else WARNING if why_then else OK,
        message=why_now or why_then or f"table {table.name}, until {table.last:%Y-%m-%d %H:%M} UTC",
        remedy="Send a table that covers the whole mission" if why_now or why_then else "",
    )


def _known_bottom(live: LiveMission) -> Iterator[CheckView]:
    built, limits = live.builder.newest, live.spec.limits
    if built is None and (live.builder.stale or live.builder.arrivals.at_rest):
        yield CheckView(
            id="bottom",
            title="Known bottom",
            status=NOTE,
            message="there are soundings; their map is being made",
        )
        return
    if built is None:
        yield CheckView(
            id="bottom",
            title="Known bottom",
            status=NOTE,
            message="nothing is known of the bottom: vehicles begin shallow and feel their way",
        )
        return
    depths = built.map.depth_m[np.isfinite(built.map.depth_m)]
    least = limits.min_depth_m + limits.min_altitude_m
    shallow = 100 * float(np.mean(depths < least))
    yield CheckView(
        id="bottom",
        title="Known bottom",
        status=WARNING if shallow > 50 else OK,
        message=f"{depths.min():.1f} to {depths.max():.1f} m deep"
        + (f"; {shallow:.0f} % is shallower than travel depth and altitude need, {least:g} m" if shallow else ""),
        remedy="Lower limits.min_depth_m, or keep the shallow part out" if shallow > 50 else "",
    )


def _duration(live: LiveMission) -> CheckView:
    spec = live.spec
    seconds = expected_s(live)
    team = [member.spec for member in live.team]
    vehicles = len(team)
    metres = _share_left(live) * sum(_way_m(spec, vehicle) for vehicle in team)
    speeds = sorted({spec.speed_of(vehicle) for vehicle in team}) or [spec.speed_mps]
    speed = f"{speeds[0]:g}" if len(speeds) == 1 else f"{speeds[0]:g} to {speeds[-1]:g}"
    area = Polygon(live.area).area
    line_m = area / metres if metres else np.inf
    return CheckView(
        id="duration",
        title="Duration",
        status=OK,
        message=f"at most {_spoken(seconds)} at {speed} m/s; {metres / 1000:.1f} km of tracks by {vehicles} "
        f"vehicle{'' if vehicles == 1 else 's'}"
        + (f", as much as lines {line_m:.1f} m apart over the whole area" if np.isfinite(line_m) else ""),
    )


def _spoken(seconds: float) -> str:
    minutes = round(seconds / 60)
    return f"{seconds:.0f} s" if minutes < 2 else f"{minutes} min" if minutes < 120 else f"{minutes / 60:.1f} h"
