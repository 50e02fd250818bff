"""Flies a team plan over the estimated floor, step by step under the constraints, and predicts when all is done.

A plan is a list of *team waypoints*: the horizontal positions of all vehicles, shape (n_vehicles, 2), and a height
above the smoothed floor. Between two of them every vehicle goes straight, all arriving at the same time: links that
hold at both waypoints then hold all the way, because a distance between two points that move evenly is convex in time.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import FloatArray, IntArray
from app.exploration.rollout.floor import FloorEstimate, deepest_dive_m, sample

WORTH_OF_EARLY = 2.5
"""What the sum over time of the part that remains counts, against a step more in the end: early gains are surer."""

PER_WAYPOINT = 0.05
"""Steps that a simpler plan is preferred by, per waypoint."""

UNFINISHED = 12.0
PER_LEFT = 0.8
"""Steps charged to a plan that ends unfinished: once, and per landmark left over and per one's missing information."""

PER_VISIT = 3.0
"""Steps charged for every place that has to be visited for what is left."""

WELL_SEEN = 0.75
"""From so far above, in visibilities, a landmark is well seen."""

CLIMB_PASSES = 8

SINKING = 0.8
"""Part of a step by which vehicles sink at most where that may not wait."""

STEEP = 0.95
"""The same for a vehicle with a route of its own, which nobody waits for: it follows slopes of three to one."""

DIVE = 2.0
"""In place of the part of a step by which vehicles may sink: they go down at the waypoint."""

LOW = 0.25
"""Height above the floor, in visibilities, at which dives go down as far as they may."""

STILL_SINKING = 0.1
"""Part of a step: a vehicle at the waypoint of a dive that sinks by more is not down yet."""

LIFTED, LIFTED_AT_LEISURE = 0.6, 0.9
"""Parts of a step by which altimeters may lift vehicles off uneven floor without breaking limits, in the end more."""

NEAREST = 1e-12
"""Square of the least distance of a landmark, in visibilities: a sensor right on it learns no more."""


class Work(NamedTuple):
    """Landmarks still to be done, sorted by the bucket (square cell, row by row) they lie in.

    Attributes
    ----------
    xyz : (3, m)
        Where they are presumed to be, depth positive down; one row per axis, for loops over neighbours.
    direction : (3, m)
        Along which each is to be known; matters only where :class:`Rules` say so.
    need : (m,)
        Information (1/m^2) each still lacks.
    first : (n_rows * n_cols + 1,)
        Where each bucket starts.
    west_m, south_m, bucket_m : float
        Outer corner of the first bucket, side of a bucket.
    rows, cols : int
        Numbers of buckets.
    allowed : float
        How many landmarks may be left over when the plan counts as finished.
    total : float
        All landmarks of the mission, done ones included.
    most_per_step : float
        How many landmarks the team can hardly exceed per step in the long run.
    """

    xyz: FloatArray
    direction: FloatArray
    need: FloatArray
    first: IntArray
    west_m: float
    south_m: float
    bucket_m: float
    rows: int
    cols: int
    allowed: float
    total: float
    most_per_step: float


class Rules(NamedTuple):
    """What flying obeys, and what the sensor does; lengths in metres.

    ``directed``: tasks have directions of their own; otherwise all of them are depths. ``lifted``: part of a step by
    which altimeters may lift vehicles without breaking limits.
    """

    step_m: float
    com_range_m: float
    min_depth_m: float
    max_depth_m: float
    visibility_m: float
    relative_noise: float
    cut_corners: bool
    directed: bool = False
    lifted: float = LIFTED


class Task(NamedTuple):
    """What plans are judged by: what is to be done, over which floor, by which rules, in how many steps."""

    work: Work
    floor: FloorEstimate
    rules: Rules
    horizon: float


class Plan(NamedTuple):
    """A team plan with room for more waypoints than it has.

    Attributes
    ----------
    at_m : (room, n_vehicles, 2)
        Horizontal positions.
    height_m : (room,)
        Height above the smoothed floor on the way to the waypoint.
    sinking : (room,)
        Part of a step by which vehicles may sink on the way to the waypoint, at the cost of their way ahead;
        ``DIVE``: they go down at the waypoint itself as far as the floor lets them, and wait for each other.
    chain : (n_vehicles,)
        Order of the vehicles in which neighbours keep within communication range.
    """

    at_m: FloatArray
    height_m: FloatArray
    sinking: FloatArray
    chain: IntArray


def make_work(
    xyz: FloatArray,
    need: FloatArray,
    area: FloatArray,
    bucket_m: float,
    allowed: float,
    total: float,
    most_per_step: float,
    direction: FloatArray | None = None,
) -> tuple[Work, IntArray]:
    """Sort landmarks (m, 3) into buckets over the bounding box of ``area`` (n, 2); return the order too, (m,)."""
    along = np.zeros_like(xyz) if direction is None else direction
    low, high = area.min(axis=0), area.max(axis=0)
    cols, rows = (max(1, int(k)) for k in np.ceil((high - low) / bucket_m))
    col = np.clip(np.floor((xyz[:, 0] - low[0]) / bucket_m), 0, cols - 1).astype(np.int64)
    row = np.clip(np.floor((xyz[:, 1] - low[1]) / bucket_m), 0, rows - 1).astype(np.int64)
    bucket = row * cols + col
    order = np.argsort(bucket, kind="stable")
    first = np.zeros(rows * cols + 1, dtype=np.int64)
    first[1:] = np.cumsum(np.bincount(bucket, minlength=rows * cols))
    work = Work(
        np.ascontiguousarray(xyz[order].T, dtype=np.float64),
        np.ascontiguousarray(along[order].T, dtype=np.float64),
        np.ascontiguousarray(need[order], dtype=np.float64),
        first,
        float(low[0]),
        float(low[1]),
        float(bucket_m),
        rows,
        cols,
        float(allowed),
        float(max(1, total)),
        float(most_per_step),
    )
    return work, order


@njit(cache=True, nogil=True, error_model="numpy")
def look(x: float, y: float, z: float, work: Work, rules: Rules, need: FloatArray) -> int:
    """Take what a vehicle sees at (x, y, z) from ``need``; return how many landmarks that completes."""
    reach = rules.visibility_m
    v2 = reach * reach
    gain = 1.0 / (rules.relative_noise * rules.relative_noise)
    b = work.bucket_m
    low = max(0, int(np.floor((y - reach - work.south_m) / b)))
    high = min(work.rows - 1, int(np.floor((y + reach - work.south_m) / b)))
    done = 0
    for row in range(low, high + 1):
        # The chord of the circle of sight across this row of buckets.
        south = work.south_m + row * b
        gap = max(0.0, max(south - y, y - south - b))
        half = np.sqrt(max(0.0, v2 - gap * gap))
        left = max(0, int(np.floor((x - half - work.west_m) / b)))
        right = min(work.cols - 1, int(np.floor((x + half - work.west_m) / b)))
        if right < left:
            continue
        low_m, high_m = work.first[row * work.cols + left], work.first[row * work.cols + right + 1]
        xs, ys, zs = work.xyz[0, low_m:high_m], work.xyz[1, low_m:high_m], work.xyz[2, low_m:high_m]
        lacks = need[low_m:high_m]
        if rules.directed:
            done += _look_along(x, y, z, xs, ys, zs, work.direction[:, low_m:high_m], v2, gain, lacks)
            continue
        # No branches: such a loop is compiled to take several landmarks at a time.
        for m in range(len(lacks)):
            dx = xs[m] - x
            dy = ys[m] - y
            dz = zs[m] - z
            r2 = max(dx * dx + dy * dy + dz * dz, NEAREST * v2)
            before = lacks[m]
            after = before - (gain * dz * dz / (r2 * r2) if r2 < v2 else 0.0)
            lacks[m] = after
            done += 1 if (before > 0.0) & (after <= 0.0) else 0
    return done


@njit(cache=True, nogil=True, error_model="numpy")
def _look_along(
    x: float,
    y: float,
    z: float,
    xs: FloatArray,
    ys: FloatArray,
    zs: FloatArray,
    direction: FloatArray,
    v2: float,
    gain: float,
    lacks: FloatArray,
) -> int:
    """Subtract from ``lacks`` what ranges inform along the tasks' directions (3, m); return how many that completes."""
    us, vs, ws = direction[0], direction[1], direction[2]
    done = 0
    for m in range(len(lacks)):
        dx = xs[m] - x
        dy = ys[m] - y
        dz = zs[m] - z
        r2 = max(dx * dx + dy * dy + dz * dz, NEAREST * v2)
        along = us[m] * dx + vs[m] * dy + ws[m] * dz
        before = lacks[m]
        after = before - (gain * along * along / (r2 * r2) if r2 < v2 else 0.0)
        lacks[m] = after
        done += 1 if (before > 0.0) & (after <= 0.0) else 0
    return done


@njit(cache=True, nogil=True)
def advance(at: FloatArray, plan: Plan, k: int, count: int, reach: float, cut: bool, out: FloatArray) -> int:
    """Move the team horizontally along its plan, the vehicle with the longest way by ``reach``.

    Writes the new positions into ``out`` (n_vehicles, 2) and returns the index of the next waypoint to be reached.
    """
    n = len(at)
    left = reach
    for i in range(n):
        out[i, 0] = at[i, 0]
        out[i, 1] = at[i, 1]
    while k < count:
        longest = 0.0
        for i in range(n):
            longest = max(longest, np.hypot(plan.at_m[k, i, 0] - out[i, 0], plan.at_m[k, i, 1] - out[i, 1]))
        if longest > left:
            f = left / longest
            for i in range(n):
                out[i, 0] += f * (plan.at_m[k, i, 0] - out[i, 0])
                out[i, 1] += f * (plan.at_m[k, i, 1] - out[i, 1])
            return k
        for i in range(n):
            out[i, 0] = plan.at_m[k, i, 0]
            out[i, 1] = plan.at_m[k, i, 1]
        left -= longest
        k += 1
        if left < 0.02 * reach or (not cut and longest > 0.02 * reach):
            break
    return k


@njit(cache=True, nogil=True)
def _keep_links(at: FloatArray, top: FloatArray, chain: IntArray, com_range: float) -> None:
    """Raise the deeper one of neighbours in the chain until they are in range in three dimensions too.

    They are then in range even where the less deep one is lifted to its ``top`` (n_vehicles,).
    """
    n = len(chain)
    for turn in range(2):
        for e in range(n - 1):
            i = chain[e] if turn == 0 else chain[n - 1 - e]
            j = chain[e + 1] if turn == 0 else chain[n - 2 - e]
            free = com_range * com_range - (at[i, 0] - at[j, 0]) ** 2 - (at[i, 1] - at[j, 1]) ** 2
            if 0.0 < free < np.inf:
                allowed = 0.98 * np.sqrt(free)
                at[i, 2] = min(at[i, 2], min(at[j, 2], top[j]) + allowed)
                at[j, 2] = min(at[j, 2], min(at[i, 2], top[i]) + allowed)


@njit(cache=True, nogil=True)
def fly_step(
    at: FloatArray, plan: Plan, k: int, count: int, floor: FloorEstimate, rules: Rules, out: FloatArray
) -> int:
    """Fly one step from ``at`` (n_vehicles, 3) into ``out``; return the index of the next waypoint to be reached."""
    n = len(at)
    step = rules.step_m * (1.0 - 1e-9)
    here = at[:, :2]
    reach = step
    there = np.empty((n, 2))
    top = np.empty(n)
    after = k
    this = min(k, count - 1)
    height, sinking = plan.height_m[this], plan.sinking[this]
    dives = sinking == DIVE
    # A dive ends at its waypoint.
    until = min(this + 1, count) if dives else count
    for _ in range(CLIMB_PASSES):
        after = advance(here, plan, k, until, reach, rules.cut_corners, there)
        steep = dives and after > k
        for i in range(n):
            x, y = there[i, 0], there[i, 1]
            spare = np.sqrt(max(0.0, step * step - (x - at[i, 0]) ** 2 - (y - at[i, 1]) ** 2))
            lowest = at[i, 2]
            if steep:
                # Of a dive the constraints refuse, nothing would be flown, and the team would wait there for good.
                limit = deepest_dive_m(floor, x, y)
                wish = limit - max(0.0, height - LOW * rules.visibility_m)
                lowest += spare
            else:
                wish = sample(floor.smooth_m, floor.west_m, floor.south_m, floor.cell_m, x, y) - height
                limit = sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, x, y)
                lowest += spare if dives else max(spare, sinking * step)
            out[i, 2] = min(max(rules.min_depth_m, min(rules.max_depth_m, wish, limit)), lowest)
            out[i, 0] = x
            out[i, 1] = y
            shoal = sample(floor.shoal_m, floor.west_m, floor.south_m, floor.cell_m, x, y)
            top[i] = max(shoal, at[i, 2] - rules.lifted * step)
        _keep_links(out, top, plan.chain, rules.com_range_m)
        longest = 0.0
        for i in range(n):
            x, y, z = out[i, 0], out[i, 1], min(out[i, 2], top[i])
            longest = max(longest, np.sqrt((x - at[i, 0]) ** 2 + (y - at[i, 1]) ** 2 + (z - at[i, 2]) ** 2))
        if longest <= step * (1.0 + 1e-9):
            break
        # Climbing may not wait: the team goes less far.
        reach *= max(0.2, 0.98 * step / longest)
    for i in range(n):
        d2 = (out[i, 0] - at[i, 0]) ** 2 + (out[i, 1] - at[i, 1]) ** 2
        allowed = np.sqrt(max(0.0, step * step - d2))
        out[i, 2] = min(max(out[i, 2], at[i, 2] - allowed), at[i, 2] + allowed)
        if dives and out[i, 2] - at[i, 2] > STILL_SINKING * step:
            after = k
    return after


class Checkpoints(NamedTuple):
    """The state in which a flight first looked at each waypoint, so that a changed plan is flown from there only.

    Attributes
    ----------
    at_m : (room + 1, n_vehicles, 3)
        Positions at the beginning of that step; row k belongs to waypoint k.
    need : (room + 1, m)
        What the landmarks lacked then.
    state : (room + 1, 4)
        Steps flown, landmarks left, cost so far, index of the waypoint then heading for.
    """

    at_m: FloatArray
    need: FloatArray
    state: FloatArray


class FlownPlan(NamedTuple):
    """A plan with its flight; ``left_need`` (m,) is what the landmarks lack in the end."""

    plan: Plan
    checkpoints: Checkpoints
    left_need: FloatArray


def new_checkpoints(room: int, vehicles: int, landmarks: int) -> Checkpoints:
    """Return checkpoints of a plan that none was made of yet."""
    return Checkpoints(np.zeros((room + 1, vehicles, 3)), np.zeros((room + 1, landmarks)), np.zeros((room + 1, 4)))


@njit(cache=True, nogil=True)
def begin(checkpoints: Checkpoints, at: FloatArray, work: Work) -> None:
    """Make the present the state from which waypoint 0 is first looked at."""
    checkpoints.at_m[0] = at
    checkpoints.need[0] = work.need
    left = 0.0
    for m in range(len(work.need)):
        if work.need[m] > 0.0:
            left += 1.0
    checkpoints.state[0, 0] = 0.0
    checkpoints.state[0, 1] = left
    checkpoints.state[0, 2] = 0.0
    checkpoints.state[0, 3] = 0.0


@njit(cache=True, nogil=True)
def fly_plan(
    checkpoints: Checkpoints,
    origin: int,
    plan: Plan,
    count: int,
    task: Task,
    bound: float,
    left_need: FloatArray,
    save: Checkpoints,
) -> float:
    """Return the score of a plan in steps; less is better, inf as soon as it cannot be better than ``bound``.

    Parameters
    ----------
    checkpoints : Checkpoints
        Where to begin: the state at which waypoint ``origin`` is first looked at.
    plan : Plan
        With ``count`` waypoints.
    left_need : (m,)
        Overwritten: what the landmarks lack in the end.
    save : Checkpoints
        Rows after ``origin`` are overwritten by this flight's states.
    """
    work, floor, rules, horizon = task.work, task.floor, task.rules, task.horizon
    n = checkpoints.at_m.shape[1]
    at = checkpoints.at_m[origin].copy()
    after = np.empty((n, 3))
    left_need[:] = checkpoints.need[origin]
    t = checkpoints.state[origin, 0]
    left = checkpoints.state[origin, 1]
    cost = checkpoints.state[origin, 2]
    k = int(checkpoints.state[origin, 3])
    saved = origin
    waypoints = PER_WAYPOINT * count
    while left > work.allowed and k < count and t < horizon:
        least = (left - work.allowed) / work.most_per_step
        if t + cost + waypoints + least * (1.0 + 0.5 * WORTH_OF_EARLY * left / work.total) >= bound:
            return np.inf
        next_k = fly_step(at, plan, k, count, floor, rules, after)
        # What the flight looks at in this step is saved as it was before the step; that may be one waypoint more than
        # it passes, when the step ends just as it turns to it.
        while saved < min(next_k + 1, count):
            saved += 1
            save.at_m[saved] = at
            save.need[saved] = left_need
            save.state[saved, 0] = t
            save.state[saved, 1] = left
            save.state[saved, 2] = cost
            save.state[saved, 3] = k
        before = left
        for i in range(n):
            left -= look(after[i, 0], after[i, 1], after[i, 2], work, rules, left_need)
        at[:] = after
        k = next_k
        if left <= work.allowed:
            part = (before - work.allowed) / (before - left)
            t += part
            cost += WORTH_OF_EARLY * part * left / work.total
            break
        t += 1.0
        cost += WORTH_OF_EARLY * left / work.total
    # Waypoints never looked at: the states do not matter, but must lead nowhere wrong.
    while saved < count:
        saved += 1
        save.at_m[saved] = at
        save.need[saved] = left_need
        save.state[saved, 0] = t
        save.state[saved, 1] = left
        save.state[saved, 2] = cost
        save.state[saved, 3] = k
    score = t + cost + waypoints
    if left > work.allowed:
        score += UNFINISHED + (horizon if t >= horizon else 0.0)
        score += leftover(at, work, floor, rules, left_need)
    return float(score)


@njit(cache=True, nogil=True)
def leftover(at: FloatArray, work: Work, floor: FloorEstimate, rules: Rules, need: FloatArray) -> float:
    """Return the charge for what a plan leaves: landmarks, missing information, and a tour over their buckets.

    The tour counts what it costs to go down where landmarks cannot be seen from above, so that no plan is better for
    leaving them.
    """
    buckets = work.rows * work.cols
    count = np.zeros(buckets)
    down = np.zeros(buckets)
    well = WELL_SEEN * rules.visibility_m
    missing = 0.0
    left = 0.0
    for k in range(buckets):
        for m in range(work.first[k], work.first[k + 1]):
            if need[m] > 0.0:
                count[k] += 1.0
                left += 1.0
                missing += min(1.0, need[m] / max(work.need[m], 1e-12))
                x, y, z = work.xyz[0, m], work.xyz[1, m], work.xyz[2, m]
                from_above = sample(floor.deepest_m, floor.west_m, floor.south_m, floor.cell_m, x, y)
                down[k] = max(down[k], z - well - from_above)
    charge = PER_LEFT * (left - work.allowed + missing)
    x = 0.0
    y = 0.0
    for i in range(len(at)):
        x += at[i, 0] / len(at)
        y += at[i, 1] / len(at)
    reach = rules.visibility_m
    length = 0.0
    spare = work.allowed
    while left > spare:
        best = np.inf
        chosen = -1
        for k in range(buckets):
            if count[k] > 0.0:
                d = np.hypot(
                    work.west_m + (k % work.cols + 0.5) * work.bucket_m - x,
                    work.south_m + (k // work.cols + 0.5) * work.bucket_m - y,
                )
                if d < best:
                    best = d
                    chosen = k
        if chosen < 0:
            break
        length += max(0.0, best - 0.5 * reach) + PER_VISIT * rules.step_m + 2.0 * down[chosen]
        x = work.west_m + (chosen % work.cols + 0.5) * work.bucket_m
        y = work.south_m + (chosen // work.cols + 0.5) * work.bucket_m
        left -= count[chosen]
        count[chosen] = 0.0
    return float(charge + length / rules.step_m)
