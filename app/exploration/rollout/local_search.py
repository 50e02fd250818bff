"""Improves a team plan by many small random changes, each judged by a flight to the end of the mission, compiled."""

import numpy as np
from numba import njit

from app.arrays import FloatArray
from app.exploration.rollout.flight import Course, Plan, Rules, Work, fly_plan
from app.exploration.rollout.floor import Floor
from app.exploration.rollout.free_space import Free, clear_ways, insert, settle_waypoint

DRAWS = 8
"""Random numbers that one change uses, uniform in [0, 1)."""

KINDS = 12
LEAST_HEIGHT = 0.25
GREATEST_HEIGHT = 0.8
"""Bounds of the flying height, in visibilities."""


@njit(cache=True, nogil=True)
def _bell(u: float, v: float) -> float:
    return float(np.sqrt(-2.0 * np.log(1.0 - u)) * np.cos(2.0 * np.pi * v))


@njit(cache=True, nogil=True)
def _copy(source: Plan, target: Plan, count: int) -> None:
    target.at_m[:count] = source.at_m[:count]
    target.height_m[:count] = source.height_m[:count]


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
    return place


@njit(cache=True, nogil=True)
def change(
    plan: Plan, count: int, start: FloatArray, work: Work, rules: Rules, left_need: FloatArray, u: FloatArray
) -> tuple[int, int, int]:
    """Change the plan at random; return its number of waypoints and the first and last one changed (-1: nothing)."""
    n = plan.at_m.shape[1]
    room = len(plan.height_m)
    kind = int(u[0] * KINDS)
    k = int(u[1] * count)
    size = rules.visibility_m * (0.06 if u[7] < 0.35 else (0.2 if u[7] < 0.75 else 0.7))
    if kind == 0 or kind == 1:
        # Shift a waypoint; or one with the next, which shifts a leg sideways.
        last = min(k + kind, count - 1)
        dx = size * _bell(u[2], u[3])
        dy = size * _bell(u[4], u[5])
        for w in range(k, last + 1):
            for i in range(n):
                plan.at_m[w, i, 0] += dx
                plan.at_m[w, i, 1] += dy
        return count, k, last
    if kind == 2:
        # Turn the team, or spread or close it up, around its middle.
        x, y = _middle(plan.at_m[k])
        angle = 0.0
        scale = 1.0
        if u[2] < 0.6:
            angle = size / rules.visibility_m * 2.0 * _bell(u[3], u[4])
        else:
            scale = np.exp(0.3 * _bell(u[3], u[4]))
        c, s = scale * np.cos(angle), scale * np.sin(angle)
        for i in range(n):
            px = plan.at_m[k, i, 0] - x
            py = plan.at_m[k, i, 1] - y
            plan.at_m[k, i, 0] = x + c * px - s * py
            plan.at_m[k, i, 1] = y + s * px + c * py
        return count, k, k
    if kind == 3 or kind == 4:
        i = int(u[2] * n)
        plan.at_m[k, i, 0] += size * _bell(u[3], u[4])
        plan.at_m[k, i, 1] += size * _bell(u[5], u[6])
        return count, k, k
    if kind == 5:
        height = plan.height_m[k] * np.exp(0.15 * _bell(u[2], u[3]))
        plan.height_m[k] = min(max(height, LEAST_HEIGHT * rules.visibility_m), GREATEST_HEIGHT * rules.visibility_m)
        return count, k, k
    if kind == 6:
        if count < 2:
            return count, -1, -1
        for w in range(k, count - 1):
            plan.at_m[w] = plan.at_m[w + 1]
            plan.height_m[w] = plan.height_m[w + 1]
        return count - 1, k, k
    if kind == 7:
        if count >= room:
            return count, -1, -1
        before = start if k == 0 else plan.at_m[k - 1]
        middle = before + u[2] * (plan.at_m[k] - before)
        insert(plan, count, k)
        dx = size * _bell(u[3], u[4])
        dy = size * _bell(u[5], u[6])
        for i in range(n):
            plan.at_m[k, i, 0] = middle[i, 0] + dx
            plan.at_m[k, i, 1] = middle[i, 1] + dy
        return count + 1, k, k + 1
    if kind == 8:
        m = _unfinished(left_need, u[2])
        if m < 0 or count >= room:
            return count, -1, -1
        place = _visit(plan, count, start, work.xyz[0, m], work.xyz[1, m], u)
        return count + 1, place, place + 1
    if kind == 9:
        # Fly a section the other way round, or move one waypoint elsewhere.
        other = int(u[2] * count)
        low, high = min(k, other), max(k, other)
        if low == high:
            return count, -1, -1
        if u[3] < 0.5:
            a, b = low, high
            while a < b:
                for i in range(n):
                    for c2 in range(2):
                        swap = plan.at_m[a, i, c2]
                        plan.at_m[a, i, c2] = plan.at_m[b, i, c2]
                        plan.at_m[b, i, c2] = swap
                swap = plan.height_m[a]
                plan.height_m[a] = plan.height_m[b]
                plan.height_m[b] = swap
                a += 1
                b -= 1
        else:
            moved = plan.at_m[k].copy()
            height = plan.height_m[k]
            if k < other:
                for w in range(k, other):
                    plan.at_m[w] = plan.at_m[w + 1]
                    plan.height_m[w] = plan.height_m[w + 1]
            else:
                for w in range(k, other, -1):
                    plan.at_m[w] = plan.at_m[w - 1]
                    plan.height_m[w] = plan.height_m[w - 1]
            plan.at_m[other] = moved
            plan.height_m[other] = height
        return count, low, min(high + 1, count - 1)
    if kind == 10:
        # Swap the ends of the row, at one waypoint or from there on.
        last = count - 1 if u[2] < 0.5 else k
        for w in range(k, last + 1):
            for e in range(n // 2):
                i, j = plan.chain[e], plan.chain[n - 1 - e]
                for c2 in range(2):
                    swap = plan.at_m[w, i, c2]
                    plan.at_m[w, i, c2] = plan.at_m[w, j, c2]
                    plan.at_m[w, j, c2] = swap
        return count, k, min(last + 1, count - 1)
    # Draw a waypoint towards the one before: lines need not be flown to their ends.
    before = start if k == 0 else plan.at_m[k - 1]
    f = 0.3 * u[2]
    for i in range(n):
        for c2 in range(2):
            plan.at_m[k, i, c2] += f * (before[i, c2] - plan.at_m[k, i, c2])
    return count, k, k


@njit(cache=True, nogil=True)
def improve(
    course: Course,
    plan: Plan,
    count: int,
    score: float,
    left_need: FloatArray,
    trial_course: Course,
    trial: Plan,
    trial_need: FloatArray,
    draws: FloatArray,
    work: Work,
    floor: Floor,
    rules: Rules,
    horizon: float,
    free: Free,
    link: float,
) -> tuple[int, float]:
    """Try one change per row of ``draws`` and keep those that better the score.

    ``course``, ``plan`` and ``left_need`` hold the best plan's flight and are kept up to date; the ``trial`` ones are
    scratch. Returns the plan's number of waypoints and its score.
    """
    start = course.at_m[0][:, :2].copy()
    for d in range(len(draws)):
        _copy(plan, trial, count)
        changed, first, last = change(trial, count, start, work, rules, left_need, draws[d])
        if first < 0:
            continue
        ok = True
        for k in range(first, min(last, changed - 1) + 1):
            ok = ok and settle_waypoint(free, trial.at_m[k], trial.chain, link)
        if not ok:
            continue
        changed = clear_ways(free, trial, changed, start, first, last + 1, link)
        if changed < 0:
            continue
        origin = min(first, count)
        value = fly_plan(course, origin, trial, changed, work, floor, rules, horizon, score, trial_need, trial_course)
        if value < score:
            score = value
            count = changed
            _copy(trial, plan, count)
            left_need[:] = trial_need
            for k in range(origin + 1, count + 1):
                course.at_m[k] = trial_course.at_m[k]
                course.need[k] = trial_course.need[k]
                course.state[k] = trial_course.state[k]
    return count, score
