"""One way over all lines of a survey, dealt to the vehicles by what each can fly.

A vehicle gets neighbouring lines, or parts of lines where these may be shared, and flies all of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.routes import Turns, Vehicles, flown_m

HALVINGS = 8
"""How often the share of what vehicles can fly is halved in: to less than a hundredth."""
MOST_SHARE = 2.0**16
"""Lines are dealt to vehicles that can fly this part of them."""
WHOLE_LINES = 4
"""Vehicles with so many lines each, on average, fly whole ones; else they may share one, in ``PARTS``."""
PARTS = 8

Dealt = TypeVar("Dealt")


@dataclass(frozen=True)
class LinePath:
    """One way over all lines: vertices (m, 2), and the first and last vertex of every part that is dealt as a whole.

    ``both_ways``: whether it may be flown from its end, too.
    """

    vertices: FloatArray
    first: list[int]
    last: list[int]
    both_ways: bool = True


def path_over(free: FreeSpace, lines: Sequence[FloatArray], parts: int, *, both_ways: bool = True) -> LinePath:
    """Return the way over lines, one after the other, round what lies between them.

    Parameters
    ----------
    lines
        The stops (k, 2) along each, k at least 2, in the direction in which it is flown.
    parts
        Into how many parts vehicles may share a line.
    """
    vertices: list[FloatArray] = []
    first: list[int] = []
    last: list[int] = []
    # All legs at once, those along lines and those between them.
    legs = free.legs(np.vstack(lines)) if lines else []
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
    return LinePath(np.array(vertices).reshape(-1, 2), first, last, both_ways)


def way_m(vehicles: Vehicles, turns: Turns, i: int, route: FloatArray) -> float:
    """Return how far vehicle ``i`` flies along a route (k, 2), turns included."""
    return flown_m(vehicles.en_m[i, 0], vehicles.en_m[i, 1], float(vehicles.headings_rad[i]), route, turns)


def dealt(
    free: FreeSpace, vehicles: Vehicles, turns: Sequence[Turns], path: LinePath, order: tuple[int, ...]
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

        for back in (False, True) if path.both_ways else (False,):

            def route(k: int, back: bool = back) -> FloatArray:
                first, last = path.first[begin], path.last[begin + k - 1]  # noqa: B023 - called at once
                stops = path.vertices[first : last + 1]
                return np.vstack([approach(last if back else first), (stops[::-1] if back else stops)[1:]])

            low, high = 0, end - begin + 1
            while high - low > 1:
                middle = (low + high) // 2
                low, high = (
                    (middle, high)
                    if way_m(vehicles, turns[i], i, route(middle)) <= vehicles.left_m[i]
                    else (low, middle)
                )
            if low and (-low, way_m(vehicles, turns[i], i, route(low))) < (-best[0], best[1]):
                best = low, way_m(vehicles, turns[i], i, route(low))
                routes[i] = route(low)
        begin += best[0]
        if begin == end:
            return [_without_straight(route) for route in routes]
    return None


def least_share(deal: Callable[[float], Dealt | None]) -> Dealt | None:
    """Return the lines dealt so that the largest share of its way that any vehicle needs is as small as may be.

    ``deal`` returns them dealt to vehicles that can fly a share of what they can; None where these cannot fly them.
    None is returned where nobody can, whatever the share.
    """
    share = 1.0
    while (found := deal(share)) is None:
        share *= 2.0
        if share > MOST_SHARE:
            return None
    while share > 1.0 / MOST_SHARE and (fewer := deal(0.5 * share)) is not None:
        found, share = fewer, 0.5 * share
    low, high = 0.5 * share, share
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        fewer = deal(middle)
        found, low, high = (found, middle, high) if fewer is None else (fewer, low, middle)
    return found


def _subdivided(stops: FloatArray, parts: int) -> FloatArray:
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(stops, axis=0).T))])
    all_at = np.unique(np.concatenate([at, np.linspace(0.0, at[-1], parts + 1)]))
    return np.column_stack([np.interp(all_at, at, stops[:, k]) for k in (0, 1)])


def _without_straight(route: FloatArray) -> FloatArray:
    """Return a route without the vertices at which it goes straight on."""
    if len(route) < 3:
        return route
    before, after = np.diff(route[:-1], axis=0), np.diff(route[1:], axis=0)
    cross = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    straight = (cross < 1e-9 * (1.0 + np.abs(before).sum(axis=1))) & ((before * after).sum(axis=1) > 0.0)
    return np.asarray(route[np.concatenate([[True], ~straight, [True]])])
