"""The coverage backbone of a survey: even lines, equal areas, every other line first, the rest coming back."""

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.routes import FreeSpace, fly
from app.exploration.lines.lattice import Sweep, even_lines, longer_axis_rad, most_lines
from app.exploration.survey.value import Nodes, SurveyObjective, make_nodes, plan_value

MARGIN_M = 0.5
FAR_M = 1e6
ACROSS_PENALTY = 1.05
"""How much worse lines across the longer axis count: of equally good ones those along it are flown."""
TO_BORDER = 0.4
"""Distance of the outer lines from the area's border, in spacings. Beyond them nothing supports the map on the other
side: for smooth sea floors (Matern 3/2) this gives the least mean variance, for rough ones it costs nothing."""
TRANSIT_PENALTY = 0.5
"""How much worse a share counts whose first line would only be reached with the whole budget."""


class Strip(NamedTuple):
    """A vehicle's strip across the lines, and how far its outer lines are from its ends, in spacings."""

    low_u: float
    high_u: float
    to_low: float
    to_high: float

    def lines(self, n: int) -> FloatArray:
        """Return where ``n`` lines run, (n,)."""
        return even_lines(self.low_u, self.high_u, n, self.to_low, self.to_high)


@dataclass(frozen=True)
class Share:
    """One vehicle's part of the backbone: stops (k, 2), the first ``coarse`` of which are the first pass."""

    stops: FloatArray
    coarse: int


def backbone(
    constraints: Constraints,
    starts: FloatArray,
    steps: int,
    nodes: Nodes,
    scale_m: float,
    power: float,
    to_border: float = TO_BORDER,
) -> list[Share]:
    """Return every vehicle's share of the backbone that promises the best map for the steps available.

    Lines along either axis of the area, strips in either order, every corner to begin at; as many lines as the steps
    pay for. ``starts`` is (n_vehicles, 2); ``to_border`` the distance of the outer lines from the border, in spacings.
    """
    free = FreeSpace(constraints, MARGIN_M)
    axis = longer_axis_rad(constraints.area)
    best: tuple[float, list[Share]] | None = None
    for direction in (axis, axis + np.pi / 2):
        sweep = Sweep(constraints, free, float(direction))
        cuts = sweep.shares(len(starts))
        for order in _orders(sweep.to_uv(starts)[:, 0]):
            shares, value = [], 0.0
            for i, strip in enumerate(order):
                strip_u = Strip(
                    float(cuts[strip]),
                    float(cuts[strip + 1]),
                    to_border if strip == 0 else 0.5,
                    to_border if strip == len(starts) - 1 else 0.5,
                )
                share, left = _best_share(
                    sweep, starts[i], strip_u, constraints.max_step_m, steps, nodes, scale_m, power
                )
                shares.append(share)
                value += left
            if direction != axis:
                value *= ACROSS_PENALTY
            if best is None or value < best[0] * (1 - 1e-9):
                best = value, shares
    assert best is not None  # noqa: S101 - two directions, at least one order
    return best[1]


def _orders(u: FloatArray) -> list[tuple[int, ...]]:
    """Return which strip each vehicle takes: every way for a few vehicles, otherwise as they stand across the lines."""
    n = len(u)
    if n <= 3:
        return list(itertools.permutations(range(n)))
    rank = np.argsort(np.argsort(u, kind="stable"))
    return [tuple(int(k) for k in rank), tuple(int(n - 1 - k) for k in rank)]


def _best_share(
    sweep: Sweep,
    start: FloatArray,
    strip: Strip,
    step_m: float,
    steps: int,
    nodes: Nodes,
    scale_m: float,
    power: float,
) -> tuple[Share, float]:
    u = sweep.to_uv(nodes.en_m)[:, 0]
    inside = (u >= strip.low_u) & (u <= strip.high_u)
    mine = make_nodes(nodes.en_m[inside], nodes.weight[inside])
    unknown = np.full(len(mine.x), np.inf)
    objective = SurveyObjective(step_m, steps, scale_m, power, 0.0, FAR_M)
    affordable = most_lines(lambda n: _steps(sweep, start, strip, n, step_m) <= steps)
    best: tuple[float, Share] | None = None
    for n in {max(1, affordable - 1), affordable, affordable + 1}:
        for forward, upwards in itertools.product((True, False), repeat=2):
            share = _there_and_back(sweep, start, strip, n, forward=forward, upwards=upwards)
            route = share.stops
            left = plan_value(
                unknown, mine, objective, start[None], np.array([np.nan]), route[None], np.array([len(route)])
            )
            left *= 1.0 + TRANSIT_PENALTY * float(np.hypot(*(route[0] - start))) / (step_m * steps)
            if best is None or left < best[0] * (1 - 1e-9):
                best = left, share
    assert best is not None  # noqa: S101 - at least one number of lines was tried
    return best[1], best[0]


def _steps(sweep: Sweep, start: FloatArray, strip: Strip, n: int, step_m: float) -> int:
    route = _there_and_back(sweep, start, strip, n, forward=True, upwards=True).stops
    most = 100_000
    _, used = fly(start[0], start[1], route, len(route), step_m, most, np.empty((2 * len(route) + 4, 2)))
    return used


def _there_and_back(sweep: Sweep, start: FloatArray, strip: Strip, n: int, *, forward: bool, upwards: bool) -> Share:
    lines = strip.lines(n)
    lines = lines if forward else lines[::-1]
    out, back = lines[::2], lines[1::2][::-1]
    first = sweep.free.connect(start, sweep.stops(out, upwards=upwards))
    rest_upwards = upwards if len(out) % 2 == 0 else not upwards
    here = first[-1] if len(first) else start
    second = sweep.free.connect(here, sweep.stops(back, upwards=rest_upwards))
    return Share(np.vstack([first, second]), len(first))
