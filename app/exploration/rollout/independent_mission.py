"""Plans for vehicles that need no links, where landmarks' whole positions are estimated: made, improved, flown."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.estimation import RangeSensor
from app.exploration.core.bottom import Bottom
from app.exploration.core.problem import Situation
from app.exploration.planner.options import PlannerOptions
from app.exploration.rollout.allowed_raster import AllowedRaster, clear_ways, settle_waypoint
from app.exploration.rollout.flight import Rules
from app.exploration.rollout.floor import (
    HELD_NEAR,
    FloorEstimate,
    estimate_floor,
    fill_depths,
    hold_to,
    let_stay,
    margin_m,
)
from app.exploration.rollout.independent_routes import (
    Routes,
    RoutesFlown,
    RoutesTask,
    fly_alone,
    improve_apart,
    judge,
    no_paths,
    no_routes,
    route_of,
    trace,
)
from app.exploration.rollout.local_search import DRAWS
from app.exploration.rollout.plan_settings import BUCKETS, HEIGHT, PARTS, SAMPLE, SAMPLE_GRID
from app.exploration.rollout.points import LandmarkPoints, make_points
from app.exploration.rollout.sectors import sectors

ROOM = 48
WORTH = 2.0
"""Steps that a change must save: what is found on one guess of all that is unknown does not hold on the next."""

FRESH_STARTS, FRESH_SEARCH = 4, 100
FIRST_SEARCH = 1000

LOWER = 0.25
"""How far below what the estimate of the floor allows vehicles are sent where their altimeters hold the clearance
anyway, in visibilities."""

AHEAD = 0.05
"""Part of a step below which a shorter one leads nowhere."""


@dataclass
class Best:
    """Routes with their paths and their score."""

    flown: RoutesFlown
    score: float

    @property
    def routes(self) -> Routes:
        """The routes."""
        return self.flown.routes


class ApartMission:
    """Everything about a step that routes are judged by."""

    def __init__(
        self, team: Situation, free_part: FloatArray, floor: FloorEstimate, free: AllowedRaster, rules: Rules,
        height_m: float, lower_m: float, accuracy_sd_m: float, rng: np.random.Generator,
    ) -> None:  # fmt: skip
        belief = team.belief
        self._start = np.ascontiguousarray(team.positions)
        self._free_part = free_part
        self._area, self._floor, self._free, self._rules = team.constraints.area, floor, free, rules
        self._horizon = max(1, team.steps_total - team.step + 1)
        self._height, self._lower, self._rng = height_m, lower_m, rng
        open_ = np.flatnonzero(~belief.accurate)
        row = open_[_sample(belief.xy_m[open_])]
        xyz = np.column_stack([belief.xy_m, belief.depth_m])[row]
        fill_depths(xyz, floor)
        total = len(belief.accurate) * len(row) / len(open_)
        self._points: LandmarkPoints = make_points(
            xyz, belief, row, accuracy_sd_m, self._area, rules.visibility_m, BUCKETS, total, floor
        )

    def plan(self, waypoints: list[FloatArray]) -> Best:
        """Make routes of waypoints (k, 2 or 3) per vehicle and fly them; what cannot be reached is left out.

        A third column is how quickly the vehicle sinks on the way to each; see ``Routes``.
        """
        routes = no_routes(len(self._start), ROOM, self._height)
        for i, stops in enumerate(waypoints):
            route, count = route_of(routes, i), 0
            here = np.ascontiguousarray(self._start[i : i + 1, :2])
            for stop in stops[: ROOM - 4]:
                route.at_m[count, 0] = stop[:2]
                if len(stop) > 2:
                    route.sinking[count] = stop[2]
                if settle_waypoint(self._free, route.at_m[count], route.chain, np.inf):
                    changed = int(clear_ways(self._free, route, count + 1, here, count, count, np.inf))
                    count = max(count, changed)
            routes.counts[i] = count
        paths = no_paths(len(self._start), self._horizon)
        for i in range(len(self._start)):
            trace(self._start, i, routes, self._floor, self._rules, paths)
        left = np.empty(len(self._points.work.need))
        count_all = int(routes.counts.sum())
        score = float(judge(paths, self._free_part, count_all, self._points, self._rules, np.inf, left))
        return Best(RoutesFlown(routes, paths, left), score)

    def first(self) -> Best:
        """Return the best of the sweeps over what is left, improved."""
        here = self._start[:, :2]
        flown = [
            (self.plan(routes).score, k, routes)
            for k, routes in enumerate(sectors(self._points.work.xyz[:2].T, here, self._area, self._rules.visibility_m))
        ]
        chosen = [self.refine(self.plan(routes), FRESH_SEARCH) for _, _, routes in sorted(flown)[:FRESH_STARTS]]
        return self.refine(min(chosen, key=lambda best: best.score), FIRST_SEARCH)

    def refine(self, best: Best, changes: int, worth: float = 0.0) -> Best:
        """Try a number of changes; the routes are improved in place."""
        trial = RoutesFlown(
            no_routes(len(self._start), ROOM, self._height),
            no_paths(len(self._start), self._horizon),
            np.empty(len(best.flown.left)),
        )
        task = RoutesTask(self._start, self._free_part, self._points, self._floor, self._rules)
        draws = self._rng.random((changes, DRAWS + 1))
        best.score = float(improve_apart(best.flown, best.score, trial, draws, task, self._free, worth))
        return best

    def steps(self, best: Best, i: int) -> tuple[FloatArray, list[int]]:
        """Return where vehicle ``i`` may go now, (k, 3), best first, and how many waypoints each of these passes.

        The first is the route's; the others go less far, as they are and as high as the step allows, for when the sea
        floor that the constraints hold to has steps that the plan's estimate smooths. The last is straight up.
        """
        wishes, passed, here = [], [], self._start[i]
        route, count, step = route_of(best.routes, i), int(best.routes.counts[i]), self._rules.step_m
        if not count:
            return here[None].copy(), [0]
        for part in PARTS:
            wish = here[None].copy()
            rules = self._rules._replace(step_m=part * step)
            after = int(fly_alone(here[None], route, 0, count, self._floor, rules, wish))
            (x, y, z), ahead = wish[0], float(np.hypot(*(wish[0] - here)[:2]))
            if part == 1.0 or ahead > AHEAD * step:
                deeper = min(z + self._lower, max(z, here[2] + _left_of(part * step, ahead)))
                wishes.append([x, y, min(deeper, self._rules.max_depth_m)])
                passed.append(after)
            if part < 1.0:
                wishes.append([x, y, max(here[2] - _left_of(step, ahead), self._rules.min_depth_m)])
                passed.append(after)
        wishes.append([*here[:2], max(here[2] - _left_of(step, 0.0), self._rules.min_depth_m)])
        passed.append(0)
        return np.array(wishes), passed


def apart_mission(
    team: Situation,
    free_part: FloatArray,
    bottom: Bottom,
    felt_m: FloatArray,
    free: AllowedRaster,
    sensor: RangeSensor,
    options: PlannerOptions,
    rng: np.random.Generator,
) -> ApartMission:
    """Return what the routes of a team are judged by.

    ``free_part`` (n_vehicles,) is what each has of its time; ``felt_m`` (k, 3) is where altimeters felt the bottom.
    """
    constraints, sight = team.constraints, sensor.visibility_m
    clearance = constraints.min_altitude_m
    height = max(HEIGHT * sight, clearance + margin_m(sight, clearance), constraints.lowest_m)
    lower = min(LOWER * sight, max(0.0, constraints.lowest_m - clearance))
    unknown = min(constraints.max_depth_m, float(team.positions[:, 2].max()) + height)
    floor = estimate_floor(
        team.belief, bottom, felt_m, constraints.area, sight, clearance, unknown, constraints.lowest_m,
        follows=lower > 0.0,
    )  # fmt: skip
    if lower > 0.0:
        hold_to(floor, _under(team), HELD_NEAR * sight)
        let_stay(floor, team.positions, height, HELD_NEAR * sight)
    rules = Rules(
        constraints.max_step_m, np.inf, constraints.min_depth_m, min(constraints.max_depth_m, 1e9), sight,
        sensor.relative_noise, free.everywhere, directed=True,
    )  # fmt: skip
    return ApartMission(team, free_part, floor, free, rules, height, lower, options.accuracy_sd_m, rng)


def _under(team: Situation) -> FloatArray:
    """Return what was sounded closest to each vehicle, (n_vehicles, 3); nothing where nothing was sounded."""
    sounded = team.belief.sounded_m
    if not len(sounded):
        return sounded
    away = np.hypot(*(sounded[:, None, :2] - team.positions[None, :, :2]).transpose(2, 0, 1))
    return np.ascontiguousarray(sounded[away.argmin(axis=0)])


def _left_of(step_m: float, ahead_m: float) -> float:
    """Return how far up or down a step may go that goes so far ahead."""
    return float((1.0 - 1e-9) * np.sqrt(max(0.0, step_m**2 - ahead_m**2)))


def _sample(xy: FloatArray) -> NDArray[np.int64]:
    """Return evenly many of the landmarks at ``xy`` (m, 2): flights over all of them would add nothing."""
    n = len(xy)
    if n <= SAMPLE:
        return np.arange(n)
    east, north = np.floor((xy - xy.min(axis=0)) / (np.ptp(xy) / SAMPLE_GRID + 1e-12)).T
    order = np.lexsort((np.where(north % 2 == 0, east, -east), north))
    return np.asarray(np.sort(order[:: -(-n // SAMPLE)]), dtype=np.int64)
