"""In which order and direction lines are flown so that little way lies between them."""

from collections.abc import Sequence

import numpy as np

from app.arrays import BoolArray, FloatArray

KEPT_ORDER = 1.05
"""The given order is kept where the whole way, lines included, grows to no more than so many times what it could be."""
MOST_IMPROVED = 400
"""So many lines are put in a better order by exchanges; of more the nearest is flown next, or all as they are given."""
MOST_PASSES = 40
LONGEST_MOVED = 3
"""So many lines in a row are tried at other places of the order."""
LEAST_GAIN_M = 1e-6

Order = list[tuple[int, bool]]
"""Numbers of lines as they are flown, and whether each is flown backwards."""


def flying_orders(
    ends_m: FloatArray, lengths_m: FloatArray, may_turn: BoolArray, starts_m: FloatArray, *, in_order: bool
) -> list[Order]:
    """Return orders with little way between the lines: the same one with its first line flown either way, if it may be.

    Parameters
    ----------
    ends_m : (n, 2, 2)
        Where each line begins and ends, in the order that is given.
    lengths_m : (n,)
        Of the lines.
    may_turn : (n,)
        Which may be flown backwards.
    starts_m : (m, 2)
        Where vehicles are.
    in_order
        Keep the given order, whatever that costs.
    """
    n = len(ends_m)
    if n == 0:
        return []
    given = list(range(n))
    sequence, lines_m = given, float(lengths_m.sum())
    given_m = min(_directed(ends_m[given], may_turn[given], back)[1] for back in (False, True))
    if not in_order and given_m > (KEPT_ORDER - 1.0) * lines_m:
        tries = [_nearest_next(ends_m, may_turn, first, back) for first, back in _firsts(ends_m, may_turn, starts_m)]
        best = min(tries, key=lambda order: _between_m(ends_m, order))
        if n <= MOST_IMPROVED:
            best = _improved(ends_m, may_turn, best)
        if lines_m + given_m > KEPT_ORDER * (lines_m + _between_m(ends_m, best)):
            sequence = [number for number, _ in best]
    orders = []
    for back in (False, True):
        directions, between_m = _directed(ends_m[sequence], may_turn[sequence], back)
        if np.isfinite(between_m):
            orders.append(list(zip(sequence, directions, strict=True)))
    return orders


def _between_m(ends_m: FloatArray, order: Order) -> float:
    """Return how long the straight ways between lines are."""
    begin, end = _oriented(ends_m, order)
    return float(np.hypot(*(begin[1:] - end[:-1]).T).sum())


def _oriented(ends_m: FloatArray, order: Order) -> tuple[FloatArray, FloatArray]:
    """Return where lines begin and end as they are flown, (n, 2) each."""
    numbers, back = np.array([number for number, _ in order]), np.array([int(b) for _, b in order])
    return ends_m[numbers, back], ends_m[numbers, 1 - back]


def _directed(ends_m: FloatArray, may_turn: BoolArray, first_back: bool) -> tuple[list[bool], float]:
    """Return the directions of lines in their order that leave the least way between them, and how long that is.

    ``first_back``: whether the first one is flown backwards; infinite where it may not be.
    """
    n = len(ends_m)
    cost = np.array([np.inf, np.inf])
    cost[int(first_back)] = 0.0 if may_turn[0] or not first_back else np.inf
    came = np.zeros((n, 2), dtype=np.int64)
    for i in range(1, n):
        # From where the line before ends, flown forwards or backwards, to where this one begins.
        ways = np.hypot(*np.moveaxis(ends_m[i - 1, ::-1, None] - ends_m[i, None, :], -1, 0))
        totals = cost[:, None] + ways
        came[i] = totals.argmin(axis=0)
        cost = totals.min(axis=0)
        if not may_turn[i]:
            cost[1] = np.inf
    if not np.isfinite(cost).any():
        return [], np.inf
    at = int(cost.argmin())
    total_m, directions = float(cost[at]), [at == 1]
    for i in range(n - 1, 0, -1):
        at = int(came[i, at])
        directions.append(at == 1)
    return directions[::-1], total_m


def _firsts(ends_m: FloatArray, may_turn: BoolArray, starts_m: FloatArray) -> list[tuple[int, bool]]:
    """Return with which lines to begin: the first one, and those that begin nearest to a vehicle."""
    found = {(0, False)}
    for start in starts_m:
        away = np.hypot(*np.moveaxis(ends_m - start, -1, 0))
        away[~may_turn, 1] = np.inf
        number, back = np.unravel_index(int(away.argmin()), away.shape)
        found.add((int(number), bool(back)))
    # What is farthest from the middle of all lies at an end of the way.
    away = np.hypot(*np.moveaxis(ends_m - ends_m.mean(axis=(0, 1)), -1, 0))
    away[~may_turn, 1] = -1.0
    number, back = np.unravel_index(int(away.argmax()), away.shape)
    found.add((int(number), bool(back)))
    return sorted(found)


def _nearest_next(ends_m: FloatArray, may_turn: BoolArray, first: int, back: bool) -> Order:
    left = np.ones(len(ends_m), dtype=np.bool_)
    order: Order = [(first, back)]
    left[first] = False
    while left.any():
        number, back = order[-1]
        away = np.hypot(*np.moveaxis(ends_m - ends_m[number, 0 if back else 1], -1, 0))
        away[~left] = np.inf
        away[~may_turn, 1] = np.inf
        number, which = (int(k) for k in np.unravel_index(int(away.argmin()), away.shape))
        order.append((number, which == 1))
        left[number] = False
    return order


def _improved(ends_m: FloatArray, may_turn: BoolArray, order: Order) -> Order:
    """Return an order after exchanges that shorten it: parts turned round, and a few lines put elsewhere."""
    for _ in range(MOST_PASSES):
        before = _between_m(ends_m, order)
        for i in range(len(order)):
            order = _turned(ends_m, may_turn, order, i)
            for count in range(1, LONGEST_MOVED + 1):
                order = _moved(ends_m, may_turn, order, i, count)
        if _between_m(ends_m, order) > before - LEAST_GAIN_M:
            break
    return order


def _turned(ends_m: FloatArray, may_turn: BoolArray, order: Order, i: int) -> Order:
    """Return the order with the part from ``i`` on turned round that gains most (2-opt)."""
    begin, end = _oriented(ends_m, order)
    n = len(order)
    gain = np.zeros(n)
    js = np.arange(i, n)
    if i > 0:
        gain[i:] += np.hypot(*(begin[i] - end[i - 1])) - np.hypot(*(end[js] - end[i - 1]).T)
    inner = js[:-1]
    gain[i : n - 1] += np.hypot(*(begin[inner + 1] - end[inner]).T) - np.hypot(*(begin[inner + 1] - begin[i]).T)
    fixed = ~may_turn[[number for number, _ in order[i:]]]
    gain[i:][np.cumsum(fixed) > 0] = 0.0
    j = int(gain.argmax())
    if gain[j] <= LEAST_GAIN_M:
        return order
    return [*order[:i], *_reversed(order[i : j + 1]), *order[j + 1 :]]


def _moved(ends_m: FloatArray, may_turn: BoolArray, order: Order, i: int, count: int) -> Order:
    """Return the order with ``count`` lines from ``i`` on put where that gains most (or-opt)."""
    part, rest = order[i : i + count], order[:i] + order[i + count :]
    if not rest or len(part) < count:
        return order
    now_m, rest_m = _between_m(ends_m, order), _between_m(ends_m, rest)
    begin, end = _oriented(ends_m, rest)
    between = np.hypot(*(begin[1:] - end[:-1]).T)
    turnable = bool(may_turn[[number for number, _ in part]].all())
    best: tuple[float, Order] = (now_m - LEAST_GAIN_M, order)
    for put in (part, _reversed(part)) if turnable else (part,):
        first, last = _oriented(ends_m, put)
        to_m, from_m = np.hypot(*(end - first[0]).T), np.hypot(*(begin - last[-1]).T)
        added = np.concatenate([[from_m[0]], to_m[:-1] + from_m[1:] - between, [to_m[-1]]])
        k = int(added.argmin())
        total_m = rest_m + _between_m(ends_m, put) + float(added[k])
        if total_m < best[0]:
            best = total_m, [*rest[:k], *put, *rest[k:]]
    return best[1]


def _reversed(part: Sequence[tuple[int, bool]]) -> Order:
    return [(number, not back) for number, back in reversed(part)]
