"""What a mission may not ask of this service: planners and vehicles that it does not have, limits that contradict."""

from collections.abc import Collection, Sequence

from shapely import Polygon, unary_union

from app.exploration.lines.lattice import LEAST_LINE_M, direction_of_lines_rad
from app.exploration.lines.lawnmower import LawnmowerPlanner
from app.exploration.lines.spaced_lines import check_line_count
from app.exploration.pcao.planner import PcaoPlanner
from app.exploration.planner.options import PlannerOptions
from app.exploration.planners import COVERERS, PLANNERS, SEARCHERS, missing, options_of
from app.missions.errors import InvalidRequestError
from app.missions.spec.mission import MissionKind, MissionSpec, PlannerSpec
from app.missions.spec.swath import SwathSonarSpec
from app.missions.spec.vehicle import Sensor, VehicleKind, VehicleSpec
from app.missions.task.constraints import make_constraints
from app.missions.task.survey_lines import given_lines, not_flyable_m
from app.missions.task.way import least_way_m


def check_spec(spec: MissionSpec, kinds: Sequence[VehicleKind]) -> None:
    """Refuse a mission with a planner, a vehicle or limits that cannot be had. Raises InvalidRequestError.

    ``kinds`` are the kinds of vehicles that can be reached.
    """
    name = spec.planner.name
    there = PLANNERS | COVERERS if spec.kind is MissionKind.SURVEY else SEARCHERS
    if name not in there:
        what = f"{name!r} plans no missions of kind {spec.kind}" if name in PLANNERS | COVERERS else missing(name)
        raise InvalidRequestError("planner.name", what, f"use one of {', '.join(there)}")
    if spec.planner.options.model is not None and name != PcaoPlanner.name:
        raise InvalidRequestError(
            "planner.options.model",
            f"a trained controller is given, and planner {name!r} does not fly with one",
            f"only {PcaoPlanner.name} flies with a model: leave it out, or use that planner",
        )
    _check_options(spec.planner, options_of(there[name]))
    if name in COVERERS and spec.limits.com_range_m is not None:
        raise InvalidRequestError(
            "limits.com_range_m",
            f"{spec.limits.com_range_m:g} m is given, and planner {name!r} sends vehicles to lines of their own",
            "leave it out, or use another planner",
        )
    check_limits(spec)
    _check_lines(spec)
    for index, vehicle in enumerate(spec.vehicles):
        check_vehicle(vehicle, spec, kinds, f"vehicles.{index}.")


def _check_options(planner: PlannerSpec, read: Collection[str]) -> None:
    """Refuse options that a planner does not read, unless they say what they would anyway. Raises InvalidRequestError.

    Not a part of the description's own checks: a mission that was stored with such options can still be opened.
    """
    unread = [
        name
        for name in sorted(planner.options.model_fields_set - set(read))
        if getattr(planner.options, name) != PlannerOptions.model_fields[name].default
    ]
    if unread:
        raise InvalidRequestError(
            f"planner.options.{unread[0]}",
            f"planner {planner.name!r} has no option {' and no option '.join(unread)}",
            f"its options are {', '.join(sorted(read))}",
        )


def _check_lines(spec: MissionSpec) -> None:
    """Refuse lines that cannot be flown, or not as they are asked for. Raises InvalidRequestError."""
    options = spec.planner.options
    if spec.survey_lines:
        _check_survey_lines(spec)
    if options.line_spacing_m is None:
        return
    constraints = make_constraints(spec)
    direction_rad = direction_of_lines_rad(constraints.area, options.line_heading_deg)
    try:
        check_line_count(constraints.area, direction_rad, options.line_spacing_m)
    except ValueError as error:
        what, _, advice = str(error).partition(": ")
        raise InvalidRequestError("planner.options.line_spacing_m", what, advice) from None


def _check_survey_lines(spec: MissionSpec) -> None:
    """Refuse a line plan beside what lays other lines, or without anything to fly. Raises InvalidRequestError."""
    planner, options = spec.planner, spec.planner.options
    if planner.name != LawnmowerPlanner.name:
        raise InvalidRequestError(
            "planner.name",
            f"survey_lines are given, and planner {planner.name!r} flies where it finds best",
            f"use {LawnmowerPlanner.name}, or leave survey_lines out",
        )
    for name in ("line_spacing_m", "line_heading_deg"):
        if getattr(options, name) is not None:
            raise InvalidRequestError(
                f"planner.options.{name}",
                "survey_lines are given, which say where lines lie",
                "leave one of them out",
            )
    if spec.coverage.crosslines_pct > 0.0:
        raise InvalidRequestError(
            "coverage.crosslines_pct",
            f"{spec.coverage.crosslines_pct:g} % is given beside survey_lines, and only lines of the plan are flown",
            "leave it out or give 0, and add crosslines to survey_lines",
        )
    cut = not_flyable_m(spec)
    if all(line.length_m - cut.get(line.name, 0.0) <= LEAST_LINE_M for line in given_lines(spec)):
        raise InvalidRequestError(
            "survey_lines",
            "nothing of the lines lies inside the area and outside the keep-out zones with their margins",
            "draw the area so that it encloses the lines, not along them",
        )


def check_limits(spec: MissionSpec) -> None:
    """Refuse limits that contradict each other. Raises InvalidRequestError.

    Not a part of the description's own checks: a mission that was stored with such limits can still be opened.
    """
    limits = spec.limits
    if spec.arrival_radius_m >= limits.max_step_m:
        raise InvalidRequestError(
            "arrival_radius_m",
            f"arrival_radius_m is {spec.arrival_radius_m:g} m and limits.max_step_m is {limits.max_step_m:g} m: a leg "
            "would count as flown where it begins",
            "make arrival_radius_m smaller than limits.max_step_m",
        )
    # Vehicles that keep off each other by their depth may be as near as they like.
    band_m = limits.max_depth_m - limits.min_depth_m
    stacked = limits.min_vertical_separation_m <= min(band_m, limits.com_range_m or 0.0)
    if limits.com_range_m is not None and limits.com_range_m <= limits.min_separation_m and not stacked:
        raise InvalidRequestError(
            "limits.com_range_m",
            f"limits.com_range_m is {limits.com_range_m:g} m and limits.min_separation_m is "
            f"{limits.min_separation_m:g} m: no two vehicles could keep to both, also not one above the other by "
            f"limits.min_vertical_separation_m, {limits.min_vertical_separation_m:g} m",
            "make limits.com_range_m larger than limits.min_separation_m",
        )
    check_way(spec)
    _check_room(spec)


def check_way(spec: MissionSpec) -> None:
    """Refuse a budget that is flown before anybody moves. Raises InvalidRequestError."""
    way_m = max((spec.allowance(v).metres or 0.0 for v in spec.vehicles), default=0.0)
    for name, value in spec.budget:
        if name != "steps" and value is not None and spec.vehicles and way_m <= least_way_m(spec):
            raise InvalidRequestError(
                f"budget.{name}",
                f"{value:g} comes to {way_m:.2g} m for each vehicle, and one with {least_way_m(spec):g} m left is "
                "done: none would begin",
                "give more, or a budget in steps",
            )


def _check_room(spec: MissionSpec) -> None:
    """Refuse keep-out zones beside which no cell of the area is left. Raises InvalidRequestError."""
    if not spec.keep_out:
        return
    margin_m = spec.limits.keep_out_margin_m
    try:
        zones = unary_union([Polygon(spec.to_local(zone)).buffer(margin_m) for zone in spec.keep_out])
    except ValueError:
        return  # one is nowhere near: no mission can be made of it, and that is told with its name
    if Polygon(spec.local_inner_area()).difference(zones).area < spec.cell_m**2:
        raise InvalidRequestError(
            "keep_out",
            f"the zones with their margin of {margin_m:g} m leave nothing of the area",
            "make the zones or limits.keep_out_margin_m smaller",
        )


def check_vehicle(vehicle: VehicleSpec, spec: MissionSpec, kinds: Sequence[VehicleKind], prefix: str = "") -> None:
    """Refuse a vehicle that this service cannot reach or its mission cannot lead. Raises InvalidRequestError."""
    if vehicle.kind not in kinds:
        raise InvalidRequestError(
            f"{prefix}kind",
            f"links of kind {vehicle.kind} are switched off",
            f"use one of {', '.join(kinds)} or switch them on in the settings",
        )
    if vehicle.depth_m is not None and vehicle.depth_m > spec.limits.max_depth_m:
        raise InvalidRequestError(
            f"{prefix}depth_m",
            f"{vehicle.depth_m:g} m is deeper than limits.max_depth_m, {spec.limits.max_depth_m:g} m",
            "make it shallower or raise the limit",
        )
    if vehicle.speed_mps is not None and spec.kind is MissionKind.SEARCH:
        raise InvalidRequestError(
            f"{prefix}speed_mps",
            f"{vehicle.speed_mps:g} m/s is given, and in a search all are back in time at the mission's speed_mps",
            "leave it out",
        )
    if spec.planner.name in COVERERS and vehicle.sensor is not Sensor.MULTIBEAM:
        raise InvalidRequestError(
            f"{prefix}sensor",
            f"{vehicle.sensor} has no swath, and planner {spec.planner.name!r} plans by swaths",
            f"give it sensor {Sensor.MULTIBEAM}, or the mission another planner",
        )
    reach_m = (vehicle.sonar or SwathSonarSpec()).range_m
    if vehicle.sensor is Sensor.MULTIBEAM and reach_m <= spec.limits.min_altitude_m:
        raise InvalidRequestError(
            f"{prefix}sonar.range_m",
            f"{reach_m:g} m does not reach the bottom from limits.min_altitude_m above it, "
            f"{spec.limits.min_altitude_m:g} m",
            "give its range, or make limits.min_altitude_m smaller",
        )
    if vehicle.recovery_point is not None:
        name = f"{prefix}recovery_point"
        try:
            spec.check_recovery_point(name, vehicle.recovery_point)
        except ValueError as error:
            words, _, advice = str(error).removeprefix(name).strip().partition(": ")
            raise InvalidRequestError(name, words, advice) from None
    taken = {name for target in spec.targets for name in (target.name, target.called)}
    if vehicle.name in taken:
        raise InvalidRequestError(
            f"{prefix}name", f"{vehicle.name!r} is the name of a target of this mission", "give it another name"
        )
