"""Plane geometry on arrays, compiled: polygons as (n, 2) vertex arrays, counter-clockwise, not closed."""

import numpy as np
from numba import njit

from app.arrays import FloatArray


@njit(cache=True, nogil=True)
def inside(polygon: FloatArray, x: float, y: float) -> bool:
    """Whether the point lies in the polygon (even-odd rule)."""
    result = False
    n = polygon.shape[0]
    j = n - 1
    for i in range(n):
        yi = polygon[i, 1]
        yj = polygon[j, 1]
        if (yi > y) != (yj > y):
            crossing = polygon[i, 0] + (y - yi) / (yj - yi) * (polygon[j, 0] - polygon[i, 0])
            if x < crossing:
                result = not result
        j = i
    return result


@njit(cache=True, nogil=True)
def segment_distance(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Distance from the point to the segment a-b."""
    dx = bx - ax
    dy = by - ay
    length2 = dx * dx + dy * dy
    t = 0.0
    if length2 > 0.0:
        t = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / length2))
    return float(np.hypot(x - ax - t * dx, y - ay - t * dy))


@njit(cache=True, nogil=True)
def boundary_distance(polygon: FloatArray, x: float, y: float) -> float:
    """Distance from the point to the polygon's boundary."""
    n = polygon.shape[0]
    best = np.inf
    j = n - 1
    for i in range(n):
        d = segment_distance(x, y, polygon[j, 0], polygon[j, 1], polygon[i, 0], polygon[i, 1])
        best = min(best, d)
        j = i
    return best


@njit(cache=True, nogil=True)
def signed_distance(polygon: FloatArray, x: float, y: float) -> float:
    """Distance to the boundary, positive outside the polygon and negative inside."""
    d = boundary_distance(polygon, x, y)
    return -d if inside(polygon, x, y) else d


def convex(polygon: FloatArray) -> bool:
    """Whether no vertex of the (simple, counter-clockwise) polygon points inwards; not compiled."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    following = np.roll(edges, -1, axis=0)
    return bool((edges[:, 0] * following[:, 1] - following[:, 0] * edges[:, 1] >= -1e-9).all())


@njit(cache=True, nogil=True)
def _side(ax: float, ay: float, bx: float, by: float, px: float, py: float) -> float:
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


@njit(cache=True, nogil=True)
def segments_cross(ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float) -> bool:
    """Whether the segments a-b and c-d cross properly (touching ends do not count)."""
    s1 = _side(ax, ay, bx, by, cx, cy)
    s2 = _side(ax, ay, bx, by, dx, dy)
    s3 = _side(cx, cy, dx, dy, ax, ay)
    s4 = _side(cx, cy, dx, dy, bx, by)
    return s1 * s2 < 0.0 and s3 * s4 < 0.0


@njit(cache=True, nogil=True)
def crosses_boundary(polygon: FloatArray, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether the segment a-b crosses an edge of the polygon, or passes from one of its vertices to another inside."""
    n = polygon.shape[0]
    j = n - 1
    for i in range(n):
        if segments_cross(ax, ay, bx, by, polygon[j, 0], polygon[j, 1], polygon[i, 0], polygon[i, 1]):
            return True
        j = i
    return False


@njit(cache=True, nogil=True)
def _apart(polygon: FloatArray, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether the segment a-b lies beside the rectangle round the polygon."""
    return bool(
        max(ax, bx) < polygon[:, 0].min()
        or min(ax, bx) > polygon[:, 0].max()
        or max(ay, by) < polygon[:, 1].min()
        or min(ay, by) > polygon[:, 1].max()
    )


@njit(cache=True, nogil=True)
def _far_between_crossings(
    polygon: FloatArray, ax: float, ay: float, bx: float, by: float, tolerance: float, side: float
) -> bool:
    """Whether the segment a-b, parted by the edges that it crosses, has a piece farther in or out than ``tolerance``.

    ``side``: -1 for inside, 1 for outside. Who is on the boundary by all but a rounding error crosses it where it
    leaves, and is on neither.
    """
    n = polygon.shape[0]
    at = np.empty(n + 2)
    at[0], at[1], count = 0.0, 1.0, 2
    j = n - 1
    for i in range(n):
        cx, cy, dx, dy = polygon[j, 0], polygon[j, 1], polygon[i, 0], polygon[i, 1]
        if segments_cross(ax, ay, bx, by, cx, cy, dx, dy):
            before, after = _side(cx, cy, dx, dy, ax, ay), _side(cx, cy, dx, dy, bx, by)
            at[count] = before / (before - after)
            count += 1
        j = i
    found = np.sort(at[:count])
    for k in range(1, count):
        t = 0.5 * (found[k - 1] + found[k])
        if side * signed_distance(polygon, ax + t * (bx - ax), ay + t * (by - ay)) > tolerance:
            return True
    return False


@njit(cache=True, nogil=True)
def enters(polygon: FloatArray, ax: float, ay: float, bx: float, by: float, tolerance: float) -> bool:
    """Whether the segment a-b runs through the polygon's inside, deeper than ``tolerance``."""
    if _apart(polygon, ax, ay, bx, by):
        return False
    if crosses_boundary(polygon, ax, ay, bx, by) and _far_between_crossings(polygon, ax, ay, bx, by, tolerance, -1.0):
        return True
    # A segment through two vertices, or with an end on the boundary, crosses no edge properly: look at its middle.
    for k in range(1, 8):
        t = k / 8.0
        if signed_distance(polygon, ax + t * (bx - ax), ay + t * (by - ay)) < -tolerance:
            return True
    return False


@njit(cache=True, nogil=True)
def leaves(polygon: FloatArray, ax: float, ay: float, bx: float, by: float, tolerance: float) -> bool:
    """Whether the segment a-b, whose ends lie in the polygon, runs outside it by more than ``tolerance``."""
    if crosses_boundary(polygon, ax, ay, bx, by) and _far_between_crossings(polygon, ax, ay, bx, by, tolerance, 1.0):
        return True
    # As above.
    for k in range(1, 8):
        t = k / 8.0
        if signed_distance(polygon, ax + t * (bx - ax), ay + t * (by - ay)) > tolerance:
            return True
    return False
