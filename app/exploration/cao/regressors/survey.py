"""Predictions for bathymeter missions, from the current map: what a leg gains, and how good the final map becomes.

The team holds two plans for all remaining steps: the coverage backbone, and a freer plan that is improved again and
again (:mod:`.survey.local_search`) towards where the map is rough and little sounded. It follows the backbone
until the freer plan promises a clearly better final map. The plan is renewed ``REPLANS`` times in a mission, and when
the team changes. Then the candidates are the next legs of both plans, turns that a vehicle can fly, legs to places of
high gain, and random ones; each is judged by the final map when the plan goes on from its end. In between the plan
is followed.

phi = (improvement of the predicted final map over the plan kept so far, uncertainty removed by the legs alone); the
objective measured after a step is the improvement of the predicted final map that really came about.
"""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from shapely import Polygon, unary_union

from app.arrays import BoolArray, FloatArray, IntArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints, inside_area
from app.exploration.core.problem import Belief, Situation
from app.exploration.core.routes import (
    CORNER_TOLERANCE,
    SAME_M,
    Turns,
    Vehicles,
    follows,
    metres_left,
    next_waypoint,
    vertices_passed,
)
from app.exploration.lines.flown_lines import after_line
from app.exploration.lines.handover import hand_over
from app.exploration.lines.lawnmower import CORNER_LOSS
from app.exploration.lines.parts import is_cut_off
from app.exploration.planner.base import vehicle_rng
from app.exploration.planner.options import PlannerOptions
from app.exploration.survey.backbone import MARGIN_M, backbone, packed
from app.exploration.survey.error import expected_roughness, noise_part, with_second_looks
from app.exploration.survey.local_search import DRAWS, PlanSearch, ViaPoints, improve
from app.exploration.survey.value import (
    SurveyObjective,
    UncertaintyNodes,
    make_nodes,
    plan_value,
    values_after_first_leg,
)

AtCruise = Callable[[Situation, Bottom, FloatArray], FloatArray]

MAX_NODES = 2500
REPLANS = 20
"""How often the plan is renewed in a mission."""
HEAT = 0.01
"""Part by which changes to a plan may worsen it while the search begins."""
POWER = 2.0
REACH = 4.0
"""Line spacings beyond which a place counts as quite unknown."""
LEAVE_BACKBONE = 0.98
"""The freer plan must promise at most this part of the squared error that the backbone promises."""
LEAVE_LINES = 0.95
"""The same where all lines are flown in order: an even survey is hard to better."""
KNOWN = 0.5
"""A map of this part of the area at the beginning tells where it is rough."""
LEAVE_PLAN = 0.02
"""A leg off the plan must promise a squared error smaller by this part: predictions are noisy, and a choice among many
takes the luckiest."""
COARSE = 0.75
"""Nodes farther apart than this part of the spacing of lines no longer tell lattices from freer plans: a search would
bend lines to pass over nodes."""
SILENT_WITHIN, SILENT = 0.5, 0.05
"""Within so many spacings of a place that gave no echo ground counts only this part: there is nothing to be heard."""
JITTER = 0.7
SKIPPED_M = 5.0
"""Ground along a line that is left out is marked at places so far apart."""
MOST_GIVEN = 24
"""How many of a vehicle's last legs can be taken back."""
LEAST_EXTRA = 0.5
"""Whose lines are all flown gets more to fly where at least this part of a step is left."""
TURNS_RAD = np.deg2rad([-120.0, -90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0, 120.0])


class GivenLeg(NamedTuple):
    """A leg that a vehicle was given: its ends (2,), and what it took from the head of either plan, (k, 2).

    ``coarse`` is how many via points were left of the first pass before it; ``free`` tells which plan was followed.
    """

    start_m: FloatArray
    end_m: FloatArray
    plan: FloatArray
    backbone: FloatArray
    coarse: int
    free: bool


class SurveyRegressors:
    """Regressors of bathymeter missions: what a leg gains, and how good the final map becomes with it.

    The module's text tells how the team's plan is made, renewed and followed.
    """

    def __init__(self, options: PlannerOptions, at_cruise: AtCruise, *, every_step: bool = False) -> None:
        """Vehicles move at their cruise depths by ``at_cruise``.

        ``every_step``: the regressors are asked for other legs than :meth:`candidates` in every step; costs time.
        """
        self._options = options
        self._at_cruise = at_cruise
        self._every_step = every_step
        self._backbone: dict[str, FloatArray] = {}
        self._coarse: dict[str, int] = {}
        self._plan: dict[str, FloatArray] = {}
        self._expected: float | None = None
        self._flown_m = self._planned_m = 0.0
        self._silent = np.zeros((0, 2))
        self._adapts = True
        self._free = False
        self._row = [0.0, 0.0]
        self._given: dict[str, list[GivenLeg]] = {}

    def begin(self, team: Situation, bottom: Bottom, seed: int) -> float:
        """See :class:`app.exploration.cao.planner.Regressors`.

        What came of a plan is only measured when the next is made, for the leg chosen when that one was made.
        """
        self._team, self._bottom, self._seed = team, bottom, seed
        self._en = np.ascontiguousarray(team.positions[:, :2])
        self._left_m = metres_left(team)
        self._steps_m = np.minimum(team.constraints.max_step_m, self._left_m) * (1 - 1e-9)
        self._whole_m = max(self._flown_m + float(self._left_m.sum()), 1e-9)
        begins = not self._plan
        self._leave_out_cut_off()
        changed = not begins and self._plan.keys() != set(team.vehicles)
        explores = not begins and any(self._coarse.get(v, 0) == 0 for v in team.vehicles)
        renews = explores and self._flown_m - self._planned_m >= self._whole_m / REPLANS
        self._replans = changed or renews or (not begins and self._runs_out())
        self._looks = begins or self._replans or self._every_step
        if not self._looks:
            self._followed = self._packed(self._plan if self._free else self._backbone)
            return np.nan
        self._look()
        if begins:
            self._adopt_backbone()
        elif changed:
            self._hand_over()
        plan, lattice = self._packed(self._plan), self._packed(self._backbone)
        values = self._value(*plan), self._value(*lattice)
        expected = min(values) / self._reference
        before, self._expected = self._expected, expected
        if self._replans:
            plan, values = self._improve_plan(plan, lattice, values)
            if not self._free:
                lattice, extended = self._extended(lattice, values[1])
                values = values[0], extended
        self._followed = plan if self._free else lattice
        self._expected_value = values[0] if self._free else values[1]
        return np.nan if before is None else before - expected

    def _look(self) -> None:
        """See what is known and where it is far to the next sounding."""
        team, constraints = self._team, self._team.constraints
        self._spacing = _free_area(constraints) / self._whole_m
        tree = cKDTree(np.vstack([team.soundings_en_m, self._en]), balanced_tree=False)
        distance = np.asarray(tree.query(team.belief.xy_m)[0])
        roughness = np.ones(len(distance))
        if self._adapts:
            roughness = expected_roughness(team.belief, distance, self._spacing)
        roughness = with_second_looks(roughness, team, self._spacing)
        # What was flown over and gave no echo gives none the next time either.
        self._silent = self._silent[np.asarray(tree.query(self._silent)[0]) > SILENT_WITHIN * self._spacing]
        if len(self._silent):
            heard_of = np.asarray(cKDTree(self._silent).query(team.belief.xy_m)[0]) <= SILENT_WITHIN * self._spacing
            roughness = np.where(heard_of & (distance > SILENT_WITHIN * self._spacing), SILENT, 1.0) * roughness
        self._nodes = thin_nodes(team, roughness)
        if not len(self._nodes.x):
            raise ValueError("keep-out zones and their margins leave nothing of the area to map")
        self._scale = max(team.belief.correlation_length_m, self._spacing)
        turns = Turns(self._options.turn_radius_m, CORNER_LOSS * constraints.max_step_m if team.left_m is None else 0.0)
        self._noise = noise_part(team.belief, distance, self._scale) * len(self._nodes.x)
        self._objective = SurveyObjective(self._scale, POWER, turns, REACH * self._spacing)
        self._vehicles = Vehicles(self._en, np.ascontiguousarray(team.headings_rad, dtype=np.float64), self._left_m)
        self._d2 = np.asarray(tree.query(self._nodes.en_m)[0]) ** 2
        self._sounded = self._nodes.sounded(self._d2)
        self._reference = float(len(self._nodes.x))

    def prior(self, team: Situation) -> tuple[FloatArray, float]:
        """The final map counts fully, what is gained at once a little."""
        return np.array([1.0, 0.02]), 10.0

    def trusted(self, theta: FloatArray) -> FloatArray:
        """Gain at once may bend the plan, never replace it."""
        final = max(float(theta[0]), 0.1)
        return np.array([final, float(np.clip(theta[1], 0.0, 0.1 * final))])

    def candidates(self, alpha: float) -> FloatArray:
        """The next legs of the plan; when it was just renewed also, per vehicle, others as described above."""
        team, n = self._team, len(self._en)
        along = self._first_legs(self._followed)
        targets = [along]
        if team.constraints.keep_out:
            # The corner that a leg cuts may be that of a zone: then it is flown out.
            targets.append(self._first_legs(self._followed, cut=0.0))
        if not self._replans:
            return self._at_cruise(team, self._bottom, np.array(targets))
        legs = [self._legs_of(i, alpha) for i in range(n)]
        for i, name in enumerate(team.vehicles):
            if self._coarse[name] > 0 or not team.moves[i]:
                continue  # before the first pass is over too little is known to be worth a detour
            for leg in legs[i]:
                target = along.copy()
                target[i] = leg
                targets.append(target)
        return self._at_cruise(team, self._bottom, np.array(targets))

    def regressors(self, candidates: FloatArray) -> FloatArray:
        """Return phi of each candidate, (c, 2): the final map's improvement, and the uncertainty its legs remove."""
        if not self._looks:
            return np.tile(self._row, (len(candidates), 1))
        values = self._after_legs(candidates)
        now = self._uncertainty_now()
        kept = self._expected_value
        off_plan = ~self._on_plan(candidates).all(axis=1)
        final = values[:, 1] + LEAVE_PLAN * kept * off_plan
        phi = np.column_stack([kept - final, now - values[:, 0]]) / self._reference
        self._asked = candidates, phi
        return phi

    def chosen(self, positions: FloatArray) -> None:
        """Drop the via points that the legs reach."""
        if self._looks:
            candidates, phi = self._asked
            self._row = phi[int(np.argmin(np.abs(candidates - positions).sum(axis=(1, 2))))].tolist()
        for i, name in enumerate(self._team.vehicles):
            if not self._team.moves[i]:
                continue
            self._flown_m += float(np.hypot(*(positions[i, :2] - self._en[i])))
            self._silent = np.vstack([self._silent, 0.5 * (self._en[i] + positions[i, :2]), positions[i, :2]])
            coarse, taken = self._coarse[name], [np.zeros((0, 2)), np.zeros((0, 2))]
            for which, routes in enumerate((self._plan, self._backbone)):
                for cut in (CORNER_TOLERANCE, 0.0):
                    first = vertices_passed(self._en[i], positions[i, :2], routes[name], self._steps_m[i], cut)
                    if first is not None:
                        routes[name], taken[which] = routes[name][first:], routes[name][:first]
                        if routes is self._plan:
                            self._coarse[name] = max(0, self._coarse[name] - first)
                        break
            leg = GivenLeg(self._en[i].copy(), positions[i, :2].copy(), taken[0], taken[1], coarse, self._free)
            self._given[name] = [*self._given.get(name, []), leg][-MOST_GIVEN:]

    def take_back(self, legs: Mapping[str, int]) -> bool:
        """See :meth:`app.exploration.planner.base.PlannerBase.take_back`."""
        if any(count > len(self._given.get(name, [])) for name, count in legs.items()):
            return False
        for name, count in legs.items():
            for _ in range(count):
                leg = self._given[name].pop()
                for routes, taken, followed in (
                    (self._plan, leg.plan, leg.free),
                    (self._backbone, leg.backbone, not leg.free),
                ):
                    if followed and not len(taken) and len(routes[name]):
                        taken = _unless_straight(leg.start_m, leg.end_m, routes[name][0])
                    routes[name] = np.vstack([taken, routes[name]])
                    if routes is self._plan:
                        self._coarse[name] = leg.coarse + len(taken) - len(leg.plan) if leg.coarse else 0
                self._flown_m -= float(np.hypot(*(leg.end_m - leg.start_m)))
                unflown = np.array([leg.end_m, 0.5 * (leg.start_m + leg.end_m)])
                same = np.abs(self._silent[:, None] - unflown).sum(axis=2).min(axis=1, initial=np.inf) < 1e-6
                self._silent = self._silent[~same]
        self._planned_m = min(self._planned_m, self._flown_m)
        return True

    def put_back(self, vehicle: str, ends_m: FloatArray, resume_at_m: FloatArray | None) -> None:
        """See :meth:`app.exploration.planner.base.PlannerBase.put_back`."""
        if not self._plan:
            return
        # Its rest may be handed on already: then this is, too.
        for routes in (self._plan, self._backbone):
            routes.setdefault(vehicle, np.zeros((0, 2)))
        given = self._given.get(vehicle, [])
        last = np.array([leg.end_m for leg in given[-len(ends_m) :]]).reshape(-1, 2)
        known = len(ends_m) > 0 and last.shape == ends_m.shape and bool(np.allclose(last, ends_m, atol=SAME_M))
        if not (known and self.take_back({vehicle: len(ends_m)})):
            self._begin_with(vehicle, ends_m.reshape(-1, 2))
        if resume_at_m is not None:
            self._begin_with(vehicle, resume_at_m[None])
        if not known or resume_at_m is not None:
            # What came before was flown elsewhere: it cannot be taken back any more.
            self._given[vehicle] = []

    def _begin_with(self, vehicle: str, vias: FloatArray) -> None:
        for routes in (self._plan, self._backbone):
            routes[vehicle] = np.vstack([vias, routes[vehicle]])
        if self._coarse.get(vehicle, 0):
            self._coarse[vehicle] += len(vias)

    def skip_line(self, vehicle: str, begin_m: FloatArray, here_m: FloatArray) -> bool:
        """See :meth:`app.exploration.planner.base.PlannerBase.skip_line`."""
        route = self.ways_ahead_m().get(vehicle, np.zeros((0, 2)))
        rest = after_line(begin_m, here_m, route)
        return rest is not None and self.leave_out(vehicle, len(route) - len(rest), here_m)

    def leave_out(self, vehicle: str, count: int, here_m: FloatArray) -> bool:
        """See :meth:`app.exploration.planner.base.PlannerBase.leave_out`."""
        followed, other = (self._plan, self._backbone) if self._free else (self._backbone, self._plan)
        if vehicle not in followed or vehicle not in other:
            return False
        skipped, followed[vehicle] = np.split(followed[vehicle], [count])
        beside = other[vehicle]
        while len(beside) and np.hypot(*(skipped - beside[0]).T).min(initial=np.inf) <= SAME_M:
            beside = beside[1:]
        other[vehicle] = beside
        self._coarse[vehicle] = max(0, self._coarse.get(vehicle, 0) - len(skipped))
        # A plan that is made anew would go there first: nobody knows what is there.
        way = np.vstack([here_m, skipped])
        parts = [np.linspace(a, b, 1 + int(np.hypot(*(b - a)) / SKIPPED_M)) for a, b in pairwise(way)]
        self._silent = np.vstack([self._silent, *parts, way])
        return True

    def ways_ahead_m(self) -> dict[str, FloatArray]:
        """See :meth:`app.exploration.planner.base.PlannerBase.ways_ahead_m`."""
        return dict(self._plan if self._free else self._backbone)

    def remember(self) -> dict[str, Any]:
        """Return the memory."""
        return {
            "backbone": self._backbone,
            "coarse": self._coarse,
            "plan": self._plan,
            "expected": self._expected,
            "flown_m": self._flown_m,
            "planned_m": self._planned_m,
            "silent": self._silent,
            "adapts": self._adapts,
            "free": self._free,
            "row": self._row,
            "given": {name: [list(leg) for leg in legs] for name, legs in self._given.items()},
        }

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self._backbone, self._plan = (
            {str(k): np.array(v, dtype=np.float64).reshape(-1, 2) for k, v in state[key].items()}
            for key in ("backbone", "plan")
        )
        self._coarse = {str(k): int(v) for k, v in state["coarse"].items()}
        self._expected = state["expected"]
        self._flown_m, self._planned_m = (float(state.get(key, 0.0)) for key in ("flown_m", "planned_m"))
        self._silent = np.array(state.get("silent", []), dtype=np.float64).reshape(-1, 2)
        self._adapts, self._free = bool(state.get("adapts", True)), bool(state["free"])
        self._row = [float(x) for x in state["row"]]
        self._given = {
            str(name): [
                GivenLeg(
                    np.array(start, dtype=np.float64),
                    np.array(end, dtype=np.float64),
                    np.array(plan, dtype=np.float64).reshape(-1, 2),
                    np.array(backbone, dtype=np.float64).reshape(-1, 2),
                    int(coarse),
                    bool(free),
                )
                for start, end, plan, backbone, coarse, free in legs
            ]
            for name, legs in state.get("given", {}).items()
        }

    def _adopt_backbone(self) -> None:
        """Give every vehicle of the team its share of the backbone."""
        team = self._team
        shares = backbone(team.constraints, self._vehicles, self._nodes, self._objective)
        self._backbone = {name: share.stops for name, share in zip(team.vehicles, shares, strict=True)}
        self._coarse = {name: share.coarse for name, share in zip(team.vehicles, shares, strict=True)}
        self._plan = dict(self._backbone)
        self._given = {}
        known = np.isfinite(team.belief.depth_m) & np.isfinite(team.belief.sd_m)
        self._adapts = any(share.coarse > 0 for share in shares) or float(known.mean()) > KNOWN
        self._free, self._planned_m = False, self._flown_m

    def _leave_out_cut_off(self) -> None:
        """Leave out of both plans what comes next and no way leads to: a team's rest is handed over anywhere."""
        team = self._team
        for i, name in enumerate(team.vehicles if team.constraints.keep_out else ()):
            for routes in (self._plan, self._backbone):
                while (
                    team.moves[i]
                    and len(route := routes.get(name, np.zeros((0, 2))))
                    and is_cut_off(team.constraints, MARGIN_M, self._en[i], route[0])
                ):
                    routes[name] = route[1:]
                    if routes is self._plan:
                        self._coarse[name] = max(0, self._coarse.get(name, 0) - 1)

    def _hand_over(self) -> None:
        """Give both plans to a team that has changed."""
        team = self._team
        self._backbone = hand_over(self._backbone, team.vehicles, self._en)
        self._plan = hand_over(self._plan, team.vehicles, self._en)
        self._coarse = dict.fromkeys(team.vehicles, 0)
        self._given = {}

    def _improve_plan(
        self, plan: tuple[FloatArray, IntArray], lattice: tuple[FloatArray, IntArray], values: tuple[float, float]
    ) -> tuple[tuple[FloatArray, IntArray], tuple[float, float]]:
        """Improve the freer plan, then decide which of the two to follow; return it and the value of both.

        It is left as it is where it could not be followed: nothing is known, or nodes lie too far apart to judge it.
        """
        team = self._team
        self._planned_m = self._flown_m
        knows = bool((np.isfinite(team.belief.depth_m) & np.isfinite(team.belief.sd_m)).any())
        if not (knows and _cell(self._nodes.en_m) <= COARSE * self._spacing):
            self._free = False
            return plan, values
        coarse = np.array([self._coarse[v] for v in team.vehicles], dtype=np.int64)
        best: tuple[float, FloatArray, IntArray] | None = None
        for which, begin in enumerate((plan, lattice)):
            vias, counts, value = self._improved(*begin, np.minimum(coarse, begin[1]), which)
            if best is None or value < best[0]:
                best = value, vias, counts
        assert best is not None  # noqa: S101 - two beginnings
        value, vias, counts = best
        self._plan = {v: vias[i, : counts[i]].copy() for i, v in enumerate(team.vehicles)}
        leave = 1.0 if self._free else LEAVE_BACKBONE if self._adapts else LEAVE_LINES
        self._free = value + self._noise < leave * (values[1] + self._noise)
        return (vias, counts), (value, values[1])

    def _runs_out(self) -> bool:
        """Whether a vehicle that gets a leg has flown all that was planned for it, and may fly on."""
        routes = self._plan if self._free else self._backbone
        none = np.zeros((0, 2))
        able = self._team.moves & (self._left_m > LEAST_EXTRA * self._team.constraints.max_step_m)
        return any(goes and not len(routes.get(v, none)) for v, goes in zip(self._team.vehicles, able, strict=True))

    def _extended(
        self, lattice: tuple[FloatArray, IntArray], value: float
    ) -> tuple[tuple[FloatArray, IntArray], float]:
        """Let vehicles that have flown all their lines use what way they have left where it promises most.

        Returns the lattice with that, and its value; the lines of the others stay as they are.
        """
        before = lattice[1]
        through = (before == 0) & self._team.moves
        if not through.any():
            return lattice, value
        vias, counts, _ = self._improved(*lattice, before, 2)
        counts = np.where(through, counts, before)
        extended = self._value(vias, counts)
        if not extended < value * (1 - 1e-9):
            return lattice, value
        for i, name in enumerate(self._team.vehicles):
            if through[i]:
                self._backbone[name] = vias[i, : counts[i]].copy()
        return (vias, counts), extended

    def _improved(
        self, vias: FloatArray, counts: IntArray, locked: IntArray, which: int
    ) -> tuple[FloatArray, IntArray, float]:
        constraints = self._team.constraints
        rng = np.random.default_rng([self._seed, 1, which])
        roomy = np.zeros((len(vias), vias.shape[1] + 32, 2))
        roomy[:, : vias.shape[1]] = vias
        search = PlanSearch(self._spacing, constraints.region, MARGIN_M, HEAT)
        return improve(
            self._d2, self._sounded, self._objective, self._vehicles, ViaPoints(roomy, counts, locked), search,
            rng.random((self._options.search, DRAWS)),
        )  # fmt: skip

    def _value(self, vias: FloatArray, counts: IntArray) -> float:
        return plan_value(self._d2, self._sounded, self._objective, self._vehicles, vias, counts)

    def _uncertainty_now(self) -> float:
        nothing = np.zeros(len(self._en), dtype=np.int64)
        return self._value(np.zeros((len(self._en), 1, 2)), nothing)

    def _packed(self, routes: dict[str, FloatArray]) -> tuple[FloatArray, IntArray]:
        return packed([routes[v] for v in self._team.vehicles])

    def _first_legs(self, plan: tuple[FloatArray, IntArray], cut: float = CORNER_TOLERANCE) -> FloatArray:
        vias, counts = plan
        legs = [
            next_waypoint(self._en[i, 0], self._en[i, 1], vias[i], 0, int(counts[i]), self._steps_m[i], cut)[:2]
            if moves
            else self._en[i]
            for i, moves in enumerate(self._team.moves)
        ]
        return np.array(legs)

    def _on_plan(self, candidates: FloatArray) -> BoolArray:
        """Return which vehicles' legs are those of the plan that is followed, (c, n_vehicles)."""
        on_plan = np.zeros(candidates.shape[:2], dtype=np.bool_)
        for cut in (CORNER_TOLERANCE, 0.0):
            on_plan |= follows(self._en, candidates[..., :2], self._first_legs(self._followed, cut))
        return on_plan

    def _legs_of(self, i: int, alpha: float) -> FloatArray:
        """Return the free candidates (k, 2) of one vehicle."""
        rng = vehicle_rng(self._seed, self._team.vehicles[i])
        here, step = self._en[i], self._steps_m[i]
        heading = self._team.headings_rad[i]
        course = np.pi / 2 - (heading if np.isfinite(heading) else rng.uniform(0, 2 * np.pi))
        turns = here + step * np.column_stack([np.cos(course + TURNS_RAD), np.sin(course + TURNS_RAD)])
        away = np.hypot(*(self._nodes.en_m - here).T)
        gain = (
            self._nodes.weight * np.minimum(1.0, self._d2 / self._scale**2) * (away <= 2 * step) * (away > 0.3 * step)
        )
        best = np.argsort(-gain, kind="stable")[:: max(1, len(gain) // 400)][:8]
        way = self._nodes.en_m[best] - here
        towards = here + way * np.minimum(1.0, step / np.maximum(away[best], 1e-9))[:, None]
        n = max(0, self._options.candidates - len(turns) - len(towards))
        random = alpha * step * rng.standard_normal((n, 2))
        random *= np.minimum(1.0, step / np.maximum(np.hypot(*random.T), 1e-12))[:, None]
        legs = np.vstack([turns, towards, here + random])
        if not np.isfinite(heading):
            return legs
        # Behind it lies what it is still to fly, and will sound then.
        east, north = (legs - here).T
        turned = np.abs((np.arctan2(east, north) - heading + np.pi) % (2.0 * np.pi) - np.pi)
        return np.asarray(legs[turned <= TURNS_RAD.max() + 1e-9])

    def _after_legs(self, candidates: FloatArray) -> FloatArray:
        """Return U after the first legs and at the end, when the team goes on with the plan it follows, (c, 2)."""
        c, n = candidates.shape[:2]
        plan_vias, plan_counts = self._followed
        vias, counts = np.zeros((c, n, plan_vias.shape[1], 2)), np.zeros((c, n), dtype=np.int64)
        on_plan = self._on_plan(candidates)
        for i in range(n):
            route = plan_vias[i, : plan_counts[i]]
            passed = 0
            if self._team.moves[i]:
                *_, passed = next_waypoint(
                    self._en[i, 0], self._en[i, 1], route, 0, len(route), self._steps_m[i], CORNER_TOLERANCE
                )
            for which, rest in ((on_plan[:, i], route[passed:]), (~on_plan[:, i], route)):
                vias[which, i, : len(rest)] = rest
                counts[which, i] = len(rest)
        targets = np.ascontiguousarray(candidates[..., :2])
        return values_after_first_leg(self._d2, self._sounded, self._objective, self._vehicles, targets, vias, counts)


def _unless_straight(start_m: FloatArray, via_m: FloatArray, next_m: FloatArray) -> FloatArray:
    """Return a via point as a route (1, 2), or none where it lies straight between the others (2,)."""
    before, after = via_m - start_m, next_m - via_m
    cross = abs(float(before[0] * after[1] - before[1] * after[0]))
    straight = cross <= 1e-6 * (1.0 + float(np.hypot(*before) * np.hypot(*after))) and float(before @ after) >= 0.0
    return np.zeros((0, 2)) if straight else via_m[None]


def thin_nodes(team: Situation, variability: FloatArray) -> UncertaintyNodes:
    """Return at most about ``MAX_NODES`` nodes of the area; nodes of one square are merged, their weights averaged.

    They are moved about a little: on a regular grid a plan would gain by lying on its lines.
    """
    belief: Belief = team.belief
    inside = inside_area(team.constraints, belief.xy_m)
    xy, weight = belief.xy_m[inside], variability[inside]
    if len(xy) > MAX_NODES:
        low, size = xy.min(axis=0), np.ptp(xy, axis=0)
        side = float(np.sqrt(max(size[0], 1e-9) * max(size[1], 1e-9) / MAX_NODES))
        bins = np.floor((xy - low) / side + 1e-9).astype(np.int64)
        _, which = np.unique(bins[:, 0] * 1_000_003 + bins[:, 1], return_inverse=True)
        count = np.bincount(which)
        xy = np.column_stack([np.bincount(which, xy[:, k]) / count for k in (0, 1)])
        weight = np.bincount(which, weight) / count
    if len(xy) > 1:
        k = np.arange(len(xy))[:, None]
        xy = xy + JITTER * _cell(xy) * ((k * np.array([0.7548776662, 0.5698402910])) % 1.0 - 0.5)
    return make_nodes(xy, weight)


def _free_area(constraints: Constraints) -> float:
    zones = unary_union([Polygon(zone) for zone in constraints.keep_out])
    return max(1.0, float(Polygon(constraints.area).difference(zones).area))


def _cell(xy: FloatArray) -> float:
    size = np.ptp(xy, axis=0)
    return float(np.sqrt(max(size[0], 1e-9) * max(size[1], 1e-9) / len(xy)))
