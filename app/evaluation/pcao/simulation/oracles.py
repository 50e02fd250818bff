"""SE(C), SPSA and FDSA in PCAO18's simulation, compiled: yardsticks that really try their moves and take them back.

They judge by AURO15's objective (eq. 8-15, read as in :mod:`app.exploration.core.objective`), as the paper's SE
does ([20, algorithm 1]). A try is flown, pinged with and judged; its measurements are dropped.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray, IntArray
from app.evaluation.pcao.simulation.kernel import KnownLandmarks, Physics, error_squared, move, sense, unknown

SE, SPSA, FDSA = 0, 1, 2
PERTURBATION, DECAY = 0.5, 0.101
"""Of SPSA and FDSA; see :mod:`app.exploration.cao.gradient`."""
EPS2 = EPS3 = 1e-9
DRAWS = 1000


def tries_per_step(method: int, candidates: int, robots: int) -> int:
    """Return how many real tries a step costs; a mission takes 1 + this times as long."""
    return (candidates, 2, 6 * robots)[method]


@njit(cache=True, nogil=True)
def _progress(
    positions: FloatArray, points: FloatArray, known: KnownLandmarks, visible: BoolArray, credited: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return |A_j|, J1_j, J2_j without switches as rows of (3, n), and J3_j, (n,)."""
    n, m = visible.shape
    progress, J3 = np.zeros((3, n)), np.full(n, -np.inf)
    progress[0] = credited
    mean, count = 0.0, 0
    for i in range(m):
        if not np.isnan(known.depth[i]):
            mean += known.depth[i]
            count += 1
    mean = mean / count if count else 0.0
    seen_before = False
    for i in range(m):
        if known.looks[i] > 0 and not known.accurate[i] and not visible[:, i].any():
            seen_before = True
            break
    for i in range(m):
        if known.accurate[i]:
            continue
        seen = False
        for j in range(n):
            if visible[j, i]:
                progress[1, j] += 1.0
                seen = True
        pending = not seen and (known.looks[i] > 0 or not seen_before)
        if not seen and not pending:
            continue
        depth = mean if np.isnan(known.depth[i]) else known.depth[i]
        least, closest = np.inf, 0
        for j in range(n):
            squared = (
                (positions[j, 0] - points[i, 0]) ** 2
                + (positions[j, 1] - points[i, 1]) ** 2
                + (positions[j, 2] - depth) ** 2
            )
            if squared < least:
                least, closest = squared, j
            if pending:
                J3[j] = max(J3[j], -squared)
        if seen:
            progress[2, closest] -= least
    for j in range(n):
        if J3[j] == -np.inf:
            J3[j] = 0.0
    return progress, J3


@njit(cache=True, nogil=True)
def _credits(known: KnownLandmarks, n: int) -> FloatArray:
    credited = np.zeros(n)
    for i in range(len(known.credited)):
        if known.credited[i] >= 0:
            credited[known.credited[i]] += 1.0
    return credited


class _World(NamedTuple):
    """The sea floor (rows, cols), the simulation's constants, and where the landmarks are in truth, (m, 3)."""

    raster: FloatArray
    physics: Physics
    landmarks: FloatArray


class _Team(NamedTuple):
    """Where n vehicles are, (n, 3), their headings, (n,), and the directions of their last moves, (n, 2)."""

    positions: FloatArray
    headings: FloatArray
    moves: FloatArray


@njit(cache=True, nogil=True)
def _try(
    world: _World,
    team: _Team,
    way: FloatArray,
    known: KnownLandmarks,
    history: FloatArray,
    visible: BoolArray,
    rng: np.random.Generator,
) -> float:
    """Return what going ``way`` (n, 3) turns out to be worth; ``history`` (2, 3, n) holds the progress at t-2, t-1."""
    raster, p, truth = world
    n = len(team.positions)
    there, heading, going = team.positions.copy(), team.headings.copy(), team.moves.copy()
    move(raster, p, there, heading, going, way)
    after = KnownLandmarks(
        known.depth.copy(), known.variance.copy(), known.looks.copy(), known.accurate.copy(), known.credited.copy()
    )
    before = known.accurate.sum()
    sense(p, truth, there, heading, after, visible, rng)
    progress, J3 = _progress(there, truth, after, visible, _credits(after, n))
    total = float(after.accurate.sum() - before)
    for j in range(n):
        opened = last = 1.0
        if not np.isnan(history[0, 0, 0]):
            stuck = history[1, 0, j] - history[0, 0, j] <= 0.0
            still = abs(history[1, 1, j] - history[0, 1, j]) <= EPS2
            still = still and abs(history[1, 2, j] - history[0, 2, j]) <= EPS3
            opened = 1.0 if stuck else 0.0
            last = 1.0 if stuck and still else 0.0
        total += opened * (progress[1, j] + progress[2, j]) + last * J3[j]
    return total


@njit(cache=True, nogil=True)
def _draw(p: Physics, positions: FloatArray, rng: np.random.Generator, way: FloatArray) -> None:
    """Write a random move of the team, (n, 3), even over what eq. (1) allows; every vehicle stays in the area."""
    for v in range(len(positions)):
        way[v] = 0.0
        for _ in range(DRAWS):
            x = p.step * (2.0 * rng.random() - 1.0)
            y = p.step * (2.0 * rng.random() - 1.0)
            z = p.step * (2.0 * rng.random() - 1.0)
            if abs(positions[v, 0] + x) <= p.half_x and abs(positions[v, 1] + y) <= p.half_y:
                way[v, 0], way[v, 1], way[v, 2] = x, y, z
                break


@njit(cache=True, nogil=True)
def fly_tried(
    raster: FloatArray,
    p: Physics,
    truth: FloatArray,
    start: FloatArray,
    headings: FloatArray,
    method: int,
    candidates: int,
    steps: int,
    rng: np.random.Generator,
) -> tuple[IntArray, FloatArray]:
    """Fly a mission with SE(``candidates``), SPSA or FDSA.

    Returns as :func:`app.evaluation.pcao.simulation.kernel.fly` does.
    """
    n, m = len(start), len(truth)
    positions, headings, moves = start.copy(), headings.copy(), np.zeros((n, 2))
    world, team = _World(raster, p, truth), _Team(positions, headings, moves)
    known, visible, trial = unknown(m), np.zeros((n, m), dtype=np.bool_), np.zeros((n, m), dtype=np.bool_)
    remaining, error = np.zeros(steps, dtype=np.int64), np.zeros(steps)
    history = np.full((2, 3, n), np.nan)
    way, best, along = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    slope = np.zeros((n, 3))
    sense(p, truth, positions, headings, known, visible, rng)
    for t in range(steps):
        progress, _ = _progress(positions, truth, known, visible, _credits(known, n))
        history[0] = history[1]
        history[1] = progress
        best[:] = 0.0
        if method == SE:
            if candidates == 0:
                _draw(p, positions, rng, best)
            else:
                top = -np.inf
                for _ in range(candidates):
                    _draw(p, positions, rng, way)
                    value = _try(world, team, way, known, history, trial, rng)
                    if value > top:
                        top = value
                        best[:] = way
        else:
            size = PERTURBATION * p.step * (1.0 + t) ** -DECAY
            slope[:] = 0.0
            for d in range(1 if method == SPSA else 3 * n):
                along[:] = 0.0
                for v in range(n):
                    for k in range(3):
                        if method == SPSA:
                            along[v, k] = 1.0 if rng.random() < 0.5 else -1.0
                        elif d == 3 * v + k:
                            along[v, k] = 1.0
                up = _try(world, team, size * along, known, history, trial, rng)
                down = _try(world, team, -size * along, known, history, trial, rng)
                slope += (up - down) / (2.0 * size) * along
            steepest = np.abs(slope).max()
            if steepest > 0.0:
                best[:] = p.step / steepest * slope
            else:
                _draw(p, positions, rng, best)
        move(raster, p, positions, headings, moves, best)
        sense(p, truth, positions, headings, known, visible, rng)
        remaining[t] = m - known.accurate.sum()
        error[t] = error_squared(p, known)
    return remaining, error
