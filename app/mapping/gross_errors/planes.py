"""Robust planes through neighbouring soundings (Huber's weights): the first look at gross errors, compiled."""

import numpy as np
from numba import njit

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.gross_errors.median import median

SUSPICION = 4.0
"""Robust standard deviations from a local plane that make a sounding suspect."""

LEAST_COMPANY = 8
"""Fewer soundings cannot tell an outlier from the sea floor."""

ROUNDS = 8
SLOPE_DAMPING = 0.05
"""Part of the squared reach added to the normal equations: along one straight track the slope across is open."""


@njit(cache=True, nogil=True)
def robust_plane(dx: FloatArray, dy: FloatArray, z: FloatArray, size: FloatArray) -> tuple[float, float, float]:
    """Return height at the origin and slopes east and north of a robust plane through ``z`` (m,) at (dx, dy) (m,).

    ``size`` (m,) is scratch space.
    """
    m = len(z)
    radius2 = 1e-12
    for c in range(m):
        radius2 = max(radius2, dx[c] * dx[c] + dy[c] * dy[c])
    centre = median(z)
    east = north = 0.0
    for _ in range(ROUNDS):
        for c in range(m):
            size[c] = abs(z[c] - centre - east * dx[c] - north * dy[c])
        bound = 1.345 * 1.4826 * median(size) + 1e-9
        s0 = sx = sy = sxx = sxy = syy = b0 = bx = by = 0.0
        for c in range(m):
            w = 1.0 if size[c] <= bound else bound / size[c]
            s0 += w
            sx += w * dx[c]
            sy += w * dy[c]
            sxx += w * dx[c] * dx[c]
            sxy += w * dx[c] * dy[c]
            syy += w * dy[c] * dy[c]
            b0 += w * z[c]
            bx += w * z[c] * dx[c]
            by += w * z[c] * dy[c]
        sxx += SLOPE_DAMPING * radius2
        syy += SLOPE_DAMPING * radius2
        # two steps of elimination; damping keeps the pivots away from zero
        a, b, d = sxx - sx * sx / s0, sxy - sx * sy / s0, syy - sy * sy / s0
        p, q = bx - sx * b0 / s0, by - sy * b0 / s0
        q -= b / a * p
        d -= b / a * b
        before = centre, east, north
        north = q / d
        east = (p - b * north) / a
        centre = (b0 - sx * east - sy * north) / s0
        moved = abs(centre - before[0]) + (abs(east - before[1]) + abs(north - before[2])) * np.sqrt(radius2)
        if moved <= 0.01 * bound:
            break
    return centre, east, north


@njit(cache=True, nogil=True)
def plane_residuals(points: FloatArray, depth: FloatArray, first: int, near: IntArray) -> FloatArray:
    """Depth minus a robust plane through the neighbours.

    Row i of ``near`` holds the neighbours of point ``first + i``.
    """
    n, k = near.shape
    result = np.zeros(n)
    dx, dy, z, size = np.empty(k), np.empty(k), np.empty(k), np.empty(k)
    for t in range(n):
        i = first + t
        m = 0
        for c in range(k):
            j = near[t, c]
            if j != i:
                dx[m], dy[m] = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
                z[m] = depth[j] - depth[i]
                m += 1
        centre, _, _ = robust_plane(dx[:m], dy[:m], z[:m], size[:m])
        result[t] = -centre
    return result


@njit(cache=True, nogil=True)
def judge_squares(
    points: FloatArray,
    depth: FloatArray,
    sd: FloatArray,
    order: IntArray,
    first: IntArray,
    suspect: BoolArray,
    alone: BoolArray,
) -> None:
    """Mark the soundings that are far from the robust plane of their square, in place.

    Parameters
    ----------
    points : (n, 2), depth : (n,), sd : (n,)
        All soundings.
    order : (n,)
        Their rows, square by square.
    first : (squares + 1,)
        Where each square begins in ``order``, and where the last one ends.
    suspect, alone : (n,)
        Written: far from the plane; in a square with less than ``LEAST_COMPANY``.
    """
    most = 0
    for s in range(len(first) - 1):
        most = max(most, first[s + 1] - first[s])
    dx, dy, z, size = np.empty(most), np.empty(most), np.empty(most), np.empty(most)
    for s in range(len(first) - 1):
        rows = order[first[s] : first[s + 1]]
        m = len(rows)
        if m < LEAST_COMPANY:
            for i in rows:
                alone[i] = True
            continue
        x0, y0, z0 = 0.0, 0.0, depth[rows[0]]
        for i in rows:
            x0 += points[i, 0] / m
            y0 += points[i, 1] / m
        for c in range(m):
            i = rows[c]
            dx[c], dy[c], z[c] = points[i, 0] - x0, points[i, 1] - y0, depth[i] - z0
        centre, east, north = robust_plane(dx[:m], dy[:m], z[:m], size[:m])
        for c in range(m):
            z[c] = abs(z[c] - centre - east * dx[c] - north * dy[c])
        scale = 1.4826 * median(z[:m])
        for c in range(m):
            i = rows[c]
            suspect[i] = z[c] > SUSPICION * max(scale, sd[i])
