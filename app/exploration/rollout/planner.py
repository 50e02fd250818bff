"""A planner that is not greedy: whole-mission rollouts on the current map estimate (the future work of AURO15).

Each step it keeps a plan for the team until everything is done, tries changes to it, each judged by flying the plan to
its end over what is known and presumed of the sea floor, and flies the first step of the best. Nothing is ever really
tried. What the next measurements show changes the landmarks' estimates, and with them the plan.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from app.arrays import FloatArray
from app.estimation import RangeSensor, Sensor
from app.exploration.core.bottom import Bottom
from app.exploration.core.bottom_contacts import FeltBottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.information_need import Lacking, lacking
from app.exploration.core.problem import Belief, Proposal, Situation
from app.exploration.planner.base import PlannerBase, settle
from app.exploration.planner.options import OF_CAO, PlannerOptions
from app.exploration.rollout.allowed_raster import AllowedRaster, allowed_raster, clear_ways, settle_waypoint
from app.exploration.rollout.flight import (
    DIVE,
    LIFTED_AT_LEISURE,
    LOW,
    SINKING,
    Checkpoints,
    FlownPlan,
    Plan,
    Rules,
    Task,
    Work,
    begin,
    fly_plan,
    fly_step,
    make_work,
    new_checkpoints,
)
from app.exploration.rollout.floor import FloorEstimate, estimate_floor, fill_depths, margin_m, sample
from app.exploration.rollout.independent_mission import WORTH, apart_mission
from app.exploration.rollout.independent_routes import stops_of
from app.exploration.rollout.initial_plans import Backbone, backbones, with_team
from app.exploration.rollout.local_search import DRAWS, improve
from app.exploration.rollout.plan_settings import BUCKETS, HEIGHT, PARTS, SAMPLE, SAMPLE_GRID
from app.exploration.rollout.tour import tour_of
from app.exploration.rollout.unseen import SLACK, deeper_than_presumed, look_in_vain

ROOM = 40
FIRST_SINKING = 0.3
"""Part of a step by which vehicles may sink in first plans."""

TOUR_SINKING, TOUR_HEIGHT = 0.6, 0.35
"""How quickly vehicles sink on tours, in steps, and how high they fly, in visibilities."""

HEDGE = 1.5
"""How much more information a landmark is presumed to need that was never seen, because its depth is a guess."""

CONVOY_MARGIN = 2.5
"""Distance that a team on its way between zones keeps from them, in cells of the free space."""

OUTLETS = 400
"""Random moves to choose from where the plan's next step is not feasible."""

UP_COUNTS = 0.3

FEW_LEFT = 0.08
"""Part of all landmarks of which tours from place to place are tried."""

LINK_OF_RANGE = 29 / 30
MAY_BE_LEFT = 0.008
"""Part of all landmarks that a plan may leave over, until the team has come so far."""

SWATH_EXCESS = 1.2
"""How far a team may exceed, on average, the landmarks in the swath that it sees."""

BACK_SOON = -1
"""In place of the number of steps planned so far: a vehicle left on an errand, or came back."""

FIRST_SEARCH = 1500
LAST_SHARE = 4
"""Part of the search that is enough once the plan's own goal is reached."""

FRESH_STARTS = 4
FRESH_SEARCH = 60

AWAY_STEPS = 40.0
"""Steps over which the share of a vehicle's time on errands is averaged."""

LEAST_FREE = 0.1


@dataclass
class _Best:
    """A plan with its flight."""

    flown: FlownPlan
    count: int
    score: float


class RolloutPlanner(PlannerBase):
    """Plans the team's whole mission on the current map and replans every step; with a bathymeter the same as cao.

    For sensors that see landmarks from afar; see the module's text.
    """

    name: ClassVar[str] = "rollout"
    own_options: ClassVar[frozenset[str]] = OF_CAO | {"rollouts"}

    def __init__(self, options: PlannerOptions, sensor: Sensor) -> None:
        if not isinstance(sensor, RangeSensor):
            raise ValueError(f"sensor: whole-mission rollouts need a RangeSensor, not {type(sensor).__name__}")
        super().__init__(options, sensor)
        self._range = sensor
        self._least_m: FloatArray = np.zeros(0)
        self._names: tuple[str, ...] = ()
        self._kept: Backbone | None = None
        self._heights: FloatArray = np.zeros(0)
        self._sinking: FloatArray = np.zeros(0)
        self._planned = 0
        self._free: tuple[Constraints, AllowedRaster] | None = None
        self._felt = FeltBottom()
        self._routes: dict[str, FloatArray] = {}
        self._away: dict[str, float] = {}

    def _remember(self) -> dict[str, Any]:
        kept = self._kept
        return {
            "names": list(self._names),
            "planned": self._planned,
            "at_m": None if kept is None else kept.at_m,
            "chain": None if kept is None else kept.chain,
            "heights": self._heights,
            "sinking": self._sinking,
            "least": self._least_m,
            "felt": self._felt.remember(),
            "routes": self._routes,
            "away": self._away,
        }

    def _recall(self, state: dict[str, Any]) -> None:
        self._names, self._planned = tuple(state["names"]), int(state["planned"])
        self._heights = np.array(state["heights"], dtype=np.float64)
        self._sinking = np.array(state["sinking"], dtype=np.float64)
        least_m = np.array(state["least"], dtype=np.float64)
        self._least_m = np.where(np.isnan(least_m), -np.inf, least_m)  # JSON has no infinity
        self._felt.recall(state["felt"])
        self._routes = {name: np.array(at, dtype=np.float64).reshape(-1, 3) for name, at in state["routes"].items()}
        self._away = {str(name): float(part) for name, part in state["away"].items()}
        self._kept = None
        if state["at_m"] is not None:
            at = np.array(state["at_m"], dtype=np.float64).reshape(-1, len(self._names), 2)
            self._kept = Backbone(at, np.array(state["chain"], dtype=np.int64))

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        if team.belief.accurate.all():
            return Proposal(self._rest(team, bottom), 0.0)
        if team.belief.covariance_m2 is not None and team.belief.on_floor and np.isinf(team.constraints.com_range_m):
            return self._decide_apart(team, seed)
        if self._names != team.vehicles:
            if self._kept is not None:
                self._kept = with_team(self._kept, self._names, team.vehicles)
            # On an errand a vehicle is away for a while only: new sweeps may compete, with the usual effort.
            away = team.targets is not None or team.localization is not None
            self._names, self._planned = team.vehicles, BACK_SOON if away and self._planned else 0
        if self._free is None or not _same(self._free[0], team.constraints):
            self._free = (team.constraints, allowed_raster(team.constraints))
        self._felt.feel(team)
        deeper_m, bottom = self._look_for_unseen(team, bottom)
        mission = _Mission(
            team, bottom, self._felt.points_m, deeper_m, self._least_m, self._free[1], self._range, self.options,
            np.random.default_rng(seed),
        )  # fmt: skip
        best = None
        if self._kept is not None and len(self._kept.at_m):
            best = mission.plan(self._kept, self._heights, self._sinking)
        # Sweeps over unseen ground look better than they are: the plan that stands is not given up for one
        # (measured: changing for a new sweep every 8 steps costs 8 steps, only for one better by 10 still costs them).
        if best is None or self._planned in (0, BACK_SOON):
            rivals = [mission.refine(start, FRESH_SEARCH) for start in mission.fresh_starts(FRESH_STARTS)]
            best = min([*rivals, *([] if best is None else [best])], key=lambda start: start.score, default=None)
        tour = mission.tour(FRESH_SEARCH)
        best = tour if best is None or (tour is not None and tour.score < best.score - 1.0) else best
        best = mission.convoy(team.constraints) if best is None else best
        if best is None:
            return Proposal(mission.way_out(team, bottom, mission.towards_work(team.constraints)), 0.0)
        best = mission.refine(best, self._effort(mission))
        wishes, passed_by = mission.first_step(best)
        feasible = np.flatnonzero(team.constraints.feasible(team.positions, wishes, bottom))
        if len(feasible):
            positions, passed = wishes[feasible[0]], passed_by[feasible[0]]
        else:
            positions, passed = mission.way_out(team, bottom, wishes[0]), 0
        self._kept = Backbone(best.flown.plan.at_m[passed : best.count].copy(), best.flown.plan.chain.copy())
        self._heights = best.flown.plan.height_m[passed : best.count].copy()
        self._sinking = best.flown.plan.sinking[passed : best.count].copy()
        self._planned = max(1, self._planned + 1)
        self._felt.ask(team.vehicles, positions)
        terms = {
            "finish": team.step - 1 + float(best.flown.checkpoints.state[best.count, 0]),
            "waypoints": float(best.count),
        }
        return Proposal(positions, -best.score, terms)

    def _decide_apart(self, team: Situation, seed: int) -> Proposal:
        """Decide where no links are needed: a route for each vehicle, those on errands included."""
        whole = team if self._whole is None else self._whole
        belief, sounded = team.belief, team.belief.sounded_m
        bottom = Bottom.from_landmarks(
            np.vstack([belief.xy_m, sounded[:, :2]]), np.append(belief.depth_m, sounded[:, 2])
        )
        self._felt.feel(team)
        constraints = team.constraints
        if self._free is None or not _same(self._free[0], constraints):
            self._free = (constraints, allowed_raster(constraints))
        self._away = {name: self._away.get(name, 0.0) for name in whole.vehicles}
        for name in whole.vehicles:
            self._away[name] += (float(name not in team.vehicles) - self._away[name]) / AWAY_STEPS
        free_part = np.array([max(LEAST_FREE, 1.0 - self._away[name]) for name in whole.vehicles])
        mission = apart_mission(
            whole,
            free_part,
            bottom,
            self._felt.points_m,
            self._free[1],
            self._range,
            self.options,
            np.random.default_rng(seed),
        )
        if set(whole.vehicles) == set(self._routes):
            kept = mission.plan([self._routes[name] for name in whole.vehicles])
            best = mission.refine(kept, self.options.rollouts, WORTH)
        else:
            best = mission.first()
        positions = team.positions.copy()
        rows = {name: whole.vehicles.index(name) for name in whole.vehicles}
        self._routes = {name: stops_of(best.routes, i) for name, i in rows.items()}
        for j, name in enumerate(team.vehicles):
            wishes, passed = mission.steps(best, rows[name])
            tries = np.repeat(positions[None], len(wishes), axis=0)
            tries[:, j] = wishes
            feasible = np.flatnonzero(constraints.feasible(team.positions, tries, bottom))
            if len(feasible):
                positions = tries[feasible[0]]
                self._routes[name] = self._routes[name][passed[feasible[0]] :]
        positions, _ = settle(team, bottom, positions[None])
        self._felt.ask(team.vehicles, positions)
        return Proposal(positions, -best.score, {"waypoints": float(best.routes.counts.sum())})

    def _rest(self, team: Situation, bottom: Bottom) -> FloatArray:
        """Return where the vehicles wait, (n_vehicles, 3): here, or closer together when that breaks a limit."""
        here = team.positions
        leg = here.mean(axis=0) - here
        length = np.maximum(np.linalg.norm(leg, axis=1, keepdims=True), 1e-12)
        closer = here + leg * np.minimum(1.0, 0.99 * team.constraints.max_step_m / length)
        return settle(team, bottom, np.array([here, closer]))[0]

    def _look_for_unseen(self, team: Situation, bottom: Bottom) -> tuple[FloatArray, Bottom]:
        """Return landmarks (k, 3) that must lie deeper than their surroundings, and the sea floor with them."""
        belief, none = team.belief, np.zeros((0, 3))
        if belief.covariance_m2 is not None or not belief.on_floor or not belief.complete:
            return none, bottom
        if len(self._least_m) != len(belief.depth_m):
            self._least_m = np.full(len(belief.depth_m), -np.inf)
        sight, deepest = self._range.visibility_m, team.constraints.max_depth_m
        self._least_m = look_in_vain(self._least_m, belief, team.positions, sight, deepest)
        deeper = deeper_than_presumed(belief, self._least_m)
        if not len(deeper):
            return none, bottom
        places, depths = np.vstack([belief.xy_m, deeper[:, :2]]), np.append(belief.depth_m, deeper[:, 2])
        return deeper, Bottom.from_landmarks(places, depths)

    def _effort(self, mission: "_Mission") -> int:
        """Return how many changes to try now: many for the first plan, few for what little is left in the end."""
        if self._planned == 0:
            return FIRST_SEARCH
        return self.options.rollouts if mission.far_from_done else self.options.rollouts // LAST_SHARE


def _sample(left: Lacking, belief: Belief) -> NDArray[np.int64]:
    """Return the tasks that plans are judged by: all, or evenly many where a landmark has several.

    Where whole positions are estimated each takes many looks, and flights are long; a sample is enough.
    """
    n = len(left.row)
    if belief.covariance_m2 is None or n <= SAMPLE:
        return np.arange(n)
    xy = belief.xy_m[left.row]
    east, north = np.floor((xy - xy.min(axis=0)) / (np.ptp(xy) / SAMPLE_GRID + 1e-12)).T
    order = np.lexsort((np.where(north % 2 == 0, east, -east), north))
    return np.asarray(order[:: -(-n // SAMPLE)], dtype=np.int64)


def _same(a: Constraints, b: Constraints) -> bool:
    """Whether two sets of limits leave the same free space."""
    return a is b or (
        np.array_equal(a.area, b.area)
        and len(a.keep_out) == len(b.keep_out)
        and all(np.array_equal(x, y) for x, y in zip(a.keep_out, b.keep_out, strict=True))
    )


class _Mission:
    """Everything about a step that plans are judged by."""

    def __init__(
        self,
        team: Situation,
        bottom: Bottom,
        felt_m: FloatArray,
        deeper_m: FloatArray,
        least_m: FloatArray,
        free: AllowedRaster,
        sensor: RangeSensor,
        options: PlannerOptions,
        rng: np.random.Generator,
    ) -> None:
        constraints, belief = team.constraints, team.belief
        visibility = sensor.visibility_m
        self._rng = rng
        self._start = np.ascontiguousarray(team.positions)
        self._sight = visibility
        self._area = constraints.area
        self._com_range = constraints.com_range_m
        self._link = constraints.com_range_m * LINK_OF_RANGE
        self._horizon = float(max(1, team.steps_total - team.step + 1))
        self._sinking = SINKING if belief.covariance_m2 is not None else FIRST_SINKING
        clearance = constraints.min_altitude_m
        self._height = max(HEIGHT * visibility, clearance + margin_m(visibility, clearance), constraints.lowest_m)
        unknown = min(constraints.max_depth_m, float(team.positions[:, 2].max()) + self._height)
        self._floor: FloorEstimate = estimate_floor(
            belief, bottom, felt_m, constraints.area, visibility, clearance, unknown, constraints.lowest_m, deeper_m
        )
        self._free = free
        self._rules = Rules(
            constraints.max_step_m,
            constraints.com_range_m,
            constraints.min_depth_m,
            min(constraints.max_depth_m, 1e9),
            visibility,
            sensor.relative_noise,
            self._free.everywhere,
            belief.covariance_m2 is not None,
        )
        self._work: Work = self._left(belief, least_m, options)
        if not self.far_from_done:
            self._rules = self._rules._replace(lifted=LIFTED_AT_LEISURE)
        self._task = Task(self._work, self._floor, self._rules, self._horizon)

    def _left(self, belief: Belief, least_m: FloatArray, options: PlannerOptions) -> Work:
        hedge = HEDGE if belief.covariance_m2 is None else 1.0
        left = lacking(belief, options.accuracy_sd_m, hedge)
        shown = _sample(left, belief)
        xyz = np.column_stack([belief.xy_m, belief.depth_m])[left.row[shown]]
        unseen = np.isnan(xyz[:, 2])
        fill_depths(xyz, self._floor)
        if len(least_m):
            least = least_m[left.row[shown]] + SLACK * self._sight
            xyz[unseen, 2] = np.maximum(xyz[unseen, 2], least[unseen])
        tasks = len(belief.xy_m) * len(left.row) / max(1, int((~belief.accurate).sum()))
        part = len(shown) / max(1, len(left.row))
        allowed = np.floor(MAY_BE_LEFT * tasks * part)
        if len(shown) <= allowed:
            allowed = 0.0
        density = tasks * part / float(Polygon(self._area).area)
        links = min(self._link, 2 * self._sight) * (len(self._start) - 1)
        most = SWATH_EXCESS * density * self._rules.step_m * (2 * self._sight + links)
        return make_work(
            xyz, left.need[shown], self._area, self._sight / BUCKETS, allowed, round(tasks * part), max(1.0, most),
            left.direction[shown],
        )[0]  # fmt: skip

    @property
    def far_from_done(self) -> bool:
        """Whether more is left than a plan may leave over."""
        return self._work.allowed > 0.0

    def plan(
        self, backbone: Backbone, heights: FloatArray, sinking: FloatArray, checkpoints: Checkpoints | None = None
    ) -> _Best | None:
        """Complete team waypoints to a plan and fly it; None when there is no allowed way.

        A ``checkpoints`` given is overwritten instead of making a new one.
        """
        n, count = len(self._start), min(len(backbone.at_m), ROOM - 4)
        plan = Plan(np.zeros((ROOM, n, 2)), np.zeros(ROOM), np.zeros(ROOM), backbone.chain)
        plan.at_m[:count], plan.height_m[:count] = backbone.at_m[:count], heights[:count]
        plan.sinking[:count] = sinking[:count]
        start = np.ascontiguousarray(self._start[:, :2])
        k = 0
        while k < count:
            # What cannot be reached is left to the search.
            changed = -1
            if settle_waypoint(self._free, plan.at_m[k], plan.chain, self._link):
                changed = int(clear_ways(self._free, plan, count, start, k, k, self._link))
            if changed < 0:
                plan.at_m[k : count - 1], plan.height_m[k : count - 1] = (
                    plan.at_m[k + 1 : count].copy(),
                    plan.height_m[k + 1 : count].copy(),
                )
                plan.sinking[k : count - 1] = plan.sinking[k + 1 : count].copy()
                count -= 1
                continue
            k += 1 + changed - count
            count = changed
        if count == 0:
            return None
        checkpoints = new_checkpoints(ROOM, n, len(self._work.need)) if checkpoints is None else checkpoints
        begin(checkpoints, self._start, self._work)
        left_need = np.empty(len(self._work.need))
        score = fly_plan(checkpoints, 0, plan, count, self._task, np.inf, left_need, checkpoints)
        return _Best(FlownPlan(plan, checkpoints, left_need), count, float(score))

    def fresh_starts(self, most: int) -> list[_Best]:
        """Return the best of the sweeps over what is left."""
        sweeps = backbones(
            self._work.xyz[:2].T, self._start[:, :2], self._area, self._sight, self._com_range, self._link
        )
        heights = np.full(ROOM, self._height)
        scratch = new_checkpoints(ROOM, len(self._start), len(self._work.need))
        sinking = np.full(ROOM, self._sinking)
        flown = [(self.plan(sweep, heights, sinking, scratch), sweep) for sweep in sweeps]
        order = sorted(((best.score, k) for k, (best, _) in enumerate(flown) if best is not None))
        chosen = [self.plan(flown[k][1], heights, sinking) for _, k in order[:most]]
        return [best for best in chosen if best is not None]

    def tour(self, changes: int) -> _Best | None:
        """Return a tour over what is left, improved by some changes; None where that is too much for one."""
        if len(self._work.need) > FEW_LEFT * self._work.total:
            return None
        floor = self._floor
        above = np.array([
            sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, x, y) for x, y in self._work.xyz[:2].T
        ])  # fmt: skip
        tour = tour_of(self._work.xyz.T, above, self._start[:, :2], self._com_range, self._link, self._sight)
        count = min(len(tour.dives), ROOM - 4)
        sinking = np.where(tour.dives, DIVE, TOUR_SINKING)[:count]
        backbone = Backbone(tour.at_m[:count], tour.chain)
        best = self.plan(backbone, np.where(tour.dives, LOW, TOUR_HEIGHT)[:count] * self._sight, sinking)
        return None if best is None else self.refine(best, changes)

    def convoy(self, constraints: Constraints) -> _Best | None:
        """Return a plan that brings the team, closed up, on the shortest way to the landmark nearest to its middle.

        For when no sweep finds a way between the zones.
        """
        at = np.repeat(self._way_to_work(constraints)[:, None], len(self._start), axis=1)
        return self.plan(
            Backbone(at, np.arange(len(self._start))), np.full(ROOM, self._height), np.full(ROOM, self._sinking)
        )

    def towards_work(self, constraints: Constraints) -> FloatArray:
        """Return a step (n_vehicles, 3) of the whole team in the direction of that way."""
        way = self._way_to_work(constraints)
        leg = way[1] - way[0]
        wish = self._start.copy()
        wish[:, :2] += leg * min(1.0, self._rules.step_m / max(float(np.hypot(*leg)), 1e-12))
        return wish

    def _way_to_work(self, constraints: Constraints) -> FloatArray:
        """Return the vertices (k, 2) of the way from the middle vehicle to the landmark nearest to it."""
        middle = self._start[np.argmin(np.linalg.norm(self._start - self._start.mean(axis=0), axis=1)), :2]
        space = FreeSpace(constraints, CONVOY_MARGIN * self._free.cell_m)
        nearest = np.argmin(np.linalg.norm(self._work.xyz[:2].T - middle, axis=1))
        return np.vstack([middle, space.way(middle, space.nearest(self._work.xyz[:2, nearest]))])

    def refine(self, best: _Best, changes: int) -> _Best:
        """Try a number of changes; the plan is improved in place."""
        n = len(self._start)
        like = best.flown.plan
        trial = FlownPlan(
            Plan(np.zeros_like(like.at_m), np.zeros(ROOM), np.zeros(ROOM), like.chain),
            new_checkpoints(ROOM, n, len(self._work.need)),
            np.empty(len(self._work.need)),
        )
        draws = self._rng.random((changes, DRAWS))
        best.count, best.score = improve(
            best.flown, best.count, best.score, trial, draws, self._task, self._free, self._link
        )
        return best

    def first_step(self, best: _Best) -> tuple[FloatArray, list[int]]:
        """Return where the vehicles may go now, and how many waypoints each of these wishes passes.

        The first of the wishes (k, n_vehicles, 3) is the plan's; the others go less far and higher, for when the sea
        floor that the constraints hold to has steps that the plan's estimate smooths.
        """
        wishes, passed = [], []
        for part in PARTS:
            wish = np.empty_like(self._start)
            rules = self._rules._replace(step_m=part * self._rules.step_m)
            after = int(fly_step(self._start, best.flown.plan, 0, best.count, self._floor, rules, wish))
            spare = np.sqrt(self._rules.step_m**2 - np.minimum(part * self._rules.step_m, self._rules.step_m) ** 2)
            wishes.append(wish)
            passed.append(after)
            if part < 1.0:
                wishes.append(wish - [0.0, 0.0, 0.99 * spare])
                passed.append(after)
        return np.array(wishes), passed

    def way_out(self, team: Situation, bottom: Bottom, wish: FloatArray) -> FloatArray:
        """Return the feasible one of many random moves (n_vehicles, 3) that comes closest to a wish that is not.

        Part of the moves change the whole team alike, part of them every vehicle on its own; going up counts little
        because it is what most often helps.
        """
        n, step = len(wish), self._rules.step_m * (1 - 1e-9)
        alike = np.linspace(0.0, 1.0, OUTLETS)[:, None, None]
        towards = (wish - self._start) * (1.0 - alike) * self._rng.random((OUTLETS, n, 1))
        noise = alike * step * self._rng.standard_normal((OUTLETS, n, 3))
        moves = towards + noise
        moves *= np.minimum(1.0, step / np.maximum(np.linalg.norm(moves, axis=2, keepdims=True), 1e-12))
        candidates = self._start + moves
        feasible = candidates[team.constraints.feasible(self._start, candidates, bottom)]
        if len(feasible) == 0:
            return settle(team, bottom, wish[None])[0]
        off = feasible - wish
        off[..., 2] *= np.where(off[..., 2] < 0.0, UP_COUNTS, 1.0)
        return np.asarray(feasible[np.argmin(np.linalg.norm(off, axis=2).sum(axis=1))])
