"""What a survey plan is worth: roughness-weighted squared interpolation error as a function of distance to soundings.

A node at distance D from the nearest sounding is interpolated with an expected squared error proportional to
``a (D / l)^p`` up to D = l, and ``a`` beyond, with ``a`` the local roughness, ``l`` the correlation length and p
between 1 and 3 (Matern field of smoothness nu: p = 2 nu). ``U`` is the sum over the nodes. Soundings are taken all
along the legs.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.exploration.routes import fly

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@njit(cache=True, nogil=True, fastmath=True)
def lower_to_segment(
    d2: FloatArray, px: FloatArray, py: FloatArray, ax: float, ay: float, bx: float, by: float
) -> None:
    """Lower squared distances ``d2`` (m,) of the points to those to the segment a-b, in place."""
    dx = bx - ax
    dy = by - ay
    length2 = dx * dx + dy * dy
    inverse = 1.0 / length2 if length2 > 1e-12 else 0.0
    for i in range(len(d2)):
        rx = px[i] - ax
        ry = py[i] - ay
        t = (rx * dx + ry * dy) * inverse
        t = 0.0 if t < 0.0 else t
        t = 1.0 if t > 1.0 else t
        ex = rx - t * dx
        ey = ry - t * dy
        e2 = ex * ex + ey * ey
        d2[i] = e2 if e2 < d2[i] else d2[i]


@njit(cache=True, nogil=True)
def uncertainty(d2: FloatArray, weight: FloatArray, scale_m: float, power: float) -> float:
    """Return U for squared distances ``d2`` (m,) and roughness ``weight`` (m,)."""
    total = 0.0
    s2 = scale_m * scale_m
    half = 0.5 * power
    for i in range(len(d2)):
        total += weight[i] * (min(1.0, d2[i] / s2)) ** half
    return total


@njit(cache=True, nogil=True)
def turning(vertices: FloatArray, n: int, heading: float) -> float:
    """Return the sum over corners of how far they turn beyond 100 degrees, in half turns; NaN heading: unknown."""
    total = 0.0
    previous = np.nan
    if not np.isnan(heading):
        previous = 0.5 * np.pi - heading
    for k in range(1, n):
        course = np.arctan2(vertices[k, 1] - vertices[k - 1, 1], vertices[k, 0] - vertices[k - 1, 0])
        if not np.isnan(previous):
            turn = abs((course - previous + np.pi) % (2 * np.pi) - np.pi)
            total += max(0.0, turn - 1.75) / np.pi
        previous = course
    return total


@njit(cache=True, nogil=True)
def plan_value(
    d2: FloatArray,
    px: FloatArray,
    py: FloatArray,
    weight: FloatArray,
    starts: FloatArray,
    headings: FloatArray,
    vias: FloatArray,
    counts: IntArray,
    step: float,
    steps: int,
    scale_m: float,
    power: float,
    turn_penalty: float,
) -> float:
    """Return U after flying a plan for ``steps`` legs, plus a penalty for reversals.

    Parameters
    ----------
    d2 : (m,)
        Squared distances of the nodes to the soundings taken so far (not changed).
    px, py, weight : (m,)
        Nodes and their roughness.
    starts : (n_vehicles, 2)
        Positions now.
    headings : (n_vehicles,)
        Clockwise from north; NaN unknown.
    vias : (n_vehicles, k, 2)
        Via points; the first ``counts[j]`` count.
    """
    after = d2.copy()
    vertices = np.empty((steps + 2, 2))
    turns = 0.0
    for j in range(len(starts)):
        n, _ = fly(starts[j, 0], starts[j, 1], vias[j], counts[j], step, steps, vertices)
        for k in range(1, n):
            lower_to_segment(after, px, py, vertices[k - 1, 0], vertices[k - 1, 1], vertices[k, 0], vertices[k, 1])
        turns += turning(vertices, n, headings[j])
    return uncertainty(after, weight, scale_m, power) * (1.0 + turn_penalty * turns)


@njit(cache=True, nogil=True)
def values_after_first_leg(
    d2: FloatArray,
    px: FloatArray,
    py: FloatArray,
    weight: FloatArray,
    starts: FloatArray,
    headings: FloatArray,
    targets: FloatArray,
    vias: FloatArray,
    counts: IntArray,
    step: float,
    steps: int,
    scale_m: float,
    power: float,
    turn_penalty: float,
) -> FloatArray:
    """Return, per team target, U after the first leg alone and U after going on with the plan from there: (c, 2).

    ``targets`` (c, n_vehicles, 2) are the ends of the first legs; ``vias`` (c, n_vehicles, k, 2) and ``counts``
    (c, n_vehicles) what each would follow afterwards; the rest as in :func:`plan_value`.
    """
    c, n, _ = targets.shape
    out = np.empty((c, 2))
    courses = np.empty(n)
    for i in range(c):
        after = d2.copy()
        turns = 0.0
        for j in range(n):
            ax, ay = starts[j, 0], starts[j, 1]
            bx, by = targets[i, j, 0], targets[i, j, 1]
            lower_to_segment(after, px, py, ax, ay, bx, by)
            courses[j] = headings[j]
            if np.hypot(bx - ax, by - ay) > 1e-6:
                courses[j] = 0.5 * np.pi - np.arctan2(by - ay, bx - ax)
                if not np.isnan(headings[j]):
                    turn = abs((courses[j] - headings[j] + np.pi) % (2 * np.pi) - np.pi)
                    turns += max(0.0, turn - 1.75) / np.pi
        out[i, 0] = uncertainty(after, weight, scale_m, power)
        rest = plan_value(
            after,
            px,
            py,
            weight,
            targets[i],
            courses,
            vias[i],
            counts[i],
            step,
            steps - 1,
            scale_m,
            power,
            turn_penalty,
        )
        out[i, 1] = rest * (1.0 + turn_penalty * turns)
    return out
