"""PCAO (PCAO18): a controller trained beforehand leads the team; see :mod:`app.exploration.pcao`."""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely import Polygon

from app.arrays import FloatArray
from app.estimation import RangeSensor, Sensor
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import inside_area
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.problem import Proposal, Situation
from app.exploration.core.routes import next_waypoint
from app.exploration.pcao.controller import control, within_step
from app.exploration.pcao.model import default_model
from app.exploration.pcao.pace import Pace
from app.exploration.pcao.state import reduced_state
from app.exploration.pcao.visits import Visits, no_visits, visiting_depth, watch
from app.exploration.planner.base import PlannerBase, at_depth, settle
from app.exploration.planner.options import PlannerOptions

UNIT_OF_SIGHT = 0.25
"""The state's unit where landmarks are seen from afar, as a part of the sight; in training, of the swath's range."""

FINER = (1.0, 0.5, 0.25)
"""How near, in units, a survey has to come to a cell. Once it was that near everywhere it goes on with the next."""

COVERED = 0.99

TURNS_RAD = tuple(float(x) for x in np.radians([0, 20, -20, 45, -45, 70, -70, 95, -95, 120, -120, 150, -150, 180]))
"""By how much a vehicle turns off its course when a limit bars it; the smallest that is allowed is taken."""

STAYS_LEADER = 1.5
"""A vehicle leads until another one's work is closer by this factor."""

LINK_SHARE = 0.92
"""Part of the communication range that the team's wishes are drawn together to."""

TRAIL = 8
"""Number of remembered positions: a vehicle that came no farther than STUCK_STEPS over them is stuck."""
STUCK_STEPS = 2.0
STUCK_LEFT = 0.1
"""Share of what is left round a vehicle above which it is not stuck but busy."""

SLOWER = (0.6, 0.3, 0.0)
"""Parts of its move that the leader tries when the others cannot follow."""
GATHERING = (0.15, 0.05, 0.02)
"""Parts of their distance to the middle of the team by which vehicles that lost each other approach in a step."""

ESCORT_SHARE = 0.4
"""Part of the communication range within which linked vehicles come along with one that visits a landmark."""
APART = 1.2
"""Least distances by which they stay away from it and from each other."""
BARRED_LOOKS = 1
"""Steps in which a visitor came no closer after which its team climbs rather than stay below what rises before it."""
GETS_ON = 0.1
"""Part of its way by which a vehicle has to come nearer to get on at all."""


class PcaoPlanner(PlannerBase):
    """A controller that was trained in simulation: one product of matrices per step, for any number of vehicles.

    Parameters
    ----------
    fallback
        What leads a team that explores from then on when it would not be done in time; None: nothing does.
    """

    name: ClassVar[str] = "pcao"
    own_options: ClassVar[frozenset[str]] = frozenset({"model", "accuracy_sd_m"})

    def __init__(self, options: PlannerOptions, sensor: Sensor, fallback: PlannerBase | None = None) -> None:
        super().__init__(options, sensor)
        model = default_model() if options.model is None else options.model
        self._horizontal, self._vertical = model.gains
        self._trail: dict[str, list[list[float]]] = {}
        self._detours: dict[str, list[list[float]]] = {}
        self._lead = ""
        self._visits = no_visits(0, 0)
        self._visitors: tuple[str, ...] = ()
        self._fallback = None if self._surveys else fallback
        self._pace = Pace()
        self._fell_back = False

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        if self._fallback is not None:
            self._pace.note(int((~team.belief.accurate).sum()))
            steps_left = team.steps_total - team.step + 1
            self._fell_back = self._fell_back or self._pace.is_too_slow(len(team.belief.accurate), steps_left)
            if self._fell_back:
                proposal = self._fallback.stand_in(self, team, bottom, seed)
                return replace(proposal, terms={**proposal.terms, "fallback": 1.0})
        return self._led(team, bottom)

    def _led(self, team: Situation, bottom: Bottom) -> Proposal:
        """Decide by the controller and its visits."""
        belief, limits, here = team.belief, team.constraints, team.positions
        area = Polygon(limits.area).area
        unit = self._unit(team, area)
        left = self._left(team, unit)
        vectors, figures, schedule = reduced_state(
            np.ascontiguousarray(here),
            self._moves(team),
            self._floor_below(team, bottom) - here[:, 2],
            np.ascontiguousarray(belief.xy_m),
            np.ascontiguousarray(belief.depth_m),
            left,
            len(left) / area,
            unit,
        )
        u = control(vectors, figures, schedule, self._horizontal, self._vertical)
        if self._surveys:
            u[:, 2] = 0.0
        way = within_step(u, limits.max_step_m * (1.0 - 1e-9), False)
        if self._surveys:
            self._go_round(team, left, schedule[:, 0], way)
        else:
            self._watch(team, left, unit)
            self._visit(team, unit, way)
        visiting = not self._surveys and self._together(team) and self._visits.target[0] >= 0
        if visiting and not alone(here, limits.com_range_m).any():
            positions = self._escort(team, bottom, way, left, unit)
        else:
            lead = self._leader(team.vehicles, np.linalg.norm(vectors[:, 0], axis=1))
            positions = self._within_limits(team, bottom, way, lead)
        for name, place in zip(team.vehicles, here, strict=True):
            self._trail[name] = [*self._trail.get(name, [])[1 - TRAIL :], [float(place[0]), float(place[1])]]
        return Proposal(positions, -float(left.sum()), {"left": float(left.mean()) if len(left) else 0.0})

    def _go_round(self, team: Situation, left: FloatArray, here_left: FloatArray, way: FloatArray) -> None:
        """Lead vehicles that get nowhere to the nearest landmark that is left, round whatever bars them.

        Writes into their moves ``way`` (n, 3). ``here_left`` (n,) is the share left round each vehicle.
        """
        step = team.constraints.max_step_m * (1.0 - 1e-9)
        for i, name in enumerate(team.vehicles):
            place, trail = team.positions[i, :2], self._trail.get(name, [])
            stuck = len(trail) == TRAIL and np.hypot(*(place - np.array(trail[0]))) < STUCK_STEPS * step
            if stuck and name not in self._detours and here_left[i] < STUCK_LEFT and left.any():
                open_ = np.flatnonzero(left)
                nearest = open_[np.argmin(np.hypot(*(team.belief.xy_m[open_] - place).T))]
                free = FreeSpace(team.constraints, 0.0)
                self._detours[name] = free.way(place, free.nearest(team.belief.xy_m[nearest])).tolist()
            route = np.array(self._detours.get(name, [])).reshape(-1, 2)
            if len(route):
                x, y, passed = next_waypoint(place[0], place[1], route, 0, len(route), step, 0.0)
                way[i, :2] = x - place[0], y - place[1]
                self._detours[name] = route[passed:].tolist()
            if not len(self._detours.get(name, [])):
                self._detours.pop(name, None)

    def _floor_below(self, team: Situation, bottom: Bottom) -> FloatArray:
        """Return the depth (n,) of the bottom below the vehicles; where it is unknown, that of the nearest known place.

        A vehicle that sees nothing would not know otherwise that it is too high. NaN where nothing is known at all.
        """
        at, belief = team.positions[:, :2], team.belief
        below = bottom.at(at)
        lacking = np.isnan(below)
        known = np.isfinite(belief.depth_m)
        if lacking.any() and known.any() and belief.on_floor:
            _, nearest = cKDTree(belief.xy_m[known]).query(at[lacking])
            below[lacking] = belief.depth_m[known][nearest]
        return below

    def _together(self, team: Situation) -> bool:
        """Whether links hold the team together."""
        return len(team.vehicles) > 1 and bool(np.isfinite(team.constraints.com_range_m))

    def _watch(self, team: Situation, left: FloatArray, unit: float) -> None:
        """See whether the team gets on; begin and end visits."""
        groups = np.zeros(len(team.vehicles), dtype=np.int64)
        if not self._together(team):
            groups = np.arange(len(team.vehicles))
        if self._visitors != team.vehicles or len(self._visits.open) != len(left):
            before = self._visits
            self._visits = no_visits(int(groups.max()) + 1, len(left))
            if len(before.open) == len(left):
                self._visits = self._visits._replace(vain=before.vain, open=before.open)
            self._visitors = team.vehicles
        belief = team.belief
        watch(
            np.ascontiguousarray(team.positions),
            groups,
            np.ascontiguousarray(belief.xy_m),
            np.ascontiguousarray(belief.depth_m),
            left,
            unit,
            team.steps_total - team.step + 1,
            self._visits,
        )

    def _visit(self, team: Situation, unit: float, way: FloatArray) -> None:
        """Write the moves of vehicles that visit a landmark into ``way`` (n, 3)."""
        visits, belief, step = self._visits, team.belief, team.constraints.max_step_m * (1.0 - 1e-9)
        for group, target in enumerate(visits.target):
            row = int(visits.visitor[group])
            name, at = team.vehicles[row], team.positions[row]
            if target < 0:
                self._detours.pop(name, None)
                continue
            goal = belief.xy_m[target]
            if team.constraints.keep_out or not team.constraints.region.area_is_convex:
                goal = self._corner(team, name, at[:2], goal, step)
            way[row] = towards(at, goal, float(belief.depth_m[target]), int(visits.looks[group]), step, unit)

    def _corner(self, team: Situation, name: str, at: FloatArray, goal: FloatArray, step: float) -> FloatArray:
        """Return where the next leg (2,) of a vehicle to ``goal`` (2,) ends, round zones."""
        route = np.array(self._detours.get(name, [])).reshape(-1, 2)
        free = FreeSpace(team.constraints, 0.0)
        end = free.nearest(goal)
        if not len(route) or np.hypot(*(route[-1] - end)) > 1e-9:
            route = np.asarray(free.way(at, end)).reshape(-1, 2)
        x, y, passed = next_waypoint(at[0], at[1], route, 0, len(route), step, 0.0)
        rest = route[passed:]
        self._detours[name] = rest.tolist() if len(rest) else [end.tolist()]
        return np.array([x, y])

    def _escort(self, team: Situation, bottom: Bottom, way: FloatArray, left: FloatArray, unit: float) -> FloatArray:
        """Return where a linked team goes (n, 3) while one of it visits a landmark by its move of ``way`` (n, 3).

        The others visit what is left within their links to it where all may; else they come close to it, or follow it,
        which no border bars. A team that comes no nearer is barred by what rises before it: then all climb until the
        visitor gets on.
        """
        here, step, visitor = team.positions, team.constraints.max_step_m * (1.0 - 1e-9), int(self._visits.visitor[0])
        wishes = [self._escorted(team, bottom, way, self._nearby_moves(team, way, left, unit))]
        for part in (1.0, *SLOWER):
            wishes.append(self._escorted(team, bottom, part * way, {}))
            wishes.append(self._escorted(team, bottom, part * way, self._following_moves(team, part * way)))
        flat, tries = way[visitor, :2], [*wishes, *climbs(here, step)]
        if self._visits.looks[0] >= BARRED_LOOKS and flat.any():
            nearer = [wish for wish in wishes if (wish - here)[visitor, :2] @ flat >= GETS_ON * (flat @ flat)]
            tries = [*nearer, *climbs(here, step), *wishes]
        positions, _ = settle(team, bottom, np.stack(tries))
        return positions

    def _escorted(self, team: Situation, bottom: Bottom, way: FloatArray, moves: dict[int, FloatArray]) -> FloatArray:
        """Return the wishes (n, 3) of a team whose visitor goes its ``way`` and whose others go theirs, or come close.

        ``moves`` are those of the others that have somewhere to go, by row.
        """
        limits, here, visitor = team.constraints, team.positions, int(self._visits.visitor[0])
        step = limits.max_step_m * (1.0 - 1e-9)
        near = max(ESCORT_SHARE * limits.com_range_m, APART * limits.min_separation_m)
        wish = self._clear(team, bottom, here + way)
        lead = wish[visitor].copy()
        for i in range(len(here)):
            if i == visitor:
                continue
            if i in moves:
                wish[i] = here[i] + moves[i]
                continue
            offset = here[i, :2] - here[visitor, :2]
            place = lead + np.append(offset * min(1.0, near / max(float(np.hypot(*offset)), 1e-12)), 0.0)
            wish[i] = here[i] + within(place - here[i], step)
        wish = self._clear(team, bottom, linked(here, wish, limits.com_range_m, step, visitor))
        wish[visitor] = lead
        return wish

    def _following_moves(self, team: Situation, way: FloatArray) -> dict[int, FloatArray]:
        """Return the moves (3,), by row, of the vehicles beside the visitor to where it is now, at its next depth."""
        here, limits, visitor = team.positions, team.constraints, int(self._visits.visitor[0])
        step, moves = limits.max_step_m * (1.0 - 1e-9), {}
        for i, at in enumerate(here):
            if i == visitor:
                continue
            flat = here[visitor, :2] - at[:2]
            keep = 1.0 - APART * limits.min_separation_m / max(float(np.hypot(*flat)), 1e-12)
            down = here[visitor, 2] + way[visitor, 2] - at[2]
            moves[i] = within(np.append(max(0.0, keep) * flat, down), step)
        return moves

    def _nearby_moves(self, team: Situation, way: FloatArray, left: FloatArray, unit: float) -> dict[int, FloatArray]:
        """Return the moves (3,), by row, of the vehicles beside the visitor to landmarks within their links to it."""
        belief, limits, visitor = team.belief, team.constraints, int(self._visits.visitor[0])
        step = limits.max_step_m * (1.0 - 1e-9)
        lead = team.positions[visitor, :2] + way[visitor, :2]
        linked_to = np.hypot(*(belief.xy_m - lead).T) < LINK_SHARE * limits.com_range_m
        open_ = np.flatnonzero((left > 0.0) & linked_to)
        open_ = open_[open_ != self._visits.target[0]]
        moves = {}
        for i, at in enumerate(team.positions):
            if i == visitor or not len(open_):
                continue
            nearest = int(np.argmin(np.hypot(*(belief.xy_m[open_] - at[:2]).T)))
            target, open_ = int(open_[nearest]), np.delete(open_, nearest)
            moves[i] = towards(at, belief.xy_m[target], float(belief.depth_m[target]), 0, step, unit)
        return moves

    def _within_limits(self, team: Situation, bottom: Bottom, way: FloatArray, lead: int) -> FloatArray:
        """Return where the team goes (n, 3): by the controller's moves ``way`` (n, 3) as far as the limits allow."""
        limits, here = team.constraints, team.positions
        ties = (limits.com_range_m, limits.max_step_m * (1.0 - 1e-9), lead)
        if alone(here, limits.com_range_m).any():  # lifted by its altimeter, or pushed by a current
            back = self._gathering(team, bottom)
            ok = limits.feasible(here, back, bottom)
            if ok.any():
                return np.asarray(back[int(np.argmax(ok))])
        wish = linked(here, here + way, *ties)
        if not self._surveys and limits.feasible(here, wish[None], bottom)[0]:
            return wish
        wish = self._clear(team, bottom, wish)
        if limits.feasible(here, wish[None], bottom)[0]:
            return wish
        # A vehicle that has to climb falls behind: the leader goes slower, or waits.
        slower = [self._clear(team, bottom, linked(here, here + f * way, *ties)) for f in SLOWER]
        positions, _ = settle(team, bottom, np.stack([self._round_limits(team, bottom, wish), wish, *slower]))
        return positions

    def _gathering(self, team: Situation, bottom: Bottom) -> FloatArray:
        """Return how vehicles that lost each other may approach, (k, n, 3), best first.

        Where what rises between them holds one back, all climb first.
        """
        here, step = team.positions, team.constraints.max_step_m * (1.0 - 1e-9)
        middle = here.mean(axis=0)
        back = [self._clear(team, bottom, here + part * (middle - here)) for part in GATHERING]
        if self._surveys:
            return np.stack(back)
        away = np.hypot(*(middle - here)[:, :2].T)
        nearer = [
            wish
            for part, wish in zip(GATHERING, back, strict=True)
            if (away - np.hypot(*(middle - wish)[:, :2].T) >= GETS_ON * part * away).all()
        ]
        return np.stack([*nearer, *climbs(here, step), *back])

    def _clear(self, team: Situation, bottom: Bottom, wish: FloatArray) -> FloatArray:
        """Return the wishes (..., n, 3) clear of the bottom, at the depths wished for; in surveys at the cruise's."""
        if self._surveys:
            return self._at_cruise(team, bottom, wish[..., :2])
        return at_depth(team.constraints, bottom, team.positions, wish[..., :2], wish[..., 2])

    def _leader(self, names: tuple[str, ...], distance: FloatArray) -> int:
        """Return the leader where links hold the team together: the vehicle closest to its work; it seldom changes."""
        nearest = int(np.argmin(distance))
        if self._lead in names and distance[names.index(self._lead)] <= STAYS_LEADER * distance[nearest] + 0.1:
            nearest = names.index(self._lead)
        self._lead = names[nearest]
        return nearest

    def _unit(self, team: Situation, area: float) -> float:
        """Return the state's unit: half of what a vehicle maps to its sides.

        A survey's lines can lie as close together as the whole way that the team can travel allows.
        """
        if isinstance(self.sensor, RangeSensor):
            return UNIT_OF_SIGHT * self.sensor.visibility_m
        step = team.constraints.max_step_m
        return float(np.clip(0.5 * area / (team.steps_total * len(team.vehicles) * step), 0.5 * step, area**0.5 / 8.0))

    def _left(self, team: Situation, unit: float) -> FloatArray:
        """Return how much is left to learn of every landmark, 0 to 1; in a survey, of every cell that it passed far."""
        belief = team.belief
        open_ = np.where(belief.accurate, 0.0, 1.0)
        if self._surveys:  # no vehicle gets to the others
            open_ *= inside_area(team.constraints, belief.xy_m)
        else:
            with np.errstate(divide="ignore"):
                lacking = 1.0 - (self.options.accuracy_sd_m / belief.sd_m) ** 2
            return open_ * np.maximum(0.25, lacking)
        if not len(team.soundings_en_m) or not len(belief.xy_m):
            return open_
        distance, _ = cKDTree(team.soundings_en_m, balanced_tree=False, compact_nodes=False).query(belief.xy_m)
        for part in FINER:
            left = np.where(distance > part * unit, open_, 0.0)
            if left.mean() > 1.0 - COVERED:
                return left
        return np.where(distance > np.median(distance), 1.0, 0.0)

    def _moves(self, team: Situation) -> FloatArray:
        """Return the directions (n, 2) that the vehicles came from their last places in; else their headings'."""
        moves = np.zeros((len(team.vehicles), 2))
        for i, name in enumerate(team.vehicles):
            was = self._trail[name][-1] if self._trail.get(name) else team.positions[i, :2]
            way = team.positions[i, :2] - np.array(was)
            length = float(np.hypot(*way))
            if length > 1e-3 * team.constraints.max_step_m:
                moves[i] = way / length
            elif np.isfinite(team.headings_rad[i]):
                moves[i] = np.sin(team.headings_rad[i]), np.cos(team.headings_rad[i])
        return moves

    def _round_limits(self, team: Situation, bottom: Bottom, wish: FloatArray) -> FloatArray:
        """Return the wishes (n, 3), vehicle by vehicle turned off as little as the limits demand."""
        result = team.positions.copy()
        for i, place in enumerate(team.positions):
            way = wish[i] - place
            turned = np.array(
                [
                    [c * way[0] + s * way[1], c * way[1] - s * way[0]]
                    for c, s in ((np.cos(a), np.sin(a)) for a in TURNS_RAD)
                ]
            )
            tries = np.repeat(result[None], len(turned), axis=0)
            tries[:, i, :2] = place[:2] + turned
            tries[:, i, 2] = wish[i, 2]
            tries[:, i] = self._clear(team, bottom, tries)[:, i]
            # Others have decided or still stand; a vehicle too far from all of them counts as linked for now.
            ok = team.constraints.feasible(team.positions, tries, bottom)
            if ok.any():
                result[i] = tries[int(np.argmax(ok)), i]
        return result

    def _remember(self) -> dict[str, Any]:
        return {
            "trail": self._trail,
            "detours": self._detours,
            "lead": self._lead,
            "visitors": list(self._visitors),
            "visits": self._visits._asdict(),
            "pace": self._pace.left,
            "fallback": self._fallback._remember() if self._fallback is not None and self._fell_back else None,
        }

    def _recall(self, state: dict[str, Any]) -> None:
        self._trail = _places(state["trail"])
        self._detours = _places(state["detours"])
        self._lead = str(state["lead"])
        # Missions that an earlier release began have made no visits.
        self._visitors = tuple(str(name) for name in state.get("visitors", ()))
        self._visits = _visits(state["visits"]) if "visits" in state else no_visits(0, 0)
        self._pace = Pace(state.get("pace", ()))
        fallback = state.get("fallback")
        self._fell_back = fallback is not None
        if self._fallback is not None and fallback is not None:
            self._fallback._recall(fallback)


def towards(at: FloatArray, goal: FloatArray, depth: float, looks: int, step: float, unit: float) -> FloatArray:
    """Return the move (3,) of a vehicle ``at`` (3,) to a landmark of a depth, by way of ``goal`` (2,)."""
    flat = goal - at[:2]
    flat = flat * min(1.0, step / max(float(np.hypot(*flat)), 1e-12))
    down = visiting_depth(at, goal, depth, looks, step, unit) - at[2]
    return within(np.append(flat, np.clip(down, -step, step)), step)


def climbs(here: FloatArray, step: float) -> list[FloatArray]:
    """Return where vehicles at ``here`` (n, 3) are after they all climbed, by a step or half of it."""
    return [here - [0.0, 0.0, part * step] for part in (1.0, 0.5)]


def within(move: FloatArray, step: float) -> FloatArray:
    """Return a move (3,), shortened to a step."""
    return np.asarray(move * min(1.0, step / max(float(np.linalg.norm(move)), 1e-12)))


def _visits(of: dict[str, Any]) -> Visits:
    blank = no_visits(0, 0)._asdict()
    return Visits(
        **{
            name: np.array([np.inf if x is None else x for x in of[name]], dtype=like.dtype)
            for name, like in blank.items()
        }
    )


def _places(of: dict[str, Any]) -> dict[str, list[list[float]]]:
    return {str(name): [[float(x) for x in place] for place in places] for name, places in of.items()}


def alone(here: FloatArray, com_range: float) -> NDArray[np.bool_]:
    """Return which vehicles (n, 3) have no other one within the range, (n,); a single vehicle needs none."""
    if len(here) < 2:
        return np.zeros(len(here), dtype=np.bool_)
    apart = np.linalg.norm(here[:, None] - here[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    return np.asarray(apart.min(axis=1) > com_range, dtype=np.bool_)


def linked(here: FloatArray, wish: FloatArray, com_range: float, step: float, leader: int) -> FloatArray:
    """Return the wishes (n, 3) drawn together so that every vehicle has another one within the range.

    The leader goes where it wishes. The others, by their distance to it, go as near as they must to the closest one
    that is placed already, as far as a step from ``here`` (n, 3) leads.
    """
    n = len(wish)
    if n < 2 or not np.isfinite(com_range):
        return wish
    wish = wish.copy()
    order = np.argsort(np.linalg.norm(here - here[leader], axis=1), kind="stable")
    placed = [leader]
    for i in (int(k) for k in order if k != leader):
        apart = np.linalg.norm(wish[placed] - wish[i], axis=1)
        closest = placed[int(np.argmin(np.linalg.norm(wish[placed] - here[i], axis=1)))]
        if apart.min() > LINK_SHARE * com_range:
            away = wish[i] - wish[closest]
            near = wish[closest] + away * (LINK_SHARE * com_range / np.linalg.norm(away))
            way = near - here[i]
            wish[i] = here[i] + way * min(1.0, step * (1.0 - 1e-9) / max(float(np.linalg.norm(way)), 1e-12))
        placed.append(i)
    return wish
