"""PCAO18's simulation, compiled: a team over a sea floor, swath sonars, landmarks, and the controller that leads it.

Frame: the cube [-1, 1]^3 of :mod:`app.evaluation.explore.world`; depth positive down.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray, IntArray
from app.estimation.depth_least_squares import fit_depth
from app.exploration.pcao.controller import control, within_step
from app.exploration.pcao.state import reduced_state
from app.exploration.pcao.visits import no_visits, visiting_move, watch


class Physics(NamedTuple):
    """Constants of the simulation that compiled functions read; lengths in the cube."""

    west: float
    south: float
    cell: float
    half_x: float
    half_y: float
    step: float
    clearance: float
    ceiling: float
    beams: int
    swath_rad: float
    cos_beam: float
    max_range: float
    noise: float
    accuracy_sd: float
    visit_cap: int
    prior_sd: float
    unit: float


class KnownLandmarks(NamedTuple):
    """What is known of the landmarks: estimated depth, its variance, looks, whether in A, and by which vehicle."""

    depth: FloatArray
    variance: FloatArray
    looks: IntArray
    accurate: BoolArray
    credited: IntArray


@njit(cache=True, nogil=True)
def floor_at(raster: FloatArray, p: Physics, x: float, y: float) -> float:
    """Return the depth at a place by bilinear interpolation between cell centres; the border's value is continued."""
    rows, cols = raster.shape
    u = min(max((x - p.west) / p.cell - 0.5, 0.0), cols - 1.0)
    v = min(max((y - p.south) / p.cell - 0.5, 0.0), rows - 1.0)
    j, i = min(int(u), cols - 2), min(int(v), rows - 2)
    u -= j
    v -= i
    south = (1.0 - u) * raster[i, j] + u * raster[i, j + 1]
    north = (1.0 - u) * raster[i + 1, j] + u * raster[i + 1, j + 1]
    return float((1.0 - v) * south + v * north)


@njit(cache=True, nogil=True)
def meets(p: Physics, dx: float, dy: float, dz: float, sin_h: float, cos_h: float) -> float:
    """Return the range to a landmark at (dx, dy, dz) from a level sonar if one of its beams meets it, else -1.

    ``sin_h`` and ``cos_h`` are of the heading, clockwise from north. The same geometry as
    :meth:`app.estimation.beams.Multibeam.meets`; no beams at all see all round, as AURO15's sensor does.
    """
    r = np.sqrt(dx * dx + dy * dy + dz * dz)
    if r >= p.max_range or r <= 0.0:
        return -1.0
    if p.beams == 0:
        return float(r)
    if dz <= 0.0:
        return -1.0
    starboard = dx * cos_h - dy * sin_h
    angle, spacing = np.arctan2(starboard, dz), 0.0
    if p.beams > 1:
        spacing = p.swath_rad / (p.beams - 1)
        number = min(max(np.round((angle + p.swath_rad / 2.0) / spacing), 0.0), p.beams - 1.0)
        beam = number * spacing - p.swath_rad / 2.0
    else:
        beam = 0.0
    if (starboard * np.sin(beam) + dz * np.cos(beam)) / r < p.cos_beam:
        return -1.0
    return float(r)


@njit(cache=True, nogil=True)
def sense(
    p: Physics,
    truth: FloatArray,
    positions: FloatArray,
    headings: FloatArray,
    known: KnownLandmarks,
    visible: BoolArray,
    rng: np.random.Generator,
) -> None:
    """Ping with every vehicle: ``known`` takes in the ranges, ``visible`` (n, m) is set to the landmarks seen."""
    for v in range(len(positions)):
        x, y, z = positions[v]
        sin_h, cos_h = np.sin(headings[v]), np.cos(headings[v])
        for i in range(len(truth)):
            visible[v, i] = False
            dx, dy = truth[i, 0] - x, truth[i, 1] - y
            h2 = dx * dx + dy * dy
            if h2 >= p.max_range * p.max_range:
                continue
            r = meets(p, dx, dy, truth[i, 2] - z, sin_h, cos_h)
            if r < 0.0:
                continue
            visible[v, i] = True
            measured = r * (1.0 + p.noise * rng.standard_normal())
            known.depth[i], known.variance[i] = fit_depth(known.depth[i], known.variance[i], h2, z, measured, p.noise)
            known.looks[i] += 1
            if not known.accurate[i] and (
                known.variance[i] < p.accuracy_sd * p.accuracy_sd or known.looks[i] > p.visit_cap
            ):
                known.accurate[i] = True
                known.credited[i] = v


@njit(cache=True, nogil=True)
def move(
    raster: FloatArray, p: Physics, positions: FloatArray, headings: FloatArray, moves: FloatArray, way: FloatArray
) -> None:
    """Move every vehicle by ``way`` (n, 3) within the area; altimeters lift it to the clearance above the bottom.

    ``headings`` and ``moves`` (unit vectors) follow the horizontal part of what was really gone.
    """
    for v in range(len(positions)):
        x = min(max(positions[v, 0] + way[v, 0], -p.half_x), p.half_x)
        y = min(max(positions[v, 1] + way[v, 1], -p.half_y), p.half_y)
        gone_x, gone_y = x - positions[v, 0], y - positions[v, 1]
        length = np.hypot(gone_x, gone_y)
        if length > 1e-3 * p.step:
            headings[v] = np.arctan2(gone_x, gone_y)
            moves[v, 0], moves[v, 1] = gone_x / length, gone_y / length
        positions[v, 0], positions[v, 1] = x, y
        deepest = floor_at(raster, p, x, y) - p.clearance
        positions[v, 2] = min(max(positions[v, 2] + way[v, 2], p.ceiling), deepest)


@njit(cache=True, nogil=True)
def error_squared(p: Physics, known: KnownLandmarks) -> float:
    """Return Omega'Omega of eq. (6), of the landmarks' deviations as footnote 4 says; at most the prior's each."""
    total, most = 0.0, p.prior_sd * p.prior_sd
    for i in range(len(known.variance)):
        total += min(known.variance[i], most)
    return total


@njit(cache=True, nogil=True)
def unknown(m: int) -> KnownLandmarks:
    """Return m landmarks that are still unseen."""
    return KnownLandmarks(
        np.full(m, np.nan),
        np.full(m, np.inf),
        np.zeros(m, dtype=np.int64),
        np.zeros(m, dtype=np.bool_),
        np.full(m, -1, dtype=np.int64),
    )


@njit(cache=True, nogil=True)
def what_is_left(accurate: BoolArray, variance: FloatArray, accuracy_sd: float, left: FloatArray) -> None:
    """Write how much is left to learn of every landmark, 0 to 1: the share of the information that it lacks."""
    for i in range(len(left)):
        lacking = 1.0 - accuracy_sd * accuracy_sd / variance[i]
        left[i] = 0.0 if accurate[i] else max(0.25, lacking)


@njit(cache=True, nogil=True)
def fly(
    raster: FloatArray,
    p: Physics,
    truth: FloatArray,
    start: FloatArray,
    headings: FloatArray,
    horizontal: FloatArray,
    vertical: FloatArray,
    steps: int,
    visiting: bool,
    rng: np.random.Generator,
) -> tuple[IntArray, FloatArray]:
    """Fly a mission with the controller of B'P = (``horizontal``, ``vertical``); ``visiting`` where it gets nowhere.

    Returns
    -------
    remaining : (steps,)
        Landmarks not accurately estimated after every step (eq. 5).
    error : (steps,)
        Omega'Omega after every step.
    """
    n, m = len(start), len(truth)
    positions, headings, moves = start.copy(), headings.copy(), np.zeros((n, 2))
    for v in range(n):
        moves[v, 0], moves[v, 1] = np.sin(headings[v]), np.cos(headings[v])
    known, visible = unknown(m), np.zeros((n, m), dtype=np.bool_)
    xy = np.ascontiguousarray(truth[:, :2])
    density = m / (4.0 * p.half_x * p.half_y)
    heights, left = np.empty(n), np.empty(m)
    alone, visits = np.arange(n), no_visits(n, m)
    remaining, error = np.zeros(steps, dtype=np.int64), np.zeros(steps)
    sense(p, truth, positions, headings, known, visible, rng)
    for t in range(steps):
        for v in range(n):
            heights[v] = floor_at(raster, p, positions[v, 0], positions[v, 1]) - positions[v, 2]
        what_is_left(known.accurate, known.variance, p.accuracy_sd, left)
        vectors, figures, schedule = reduced_state(positions, moves, heights, xy, known.depth, left, density, p.unit)
        u = control(vectors, figures, schedule, horizontal, vertical)
        way = within_step(u, p.step, True)
        watch(positions, alone, xy, known.depth, left, p.unit, steps - t, visits)
        for v in range(n):
            i = visits.target[v]
            if visiting and i >= 0:
                visiting_move(positions[v], xy[i], known.depth[i], visits.looks[v], p.step, p.unit, way[v])
        move(raster, p, positions, headings, moves, way)
        sense(p, truth, positions, headings, known, visible, rng)
        remaining[t] = m - known.accurate.sum()
        error[t] = error_squared(p, known)
    return remaining, error
