"""A tour over what is left of a mission, from place to place: where sweeps would see little that is new."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray
from app.exploration.rollout.initial_plans import row_orders

PLACE = 0.35
"""Radius, in visibilities, around a place within which landmarks are seen from there."""

FROM_ABOVE = 0.75
"""A landmark farther below where vehicles fly, in visibilities, is gone down to."""

CLOSE, APART = 0.25, 0.6
"""Gaps between vehicles that go down together, in visibilities at most, and on the way, in those that links allow."""


class Tour(NamedTuple):
    """Team waypoints (k, n_vehicles, 2) in the order of ``chain``; at some (k,) the team goes down."""

    at_m: FloatArray
    chain: NDArray[np.int64]
    dives: BoolArray


def tour_of(
    left_m: FloatArray, above_m: FloatArray, here_m: FloatArray, com_range_m: float, link_m: float, visibility_m: float
) -> Tour:
    """Return a short tour over all places where landmarks are left.

    Parameters
    ----------
    left_m : (m, 3)
        The landmarks, at least one.
    above_m : (m,)
        How deep vehicles may be above each that only pass.
    here_m : (n_vehicles, 2)
        Where the vehicles are.
    link_m : float
        Distance of neighbours that plans keep to.
    """
    places, deep = _places(left_m, above_m, PLACE * visibility_m, FROM_ABOVE * visibility_m)
    order = shortest_order(here_m.mean(axis=0), places)
    chain = row_orders(here_m, com_range_m)[0]
    n = len(here_m)
    along = here_m[chain[-1]] - here_m[chain[0]]
    length = float(np.hypot(*along))
    along = along / length if length > 1e-9 else np.array([1.0, 0.0])
    gaps = np.where(deep[order], min(CLOSE * visibility_m, APART * link_m), APART * link_m)
    offsets = np.empty(n)
    offsets[chain] = np.arange(n) - (n - 1) / 2
    at = places[order][:, None] + gaps[:, None, None] * offsets[:, None] * along
    return Tour(at, chain, deep[order])


def _places(
    left_m: FloatArray, above_m: FloatArray, radius_m: float, from_above_m: float
) -> tuple[FloatArray, BoolArray]:
    """Return few places (k, 2) from which all landmarks (m, 3) are seen, and at which (k,) of them one has to go down.

    Greedily: where most landmarks are near comes first.
    """
    deep = left_m[:, 2] - above_m > from_above_m
    open_ = np.ones(len(left_m), dtype=np.bool_)
    near = np.hypot(*(left_m[:, None, :2] - left_m[None, :, :2]).transpose(2, 0, 1)) <= radius_m
    places, dives = [], []
    while open_.any():
        count = (near & open_).sum(axis=1) * open_
        seen = near[int(np.argmax(count))] & open_
        places.append(left_m[seen, :2].mean(axis=0))
        dives.append(bool(deep[seen].any()))
        open_ &= ~seen
    return np.array(places), np.array(dives)


def shortest_order(start_m: FloatArray, places_m: FloatArray) -> NDArray[np.int64]:
    """Return an order (k,) of places (k, 2) that makes the way from ``start_m`` over all of them short.

    The nearest place first, then sections are turned round while that helps (2-opt, open end).
    """
    k = len(places_m)
    points = np.vstack([start_m, places_m])
    away = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    order, rest = [0], set(range(1, k + 1))
    while rest:
        order.append(min(rest, key=lambda j: float(away[order[-1], j])))
        rest.remove(order[-1])
    better = True
    while better:
        better = False
        for i in range(1, k):
            for j in range(i + 1, k + 1):
                after = away[order[i], order[j + 1]] if j < k else 0.0
                before = away[order[j], order[j + 1]] if j < k else 0.0
                if away[order[i - 1], order[j]] + after < away[order[i - 1], order[i]] + before - 1e-12:
                    order[i : j + 1] = order[i : j + 1][::-1]
                    better = True
    return np.array(order[1:], dtype=np.int64) - 1
