"""The plan of a mission as it would begin: each vehicle's way over the area, and what that takes.

No sea floor is flown over, only the planner is asked: that takes parts of a second, so a plan can be drawn while its
area is dragged. Planners that adapt begin with it and leave it for what they find.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from shapely.geometry import Polygon

from app.arrays import FloatArray
from app.exploration.cao.planner import CaoPlanner
from app.exploration.core.constraints import Constraints
from app.exploration.core.coverage import Coverage
from app.exploration.core.free_space import FreeSpace
from app.exploration.lines.lattice import direction_of_lines_rad
from app.exploration.lines.lawnmower import LawnmowerPlanner
from app.exploration.planners import COVERERS
from app.exploration.rollout.planner import RolloutPlanner
from app.exploration.swath.flown_ahead import lines_flown_ahead
from app.exploration.swath.near_zones import BarredGround
from app.exploration.swath.raster import Flying
from app.exploration.swath.survey import SwathSurvey
from app.mapping.types import Grid
from app.missions.flight.decisions.decision import Knowledge, decide
from app.missions.forecast.floor import LEAST_GUESS_M, ROOM_M, forecast_cell_m
from app.missions.forecast.simulate import fly
from app.missions.forecast.swarm import Swarm
from app.missions.forecast.whole_survey import HALVINGS, WholeWay, whole_way
from app.missions.maps.builder import MapBuilder, make_grid
from app.missions.recovery.berths import home_of
from app.missions.recovery.energy import Energy
from app.missions.recovery.failsafes import with_reserve_s
from app.missions.recovery.way_home import WaysHome
from app.missions.safety import room
from app.missions.spec.mission import MissionSpec, PlannerSpec
from app.missions.task.constraints import from_outside, make_constraints
from app.missions.task.planner import make_planner, turn_radius_m
from app.missions.task.swath import swath_sonar, without_zones
from app.missions.team import Member
from simulator.floors.terrain import Terrain

WEIGHING = (CaoPlanner.name, RolloutPlanner.name)
"""Planners that compare many ways of laying lines before their first step."""

MOST_CELLS, CELLS_OF_HALF = 10_000, 5.0
"""Swaths are planned on so many cells at most, and on as many in half a swath."""

TURNED = 1.5
"""Cells of lines in any direction are so many times as large: smaller ones would miss some of the area's."""

SAME_M = 0.01
"""Corners closer together are one."""

MOST_OWN, ZONES_COUNT = 6, 3
"""The default planner weighs many ways of laying lines: for so many vehicles at most that is quick, where there are
zones for so many times fewer. Even lines stand in for its own where there are more."""


@dataclass(frozen=True)
class VehiclePlan:
    """What one vehicle would do.

    Attributes
    ----------
    corners_m : (k, 2)
        Its way, from where it begins; east and north.
    distance_m, seconds
        How long that is, and how long it takes with its turns and its fixes at the surface.
    least_s, most_s
        Without turns and fixes, and with every turn flown as a circle.
    way_home_m : (n, 2)
        The corners of its way home from the end; None: it has no recovery point, or no way leads there.
    home_s
        How long that takes.
    left_s
        How long its energy lasts for sure; None: not known.
    turn_back_m
        How far along its way it has to turn back, for want of energy; None: it has enough, or that is not known.
    """

    name: str
    corners_m: FloatArray
    distance_m: float
    seconds: float
    least_s: float
    most_s: float
    way_home_m: FloatArray | None
    home_s: float
    left_s: float | None
    turn_back_m: float | None

    @property
    def needs_s(self) -> float:
        """What its energy has to last for: its way, its way home, and a reserve where it has one."""
        return self.seconds + (with_reserve_s(self.home_s) if self.way_home_m is not None else 0.0)

    def place_m(self, at_m: float) -> FloatArray:
        """Return the place so far along its way, (2,)."""
        return _place(self.corners_m, _along(self.corners_m), at_m)


@dataclass(frozen=True)
class LeftOut:
    """How long the lines that were asked for are that no vehicle can reach from where it begins; by name, if any."""

    length_m: float = 0.0
    by_name: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class TeamPlan:
    """The ways of a team, and whether they were found in the time allowed; else they end early."""

    ways: list[VehiclePlan]
    whole: bool
    own: bool
    """Whether they are the planner's own; else even lines stand in for them."""
    depth_m: float
    """How deep the bottom is taken to be."""
    whole_survey: dict[str, WholeWay] | None = None
    """What each vehicle does until nothing is left to ensonify, or all lines asked for are flown, whatever its budget;
    None: that was not planned."""
    left_out: LeftOut = LeftOut()


def plan(
    spec: MissionSpec,
    members: list[Member],
    starts_m: FloatArray,
    *,
    floor_depth_m: float | None = None,
    budget_s: float,
    stop: Callable[[], bool] = lambda: False,
) -> TeamPlan:
    """Return the plan that a mission would begin with.

    Parameters
    ----------
    members, starts_m
        The vehicles and where they begin, (vehicles, 2): east, north.
    floor_depth_m
        How deep the bottom is; None: a guess that leaves the vehicles room.
    budget_s
        Seconds of the processor after which a plan that is found leg by leg ends early.
    stop
        Asked at every leg whether anyone still wants to know.
    """
    until = time.thread_time() + budget_s
    cruise_m = max(member.cruise_depth_m(spec.limits) for member in members)
    depth_m = floor_depth_m or max(LEAST_GUESS_M, cruise_m + spec.limits.min_altitude_m + ROOM_M)
    constraints = make_constraints(spec)
    inner = Polygon(constraints.area)
    begin_m = np.array([room.nearest_inside(inner, start) for start in starts_m])

    def over() -> bool:
        return stop() or time.thread_time() > until

    weight = len(members) * (ZONES_COUNT if constraints.keep_out else 1)
    own = spec.planner.name not in WEIGHING or weight <= MOST_OWN
    if not own:
        even = PlannerSpec(name=LawnmowerPlanner.name, options=spec.planner.options)
        spec = spec.model_copy(update={"planner": even})

    def ways_whole(routes: list[FloatArray]) -> dict[str, WholeWay]:
        found = {}
        for i, (member, route) in enumerate(zip(members, routes, strict=True)):
            way = _cut(np.vstack([starts_m[i], begin_m[i], route]), math.inf)
            found[member.name] = whole_way(
                spec, constraints, member, way, _clock_s(spec, member, way), float(_along(way)[-1])
            )
        return found

    all_of_it, left_out = None, LeftOut()
    if spec.planner.name in COVERERS:
        routes, done = _swath_lines(spec, members, constraints, begin_m, depth_m, over)
        all_of_it = ways_whole(routes) if done else None
        # Beyond what a vehicle may fly nothing is missing.
        whole = done or all(
            _along(np.vstack([begin_m[i], route]))[-1] >= member.way_left_m(spec)
            for i, (member, route) in enumerate(zip(members, routes, strict=True))
        )
    else:
        routes, whole, left_out = _planned(spec, members, constraints, begin_m, depth_m, over)
        if spec.planner.name == LawnmowerPlanner.name and spec.lines_asked_for:
            all_of_it = None if left_out.length_m else ways_whole(routes)
    ways_in_m = np.where(
        [from_outside(start, inner, spec) for start in starts_m], np.hypot(*(begin_m - starts_m).T), 0.0
    )
    ways = [
        _way(
            spec,
            constraints,
            member,
            _cut(np.vstack([starts_m[i], begin_m[i], route]), ways_in_m[i] + member.way_left_m(spec)),
        )
        for i, (member, route) in enumerate(zip(members, routes, strict=True))
    ]
    return TeamPlan(ways, whole, own, depth_m, all_of_it, left_out)


def _planned(
    spec: MissionSpec,
    members: list[Member],
    constraints: Constraints,
    begin_m: FloatArray,
    depth_m: float,
    over: Callable[[], bool],
) -> tuple[list[FloatArray], bool, LeftOut]:
    """Ask the planner for its first step and what it plans after that, or fly it ahead where it plans no further.

    Returns each vehicle's way, whether that is all, and the lines that nobody can reach.
    """
    planner = make_planner(spec)
    builder = MapBuilder(spec.local_area(), forecast_cell_m(spec), spec.accuracy_m)
    builder.build()
    places = Swarm(spec, members, begin_m, 1).places(np.ones(len(members), dtype=bool))
    first = decide(1, spec, constraints, planner, places, Knowledge(builder.belief(), np.zeros((0, 2))))
    ahead = planner.ways_ahead_m()
    if ahead:
        legs = {leg.vehicle: leg.target_m[None, :2] for leg in first.legs}
        none = np.zeros((0, 2))
        left_out = LeftOut()
        if isinstance(planner, LawnmowerPlanner):
            left_out = LeftOut(planner.left_out_m, planner.left_out)
        return [np.vstack([legs.get(m.name, none), ahead.get(m.name, none)]) for m in members], True, left_out
    side = forecast_cell_m(spec)
    grid, _ = make_grid(spec.local_area(), side)
    level = Terrain(np.full((grid.rows + 2, grid.cols + 2), depth_m), side, name="level")
    here: list[list[FloatArray]] = [[] for _ in members]
    for step in fly(spec, members, begin_m, builder, level):
        for i, place in enumerate(step.here_m):
            here[i].append(place)
        if over():
            return [np.array(one).reshape(-1, 2) for one in here], False, LeftOut()
    return [np.array(one).reshape(-1, 2) for one in here], True, LeftOut()


def _swath_lines(
    spec: MissionSpec,
    members: list[Member],
    constraints: Constraints,
    begin_m: FloatArray,
    depth_m: float,
    over: Callable[[], bool],
) -> tuple[list[FloatArray], bool]:
    flying = {member.name: how for member in members if (how := _flying(spec, member)) is not None}
    widths_m = [float(how.half_width_m(np.array([depth_m]))[0]) for how in flying.values()]
    fewest_m = math.sqrt(Polygon(spec.local_area()).area / MOST_CELLS)
    grid, mask = make_grid(spec.local_area(), max(spec.cell_m, fewest_m, min(widths_m, default=0.0) / CELLS_OF_HALF))
    coverage = without_zones(spec, _level(grid, depth_m, mask))
    if constraints.keep_out:
        barred = BarredGround(constraints.for_plans, coverage)
        for how in flying.values():
            coverage = barred.within_sight(coverage, how)
    space = FreeSpace(constraints.for_plans, 0.0)
    heading_deg, crosslines = spec.planner.options.line_heading_deg, spec.coverage.crosslines_pct / 100.0
    along_rad = direction_of_lines_rad(constraints.area, heading_deg)
    survey = SwathSurvey(along_rad, TURNED * coverage.cell_m, depth_m, crosslines, space, turned=heading_deg is None)
    sounding = [(i, member) for i, member in enumerate(members) if member.name in flying]
    found = lines_flown_ahead(
        survey,
        space,
        coverage,
        {member.name: begin_m[i] for i, member in sounding},
        flying,
        {member.name: math.inf for _, member in sounding},
        stop=over,
    )
    return [found.get(member.name, np.zeros((0, 2))) for member in members], not over()


def _level(grid: Grid, depth_m: float, mask: np.ndarray) -> Coverage:
    done = np.zeros_like(mask)
    depths = np.full(mask.shape, depth_m)
    return Coverage(grid.west_m, grid.south_m, grid.cell_m, mask, done, depths).planned_on()


def _flying(spec: MissionSpec, member: Member) -> Flying | None:
    sonar = swath_sonar(member.spec)
    if sonar is None:
        return None
    depth_m, altitude_m = member.cruise_depth_m(spec.limits), spec.limits.min_altitude_m
    if math.isfinite(member.altitude_m):
        depth_m, altitude_m = spec.limits.max_depth_m, max(member.altitude_m, altitude_m)
    radius_m = max(turn_radius_m(spec, member.spec), 0.5)
    return Flying(sonar, depth_m, altitude_m, radius_m, spec.coverage.overlap_pct / 100.0)


def _cut(corners_m: FloatArray, most_m: float) -> FloatArray:
    """Return a way (k, 2) without repeated corners, and no longer than a vehicle may fly."""
    keep = np.concatenate([[True], np.hypot(*np.diff(corners_m, axis=0).T) > SAME_M])
    corners = np.asarray(corners_m[keep])
    along = _along(corners)
    if along[-1] <= most_m:
        return corners
    return np.vstack([corners[along < most_m], _place(corners, along, most_m)])


def _along(corners_m: FloatArray) -> FloatArray:
    lengths: FloatArray = np.hypot(*np.diff(corners_m, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(lengths)])


def _place(corners_m: FloatArray, along_m: FloatArray, at_m: float) -> FloatArray:
    return np.array([float(np.interp(at_m, along_m, corners_m[:, k])) for k in (0, 1)])


def _turns_s(spec: MissionSpec, member: Member, corners: FloatArray) -> FloatArray:
    """Return how long a vehicle turns at each corner between the ends of a way (k, 2), (k - 2,)."""
    steps = np.diff(corners, axis=0)
    course = np.arctan2(steps[:, 0], steps[:, 1]) if len(steps) else np.zeros(0)
    turns = np.abs((np.diff(course) + np.pi) % (2.0 * np.pi) - np.pi)
    return np.asarray(turns * turn_radius_m(spec, member.spec) / spec.speed_of(member.spec))


def _clock_s(spec: MissionSpec, member: Member, corners: FloatArray) -> FloatArray:
    """Return how long a vehicle is under way at each corner (k, 2), with the turns before it and its fixes, (k,)."""
    clock_s = _along(corners) / spec.speed_of(member.spec)
    clock_s[2:] += np.cumsum(_turns_s(spec, member, corners))
    policy = spec.surface_policy
    if policy is not None and policy.every_min is not None:
        clock_s = clock_s + np.floor(clock_s / (60.0 * policy.every_min)) * policy.stay_s
    return clock_s


def _way(spec: MissionSpec, constraints: Constraints, member: Member, corners: FloatArray) -> VehiclePlan:
    speed, radius_m = spec.speed_of(member.spec), turn_radius_m(spec, member.spec)
    along = _along(corners)
    turn_s, clock_s = _turns_s(spec, member, corners), _clock_s(spec, member, corners)
    circles_s = len(turn_s) * 2.0 * np.pi * radius_m / speed
    home_m = home_of(member.spec, member.slot, spec, spec.vehicles)
    ways_home = None if home_m is None else WaysHome(constraints, home_m)

    def home_from(place_m: FloatArray) -> FloatArray | None:
        return None if ways_home is None else ways_home.way(place_m)

    def home_s(place_m: FloatArray) -> float:
        found = home_from(place_m)
        return 0.0 if found is None else float(_along(np.vstack([place_m, found]))[-1]) / speed

    way_home = home_from(corners[-1])
    left_s = _left_s(spec, member)
    planned = VehiclePlan(
        name=member.name,
        corners_m=corners,
        distance_m=float(along[-1]),
        seconds=float(clock_s[-1]),
        least_s=float(along[-1]) / speed,
        most_s=max(float(clock_s[-1] - turn_s.sum() + circles_s), float(clock_s[-1])),
        way_home_m=way_home,
        home_s=home_s(corners[-1]),
        left_s=left_s,
        turn_back_m=None,
    )
    if left_s is None or planned.needs_s <= left_s:
        return planned

    def lasts(at_m: float) -> bool:
        place = _place(corners, along, at_m)
        reserve_s = with_reserve_s(home_s(place)) if way_home is not None else 0.0
        return float(np.interp(at_m, along, clock_s)) + reserve_s <= left_s

    # Home comes no nearer faster than the way goes on: what is needed never falls along it.
    low, high = 0.0, planned.distance_m
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if lasts(middle) else (low, middle)
    return replace(planned, turn_back_m=low)


def _left_s(spec: MissionSpec, member: Member) -> float | None:
    """Return how long a vehicle's energy lasts for sure: by its battery where it tells that, else by what it has."""
    endurance_s = None if member.spec.endurance_min is None else 60.0 * member.spec.endurance_min
    energy = Energy(spec.speed_of(member.spec), endurance_s)
    if member.report is not None:
        report = member.report
        energy.take_level(report.battery_pct, report.battery_confidence_pct, report.energy_left_s)
    left = energy.left
    return None if left is None else left.safe_s
