"""Improves a team plan by many small random changes, each judged by a flight to the end of the mission, compiled."""

import numpy as np
from numba import njit

from app.arrays import FloatArray
from app.exploration.rollout.allowed_raster import AllowedRaster, clear_ways, insert, settle_waypoint
from app.exploration.rollout.flight import DIVE, STEEP, FlownPlan, Plan, Rules, Task, Work, fly_plan

DRAWS = 8
"""Random numbers that one change uses, uniform in [0, 1)."""

KINDS = 12
LEAST_HEIGHT = 0.25
GREATEST_HEIGHT = 0.8
"""Bounds of the flying height, in visibilities."""

MOST_SINKING = 0.85
GATHERED = 0.8
"""Longest row of a team that goes down in one place, in visibilities."""


@njit(cache=True, nogil=True)
def _bell(u: float, v: float) -> float:
    return float(np.sqrt(-2.0 * np.log(1.0 - u)) * np.cos(2.0 * np.pi * v))


@njit(cache=True, nogil=True)
def _copy(source: Plan, target: Plan, count: int) -> None:
    target.at_m[:count] = source.at_m[:count]
    target.height_m[:count] = source.height_m[:count]
    target.sinking[:count] = source.sinking[:count]


@njit(cache=True, nogil=True)
def _middle(at: FloatArray) -> tuple[float, float]:
    x = 0.0
    y = 0.0
    for i in range(len(at)):
        x += at[i, 0] / len(at)
        y += at[i, 1] / len(at)
    return x, y


@njit(cache=True, nogil=True)
def _unfinished(left_need: FloatArray, u: float) -> int:
    """Return a landmark that the plan leaves over, chosen by ``u`` in [0, 1); -1 when it leaves none."""
    count = 0
    for m in range(len(left_need)):
        if left_need[m] > 0.0:
            count += 1
    wanted = int(u * count)
    for m in range(len(left_need)):
        if left_need[m] > 0.0:
            if wanted == 0:
                return m
            wanted -= 1
    return -1


@njit(cache=True, nogil=True)
def _visit(plan: Plan, count: int, start: FloatArray, x: float, y: float, u: FloatArray) -> int:
    """Insert a waypoint that brings a vehicle to (x, y) where the detour is shortest; return its index."""
    best = np.inf
    place = 0
    for k in range(count + 1):
        before = start if k == 0 else plan.at_m[k - 1]
        ax, ay = _middle(before)
        extra = np.hypot(x - ax, y - ay)
        if k < count:
            bx, by = _middle(plan.at_m[k])
            extra += np.hypot(bx - x, by - y) - np.hypot(bx - ax, by - ay)
        # A blur per place lets second-best insertions have their turn.
        extra *= 1.0 + 0.6 * ((u[4] * 7919.0 * (k + 1)) % 1.0)
        if extra < best:
            best = extra
            place = k
    insert(plan, count, place)
    like = start if place == 0 else plan.at_m[place - 1]
    if place < count and u[5] < 0.5:
        like = plan.at_m[place + 1]
    n = len(start)
    nearest = 0
    for i in range(n):
        if np.hypot(like[i, 0] - x, like[i, 1] - y) < np.hypot(like[nearest, 0] - x, like[nearest, 1] - y):
            nearest = i
    dx = x - like[nearest, 0]
    dy = y - like[nearest, 1]
    # Not all the way: it is enough to see the landmark well.
    f = 0.5 + 0.5 * u[6]
    for i in range(n):
        plan.at_m[place, i, 0] = like[i, 0] + f * dx
        plan.at_m[place, i, 1] = like[i, 1] + f * dy
    plan.height_m[place] = plan.height_m[min(max(place - 1, 0), count)]
    plan.sinking[place] = 0.0
    return place


@njit(cache=True, nogil=True)
def _dive(plan: Plan, k: int, x: float, y: float, size: float) -> None:
    """Let the team go down at (x, y), closed up to ``size`` in the row that it is in: each relays to the one below."""
    n = plan.at_m.shape[1]
    if n > 1:
        first, last = plan.chain[0], plan.chain[n - 1]
        dx = plan.at_m[k, last, 0] - plan.at_m[k, first, 0]
        dy = plan.at_m[k, last, 1] - plan.at_m[k, first, 1]
        length = max(np.hypot(dx, dy), 1e-9)
        for e in range(n):
            away = size * (e / (n - 1) - 0.5) / length
            plan.at_m[k, plan.chain[e], 0] = x + away * dx
            plan.at_m[k, plan.chain[e], 1] = y + away * dy
    else:
        plan.at_m[k, 0, 0] = x
        plan.at_m[k, 0, 1] = y
    plan.sinking[k] = DIVE


@njit(cache=True, nogil=True)
def _shift(plan: Plan, first: int, last: int, dx: float, dy: float) -> None:
    """Shift the whole team at waypoints ``first`` to ``last``."""
    for w in range(first, last + 1):
        for i in range(plan.at_m.shape[1]):
            plan.at_m[w, i, 0] += dx
            plan.at_m[w, i, 1] += dy


@njit(cache=True, nogil=True)
def _turn(plan: Plan, k: int, angle: float, scale: float) -> None:
    """Turn the team around its middle, spread it or close it up."""
    x, y = _middle(plan.at_m[k])
    c, s = scale * np.cos(angle), scale * np.sin(angle)
    for i in range(plan.at_m.shape[1]):
        px = plan.at_m[k, i, 0] - x
        py = plan.at_m[k, i, 1] - y
        plan.at_m[k, i, 0] = x + c * px - s * py
        plan.at_m[k, i, 1] = y + s * px + c * py


@njit(cache=True, nogil=True)
def _leave_out(plan: Plan, count: int, k: int) -> None:
    for w in range(k, count - 1):
        plan.at_m[w] = plan.at_m[w + 1]
        plan.height_m[w] = plan.height_m[w + 1]
        plan.sinking[w] = plan.sinking[w + 1]


@njit(cache=True, nogil=True)
def _bend(plan: Plan, count: int, k: int, before: FloatArray, part: float, dx: float, dy: float) -> None:
    """Insert a waypoint at a part of the leg to waypoint ``k``, shifted."""
    middle = before + part * (plan.at_m[k] - before)
    insert(plan, count, k)
    for i in range(plan.at_m.shape[1]):
        plan.at_m[k, i, 0] = middle[i, 0] + dx
        plan.at_m[k, i, 1] = middle[i, 1] + dy


@njit(cache=True, nogil=True)
def _swap(a: FloatArray, b: FloatArray) -> None:
    for c in range(2):
        kept = a[c]
        a[c] = b[c]
        b[c] = kept


@njit(cache=True, nogil=True)
def _reverse(plan: Plan, low: int, high: int) -> None:
    """Fly a section the other way round."""
    while low < high:
        for i in range(plan.at_m.shape[1]):
            _swap(plan.at_m[low, i], plan.at_m[high, i])
        kept = plan.height_m[low]
        plan.height_m[low] = plan.height_m[high]
        plan.height_m[high] = kept
        kept = plan.sinking[low]
        plan.sinking[low] = plan.sinking[high]
        plan.sinking[high] = kept
        low += 1
        high -= 1


@njit(cache=True, nogil=True)
def _relocate(plan: Plan, k: int, to: int) -> None:
    """Move one waypoint elsewhere in the order."""
    moved = plan.at_m[k].copy()
    height = plan.height_m[k]
    sinking = plan.sinking[k]
    step = 1 if k < to else -1
    for w in range(k, to, step):
        plan.at_m[w] = plan.at_m[w + step]
        plan.height_m[w] = plan.height_m[w + step]
        plan.sinking[w] = plan.sinking[w + step]
    plan.at_m[to] = moved
    plan.height_m[to] = height
    plan.sinking[to] = sinking


@njit(cache=True, nogil=True)
def _swap_ends(plan: Plan, first: int, last: int) -> None:
    """Swap the ends of the row at some waypoints."""
    n = plan.at_m.shape[1]
    for w in range(first, last + 1):
        for e in range(n // 2):
            _swap(plan.at_m[w, plan.chain[e]], plan.at_m[w, plan.chain[n - 1 - e]])


@njit(cache=True, nogil=True)
def _shorten(plan: Plan, k: int, before: FloatArray, part: float) -> None:
    """Draw a waypoint towards the one before: lines need not be flown to their ends."""
    for i in range(plan.at_m.shape[1]):
        for c in range(2):
            plan.at_m[k, i, c] += part * (before[i, c] - plan.at_m[k, i, c])


@njit(cache=True, nogil=True)
def change(
    plan: Plan, count: int, start: FloatArray, work: Work, rules: Rules, left_need: FloatArray, u: FloatArray
) -> tuple[int, int, int]:
    """Change the plan at random; return its number of waypoints and the first and last one changed (-1: nothing)."""
    n = plan.at_m.shape[1]
    has_room = count < len(plan.height_m)
    kind = int(u[0] * KINDS)
    k = int(u[1] * count)
    size = rules.visibility_m * (0.06 if u[7] < 0.35 else (0.2 if u[7] < 0.75 else 0.7))
    before = start if k == 0 else plan.at_m[k - 1]
    if kind == 0 or kind == 1:  # one waypoint; or one with the next, which shifts a leg sideways
        last = min(k + kind, count - 1)
        _shift(plan, k, last, size * _bell(u[2], u[3]), size * _bell(u[4], u[5]))
        return count, k, last
    if kind == 2:
        if u[2] < 0.6:
            _turn(plan, k, size / rules.visibility_m * 2.0 * _bell(u[3], u[4]), 1.0)
        else:
            _turn(plan, k, 0.0, np.exp(0.3 * _bell(u[3], u[4])))
        return count, k, k
    if kind == 3 or kind == 4:  # shift one vehicle
        i = int(u[2] * n)
        plan.at_m[k, i, 0] += size * _bell(u[3], u[4])
        plan.at_m[k, i, 1] += size * _bell(u[5], u[6])
        return count, k, k
    if kind == 5 and u[4] < 0.5 and rules.directed:  # sink quicker or slower
        plan.sinking[k] = min(1.0, 2.0 * u[5])
        return count, k, k
    if kind == 5 and u[4] < 0.5:  # sink quicker or slower, or go down at the waypoint
        plan.sinking[k] = u[5] if u[5] < MOST_SINKING else (DIVE if u[6] < 0.5 else 0.0)
        return count, k, k
    if kind == 5:  # fly higher or lower
        height = plan.height_m[k] * np.exp(0.15 * _bell(u[2], u[3]))
        plan.height_m[k] = min(max(height, LEAST_HEIGHT * rules.visibility_m), GREATEST_HEIGHT * rules.visibility_m)
        return count, k, k
    if kind == 6 and count >= 2:
        _leave_out(plan, count, k)
        return count - 1, k, k
    if kind == 7 and has_room:
        _bend(plan, count, k, before, u[2], size * _bell(u[3], u[4]), size * _bell(u[5], u[6]))
        return count + 1, k, k + 1
    if kind == 8 and has_room:
        m = _unfinished(left_need, u[2])
        if m >= 0:
            x, y = work.xyz[0, m], work.xyz[1, m]
            place = _visit(plan, count, start, x, y, u)
            if rules.directed:
                plan.sinking[place] = STEEP
            if u[3] < 0.5 and not rules.directed:
                _dive(plan, place, x, y, GATHERED * rules.visibility_m * u[1])
                plan.height_m[place] = LEAST_HEIGHT * rules.visibility_m
            return count + 1, place, place + 1
    other = int(u[2] * count)
    if kind == 9 and other != k:
        low, high = min(k, other), max(k, other)
        if u[3] < 0.5:
            _reverse(plan, low, high)
        else:
            _relocate(plan, k, other)
        return count, low, min(high + 1, count - 1)
    if kind == 10:  # at one waypoint, or from there on
        last = count - 1 if u[2] < 0.5 else k
        _swap_ends(plan, k, last)
        return count, k, min(last + 1, count - 1)
    if kind == 11:
        _shorten(plan, k, before, 0.3 * u[2])
        return count, k, k
    return count, -1, -1


@njit(cache=True, nogil=True)
def improve(
    flown: FlownPlan,
    count: int,
    score: float,
    trial: FlownPlan,
    draws: FloatArray,
    task: Task,
    free: AllowedRaster,
    link: float,
) -> tuple[int, float]:
    """Try one change per row of ``draws`` and keep those that better the score.

    ``flown`` is the best plan and is kept up to date, ``trial`` scratch. Returns the plan's number of waypoints and its
    score.
    """
    plan, checkpoints = flown.plan, flown.checkpoints
    start = checkpoints.at_m[0][:, :2].copy()
    for d in range(len(draws)):
        _copy(plan, trial.plan, count)
        changed, first, last = change(trial.plan, count, start, task.work, task.rules, flown.left_need, draws[d])
        if first < 0:
            continue
        ok = True
        for k in range(first, min(last, changed - 1) + 1):
            ok = ok and settle_waypoint(free, trial.plan.at_m[k], plan.chain, link)
        if not ok:
            continue
        changed = clear_ways(free, trial.plan, changed, start, first, last + 1, link)
        if changed < 0:
            continue
        origin = min(first, count)
        value = fly_plan(checkpoints, origin, trial.plan, changed, task, score, trial.left_need, trial.checkpoints)
        if value < score:
            score = value
            count = changed
            _copy(trial.plan, plan, count)
            flown.left_need[:] = trial.left_need
            for k in range(origin + 1, count + 1):
                checkpoints.at_m[k] = trial.checkpoints.at_m[k]
                checkpoints.need[k] = trial.checkpoints.need[k]
                checkpoints.state[k] = trial.checkpoints.state[k]
    return count, score
