"""The reduced state of PCAO18's controller: a fixed, small vector per vehicle, whatever the landmarks and the team.

The paper's state holds all landmarks' errors Omega. Here every vehicle sees them through 7 horizontal vectors, each the
displacement from where something draws it (so that V = z'Pz is least where it should go), 4 vertical figures, and 2
figures about how much is left, from which the mixing signals follow. What a vehicle sees depends on the others only
through symmetric functions (the nearest one of a landmark, the sum of repulsions), so permuting the vehicles permutes
the states, and turning or mirroring the plane turns or mirrors the vectors. Lengths are in units of ``unit``, half
of what a vehicle maps to its sides.
"""

import numpy as np
from numba import njit

from app.arrays import FloatArray

VECTORS = (
    "nearest", "close", "far", "short_gain", "long_gain", "apart", "momentum",
)  # fmt: skip
"""nearest: from the nearest landmark that is left, others' landmarks seeming farther. close, far: from the weighted
mean of what is left, by distances of 2 and 8 units. short_gain, long_gain: against the direction whose strip of 2 and 6
units holds most of what is left. apart: towards the other vehicles. momentum: against the last move."""

FIGURES = ("height", "rise", "one", "left_here")
"""height above the bottom; rise of the known bottom within 2 units; a constant; the share left within 2.5 units."""

N_VECTORS, N_FIGURES = len(VECTORS), len(FIGURES)

DIRECTIONS = 16
CLOSE, FAR, HERE = 2.0, 8.0, 2.5
SHORT, LONG = 2.0, 6.0
FOREIGN = 0.3
"""Weight of what is left where another vehicle is closer, for the gains."""
KEEP_ON = 0.1
"""How much a straight way on is preferred among equal gains."""
TURN = 0.3
"""By how much of its distance a landmark right behind seems farther than one right ahead (half of it each way)."""
TALLEST = 6.0


@njit(cache=True, nogil=True, error_model="numpy")
def reduced_state(
    positions: FloatArray,
    moves: FloatArray,
    heights: FloatArray,
    xy: FloatArray,
    depth: FloatArray,
    left: FloatArray,
    density: float,
    unit: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the state of every vehicle: vectors (n, 7, 2), figures (n, 4), and what schedules (n, 2).

    One function because everything that a vehicle sees is gathered in one pass over the landmarks.

    Parameters
    ----------
    positions : (n, 3)
        Of the vehicles; depth positive down.
    moves : (n, 2)
        Directions of their last moves, unit vectors; zeros where there was none.
    heights : (n,)
        Above the bottom, by altimeter or by the map; NaN where unknown.
    xy, depth, left : (m, 2), (m,), (m,)
        The landmarks: where they are, estimated depth (NaN unknown), and how much is left to learn of each, 0 to 1.
    density : float
        Landmarks per area.
    unit : float
        Length that the state is measured in.
    """
    n, m = len(positions), len(xy)
    vectors = np.zeros((n, 7, 2))
    figures = np.zeros((n, 4))
    schedule = np.zeros((n, 2))
    nearest = np.full(n, np.inf)
    near_weight = np.zeros(n)
    far_weight = np.zeros(n)
    here_left = np.zeros(n)
    here_all = np.zeros(n)
    rise = np.zeros(n)
    short = np.zeros((n, DIRECTIONS))
    long = np.zeros((n, DIRECTIONS))
    cosine = np.empty(DIRECTIONS)
    sine = np.empty(DIRECTIONS)
    for k in range(DIRECTIONS):
        cosine[k] = np.cos(2.0 * np.pi * k / DIRECTIONS)
        sine[k] = np.sin(2.0 * np.pi * k / DIRECTIONS)
    squared = np.empty(n)
    total = 0.0
    for i in range(m):
        w = left[i]
        total += w
        least, second, owner = np.inf, np.inf, -1
        for v in range(n):
            d2 = ((xy[i, 0] - positions[v, 0]) ** 2 + (xy[i, 1] - positions[v, 1]) ** 2) / (unit * unit)
            squared[v] = d2
            if d2 < least:
                least, second, owner = d2, least, v
            elif d2 < second:
                second = d2
        for v in range(n):
            d2 = squared[v]
            if d2 < HERE * HERE:
                here_all[v] += 1.0
                here_left[v] += w
                if d2 < 4.0 and not np.isnan(depth[i]) and not np.isnan(heights[v]):
                    rise[v] = max(rise[v], (positions[v, 2] + heights[v] - depth[i]) / unit)
            if w <= 0.0:
                continue
            dx = (xy[i, 0] - positions[v, 0]) / unit
            dy = (xy[i, 1] - positions[v, 1]) / unit
            others = second if v == owner else least
            foreign = d2 / others if others < d2 else 1.0  # of squares: more than 1 where another is closer
            d = np.sqrt(d2)
            ahead = (dx * moves[v, 0] + dy * moves[v, 1]) / d if d > 0.0 else 0.0
            seeming = d * (1.0 - 0.5 * TURN * ahead) * foreign
            if seeming < nearest[v]:
                nearest[v] = seeming
                vectors[v, 0, 0] = -dx / (d + 0.5)
                vectors[v, 0, 1] = -dy / (d + 0.5)
            share = w / (foreign * foreign)
            k2 = share / (1.0 + d2 / (CLOSE * CLOSE)) ** 2
            near_weight[v] += k2
            vectors[v, 1, 0] -= k2 * dx
            vectors[v, 1, 1] -= k2 * dy
            k8 = share / (1.0 + d2 / (FAR * FAR))
            far_weight[v] += k8
            vectors[v, 2, 0] -= k8 * dx
            vectors[v, 2, 1] -= k8 * dy
            if d2 < LONG * LONG + 1.0:
                own = w if v == owner else FOREIGN * w
                for k in range(DIRECTIONS // 2):  # a strip and the one behind it
                    if abs(dy * cosine[k] - dx * sine[k]) >= 1.0:
                        continue
                    along = dx * cosine[k] + dy * sine[k]
                    way = k if along > 0.0 else k + DIRECTIONS // 2
                    if abs(along) < LONG:
                        long[v, way] += own
                        if abs(along) < SHORT:
                            short[v, way] += own
    for v in range(n):
        if near_weight[v] > 0.0:
            vectors[v, 1] /= near_weight[v] * CLOSE
            vectors[v, 2] /= far_weight[v] * FAR
        for which in range(2):
            gains = short[v] if which == 0 else long[v]
            best, top = 0, -1.0
            for k in range(DIRECTIONS):
                value = gains[k] * (1.0 + KEEP_ON * (cosine[k] * moves[v, 0] + sine[k] * moves[v, 1]))
                if value > top:
                    best, top = k, value
            full = 2.0 * (SHORT if which == 0 else LONG) * unit * unit * density
            size = min(1.0, gains[best] / max(full, 1e-12))
            vectors[v, 3 + which, 0] = -size * cosine[best]
            vectors[v, 3 + which, 1] = -size * sine[best]
        for o in range(n):
            if o == v:
                continue
            dx = (positions[o, 0] - positions[v, 0]) / unit
            dy = (positions[o, 1] - positions[v, 1]) / unit
            d = np.sqrt(dx * dx + dy * dy) + 1e-9
            pull = 1.0 / (1.0 + (d / CLOSE) ** 2) / d
            vectors[v, 5, 0] += pull * dx
            vectors[v, 5, 1] += pull * dy
        vectors[v, 6] = -moves[v]
        here = here_left[v] / here_all[v] if here_all[v] > 0.0 else 0.0
        figures[v, 0] = 1.0 if np.isnan(heights[v]) else min(heights[v] / unit, TALLEST)
        figures[v, 1] = min(rise[v], TALLEST)
        figures[v, 2] = 1.0
        figures[v, 3] = here
        schedule[v, 0] = here
        schedule[v, 1] = total / max(m, 1)
    return vectors, figures, schedule
