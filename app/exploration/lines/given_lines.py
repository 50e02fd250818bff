"""Lines of a plan that is given, with numbers or names, dealt so that all vehicles are done at about the same time."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely import LineString, STRtree
from shapely.geometry.base import BaseGeometry

from app.arrays import FloatArray, IntArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.routes import SAME_M, Turns, Vehicles
from app.exploration.lines.even_survey import MOST_ORDERS
from app.exploration.lines.flying_order import flying_orders
from app.exploration.lines.lattice import LEAST_LINE_M
from app.exploration.lines.line_shares import PARTS, WHOLE_LINES, LinePath, dealt, least_share, path_over, way_m
from app.exploration.lines.parts import parts_of

DETAIL_M = 0.25
"""Vertices that lie no farther off the rest of a line say nothing: no vehicle keeps its line as closely."""
ON_LINE_M, ON_LINE_PART = 3.0, 0.1
"""A leg lies on a line where neither its ends nor its middle are farther off than that, and than this part of it."""


@dataclass(frozen=True)
class GivenLine:
    """A line to be flown.

    Attributes
    ----------
    name
        What the plan calls it.
    en_m : (k, 2)
        Its vertices, east and north, in the direction in which it is drawn.
    keep_direction
        Whether it is flown in that direction only.
    """

    name: str
    en_m: FloatArray
    keep_direction: bool = False

    @cached_property
    def vertices_m(self) -> FloatArray:
        """Its vertices without those that say nothing, (k, 2)."""
        return shapely.get_coordinates(shapely.simplify(shapely.linestrings(self.en_m), DETAIL_M))

    @cached_property
    def length_m(self) -> float:
        """How long it is."""
        return float(np.hypot(*np.diff(self.vertices_m, axis=0).T).sum())

    def within(self, region: BaseGeometry) -> list[FloatArray]:
        """Return its parts (k, 2) that lie in a region, in its direction; very short ones are left out."""
        corners = self.vertices_m
        corners = corners[np.concatenate([[True], np.hypot(*np.diff(corners, axis=0).T) > SAME_M])]
        if len(corners) < 2:
            return []
        way = np.diff(corners, axis=0)
        length_m = np.hypot(*way.T)
        at_m = np.concatenate([[0.0], np.cumsum(length_m)])
        legs = np.asarray(shapely.linestrings(np.stack([corners[:-1], corners[1:]], axis=1)))
        # Leg by leg: where a line crosses itself all of it at once would come in another order.
        # Most legs lie inside or outside as a whole, which takes far less to find out.
        inside = shapely.covers(region, legs)
        legs[~inside] = shapely.intersection(legs[~inside], region)
        cuts, of = shapely.get_parts(legs, return_index=True)
        straight = (shapely.get_type_id(cuts) == shapely.GeometryType.LINESTRING) & ~shapely.is_empty(cuts)
        cuts, of = cuts[straight], of[straight]
        ends = np.stack([shapely.get_coordinates(shapely.get_point(cuts, k)).reshape(-1, 2) for k in (0, -1)], axis=1)
        along = np.einsum("kij,kj->ki", ends - corners[of][:, None], way[of] / length_m[of][:, None])
        spans = np.sort(at_m[of][:, None] + along, axis=1)
        joined: list[tuple[float, float]] = []
        for begin_m, end_m in spans[np.argsort(spans[:, 0], kind="stable")].tolist():
            if joined and begin_m <= joined[-1][1] + SAME_M:
                joined[-1] = joined[-1][0], max(joined[-1][1], end_m)
            else:
                joined.append((begin_m, end_m))
        return [_between(corners, at_m, *span) for span in joined if span[1] - span[0] > LEAST_LINE_M]


def _between(corners: FloatArray, at_m: FloatArray, begin_m: float, end_m: float) -> FloatArray:
    """Return a line (k, 2) whose corners lie ``at_m`` along it, from one place of it to another."""
    inner = corners[(at_m > begin_m + SAME_M) & (at_m < end_m - SAME_M)]
    ends = [[np.interp(one, at_m, corners[:, k]) for k in (0, 1)] for one in (begin_m, end_m)]
    return np.vstack([ends[0], inner, ends[1]])


class LinePlan:
    """All lines of a plan, and which of them ways lie on."""

    def __init__(self, lines: Sequence[GivenLine]) -> None:
        self.lines = tuple(lines)
        self._shapes = [LineString(line.vertices_m) for line in self.lines]
        self._tree = STRtree(self._shapes)

    @property
    def both_ways(self) -> bool:
        """Whether each may be flown in either direction."""
        return not any(line.keep_direction for line in self.lines)

    def numbers_of(self, legs_m: FloatArray) -> IntArray:
        """Return the number of the line that each of some legs (n, 2, 2) lies on; -1: it lies on none."""
        found, nearest_m = np.full(len(legs_m), -1), np.full(len(legs_m), np.inf)
        if not len(legs_m) or not self.lines:
            return found
        middle = legs_m.mean(axis=1)
        legs, lines = self._tree.query(shapely.points(middle), predicate="dwithin", distance=ON_LINE_M)
        shapes = np.array(self._shapes, dtype=object)[lines]
        places = np.stack([legs_m[legs, 0], middle[legs], legs_m[legs, 1]], axis=1)
        away_m = shapely.distance(shapely.points(places), shapes[:, None])
        length_m = np.hypot(*(legs_m[legs, 1] - legs_m[legs, 0]).T)
        near = away_m.max(axis=1, initial=0.0) <= np.minimum(ON_LINE_M, SAME_M + ON_LINE_PART * length_m)
        for leg, line, off_m in zip(legs[near], lines[near], away_m.sum(axis=1)[near], strict=True):
            if off_m < nearest_m[leg]:
                found[leg], nearest_m[leg] = line, off_m
        return found

    def metres_on(self, ways_m: Iterable[FloatArray]) -> dict[str, float]:
        """Return how much of lines some ways (k, 2) lie on, by name and in the plan's order, where it is any."""
        legs = [np.stack([way[:-1], way[1:]], axis=1) for way in ways_m if len(way) > 1]
        legs_m = np.concatenate(legs) if legs else np.zeros((0, 2, 2))
        numbers = self.numbers_of(legs_m)
        on = numbers >= 0
        length_m = np.hypot(*(legs_m[on, 1] - legs_m[on, 0]).T)
        sums = self._shared_out(np.asarray(np.bincount(numbers[on], length_m, len(self.lines)), np.float64))
        return {line.name: min(float(m), line.length_m) for line, m in zip(self.lines, sums, strict=True) if m > 0.0}

    def _shared_out(self, metres: FloatArray) -> FloatArray:
        """Return how much of each line is flown where some lie on each other: what is too much for one is another's."""
        metres = metres.copy()
        for i in np.flatnonzero(metres > [line.length_m + ON_LINE_M for line in self.lines]):
            for k in self._tree.query(self._shapes[i]):
                room_m = min(metres[i] - self.lines[i].length_m, self.lines[k].length_m - metres[k])
                if room_m > 0.0 and shapely.hausdorff_distance(self._shapes[i], self._shapes[k]) <= ON_LINE_M:
                    metres[k] += room_m
                    metres[i] -= room_m
        return metres

    def after_line(self, begin_m: FloatArray, here_m: FloatArray, route: FloatArray) -> FloatArray | None:
        """Return what is left of a route (k, 2) without the line that is flown now, or the next where none is.

        None where no line is left.

        Parameters
        ----------
        begin_m, here_m : (2,)
            Where the line began, and where its vehicle is.
        """
        route = route[int(np.argmax(np.append(np.hypot(*(route - here_m).T) > SAME_M, True))) :]
        if not len(route):
            return None
        corners = np.vstack([here_m, route])
        numbers = self.numbers_of(np.stack([corners[:-1], corners[1:]], axis=1))
        flown = int(self.numbers_of(np.stack([begin_m, route[0]])[None])[0])
        if flown >= 0:
            numbers[0] = flown
        elif not (numbers >= 0).any():
            return None
        flown = int(numbers[np.argmax(numbers >= 0)])
        others = np.flatnonzero((numbers >= 0) & (numbers != flown))
        mine = np.flatnonzero(numbers[: others[0] if len(others) else len(numbers)] == flown)
        # Another one may lie on it: no line is longer than itself.
        corners[0] = begin_m if numbers[0] == flown else here_m
        flown_m = np.cumsum(np.hypot(*np.diff(corners, axis=0).T)[mine])
        mine = mine[(flown_m <= self.lines[flown].length_m + ON_LINE_M) | (mine == mine[0])]
        return route[int(mine[-1]) + 1 :]


@dataclass(frozen=True)
class GivenSurvey:
    """Each vehicle's route (k, 2), and the parts (k, 2) of lines that no vehicle can reach or fly."""

    routes: list[FloatArray]
    left_out: list[FloatArray]


def given_survey(
    constraints: Constraints,
    margin_m: float,
    plan: LinePlan,
    vehicles: Vehicles,
    turns: Sequence[Turns],
    *,
    in_order: bool,
) -> GivenSurvey:
    """Return each vehicle's route over the lines of a plan, as far as they lie in the area and outside its zones.

    Each vehicle gets lines that follow each other, by what it can fly: as large a share of it from all. Where keep-out
    zones cut the area into parts between which no way leads, the vehicles in each part share the lines of that part.

    Parameters
    ----------
    margin_m
        How far lines keep off borders and zones.
    vehicles
        The team.
    turns
        What they cost each vehicle.
    in_order
        Whether lines are flown in the plan's order, whatever that costs.
    """
    routes: list[FloatArray] = [np.zeros((0, 2))] * len(vehicles.en_m)
    free = FreeSpace(constraints, margin_m)
    rest: BaseGeometry = free.region
    for part, members in parts_of(constraints, free, vehicles.en_m):
        space = FreeSpace(part, margin_m)
        there = Vehicles(*(of_all[members] for of_all in vehicles))
        dealt_here = _fairest(space, plan, there, [turns[i] for i in members], in_order=in_order)
        if dealt_here is None:
            continue
        rest = rest.difference(space.region.buffer(SAME_M))
        for i, route in zip(members, dealt_here, strict=True):
            routes[i] = route
    return GivenSurvey(routes, [piece for line in plan.lines for piece in line.within(rest)])


def _fairest(
    free: FreeSpace, plan: LinePlan, vehicles: Vehicles, turns: Sequence[Turns], *, in_order: bool
) -> list[FloatArray] | None:
    """Return the routes by which the largest share that any vehicle needs of its way is as small as may be."""
    shapely.prepare(free.region)
    flown = [(line, np.vstack(pieces)) for line in plan.lines if (pieces := line.within(free.region))]
    if not flown:
        return [np.zeros((0, 2))] * len(vehicles.en_m)
    stops = [one for _, one in flown]
    may_turn = np.array([not line.keep_direction for line, _ in flown])
    parts = 1 if len(flown) >= WHOLE_LINES * len(vehicles.en_m) else PARTS
    orders = flying_orders(
        np.array([[one[0], one[-1]] for one in stops]),
        np.array([np.hypot(*np.diff(one, axis=0).T).sum() for one in stops]),
        may_turn,
        vehicles.en_m,
        in_order=in_order,
    )
    both_ways = bool(may_turn.all()) and not in_order
    paths = [
        path_over(free, [stops[k][::-1] if back else stops[k] for k, back in order], parts, both_ways=both_ways)
        for order in orders
    ]

    def length_m(routes: list[FloatArray]) -> float:
        return sum(way_m(vehicles, turns[i], i, route) for i, route in enumerate(routes))

    def deal(share: float) -> list[FloatArray] | None:
        able = vehicles._replace(left_m=share * vehicles.left_m)
        found = (dealt(free, able, turns, path, order) for path in paths for order in _orders_along(path, vehicles))
        return min((routes for routes in found if routes is not None), key=length_m, default=None)

    return least_share(deal)


def _orders_along(path: LinePath, vehicles: Vehicles) -> list[tuple[int, ...]]:
    """Return in which orders vehicles may take parts of a path: all for a few, else as they lie along it."""
    count = len(vehicles.en_m)
    if count <= MOST_ORDERS:
        return list(itertools.permutations(range(count)))
    away_m = np.hypot(*np.moveaxis(vehicles.en_m[:, None] - path.vertices[None], -1, 0))
    rank = tuple(int(k) for k in np.argsort(away_m.argmin(axis=1), kind="stable"))
    return [rank, rank[::-1]]
