"""Greedy on the trace of the EKF covariance: the usual way of active exploration, which MED13 figure 1 argues against.

Each step all vehicles go to the neighbouring positions, out of 27 each, after which the filters of all landmarks and
targets expect the least sum of variances. As long as there are few landmarks every combination is weighed ("infinite
computing power"); otherwise the vehicles choose one after the other, three times round.
"""

import numpy as np
from numba import njit

from app.arrays import FloatArray
from app.evaluation.track.world import TrackWorld
from app.exploration.core.bottom import Bottom
from app.exploration.core.errands import neighbouring_moves
from app.exploration.core.problem import Proposal, Situation

TRACE_GREEDY = "ekf-trace"
MOST_PAIRS = 800_000
ROUNDS = 3
UNSEEN_VARIANCE = 1.0


class TraceGreedy:
    """Stands where a planner stands; knows the world's filters, not its truth."""

    def __init__(self, world: TrackWorld) -> None:
        self._world = world

    def propose(self, situation: Situation, rng: np.random.Generator) -> Proposal:
        """Return the configuration after which the least variance is expected."""
        origin, constraints = situation.positions, situation.constraints
        belief = situation.belief
        bottom = Bottom.from_landmarks(belief.xy_m, belief.depth_m) if belief.on_floor else Bottom.unknown()
        points, covariances, sight = self._features(situation)
        moves = neighbouring_moves(constraints.max_step_m * (1.0 - 1e-9))
        n, m = len(origin), len(moves)
        scenario = self._world.scenario
        noise, fixed = scenario.sensor.relative_noise, scenario.fixed_noise
        noise, fixed_m = (noise, 0.0) if fixed is None else (0.0, fixed)

        def best_of(configurations: FloatArray) -> FloatArray:
            allowed = configurations[constraints.feasible(origin, configurations, bottom)]
            if len(allowed) == 0:
                return origin
            # Equal ones are left to chance: far from everything no move is better than another.
            allowed = allowed[rng.permutation(len(allowed))]
            trace = foretold_trace(allowed, points, covariances, sight, noise, fixed_m)
            return np.asarray(allowed[np.argmin(trace)])

        if m**n * len(points) <= MOST_PAIRS:
            index = np.stack(np.meshgrid(*[np.arange(m)] * n, indexing="ij"), axis=-1).reshape(-1, n)
            return Proposal(best_of(origin + moves[index]), 0.0)
        chosen = origin.copy()
        for _ in range(ROUNDS):
            for j in range(n):
                configurations = np.repeat(chosen[None], m, axis=0)
                configurations[:, j] = origin[j] + moves
                chosen = best_of(configurations)
        return Proposal(chosen, 0.0)

    def _features(self, situation: Situation) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return points (k, 3), covariances (k, 3, 3) and distances of sight (k,) of all that may be seen next."""
        known, reach = self._world.known, self._world.scenario.visibility
        seen = known.looks > 0
        places = situation.belief.xy_m
        unseen = np.column_stack([places, self._world.presumed.middles[0, 2] * np.ones(len(places))])
        point = np.where(seen[:, None], known.position_m, unseen)
        covariance = np.where(seen[:, None, None], known.covariance_m2, UNSEEN_VARIANCE * np.eye(3))
        near = np.linalg.norm(point[None] - situation.positions[:, None], axis=2).min(axis=0)
        kept = near < reach + situation.constraints.max_step_m
        points, covariances, sight = point[kept], covariance[kept], np.full(int(kept.sum()), reach)
        told = situation.targets
        if told is not None and np.isfinite(told.state).all():
            points = np.vstack([points, told.state[:, :3]])
            covariances = np.concatenate([covariances, told.covariance[:, :3, :3]])
            sight = np.append(sight, np.full(len(told.state), told.hearing_m))
        return np.ascontiguousarray(points), np.ascontiguousarray(covariances), sight


@njit(cache=True, nogil=True)
def foretold_trace(
    configurations: FloatArray,
    points: FloatArray,
    covariances: FloatArray,
    sight: FloatArray,
    noise: float,
    fixed_m: float = 0.0,
) -> FloatArray:
    """Return the sum of all variances after each of the configurations (c, n_vehicles, 3) has measured, (c,).

    The deviation of a range is ``noise`` times its length and ``fixed_m`` besides.
    """
    result = np.zeros(len(configurations))
    P = np.empty((3, 3))
    u = np.empty(3)
    Pu = np.empty(3)
    for c in range(len(configurations)):
        for m in range(len(points)):
            P[:] = covariances[m]
            for j in range(configurations.shape[1]):
                r2 = 0.0
                for k in range(3):
                    u[k] = points[m, k] - configurations[c, j, k]
                    r2 += u[k] * u[k]
                if r2 >= sight[m] * sight[m]:
                    continue
                r2 = max(r2, 1e-12)
                along = 0.0
                for k in range(3):
                    Pu[k] = (P[k, 0] * u[0] + P[k, 1] * u[1] + P[k, 2] * u[2]) / np.sqrt(r2)
                for k in range(3):
                    along += u[k] * Pu[k] / np.sqrt(r2)
                variance = along + noise * noise * (r2 + along) + fixed_m * fixed_m
                for a in range(3):
                    for b in range(3):
                        P[a, b] -= Pu[a] * Pu[b] / variance
            result[c] += P[0, 0] + P[1, 1] + P[2, 2]
    return result
