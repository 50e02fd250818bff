"""A mission's planner beside what its operator orders: vehicles on an ordered way are led along it, the others planned.

An ordered leg is proposed like a planned one and held to the same checks. What is left of an ordered way is part of the
planner's memory: it is written down with the legs, so that an order is neither lost nor carried out twice.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.open_ground import OpenGround
from app.exploration.core.problem import Proposal, Situation
from app.exploration.core.routes import SAME_M
from app.exploration.core.snapshot_codec import pack, unpack
from app.exploration.planner.base import PlannerBase, at_depth

KIND = "ordered"
NEAR_M = 0.5
"""Who is so near a corner of its way has reached it."""

PARTS = (1.0, 0.6, 0.3)
"""Parts of a leg to try where the whole one is not allowed."""

MOST_TRIES = 3
"""So many legs in a row that come to nothing end an order."""

MOST_LOST = 6
"""So often legs of an order are given up before the order is."""

NO_ORDER = 0
"""In place of an order's number, of a way round what barred a vehicle's legs, or round a shoal."""


@dataclass
class OrderedWay:
    """What is left of a vehicle's ordered way, or way round: corners (k, 2), and those (j, 2) that it was given.

    ``tries`` are legs in a row that led nowhere, ``lost`` is how often legs were given up.
    """

    order: int
    corners_m: FloatArray
    tries: int = 0
    passed_m: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    lost: int = 0

    def pass_corner(self) -> None:
        """Go on with the next corner."""
        self.passed_m = np.vstack([self.passed_m, self.corners_m[:1]])
        self.corners_m, self.tries = self.corners_m[1:], 0

    def remember(self) -> dict[str, Any]:
        """Return what is stored."""
        return {
            "order": self.order,
            "corners": self.corners_m,
            "tries": self.tries,
            "passed": self.passed_m,
            "lost": self.lost,
        }

    @classmethod
    def recall(cls, stored: dict[str, Any]) -> "OrderedWay":
        """Return what was stored."""
        corners, passed = (np.array(stored[key], dtype=np.float64).reshape(-1, 2) for key in ("corners", "passed"))
        return cls(int(stored["order"]), corners, int(stored["tries"]), passed, int(stored["lost"]))


class OrderedPlanner:
    """Leads vehicles along ordered ways, and leaves the others to a planner.

    Attributes
    ----------
    ways
        By vehicle, its ordered way; one without corners left is decided to its end.
    taken
        By vehicle, the last order that was taken up.
    refused
        By vehicle, the last order that could not be carried out, and why.
    """

    def __init__(self, planner: PlannerBase) -> None:
        self.planner = planner
        self.ways: dict[str, OrderedWay] = {}
        self.taken: dict[str, int] = {}
        self.refused: dict[str, tuple[int, str]] = {}
        self._since: dict[str, int] = {}
        """How many legs the planner has decided for vehicles since their last one on a way, or they left a line."""
        self._spaces: list[tuple[Constraints, FreeSpace]] = []
        """Of plans' limits and of checks'."""

    @property
    def decides_apart(self) -> bool:
        """Whether legs may be decided for some of the vehicles while the others fly on."""
        return self.planner.decides_apart

    def lead(
        self, vehicle: str, order: int, corners_m: FloatArray, ends_m: FloatArray, resume_at_m: FloatArray | None
    ) -> None:
        """Take up an order to fly along corners (k, 2), in place of legs that end at ``ends_m`` (n, 2).

        The planner goes on from ``resume_at_m`` (2,) when the way was flown.
        """
        before = self._leave_way_round(vehicle)
        going_on = before is not None and len(before.corners_m) > 0
        self.ways[vehicle] = OrderedWay(order, np.asarray(corners_m, dtype=np.float64).reshape(-1, 2))
        self.taken[vehicle] = order
        if not going_on:
            self.planner.put_back(vehicle, ends_m, resume_at_m)
        self._since[vehicle] = 0

    def skip(self, vehicle: str, order: int, ends_m: FloatArray, begin_m: FloatArray, here_m: FloatArray) -> bool:
        """Leave out the rest of a vehicle's line; returns False where the planner knows none.

        Parameters
        ----------
        ends_m : (n, 2)
            Where the legs end that are given up.
        begin_m, here_m : (2,)
            Where the line began, and where the vehicle is.
        """
        self._leave_way_round(vehicle)
        self.taken[vehicle] = order
        self._since[vehicle] = 0
        self.planner.put_back(vehicle, ends_m, None)
        return self.planner.skip_line(vehicle, begin_m, here_m)

    def lose(self, vehicle: str, ends_m: FloatArray) -> None:
        """Lead a vehicle once more to corners of its way whose legs, ending at ``ends_m`` (n, 2), are not flown."""
        way = self.ways.get(vehicle)
        if way is None or not len(way.passed_m) or not len(ends_m):
            return
        away = np.hypot(*(way.passed_m[:, None] - ends_m[None]).transpose(2, 0, 1)).min(axis=1)
        again = np.flatnonzero(away <= NEAR_M)
        if not len(again):
            return
        # Legs are given up from one of them to the last.
        way.corners_m = np.vstack([way.passed_m[again[0] :], way.corners_m])
        way.passed_m = way.passed_m[: again[0]]
        way.lost += 1
        if way.lost > MOST_LOST:
            self._refuse(vehicle, way, "its legs there came to nothing again and again")

    def put_back(self, vehicle: str, ends_m: FloatArray) -> None:
        """Learn that a vehicle was not given the last legs decided for it, which were to end at ``ends_m`` (n, 2)."""
        own = min(self._since.get(vehicle, len(ends_m)), len(ends_m))
        led, planned = np.split(ends_m, [len(ends_m) - own])
        if len(planned):
            self.planner.put_back(vehicle, planned, None)
            if vehicle in self._since:
                self._since[vehicle] -= own
        if not len(led):
            return
        # A way round is forgotten at its end.
        way = self.ways.setdefault(vehicle, OrderedWay(NO_ORDER, np.zeros((0, 2))))
        kept = len(way.passed_m)
        while kept and np.hypot(*(led - way.passed_m[kept - 1]).T).min() <= NEAR_M:
            kept -= 1
        # Planned legs before a way round may be among them.
        again = led if way.order == NO_ORDER else way.passed_m[kept:]
        way.corners_m = np.vstack([again, way.corners_m])
        way.passed_m = way.passed_m[:kept]

    def leave(self, vehicle: str, place_m: FloatArray, ends_m: FloatArray) -> None:
        """Learn that a vehicle leaves its line at a place (2,) without its last legs, which were to end at ``ends_m``.

        Whoever goes on with the line does so from there: the vehicle itself when it comes back, or another one.
        """
        if self.is_ordered(vehicle) or (self._since.get(vehicle) == 0 and vehicle not in self.ways):
            return  # its line waits where it left that before
        self.put_back(vehicle, ends_m)
        self._leave_way_round(vehicle)
        self._since[vehicle] = 0
        if len(self.planner.ways_ahead_m().get(vehicle, ())):
            self.planner.put_back(vehicle, np.zeros((0, 2)), place_m)

    def reach(self, vehicle: str, place_m: FloatArray) -> None:
        """Take note that a vehicle has flown all its legs, the last of which ended at ``place_m`` (2,).

        It may be an arrival radius away from there.
        """
        way = self.ways.get(vehicle)
        if way is not None and len(way.corners_m) and np.hypot(*(way.corners_m[0] - place_m)) <= NEAR_M:
            way.pass_corner()

    def go_round(self, vehicle: str, ends_m: FloatArray) -> None:
        """Lead a vehicle to where its planned legs were to end, (n, 2), round what barred them from where it was.

        Its planner takes them as flown.
        """
        way = self.ways.get(vehicle)
        if way is None:
            self.ways[vehicle] = OrderedWay(NO_ORDER, np.asarray(ends_m, dtype=np.float64).reshape(-1, 2))
            self._since[vehicle] = 0
            return
        # Only ends that it was led to are to be seen again, not the corners on the way there.
        given = way.passed_m
        again = [end for end in ends_m if len(given) and np.hypot(*(given - end).T).min() <= NEAR_M]
        way.corners_m = np.vstack([*again, way.corners_m])
        way.lost += 1
        if way.lost > MOST_LOST or not len(way.corners_m):
            del self.ways[vehicle]

    def is_ordered(self, vehicle: str) -> bool:
        """Whether a vehicle is on a way that somebody ordered."""
        way = self.ways.get(vehicle)
        return way is not None and way.order != NO_ORDER

    def _leave_way_round(self, vehicle: str) -> OrderedWay | None:
        """End a vehicle's way round something; its planner gets what is left of it. Returns a way that was ordered."""
        way = self.ways.get(vehicle)
        if way is None or way.order != NO_ORDER:
            return way
        del self.ways[vehicle]
        self.planner.put_back(vehicle, way.corners_m, None)
        return None

    def drop(self, vehicle: str) -> None:
        """End a vehicle's ordered way."""
        self.ways.pop(vehicle, None)

    def propose(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        """Return a configuration that obeys ``situation.constraints``."""
        moves = situation.moves
        belief = situation.belief
        bottom = Bottom.from_landmarks(belief.xy_m, belief.depth_m) if belief.on_floor else Bottom.unknown()
        self._lead_round_shoals(situation, bottom)
        led = [
            i for i, name in enumerate(situation.vehicles) if moves[i] and self._has_way(name, situation.positions[i])
        ]
        planned = moves.copy()
        planned[led] = False
        for name, goes in zip(situation.vehicles, planned, strict=True):
            if goes and name in self._since:
                self._since[name] += 1
        if not led:
            return self.planner.propose(situation, rng)
        proposal = self.planner.propose(replace(situation, moving=planned), rng)
        positions = np.array(proposal.positions, dtype=np.float64)
        for i in led:
            self._since[situation.vehicles[i]] = 0
            positions[i] = self._leg(situation, i, positions, bottom)
        return replace(proposal, positions=positions, done=proposal.done - {situation.vehicles[i] for i in led})

    def _lead_round_shoals(self, situation: Situation, bottom: Bottom) -> None:
        """Lead vehicles round shoals within a step on their planned ways: they would stand before these."""
        constraints, belief = situation.constraints, situation.belief
        ground, ahead = OpenGround(bottom, constraints), self.planner.ways_ahead_m()
        for name, place_m, goes in zip(situation.vehicles, situation.positions[:, :2], situation.moves, strict=True):
            if not goes or name in self.ways:
                continue
            vias_m = ahead.get(name, np.zeros((0, 2)))
            found = ground.way_round(place_m, vias_m, constraints.max_step_m)
            if found is not None and found.passed == len(vias_m):
                # Its whole rest is left out where that is sure, not where few soundings make all ground look shoal.
                least = Bottom.from_landmarks(belief.xy_m, belief.depth_m + belief.sd_m)
                sure = OpenGround(least, constraints).way_round(place_m, vias_m, constraints.max_step_m)
                found = found if sure is not None and sure.passed == len(vias_m) else None
            if found is None or not self.planner.leave_out(name, found.passed, place_m):
                continue
            if len(found.corners_m):
                self.ways[name] = OrderedWay(NO_ORDER, found.corners_m)
                self._since[name] = 0

    def _has_way(self, vehicle: str, place_m: FloatArray) -> bool:
        way = self.ways.get(vehicle)
        if way is None:
            return False
        while len(way.corners_m) and np.hypot(*(way.corners_m[0] - place_m[:2])) <= NEAR_M:
            way.pass_corner()
        if way.tries >= MOST_TRIES:
            self._refuse(vehicle, way, self.refused.get(vehicle, (0, "no leg there is allowed"))[1])
            return False
        if not len(way.corners_m) and way.order == NO_ORDER:
            del self.ways[vehicle]
        return len(way.corners_m) > 0

    def _refuse(self, vehicle: str, way: OrderedWay, why: str) -> None:
        if way.order != NO_ORDER:
            self.refused[vehicle] = (way.order, why)
        del self.ways[vehicle]

    def _leg(self, situation: Situation, row: int, positions: FloatArray, bottom: Bottom) -> FloatArray:
        """Return the end (3,) of a vehicle's next leg along its way."""
        way, origin, constraints = self.ways[situation.vehicles[row]], situation.positions, situation.constraints
        here_m = origin[row, :2]
        space = self._free(constraints)
        if not space.holds(way.corners_m[0]):
            # It was ordered nearer to a zone than plans go, and may be there.
            constraints = constraints.for_checks
            space = self._free(constraints)
        corner_m = space.corner(here_m, space.nearest(way.corners_m[0]), SAME_M)
        away_m = float(np.hypot(*(corner_m - here_m)))
        if away_m <= SAME_M:
            way.tries += 1
            self.refused[situation.vehicles[row]] = (way.order, "nobody may go nearer to where it was ordered")
            return np.asarray(origin[row])
        whole_m = min(away_m, constraints.max_step_m * (1.0 - 1e-9))
        tries = np.repeat(positions[None], len(PARTS), axis=0)
        for k, part in enumerate(PARTS):
            tries[k, row, :2] = here_m + part * whole_m / max(away_m, 1e-12) * (corner_m - here_m)
        tries = at_depth(constraints, bottom, origin, tries[..., :2], positions[:, 2])
        allowed = np.flatnonzero(constraints.feasible(origin, tries, bottom))
        if len(allowed):
            way.tries = 0
            return np.asarray(tries[allowed[0], row])
        way.tries += 1
        broken = constraints.violations(situation.vehicles, origin, tries[0], bottom)
        why = next((one.reason for one in broken if one.vehicle == situation.vehicles[row]), "others are in the way")
        self.refused[situation.vehicles[row]] = (way.order, why)
        return np.asarray(origin[row])

    def _free(self, constraints: Constraints) -> FreeSpace:
        known = next((space for of, space in self._spaces if of is constraints), None)
        if known is None:
            known = FreeSpace(constraints, 0.0)
            self._spaces = [*self._spaces[-1:], (constraints, known)]
        return known

    def take_back(self, legs: Mapping[str, int]) -> bool:
        """See :meth:`.PlannerBase.take_back`; ordered legs are not taken back."""
        if any(count > self._since.get(name, count) for name, count in legs.items()):
            return False
        if not self.planner.take_back(legs):
            return False
        for name, count in legs.items():
            if name in self._since:
                self._since[name] -= count
        return True

    def snapshot(self) -> bytes:
        """Return the planner's memory, and the ordered ways."""
        memory = self.planner.snapshot()
        if not self.taken and not self.ways and not self._since:
            return memory
        ways = {name: way.remember() for name, way in self.ways.items()}
        state: dict[str, Any] = {"ways": ways, "taken": self.taken, "refused": self.refused, "since": self._since}
        return pack(KIND, {**state, "planner": memory.decode()})

    def restore(self, memory: bytes) -> None:
        """Take up a memory made by ``snapshot``, or by the planner alone. Raises ValueError when it is not one."""
        if not memory.startswith(b'{"kind":"ordered"'):
            self.planner.restore(memory)
            self.ways, self.taken, self.refused, self._since = {}, {}, {}, {}
            return
        state = unpack(KIND, memory)
        try:
            inner = str(state["planner"]).encode()
            ways = {str(name): OrderedWay.recall(way) for name, way in state["ways"].items()}
            taken = {str(name): int(order) for name, order in state["taken"].items()}
            refused = {str(name): (int(order), str(why)) for name, (order, why) in state["refused"].items()}
            since = {str(name): int(count) for name, count in state["since"].items()}
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ValueError(f"the memory of ordered ways lacks or garbles a field: {error}") from error
        self.planner.restore(inner)
        self.ways, self.taken, self.refused, self._since = ways, taken, refused, since
