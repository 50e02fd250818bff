"""What a survey plan is worth: the squared interpolation error that is expected after it.

A node at distance D from the nearest sounding has an expected squared error of a x / (1 + x) with x = (D / l)^p, where
``a`` is the local roughness, ``l`` the correlation length, and p the exponent of short distances. It grows with the
distance and ends at ``a``, the most that can be wrong there: far less on sand than among rocks. ``U`` is the sum over
the nodes. Soundings are taken all along the legs. Every vehicle flies its route until the metres are used up that it
has left, and pays for its turns in metres.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from app.arrays import FloatArray, IntArray
from app.exploration.core.copies import copy_row, copy_rows
from app.exploration.core.routes import Turns, Underway, Vehicles, after_leg, set_out

BUCKETS_PER_SIDE = 12


class UncertaintyNodes(NamedTuple):
    """Where uncertainty is summed up, sorted by square buckets, so that a leg only asks the nodes around it.

    Attributes
    ----------
    x, y : (m,)
        East and north.
    weight : (m,)
        Roughness.
    first : (rows * cols + 1,)
        Where each bucket, row by row from the south-west, begins.
    west, south, side : float
        Corner of the first bucket and side of all.
    rows, cols : int
        Their number.
    most_m : (rows * cols,)
        The farthest that a node of each bucket is from the nearest sounding: a leg farther off lowers nothing there.
    """

    x: FloatArray
    y: FloatArray
    weight: FloatArray
    first: IntArray
    west: float
    south: float
    side: float
    rows: int
    cols: int
    most_m: FloatArray

    @property
    def en_m(self) -> FloatArray:
        """Positions (m, 2)."""
        return np.column_stack([self.x, self.y])

    def sounded(self, d2: FloatArray) -> "UncertaintyNodes":
        """Return the same nodes for squared distances to soundings that are nowhere larger than ``d2`` (m,)."""
        most2 = np.zeros(len(self.most_m))
        np.maximum.at(most2, np.repeat(np.arange(len(most2)), np.diff(self.first)), d2)
        return self._replace(most_m=np.sqrt(most2))


class SurveyObjective(NamedTuple):
    """How a plan is judged: l and p as above, and what turns cost.

    Nodes farther than ``reach_m`` from all soundings count as quite unknown.
    """

    scale_m: float
    power: float
    turns: Turns
    reach_m: float


def make_nodes(en_m: FloatArray, weight: FloatArray) -> UncertaintyNodes:
    """Sort nodes at ``en_m`` (m, 2) with their ``weight`` (m,) into buckets."""
    if len(en_m) == 0:
        none = np.zeros(0)
        return UncertaintyNodes(none, none, none, np.zeros(2, dtype=np.int64), 0.0, 0.0, 1.0, 1, 1, np.zeros(1))
    low, high = en_m.min(axis=0), en_m.max(axis=0)
    side = max(float((high - low).max()) / BUCKETS_PER_SIDE, 1e-6)
    cols, rows = (int(k) + 1 for k in (high - low) / side)
    at = np.minimum(((en_m - low) / side).astype(np.int64), [cols - 1, rows - 1])
    bucket = at[:, 1] * cols + at[:, 0]
    order = np.argsort(bucket, kind="stable")
    first = np.searchsorted(bucket[order], np.arange(rows * cols + 1)).astype(np.int64)
    x, y, w = (np.ascontiguousarray(v[order], dtype=np.float64) for v in (en_m[:, 0], en_m[:, 1], weight))
    anything = np.full(rows * cols, np.inf)
    return UncertaintyNodes(x, y, w, first, float(low[0]), float(low[1]), side, rows, cols, anything)


@njit(cache=True, nogil=True, fastmath=True)
def _lower(
    d2: FloatArray, x: FloatArray, y: FloatArray, first: int, end: int, ax: float, ay: float, dx: float, dy: float
) -> None:
    length2 = dx * dx + dy * dy
    inverse = 1.0 / length2 if length2 > 1e-12 else 0.0
    for i in range(first, end):
        rx = x[i] - ax
        ry = y[i] - ay
        t = (rx * dx + ry * dy) * inverse
        t = 0.0 if t < 0.0 else t
        t = 1.0 if t > 1.0 else t
        ex = rx - t * dx
        ey = ry - t * dy
        e2 = ex * ex + ey * ey
        d2[i] = e2 if e2 < d2[i] else d2[i]


@njit(cache=True, nogil=True)
def lower_to_segment(
    d2: FloatArray, nodes: UncertaintyNodes, ax: float, ay: float, bx: float, by: float, reach: float
) -> None:
    """Lower squared distances ``d2`` (m,) of the nodes to those to the segment a-b, in place.

    Nodes farther away than ``reach`` may be left as they are.
    """
    dx = bx - ax
    dy = by - ay
    length2 = dx * dx + dy * dy
    side = nodes.side
    c0 = max(0, int((min(ax, bx) - reach - nodes.west) / side))
    c1 = min(nodes.cols - 1, int((max(ax, bx) + reach - nodes.west) / side))
    r0 = max(0, int((min(ay, by) - reach - nodes.south) / side))
    r1 = min(nodes.rows - 1, int((max(ay, by) + reach - nodes.south) / side))
    for r in range(r0, r1 + 1):
        # Of a row of buckets the nodes are contiguous: find its part that the segment comes close to.
        low, high = -1, -1
        my = nodes.south + (r + 0.5) * side
        for c in range(c0, c1 + 1):
            rx = nodes.west + (c + 0.5) * side - ax
            ry = my - ay
            t = (rx * dx + ry * dy) / length2 if length2 > 1e-12 else 0.0
            t = min(1.0, max(0.0, t))
            ex = rx - t * dx
            ey = ry - t * dy
            far = min(reach, nodes.most_m[r * nodes.cols + c]) + 0.7072 * side
            if ex * ex + ey * ey <= far * far:
                if low < 0:
                    low = c
                high = c
        if low >= 0:
            row = r * nodes.cols
            _lower(d2, nodes.x, nodes.y, nodes.first[row + low], nodes.first[row + high + 1], ax, ay, dx, dy)


@njit(cache=True, nogil=True)
def lower_to_leg(
    d2: FloatArray,
    nodes: UncertaintyNodes,
    objective: SurveyObjective,
    at: Underway,
    to_x: float,
    to_y: float,
    most_m: float,
) -> Underway:
    """Lower ``d2`` to what it is after a vehicle's next leg, in place; return the vehicle after it.

    It ends where the vehicle has flown ``most_m`` in all.
    """
    after, part = after_leg(at, to_x, to_y, most_m, objective.turns)
    if part > 0.0:
        x, y = at.x + part * (to_x - at.x), at.y + part * (to_y - at.y)
        lower_to_segment(d2, nodes, at.x, at.y, x, y, objective.reach_m)
    return after


@njit(cache=True, nogil=True)
def lower_to_route(
    d2: FloatArray,
    nodes: UncertaintyNodes,
    objective: SurveyObjective,
    start: FloatArray,
    heading: float,
    left_m: float,
    route: FloatArray,
    count: int,
) -> float:
    """Lower ``d2`` to what it is after flying a route from ``start`` (2,), in place; return the metres left."""
    at = set_out(start[0], start[1], heading)
    for k in range(count):
        if at.flown_m >= left_m:
            break
        at = lower_to_leg(d2, nodes, objective, at, route[k, 0], route[k, 1], left_m)
    return max(0.0, left_m - at.flown_m)


@njit(cache=True, nogil=True, inline="always")
def expected_error(d2: float, weight: float, inverse2: float, power: float) -> float:
    """Return a x / (1 + x) for a squared distance and the roughness a, ``weight``; ``inverse2`` is 1 / l^2."""
    r2 = d2 * inverse2
    if r2 > 1e6:
        return weight
    x = r2 if power == 2.0 else r2 * np.sqrt(r2) if power == 3.0 else r2 ** (0.5 * power)
    part: float = weight * x / (1.0 + x)
    return part


@njit(cache=True, nogil=True)
def uncertainty(d2: FloatArray, weight: FloatArray, scale_m: float, power: float) -> float:
    """Return U for squared distances ``d2`` (m,) and roughness ``weight`` (m,)."""
    total = 0.0
    inverse2 = 1.0 / (scale_m * scale_m)
    for i in range(len(d2)):
        total += expected_error(d2[i], weight[i], inverse2, power)
    return total


@njit(cache=True, nogil=True)
def plan_value(
    d2: FloatArray,
    nodes: UncertaintyNodes,
    objective: SurveyObjective,
    vehicles: Vehicles,
    vias: FloatArray,
    counts: IntArray,
) -> float:
    """Return U after flying a plan.

    Parameters
    ----------
    d2 : (m,)
        Squared distances of the nodes to the soundings taken so far (not changed).
    vias : (n_vehicles, k, 2)
        Via points; the first ``counts[j]`` count.
    """
    after = d2.copy()
    for j in range(len(counts)):
        lower_to_route(
            after, nodes, objective, vehicles.en_m[j], vehicles.headings_rad[j], vehicles.left_m[j], vias[j], counts[j]
        )
    return uncertainty(after, nodes.weight, objective.scale_m, objective.power)


@njit(cache=True, nogil=True)
def values_after_first_leg(
    d2: FloatArray,
    nodes: UncertaintyNodes,
    objective: SurveyObjective,
    vehicles: Vehicles,
    targets: FloatArray,
    vias: FloatArray,
    counts: IntArray,
) -> FloatArray:
    """Return, per team target, U after the first leg alone and U after going on with the plan from there: (c, 2).

    ``targets`` (c, n_vehicles, 2) are the ends of the first legs; ``vias`` (c, n_vehicles, k, 2) and ``counts``
    (c, n_vehicles) what each would follow afterwards; the rest as in :func:`plan_value`.
    """
    c, n, _ = targets.shape
    out = np.empty((c, 2))
    route = np.empty((vias.shape[2] + 1, 2))
    for i in range(c):
        first = d2.copy()
        after = d2.copy()
        for j in range(n):
            start, heading, left = vehicles.en_m[j], vehicles.headings_rad[j], vehicles.left_m[j]
            copy_row(route[0], targets[i, j])
            copy_rows(route[1:], vias[i, j])
            # From the counts as below: numba compiles lower_to_route once more for the number 1 itself.
            only_first = counts[i, j] * 0 + 1
            lower_to_route(first, nodes, objective, start, heading, left, route, only_first)
            lower_to_route(after, nodes, objective, start, heading, left, route, counts[i, j] + 1)
        out[i, 0] = uncertainty(first, nodes.weight, objective.scale_m, objective.power)
        out[i, 1] = uncertainty(after, nodes.weight, objective.scale_m, objective.power)
    return out


def warm_up() -> None:
    """Compile what values plans, or load it from the cache of an earlier start."""
    one, two = np.zeros(1), np.zeros((1, 1, 2))
    nodes, objective = make_nodes(two[0], one), SurveyObjective(1.0, 2.0, Turns(0.0, 0.0), 1.0)
    counts = np.zeros((1, 1), dtype=np.int64)
    values_after_first_leg(one, nodes, objective, Vehicles(two[0], one, one), two, two[None], counts)
    plan_value(one, nodes, objective, Vehicles(two[0], one, one), two, counts[0])
