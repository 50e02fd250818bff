"""Even parallel lines: a strip for each vehicle, as usual practice has it, or shared out over the whole area.

As close as the vehicles' budgets allow, or at the distance that is asked for. Or the lines of a plan that is given.
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from shapely import LineString, Polygon

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.problem import Proposal, Situation
from app.exploration.core.routes import CORNER_TOLERANCE, Turns, Vehicles, metres_left, next_waypoint, vertices_passed
from app.exploration.lines.even_survey import Pattern, fullest_surveys
from app.exploration.lines.flown_lines import after_line
from app.exploration.lines.given_lines import GivenLine, LinePlan, given_survey
from app.exploration.lines.ground import Ground
from app.exploration.lines.handover import halves, hand_over
from app.exploration.lines.lattice import Sweep, boustrophedon, direction_of_lines_rad, flown_length, route_length
from app.exploration.lines.parts import is_cut_off, parts_of
from app.exploration.lines.spaced_lines import spaced_lines, with_crosslines
from app.exploration.planner.base import PlannerBase, settle

BORDER_MARGIN_M = 0.5
SHARED = Pattern(parts=8)
"""How lines lie that a team shares out."""
ACROSS = 0.9
"""Lines lie across the longer axis where the ground is closer to them by this factor, squared and on average."""
LEAST_SHARED = 4
"""A vehicle hands lines over only while it has so many ends of lines left, those of two lines."""
SOONER = 0.8
"""A vehicle takes lines over only where it flies them within this part of the time that their vehicle still needs."""
LEAST_LEG_M = 5.0
"""Who can fly no farther is done."""
CORNER_LOSS = 0.4
"""Part of a step that a corner costs where steps are counted: the leg to it ends early."""
LEAST_BUDGET_M = 1.0
"""Also who can fly no farther has a strip, a very narrow one."""


def lawnmower_routes(
    constraints: Constraints,
    starts: FloatArray,
    budgets_m: FloatArray,
    turn_radius_m: float = 0.0,
    heading_deg: float | None = None,
) -> list[FloatArray]:
    """Return each vehicle's route (k, 2): lines along the longer axis, as many as fit into the distance it can travel.

    This is the usual practice that surveys are compared with.

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
    heading_deg
        Of the lines, clockwise from north; None: along the longer axis.
    """
    direction_rad = direction_of_lines_rad(constraints.area, heading_deg)
    sweep = Sweep(constraints, FreeSpace(constraints, BORDER_MARGIN_M), direction_rad)
    order = np.argsort(sweep.to_uv(starts)[:, 0], kind="stable")
    cuts = sweep.shares(np.maximum(budgets_m[order], LEAST_BUDGET_M))
    routes: list[FloatArray] = [np.zeros((0, 2))] * len(starts)
    for strip, i in enumerate(order):
        low, high = float(cuts[strip]), float(cuts[strip + 1])
        routes[i] = boustrophedon(sweep, starts[i], low, high, float(budgets_m[i]), turn_radius_m=turn_radius_m)
    return routes


def shared_lines(
    constraints: Constraints,
    starts: FloatArray,
    budgets_m: FloatArray,
    radii_m: FloatArray,
    corner_m: float = 0.0,
    heading_deg: float | None = None,
) -> list[FloatArray]:
    """Return each vehicle's route (k, 2): neighbouring ones of the most even lines that the team can fly together.

    Lines lie along the longer axis, or across it where that brings the ground clearly nearer; vehicles may share one.
    A team that cannot fly even one line begins those of :func:`lawnmower_routes`. Where keep-out zones cut the area
    into parts between which no way leads, the vehicles in each part share the lines of that part.

    Parameters
    ----------
    constraints : Constraints
        Give the area and its keep-out zones.
    starts : (n_vehicles, 2)
        Where the vehicles are.
    budgets_m : (n_vehicles,)
        Distances that the vehicles can travel, nearly all of which they do.
    radii_m : (n_vehicles,)
        Of the circles in which each turns, which takes some of those distances.
    corner_m
        What a corner takes of them besides.
    heading_deg
        The course of all lines, clockwise from north, where that is asked for.
    """
    turns = [Turns(float(radius_m), corner_m) for radius_m in radii_m]
    routes: list[FloatArray] = [np.zeros((0, 2))] * len(starts)
    for part, members in parts_of(constraints, FreeSpace(constraints, BORDER_MARGIN_M), starts):
        own = _lines_of_one(part, starts[members], budgets_m[members], [turns[i] for i in members], heading_deg)
        for i, route in zip(members, own, strict=True):
            routes[i] = route
    return routes


def _lines_of_one(
    constraints: Constraints, starts: FloatArray, budgets_m: FloatArray, turns: list[Turns], heading_deg: float | None
) -> list[FloatArray]:
    """Return :func:`shared_lines` of an area in one part."""
    free, axis = FreeSpace(constraints, BORDER_MARGIN_M), direction_of_lines_rad(constraints.area, heading_deg)
    vehicles = Vehicles(np.ascontiguousarray(starts), np.full(len(starts), np.nan), np.asarray(budgets_m, dtype=float))
    ground = Ground.of(constraints)
    directions = [(axis, 1.0), (axis + np.pi / 2, 1.0 / ACROSS)] if heading_deg is None else [(axis, 1.0)]
    best: tuple[float, list[FloatArray]] | None = None
    for direction, counts in directions:
        for survey in fullest_surveys(Sweep(constraints, free, direction), vehicles, turns, SHARED):
            ways = [np.vstack([start, route]) for start, route in zip(starts, survey.routes, strict=True)]
            left_m2 = counts * float((ground.away_m(ways) ** 2).sum())
            if best is None or left_m2 < best[0] * (1.0 - 1e-9):
                best = left_m2, survey.routes
    widest_m = max(turn.radius_m for turn in turns)
    return lawnmower_routes(constraints, starts, budgets_m, widest_m, heading_deg) if best is None else best[1]


def route_across(
    constraints: Constraints,
    en_m: FloatArray,
    vehicle: int,
    passes: int,
    budget_m: float,
    turn_radius_m: float = 0.0,
    heading_deg: float | None = None,
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
    heading_deg
        The course of the lines that it has flown, clockwise from north; None: along the longer axis.
    """
    direction_rad = direction_of_lines_rad(constraints.area, heading_deg)
    sweep = Sweep(constraints, FreeSpace(constraints, BORDER_MARGIN_M), direction_rad)
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
    gets more of them, across its strip; what is left then is flown as straight legs over ground that lines left out.
    Where the distance of lines is asked for, or lines are given, it takes half of the longest rest instead, and is done
    when none is left.
    """

    name: ClassVar[str] = "lawnmower"
    own_options: ClassVar[frozenset[str]] = frozenset({"line_spacing_m", "line_heading_deg", "keep_line_order"})
    plans_for_all = True
    flies_lines = True
    decides_apart = True

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._routes: dict[str, FloatArray] = {}
        self._passes: dict[str, int] = {}
        """How often vehicles got more lines."""
        self._dealt: list[FloatArray] = []
        """All ways that vehicles got, (k, 2) each."""
        self._left_out_m = 0.0
        """Metres of lines that were asked for and nobody can reach."""
        self._given: LinePlan | None = None
        self._out_of_reach: list[FloatArray] = []
        """Parts of given lines that nobody can reach, (k, 2) each."""

    def take_lines(self, lines: Sequence[GivenLine]) -> None:
        """Fly these lines in place of own ones; before the first decision."""
        self._given = LinePlan(lines)

    @property
    def _asked_for(self) -> bool:
        """Whether lines were asked for, which are not as many as can be flown."""
        return self._given is not None or self.options.line_spacing_m is not None

    @property
    def _both_ways(self) -> bool:
        """Whether lines may be flown from their ends, and in the opposite order."""
        return self._given is None or (self._given.both_ways and not self.options.keep_line_order)

    def put_back(self, vehicle: str, ends_m: FloatArray, resume_at_m: FloatArray | None) -> None:
        """See :meth:`app.exploration.planner.base.PlannerBase.put_back`."""
        if self._routes:
            begin = np.zeros((0, 2)) if resume_at_m is None else resume_at_m[None]
            # Its rest may be handed on already: then this is, too.
            rest = self._routes.get(vehicle, np.zeros((0, 2)))
            self._routes[vehicle] = np.vstack([begin, ends_m.reshape(-1, 2), rest])

    def skip_line(self, vehicle: str, begin_m: FloatArray, here_m: FloatArray) -> bool:
        """See :meth:`app.exploration.planner.base.PlannerBase.skip_line`."""
        route = self._routes.get(vehicle, np.zeros((0, 2)))
        after = after_line if self._given is None else self._given.after_line
        rest = after(begin_m, here_m, route)
        if rest is None:
            return False
        self._routes[vehicle] = rest
        return True

    def leave_out(self, vehicle: str, count: int, here_m: FloatArray) -> bool:
        """See :meth:`app.exploration.planner.base.PlannerBase.leave_out`."""
        if vehicle not in self._routes:
            return False
        self._routes[vehicle] = self._routes[vehicle][count:]
        return True

    def ways_ahead_m(self) -> dict[str, FloatArray]:
        """See :meth:`app.exploration.planner.base.PlannerBase.ways_ahead_m`."""
        return dict(self._routes)

    def lines_left_m(self) -> float:
        """See :meth:`app.exploration.planner.base.PlannerBase.lines_left_m`."""
        if self._given is not None:
            return sum(self.lines_left().values())
        if self.options.line_spacing_m is None:
            return 0.0
        rests = (route_length(route[0], route) for route in self._routes.values() if len(route))
        return self._left_out_m + sum(rests)

    def lines_left(self) -> dict[str, float]:
        """See :meth:`app.exploration.planner.base.PlannerBase.lines_left`."""
        if self._given is None:
            return {}
        return self._given.metres_on([*self._out_of_reach, *self._routes.values()])

    @property
    def left_out(self) -> dict[str, float]:
        """By name, how much of given lines nobody can reach."""
        return {} if self._given is None else self._given.metres_on(self._out_of_reach)

    @property
    def left_out_m(self) -> float:
        """How long the lines are that were asked for and nobody can reach."""
        return self._left_out_m

    def _remember(self) -> dict[str, Any]:
        own: dict[str, Any] = {"routes": self._routes, "passes": self._passes, "dealt": self._dealt}
        if self._out_of_reach:
            own["out_of_reach"] = self._out_of_reach
        return own | ({"left_out_m": self._left_out_m} if self._left_out_m else {})

    def _recall(self, state: dict[str, Any]) -> None:
        self._routes = {k: np.array(v, dtype=np.float64).reshape(-1, 2) for k, v in state["routes"].items()}
        self._passes = {k: int(count) for k, count in state.get("passes", {}).items()}
        self._left_out_m = float(state.get("left_out_m", 0.0))
        self._out_of_reach = [np.array(way, dtype=np.float64).reshape(-1, 2) for way in state.get("out_of_reach", ())]
        dealt = state.get("dealt", list(state["routes"].values()))
        self._dealt = [np.array(way, dtype=np.float64).reshape(-1, 2) for way in dealt]

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        self._adopt(team)
        self._lead_round(team)
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

    def _lines_for(self, team: Situation, corner_m: float) -> list[FloatArray]:
        """Return each vehicle's route, (k, 2), over the lines asked for, or over lines as close as can be flown."""
        constraints, en, left_m = team.constraints, team.positions[:, :2], metres_left(team)
        radii_m, heading_deg = self._turn_radii_m(team), self.options.line_heading_deg
        spacing_m, vehicles = self.options.line_spacing_m, Vehicles(en, np.full(len(en), np.nan), left_m)
        direction_rad = direction_of_lines_rad(constraints.area, heading_deg)
        turns = [Turns(float(radius_m), corner_m) for radius_m in radii_m]
        if self._given is not None:
            in_order = self.options.keep_line_order
            survey = given_survey(constraints, BORDER_MARGIN_M, self._given, vehicles, turns, in_order=in_order)
            self._out_of_reach = survey.left_out
            self._left_out_m = sum(route_length(way[0], way) for way in survey.left_out)
            return survey.routes
        if spacing_m is None:
            return shared_lines(constraints, en, left_m, radii_m, corner_m, heading_deg)
        lines = spaced_lines(constraints, BORDER_MARGIN_M, direction_rad, spacing_m, vehicles, turns)
        self._left_out_m = lines.left_out_m
        if team.crosslines == 0.0:
            return lines.routes
        across_m = team.crosslines * FreeSpace(constraints, BORDER_MARGIN_M).region.area / spacing_m
        return with_crosslines(constraints, BORDER_MARGIN_M, direction_rad, across_m, vehicles, lines.routes)

    def _turn_radii_m(self, team: Situation) -> FloatArray:
        """Return the radius of each vehicle's circles, (n_vehicles,); 0 where turns take no way."""
        if team.left_m is None or not team.turns_take_way:
            return np.zeros(len(team.vehicles))
        if team.turn_radii_m is None:
            return np.full(len(team.vehicles), self.options.turn_radius_m)
        return team.turn_radii_m

    def _left(self, team: Situation, i: int) -> float:
        return route_length(team.positions[i, :2], self._routes[team.vehicles[i]])

    def _go_on(self, team: Situation) -> frozenset[str]:
        """Give those that have flown their lines more of them; returns those that can fly no others."""
        en, left_m, done = team.positions[:, :2], metres_left(team), set()
        radii_m = self._turn_radii_m(team).tolist()
        for i, name in enumerate(team.vehicles):
            if not team.moves[i] or self._left(team, i) > 0.0:
                continue
            if self._asked_for:
                if not self._help_out(team, i):
                    done.add(name)
                continue
            passes = self._passes.get(name, 0)
            heading_deg = self.options.line_heading_deg
            route = route_across(team.constraints, en, i, passes, float(left_m[i]), radii_m[i], heading_deg)
            if route is not None:
                self._passes[name] = passes + 1
            elif left_m[i] >= LEAST_LEG_M:
                route = self._over_gaps(team, i, float(left_m[i]))
            if route is not None:
                self._routes[name] = route
                self._dealt.append(np.vstack([en[i], route]))
            else:
                done.add(name)
        return frozenset(done)

    def _help_out(self, team: Situation, i: int) -> bool:
        """Let a vehicle that has flown its lines take some of another's, where all are done clearly sooner then."""
        en, name, left_m = team.positions[:, :2], team.vehicles[i], metres_left(team)
        needs = np.array([self._left(team, k) for k in range(len(en))]) / np.maximum(left_m, LEAST_BUDGET_M)
        other = int(np.argmax(needs))
        donor = team.vehicles[other]
        if len(self._routes[donor]) < LEAST_SHARED:
            return False
        kept, given = halves(self._routes[donor], en[i], both_ways=self._both_ways)
        if any(self._cut_off(team, i, stop) for stop in given):
            return False
        way_m = route_length(en[i], FreeSpace(team.constraints, BORDER_MARGIN_M).connect(en[i], given))
        if way_m >= min(left_m[i], SOONER * needs[other] * left_m[i]):
            return False
        self._routes[donor], self._routes[name] = kept, given
        return True

    def _over_gaps(self, team: Situation, i: int, budget_m: float) -> FloatArray | None:
        """Return the leg of a vehicle, (1, 2), over ground that is far from all lines; None where there is none."""
        ground, free = Ground.of(team.constraints), FreeSpace(team.constraints, BORDER_MARGIN_M)
        here_m, heading_rad = team.positions[i, :2], float(team.headings_rad[i])
        radius_m = float(self._turn_radii_m(team)[i])
        end_m = ground.best_end(free, ground.away_m(self._dealt), here_m, heading_rad, budget_m, radius_m)
        return None if end_m is None else end_m[None]

    def _lead_round(self, team: Situation) -> None:
        """Lead vehicles round zones between them and their next stop: routes that are handed over begin anywhere.

        Stops to which no way leads go to somebody who gets there; where nobody does they are left out.
        """
        zones = [Polygon(zone) for zone in team.constraints.keep_out]
        for i, name in enumerate(team.vehicles):
            here = team.positions[i, :2]
            if not team.moves[i]:
                continue
            route = self._routes[name]
            while len(route) and self._cut_off(team, i, route[0]):
                beyond = next((k for k, stop in enumerate(route) if not self._cut_off(team, i, stop)), len(route))
                self._hand_on(team, i, route[:beyond])
                route = route[beyond:]
            if len(route) and any(zone.intersects(LineString([here, route[0]])) for zone in zones):
                free = FreeSpace(team.constraints, BORDER_MARGIN_M)
                route = np.vstack([free.way(here, route[0]), route[1:]])
            self._routes[name] = route

    def _cut_off(self, team: Situation, i: int, stop_m: FloatArray) -> bool:
        return is_cut_off(team.constraints, BORDER_MARGIN_M, team.positions[i, :2], stop_m)

    def _hand_on(self, team: Situation, i: int, stops_m: FloatArray) -> None:
        """Give stops (k, 2) that a vehicle cannot reach to one that can; if there is none, count them as left out."""
        for k, name in enumerate(team.vehicles):
            if k != i and not self._cut_off(team, k, stops_m[0]):
                self._routes[name] = np.vstack([self._routes[name], stops_m])
                return
        self._left_out_m += route_length(stops_m[0], stops_m)
        if self._given is not None:
            self._out_of_reach.append(stops_m)

    def _adopt(self, team: Situation) -> None:
        """Give every vehicle of the team a route."""
        en = team.positions[:, :2]
        if not self._routes:
            corner_m = CORNER_LOSS * team.constraints.max_step_m if team.left_m is None else 0.0
            routes = self._lines_for(team, corner_m)
            self._routes = dict(zip(team.vehicles, routes, strict=True))
            self._dealt = [np.vstack([here, route]) for here, route in zip(en, routes, strict=True)]
            return
        self._routes = hand_over(self._routes, team.vehicles, en, both_ways=self._both_ways)
