"""First routes of vehicles that need no links: a strip of the area for each, flown in lines there and back."""

import itertools
from collections.abc import Iterator
from functools import partial

import numpy as np

from app.arrays import FloatArray
from app.exploration.lines.lattice import longer_axis_rad

MOST_LINES = 5
"""Lines tried per strip and direction."""

INSETS = (0.1, 0.3)
"""How far from the end of what is left lines turn, in visibilities."""

MOST_VEHICLES = 3
"""Up to this many vehicles every way of giving them the strips is tried; otherwise as they stand across the lines."""


def sectors(left_m: FloatArray, here_m: FloatArray, area: FloatArray, sight_m: float) -> Iterator[list[FloatArray]]:
    """Yield sets of routes, each a list of waypoints (k, 2) per vehicle.

    Parameters
    ----------
    left_m : (m, 2)
        Positions of the landmarks to be done, at least one.
    here_m : (n_vehicles, 2)
        Where the vehicles are.
    area : (k, 2)
        Its longer axis and the one across it are the directions of the lines.
    """
    direction = longer_axis_rad(area)
    for lines, inset in itertools.product(range(1, MOST_LINES + 1), INSETS):
        ways = [
            list(_lines(left_m, here_m, angle, lines, inset * sight_m)) for angle in (direction, direction + np.pi / 2)
        ]
        for along, across in (ways, ways[::-1]):
            yield from along
            # Lines across those of a first pass see landmarks from other sides.
            for routes in along:
                ends = np.array([route[-1] for route in routes])
                follow = min(across, key=partial(_transit, ends))
                yield [np.vstack(pair) for pair in zip(routes, follow, strict=True)]


def _transit(here_m: FloatArray, routes: list[FloatArray]) -> float:
    """Return the longest way of a vehicle to the first waypoint of its route."""
    return max(float(np.hypot(*(route[0] - at))) for at, route in zip(here_m, routes, strict=True))


def _lines(
    left_m: FloatArray, here_m: FloatArray, angle: float, lines: int, inset_m: float
) -> Iterator[list[FloatArray]]:
    """Yield routes of ``lines`` lines in every vehicle's strip, for every corner to begin at and order of vehicles."""
    n = len(here_m)
    along = np.array([np.cos(angle), np.sin(angle)])
    axes = np.stack([np.array([along[1], -along[0]]), along])
    u, v = (left_m @ axes.T).T
    inset = min(inset_m, float(np.ptp(v)) / 2)
    ends = np.array([v.min() + inset, v.max() - inset])
    width = float(np.ptp(u)) / n
    middles = (np.arange(lines) + 0.5) * width / lines
    for order in _orders(here_m @ axes[0]):
        for outwards, upwards in itertools.product((True, False), repeat=2):
            row = middles if outwards else middles[::-1]
            v_of = np.array([ends if upwards == (k % 2 == 0) else ends[::-1] for k in range(lines)]).ravel()
            u_of = np.repeat(row, 2)
            yield [np.column_stack([u.min() + strip * width + u_of, v_of]) @ axes for strip in order]


def _orders(u: FloatArray) -> list[tuple[int, ...]]:
    """Return which strip each vehicle takes."""
    n = len(u)
    if n <= MOST_VEHICLES:
        return list(itertools.permutations(range(n)))
    rank = np.argsort(np.argsort(u, kind="stable"))
    return [tuple(int(k) for k in rank), tuple(int(n - 1 - k) for k in rank)]
