"""Even surveys: parallel lines over the whole area, dealt to the vehicles by what each can fly.

A vehicle gets neighbouring lines, or parts of lines where these may be shared, and flies all of them: no line is left
half flown. There are as many lines as the team can pay for, transits and turns included.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.routes import FreeSpace, Turns, Vehicles, flown_m
from app.exploration.lines.lattice import Sweep, even_lines, most_lines

MOST_ORDERS = 3
"""Teams up to this size are dealt the lines in every order."""


@dataclass(frozen=True)
class Pattern:
    """How even lines lie: distances from the border in spacings, and into how many parts vehicles may share a line.

    ``to_side`` is that of the outer lines, ``to_end`` that of the ends of all lines.
    """

    to_side: float = 0.5
    to_end: float = 0.0
    parts: int = 1


@dataclass(frozen=True)
class EvenSurvey:
    """The routes (k, 2) of all vehicles and the distance of the lines."""

    routes: list[FloatArray]
    spacing_m: float


@dataclass(frozen=True)
class _Path:
    """One way over all lines: vertices (m, 2), and the first and last vertex of every part that is dealt as a whole."""

    vertices: FloatArray
    first: list[int]
    last: list[int]


def even_survey(sweep: Sweep, vehicles: Vehicles, turns: Turns, pattern: Pattern) -> EvenSurvey | None:
    """Return the survey of the most lines in the direction of ``sweep`` that the team can fly; None without any."""
    u = sweep.to_uv(sweep.constraints.area)[:, 0]
    low, high = float(u.min()), float(u.max())
    orders = orders_across(sweep.to_uv(vehicles.en_m)[:, 0])
    dealt: dict[int, list[FloatArray] | None] = {}

    def length_m(way: list[FloatArray]) -> float:
        return sum(way_m(vehicles, turns, i, route) for i, route in enumerate(way))

    def routes(n: int) -> list[FloatArray] | None:
        if n not in dealt:
            lines_u = even_lines(low, high, n, pattern.to_side, pattern.to_side)
            inset_m = pattern.to_end * (high - low) / (n - 1 + 2 * pattern.to_side)
            paths = [_path(sweep, lines_u, inset_m, pattern.parts, upwards=upwards) for upwards in (True, False)]
            ways = (_dealt(sweep.free, vehicles, turns, path, order) for path in paths for order in orders)
            dealt[n] = min((way for way in ways if way is not None), key=length_m, default=None)
        return dealt[n]

    n = most_lines(lambda k: routes(k) is not None)
    found = routes(n)
    return None if found is None else EvenSurvey(found, (high - low) / (n - 1 + 2 * pattern.to_side))


def orders_across(u: FloatArray) -> list[tuple[int, ...]]:
    """Return in which orders vehicles may stand across the lines: all for a few, else as they do, there or back."""
    if len(u) <= MOST_ORDERS:
        return list(itertools.permutations(range(len(u))))
    rank = tuple(int(k) for k in np.argsort(u, kind="stable"))
    return [rank, rank[::-1]]


def way_m(vehicles: Vehicles, turns: Turns, i: int, route: FloatArray) -> float:
    """Return how far vehicle ``i`` flies along a route (k, 2), turns included."""
    return flown_m(vehicles.en_m[i, 0], vehicles.en_m[i, 1], float(vehicles.headings_rad[i]), route, turns)


def _path(sweep: Sweep, lines_u: FloatArray, inset_m: float, parts: int, *, upwards: bool) -> _Path:
    vertices: list[FloatArray] = []
    first: list[int] = []
    last: list[int] = []
    lines: list[FloatArray] = []
    for pieces in sweep.lines(lines_u, inset_m):
        if not pieces:
            continue
        stops = np.vstack(pieces)
        lines.append(stops if upwards else stops[::-1])
        upwards = not upwards
    # All legs at once, those along lines and those between them.
    legs = sweep.free.legs(np.vstack(lines)) if lines else []
    at = 0
    for line in lines:
        stops = np.vstack([line[:1], *legs[at : at + len(line) - 1]])
        if parts > 1:
            stops = _subdivided(stops, parts)
        if vertices:
            vertices.extend(legs[at - 1])
        else:
            vertices.append(stops[0])
        at += len(line)
        begin, end = len(vertices) - 1, len(vertices) + len(stops) - 2
        vertices.extend(stops[1:])
        first.extend([begin] if parts == 1 else range(begin, end))
        last.extend([end] if parts == 1 else range(begin + 1, end + 1))
    return _Path(np.array(vertices).reshape(-1, 2), first, last)


def _subdivided(stops: FloatArray, parts: int) -> FloatArray:
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(stops, axis=0).T))])
    all_at = np.unique(np.concatenate([at, np.linspace(0.0, at[-1], parts + 1)]))
    return np.column_stack([np.interp(all_at, at, stops[:, k]) for k in (0, 1)])


def _dealt(
    free: FreeSpace, vehicles: Vehicles, turns: Turns, path: _Path, order: tuple[int, ...]
) -> list[FloatArray] | None:
    """Return the routes when the vehicles take parts of the path in this order; None when they cannot fly it all."""
    routes: list[FloatArray] = [np.zeros((0, 2))] * len(order)
    begin, end = 0, len(path.first)
    for i in order:
        best = 0, np.inf
        approaches: dict[int, FloatArray] = {}

        def approach(vertex: int) -> FloatArray:
            if vertex not in approaches:  # noqa: B023 - called at once
                way = free.connect(vehicles.en_m[i], path.vertices[vertex : vertex + 1])  # noqa: B023 - called at once
                approaches[vertex] = way  # noqa: B023 - called at once
            return approaches[vertex]  # noqa: B023 - called at once

        for back in (False, True):

            def route(k: int, back: bool = back) -> FloatArray:
                first, last = path.first[begin], path.last[begin + k - 1]  # noqa: B023 - called at once
                stops = path.vertices[first : last + 1]
                return np.vstack([approach(last if back else first), (stops[::-1] if back else stops)[1:]])

            low, high = 0, end - begin + 1
            while high - low > 1:
                middle = (low + high) // 2
                low, high = (
                    (middle, high) if way_m(vehicles, turns, i, route(middle)) <= vehicles.left_m[i] else (low, middle)
                )
            if low and (-low, way_m(vehicles, turns, i, route(low))) < (-best[0], best[1]):
                best = low, way_m(vehicles, turns, i, route(low))
                routes[i] = route(low)
        begin += best[0]
        if begin == end:
            return [_without_straight(route) for route in routes]
    return None


def _without_straight(route: FloatArray) -> FloatArray:
    """Return a route without the vertices at which it goes straight on."""
    if len(route) < 3:
        return route
    before, after = np.diff(route[:-1], axis=0), np.diff(route[1:], axis=0)
    cross = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    straight = (cross < 1e-9 * (1.0 + np.abs(before).sum(axis=1))) & ((before * after).sum(axis=1) > 0.0)
    return np.asarray(route[np.concatenate([[True], ~straight, [True]])])
