"""The usual practice: evenly spaced parallel lines, an equal share of the area per vehicle."""

import itertools
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from shapely import LineString, Polygon

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Proposal, Situation
from app.exploration.core.routes import CORNER_TOLERANCE, FreeSpace, metres_left, next_waypoint, vertices_passed
from app.exploration.lines.flown_lines import after_line
from app.exploration.lines.handover import hand_over
from app.exploration.lines.lattice import Sweep, boustrophedon, flown_length, longer_axis_rad, route_length
from app.exploration.planner.base import PlannerBase, settle

BORDER_MARGIN_M = 0.5
LEAST_BUDGET_M = 1.0
"""Also who can fly no farther has a strip, a very narrow one."""


def lawnmower_routes(
    constraints: Constraints, starts: FloatArray, budgets_m: FloatArray, turn_radius_m: float = 0.0
) -> list[FloatArray]:
    """Return each vehicle's route (k, 2): lines along the longer axis, as many as fit into the distance it can travel.

    Parameters
    ----------
    constraints : Constraints
        Give the area and its keep-out zones.
    starts : (n_vehicles, 2)
        Where the vehicles are; they take the strips in the order in which they stand across the lines.
    budgets_m : (n_vehicles,)
        Distances that the vehicles can travel; their strips are in proportion to them.
    turn_radius_m
        Of the circles in which they turn, which takes some of those distances.
    """
    sweep = Sweep(constraints, FreeSpace(constraints, BORDER_MARGIN_M), longer_axis_rad(constraints.area))
    order = np.argsort(sweep.to_uv(starts)[:, 0], kind="stable")
    cuts = sweep.shares(np.maximum(budgets_m[order], LEAST_BUDGET_M))
    routes: list[FloatArray] = [np.zeros((0, 2))] * len(starts)
    for strip, i in enumerate(order):
        low, high = float(cuts[strip]), float(cuts[strip + 1])
        routes[i] = boustrophedon(sweep, starts[i], low, high, float(budgets_m[i]), turn_radius_m=turn_radius_m)
    return routes


def route_across(
    constraints: Constraints, en_m: FloatArray, vehicle: int, passes: int, budget_m: float, turn_radius_m: float = 0.0
) -> FloatArray | None:
    """Return the next lines (k, 2) of a vehicle that has flown its own and can go on; None where it cannot.

    Parameters
    ----------
    en_m : (n_vehicles, 2)
        Where the team is: it has strips of equal shares, in that order.
    passes
        How often it got such lines: they lie across its strip and along it in turn. The first ones must pay: it has to
        be able to fly farther than a line of the area is long.
    budget_m
        How far it can fly.
    turn_radius_m
        Of the circles in which it turns.
    """
    sweep = Sweep(constraints, FreeSpace(constraints, BORDER_MARGIN_M), longer_axis_rad(constraints.area))
    uv, area_uv = sweep.to_uv(en_m), sweep.to_uv(constraints.area)
    if passes == 0 and budget_m <= float(np.ptp(area_uv[:, 1])):
        return None
    strip = int(np.flatnonzero(np.argsort(uv[:, 0], kind="stable") == vehicle)[0])
    low, high = sweep.shares(np.ones(len(en_m)))[strip : strip + 2].tolist()
    across = replace(sweep, direction_rad=sweep.direction_rad + np.pi / 2, within=(-high, -low))
    ways = [
        (across, float(area_uv[:, 1].min()), float(area_uv[:, 1].max())),
        (sweep, low, high),
    ]
    for of, begin, end in ways if passes % 2 == 0 else ways[::-1]:
        route = boustrophedon(of, en_m[vehicle], begin, end, budget_m, turn_radius_m=turn_radius_m)
        if len(route) and flown_length(en_m[vehicle], route, turn_radius_m) <= budget_m:
            return route
    return None


class LawnmowerPlanner(PlannerBase):
    """Follows the lines; a vehicle that leaves hands on its rest, one that joins takes half of the longest rest.

    A vehicle that can still fly when it has flown its lines, as one whose battery lasts longer than was sure at first,
    gets more of them, across its strip.
    """

    name: ClassVar[str] = "lawnmower"
    plans_for_all = True
    flies_lines = True
    decides_apart = True

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._routes: dict[str, FloatArray] = {}
        self._passes: dict[str, int] = {}
        """How often vehicles got more lines."""

    def put_back(self, vehicle: str, ends_m: FloatArray, resume_at_m: FloatArray | None) -> None:
        """See :meth:`app.exploration.planner.base.PlannerBase.put_back`."""
        if vehicle in self._routes:
            begin = np.zeros((0, 2)) if resume_at_m is None else resume_at_m[None]
            self._routes[vehicle] = np.vstack([begin, ends_m.reshape(-1, 2), self._routes[vehicle]])

    def skip_line(self, vehicle: str, begin_m: FloatArray, here_m: FloatArray) -> bool:
        """See :meth:`app.exploration.planner.base.PlannerBase.skip_line`."""
        rest = after_line(begin_m, here_m, self._routes.get(vehicle, np.zeros((0, 2))))
        if rest is None:
            return False
        self._routes[vehicle] = rest
        return True

    def ways_ahead_m(self) -> dict[str, FloatArray]:
        """See :meth:`app.exploration.planner.base.PlannerBase.ways_ahead_m`."""
        return dict(self._routes)

    def _remember(self) -> dict[str, Any]:
        return {"routes": self._routes, "passes": self._passes}

    def _recall(self, state: dict[str, Any]) -> None:
        self._routes = {k: np.array(v, dtype=np.float64).reshape(-1, 2) for k, v in state["routes"].items()}
        self._passes = {k: int(count) for k, count in state.get("passes", {}).items()}

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        self._adopt(team)
        done = self._go_on(team)
        self._lead_round(team)
        steps = np.minimum(team.constraints.max_step_m, metres_left(team)) * (1 - 1e-9)
        # The corner that a leg cuts may be that of a zone, or an inward one of the area: then it is flown out.
        tolerances = (CORNER_TOLERANCE, 0.0) if team.constraints.keep_out else (CORNER_TOLERANCE,)
        cuts = [[cut] * len(team.vehicles) for cut in tolerances]
        targets = np.empty((len(cuts), len(team.vehicles), 2))
        area = Polygon(team.constraints.area)
        for k, i in itertools.product(range(len(cuts)), range(len(team.vehicles))):
            route = self._routes[team.vehicles[i]][: None if team.moves[i] else 0]
            x, y = team.positions[i, :2]
            targets[k, i] = next_waypoint(x, y, route, 0, len(route), steps[i], cuts[k][i])[:2]
            if not area.covers(LineString([team.positions[i, :2], targets[k, i]])):
                cuts[k][i] = 0.0
                targets[k, i] = next_waypoint(x, y, route, 0, len(route), steps[i], 0.0)[:2]
        positions, which = settle(team, bottom, self._at_cruise(team, bottom, targets))
        for i, name in enumerate(team.vehicles):
            route, end_m = self._routes[name], positions[i, :2]
            passed = 0
            if team.moves[i]:
                passed = vertices_passed(team.positions[i, :2], end_m, route, steps[i], cuts[which][i]) or 0
            self._routes[name] = route[passed:]
        left_m = float(sum(self._left(team, i) for i in range(len(positions))))
        return Proposal(positions, 0.0, {"left_m": left_m}, done=done)

    def _turn_radius_m(self, team: Situation) -> float:
        counted = team.left_m is not None and team.turns_take_way
        return self.options.turn_radius_m if counted else 0.0

    def _left(self, team: Situation, i: int) -> float:
        return route_length(team.positions[i, :2], self._routes[team.vehicles[i]])

    def _go_on(self, team: Situation) -> frozenset[str]:
        """Give those that have flown their lines more of them; returns those that can fly no others."""
        en, left_m, done = team.positions[:, :2], metres_left(team), set()
        for i, name in enumerate(team.vehicles):
            if not team.moves[i] or self._left(team, i) > 0.0:
                continue
            passes = self._passes.get(name, 0)
            route = route_across(team.constraints, en, i, passes, float(left_m[i]), self._turn_radius_m(team))
            if route is not None:
                self._routes[name], self._passes[name] = route, passes + 1
            else:
                done.add(name)
        return frozenset(done)

    def _lead_round(self, team: Situation) -> None:
        """Lead vehicles round zones between them and their next stop: routes that are handed over begin anywhere."""
        zones = [Polygon(zone) for zone in team.constraints.keep_out]
        for i, name in enumerate(team.vehicles):
            here, route = team.positions[i, :2], self._routes[name]
            if not team.moves[i] or not len(route):
                continue
            leg = LineString([here, route[0]])
            if any(zone.intersects(leg) for zone in zones):
                free = FreeSpace(team.constraints, BORDER_MARGIN_M)
                self._routes[name] = np.vstack([free.way(here, route[0]), route[1:]])

    def _adopt(self, team: Situation) -> None:
        """Give every vehicle of the team a route."""
        en = team.positions[:, :2]
        if not self._routes.keys() & set(team.vehicles):
            routes = lawnmower_routes(team.constraints, en, metres_left(team), self._turn_radius_m(team))
            self._routes = dict(zip(team.vehicles, routes, strict=True))
            return
        self._routes = hand_over(self._routes, team.vehicles, en)
