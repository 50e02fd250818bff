"""Ways of a vehicle that is to serve a target: its own route, over the floor, or up to it, judged by what they cost.

Ranges tell a target's position by their directions, not by being short: often the team's routes tell enough, and a
vehicle that keeps within sight of the floor meanwhile still sees landmarks. One that climbs to a target sees none
until it has come down again.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray
from app.estimation.targets import foretell
from app.exploration.core.errands import ENOUGH, LEAVES_AT, LOST
from app.exploration.core.moving_targets import Targets
from app.exploration.rollout.flight import STEEP, Plan, Rules
from app.exploration.rollout.floor import FloorEstimate, sample
from app.exploration.rollout.independent_mission import PARTS, ApartMission, Best
from app.exploration.rollout.independent_routes import Paths, fly_alone

AHEAD_STEPS = 30
"""Steps over which ways are judged."""

LOST_COSTS = 4.0
"""Steps of a vehicle that a step is worth in which a target is not accurately known, where routes take all the time
that is left; more as they take less of it."""

SEEING_COSTS = 0.5
"""What a step costs in which the vehicle sees the floor all the same."""

SHORT_COSTS = 20.0
"""Steps charged per part of the accuracy threshold that a way lacks in the end."""

AROUND = 2.0 * np.pi * np.arange(6) / 6
PLACES = np.vstack([
    np.zeros((1, 2)), *(away * np.column_stack([np.cos(AROUND), np.sin(AROUND)]) for away in (0.25, 0.6))
])  # fmt: skip
"""Where ways lead to, horizontally from the target: part of the distance of which a single range is accurate enough."""

PARTS_UP = (0.0, 0.5)
"""How far up such a place is, from over the floor to the target."""

WITHIN = 0.2
"""How much higher than over the floor landmarks are still seen, in visibilities."""


class Ground(NamedTuple):
    """What ways lead over: the floor, how vehicles fly over it, and the height that they keep."""

    floor: FloorEstimate
    rules: Rules
    height_m: float


def way_to(
    mission: ApartMission, best: Best, row: int, others: BoolArray, targets: Targets, target: int
) -> FloatArray | None:
    """Return where a vehicle may go that is to serve a target, (k, 3), best first; None: on along its own route.

    ``others`` (n_vehicles,) are on errands as well, and taken to stay where they are.
    """
    ground = Ground(mission.floor, mission.rules, mission.height_m)
    team = _team(mission.start, best.flown.paths, others)
    lost = targets.sd_m[target] > LOST * targets.accuracy_sd_m
    worth = LOST_COSTS * mission.horizon / max(1, best.flown.paths.length.max())
    own = np.inf if lost or not best.routes.counts[row] else worth * _lost(_parts(team, targets))
    if own <= SEEING_COSTS:  # what every other way costs at least
        return None
    here, goal = mission.start[row], targets.state[target, :3]
    reach = targets.accuracy_sd_m / targets.relative_noise
    low, high = mission.area.min(axis=0), mission.area.max(axis=0)
    places = np.repeat(np.clip(goal[:2] + reach * PLACES, low, high), len(PARTS_UP), axis=0)
    parts = np.tile(PARTS_UP, len(PLACES))
    plans = [_straight(place, mission.height_m) for place in places]
    ways = [_way(here, plan, goal[2], part, ground) for plan, part in zip(plans, parts, strict=True)]
    served = int(np.isfinite(targets.state[:target]).all(axis=1).sum())
    costs = []
    for way in ways:
        team[:, row] = way
        sd = _parts(team, targets)
        costs.append(worth * _lost(sd) + _away(way, sd[:, served], ground))
    k = int(np.argmin(costs))
    if own <= costs[k]:
        return None
    if parts[k] == 0.0:
        return mission.steps(row, plans[k], 1)[0]
    step = ways[k][0] - here
    length, left = np.hypot(*step[:2]), mission.rules.step_m * (1.0 - 1e-9)
    higher = [[*(part * step[:2]), -np.sqrt(left**2 - (part * length) ** 2)] for part in (*PARTS, 0.0)]
    return np.asarray(here + np.vstack([[part * step for part in PARTS], higher]))


def _team(start: FloatArray, paths: Paths, stay: BoolArray) -> FloatArray:
    """Return where vehicles are at the end of each step as planned, (AHEAD_STEPS, n_vehicles, 3)."""
    team = np.repeat(start[None], AHEAD_STEPS, axis=0)
    for i in np.flatnonzero(~stay & (paths.length > 0)):
        flown = min(AHEAD_STEPS, int(paths.length[i]))
        team[:flown, i], team[flown:, i] = paths.at_m[i, :flown], paths.at_m[i, flown - 1]
    return team


def _straight(place: FloatArray, height_m: float) -> Plan:
    """Return the plan of a vehicle that goes to a place (2,) over the floor."""
    return Plan(place.reshape(1, 1, 2), np.full(1, height_m), np.full(1, STEEP), np.zeros(1, dtype=np.int64))


@njit(cache=True, nogil=True)
def _way(here: FloatArray, plan: Plan, depth_m: float, part: float, ground: Ground) -> FloatArray:
    """Return the way of a plan to one place, (AHEAD_STEPS, 3).

    It ends ``part`` of the height from over the floor up to a depth; 0 keeps over the floor.
    """
    rules, step = ground.rules, ground.rules.step_m * (1.0 - 1e-9)
    way, at, after = np.empty((AHEAD_STEPS, 3)), here.copy().reshape(1, 3), np.empty((1, 3))
    end = np.array([plan.at_m[0, 0, 0], plan.at_m[0, 0, 1], 0.0])
    end[2] = _over(ground, end)
    end[2] = max(end[2] + part * min(0.0, depth_m - end[2]), rules.min_depth_m)
    k = 0
    for t in range(AHEAD_STEPS):
        if part > 0.0:
            leg = end - at[0]
            at[0] += leg * min(1.0, step / max(np.sqrt((leg * leg).sum()), 1e-12))
            at[0, 2] = min(at[0, 2], _over(ground, at[0]))
        elif k == 0:
            k = fly_alone(at, plan, 0, 1, ground.floor, rules, after)
            at[:] = after
        way[t] = at[0]
    return way


@njit(cache=True, nogil=True)
def _over(ground: Ground, at: FloatArray) -> float:
    """Return the depth of a vehicle that keeps over the floor, at a place (3,)."""
    floor = ground.floor
    deepest = sample(floor.smooth_m, floor.west_m, floor.south_m, floor.cell_m, at[0], at[1])
    return float(min(deepest - ground.height_m, ground.rules.max_depth_m))


def _parts(paths: FloatArray, targets: Targets) -> FloatArray:
    """Return the deviations of the targets that are known after each step, as parts of the accuracy threshold."""
    assert targets.growth is not None  # noqa: S101 - nobody looks ahead otherwise
    known = np.isfinite(targets.state).all(axis=1)
    sd = foretell(
        np.ascontiguousarray(targets.state[known]), np.ascontiguousarray(targets.covariance[known]), paths,
        targets.growth, targets.relative_noise, targets.hearing_m, targets.range_sd_m,
    )  # fmt: skip
    return np.asarray(sd / targets.accuracy_sd_m)


def _lost(part: FloatArray) -> float:
    """Return in how many steps targets are not accurately known, added up."""
    return float(np.clip((part - LEAVES_AT) / (1.0 - LEAVES_AT), 0.0, 1.0).sum())


@njit(cache=True, nogil=True)
def _away(way: FloatArray, part: FloatArray, ground: Ground) -> float:
    """Return what a way costs until the target is known well enough and the floor is in sight again, in steps."""
    near = WITHIN * ground.rules.visibility_m
    away, last = 0.0, len(way) - 1
    for t in range(len(way)):
        away += 1.0 if way[t, 2] < _over(ground, way[t]) - near else SEEING_COSTS
        if part[t] < ENOUGH:
            last = t
            break
    away += SHORT_COSTS * max(0.0, part[last] - ENOUGH)
    return float(away + max(0.0, _over(ground, way[last]) - near - way[last, 2]) / ground.rules.step_m)
