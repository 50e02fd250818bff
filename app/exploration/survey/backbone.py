"""The coverage backbone of a survey: even lines, every other one first and the rest coming back, or all in order."""

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints, inside_area
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.routes import Vehicles
from app.exploration.lines.even_survey import Pattern, even_survey, orders_across
from app.exploration.lines.lattice import Sweep, even_lines, longer_axis_rad, most_lines
from app.exploration.lines.line_shares import way_m
from app.exploration.lines.parts import parts_of
from app.exploration.survey.value import SurveyObjective, UncertaintyNodes, make_nodes, plan_value

MARGIN_M = 0.5
TO_BORDER = 0.4
"""Distance of the outer lines from the area's border, in spacings. Beyond them nothing supports the map on the other
side: for smooth sea floors (Matern 3/2) this gives the least mean variance, for rough ones it costs nothing."""
TO_END = 0.25
"""Distance of the ends of lines from the border, in spacings, where the lines are flown in order."""
PARTS = 8
"""Into how many parts vehicles may share a line."""
IN_ORDER = (Pattern(), Pattern(TO_BORDER, 0.0), Pattern(TO_BORDER, TO_END, PARTS))
ADAPTS, MANY_LINES = 0.85, 11
"""How much better every other line first counts than all in order where every vehicle flies many lines: what it has met
may be followed up. After fewer the map tells too little of where it is rough."""
NARROW = 4.0
"""Lines closer than so many turning radii count as many: on every other one, vehicles do not have to swing out."""
TRANSIT_PENALTY = 0.5
"""How much worse a share counts whose first line would only be reached with the whole budget."""
LEAST_STRIP = 0.05
"""Who can hardly reach its strip gets one in proportion to this part of what it can fly."""


class BackboneStrip(NamedTuple):
    """A vehicle's strip across the lines; how far its outer lines, and the ends of all, are from its border.

    Distances from the border are in spacings.
    """

    low_u: float
    high_u: float
    to_low: float
    to_high: float
    to_end: float

    def lines(self, n: int) -> FloatArray:
        """Return where ``n`` lines run, (n,)."""
        return even_lines(self.low_u, self.high_u, n, self.to_low, self.to_high)

    def inset_m(self, n: int) -> float:
        """Return how far ``n`` lines end from the border."""
        return self.to_end * (self.high_u - self.low_u) / (n - 1 + self.to_low + self.to_high)


@dataclass(frozen=True)
class Share:
    """One vehicle's part of the backbone: stops (k, 2), the first ``coarse`` of which are the first pass.

    None are where all lines are flown in order.
    """

    stops: FloatArray
    coarse: int


def backbone(
    constraints: Constraints, vehicles: Vehicles, nodes: UncertaintyNodes, objective: SurveyObjective
) -> list[Share]:
    """Return every vehicle's share of the even survey that promises the best map for what each can fly.

    Either there and back, or whole lines in order, whichever leaves less uncertainty. Where keep-out zones cut the area
    into parts between which no way leads, the vehicles in each part share a survey of that part.
    """
    shares = [Share(np.zeros((0, 2)), 0)] * len(vehicles.en_m)
    for part, members in parts_of(constraints, FreeSpace(constraints, MARGIN_M), vehicles.en_m):
        within = nodes
        if part is not constraints:
            inside = inside_area(part, nodes.en_m)
            within = make_nodes(nodes.en_m[inside], nodes.weight[inside])
        own = Vehicles(vehicles.en_m[members], vehicles.headings_rad[members], vehicles.left_m[members])
        for i, share in zip(members, _backbone_of_one(part, own, within, objective), strict=True):
            shares[i] = share
    return shares


def _backbone_of_one(
    constraints: Constraints, vehicles: Vehicles, nodes: UncertaintyNodes, objective: SurveyObjective
) -> list[Share]:
    """Return :func:`backbone` of an area in one part."""
    axis = longer_axis_rad(constraints.area)
    free = FreeSpace(constraints, MARGIN_M)
    sweeps = [Sweep(constraints, free, direction) for direction in (axis, axis + np.pi / 2)]
    whole = [even_survey(sweep, vehicles, objective.turns, Pattern()) for sweep in sweeps]
    # Where no sounding tells which way the ground falls, the direction is that in which lines lie closer.
    spacings_m = [np.inf if survey is None else survey.spacing_m for survey in whole]
    sweep = sweeps[int(np.argmin(spacings_m))]
    value, shares = there_and_back(sweep, vehicles, nodes, objective)
    spacing_m, width_m = min(spacings_m), float(np.ptp(sweep.to_uv(constraints.area)[:, 0]))
    many = MANY_LINES * len(vehicles.en_m) * spacing_m <= width_m or spacing_m <= NARROW * objective.turns.radius_m
    if many:
        value *= ADAPTS
    unknown = np.full(len(nodes.x), np.inf)
    for pattern in IN_ORDER:
        survey = even_survey(sweep, vehicles, objective.turns, pattern)
        if survey is None:
            continue
        left = plan_value(unknown, nodes, objective, vehicles, *packed(survey.routes))
        if left < value * (1 - 1e-9):
            value, shares = left, [Share(route, 0) for route in survey.routes]
    return shares


def there_and_back(
    sweep: Sweep,
    vehicles: Vehicles,
    nodes: UncertaintyNodes,
    objective: SurveyObjective,
    to_border: float = TO_BORDER,
    to_end: float = TO_END,
) -> tuple[float, list[Share]]:
    """Return the best survey that flies every other line first and the lines between on the way back, and its U.

    Strips in either order, every corner to begin at; as many lines as the metres pay for. Strips are in proportion to
    what the vehicles can fly when they have come there. ``to_border`` and ``to_end`` are the distances of the outer
    lines, and of the ends of all, from the border, in spacings.
    """
    best: tuple[float, list[Share]] | None = None
    for order in orders_across(sweep.to_uv(vehicles.en_m)[:, 0]):
        shares, value = [Share(np.zeros((0, 2)), 0)] * len(order), 0.0
        for i, strip in zip(order, _strips(sweep, vehicles, order, to_border, to_end), strict=True):
            shares[i], left = _best_share(sweep, vehicles, i, strip, nodes, objective)
            value += left
        if best is None or value < best[0] * (1 - 1e-9):
            best = value, shares
    assert best is not None  # noqa: S101 - at least one order
    return best


def packed(routes: list[FloatArray]) -> tuple[FloatArray, np.ndarray]:
    """Return routes (k, 2) as one array (n, k, 2) and how many rows of each count."""
    counts = np.array([len(route) for route in routes], dtype=np.int64)
    vias = np.zeros((len(routes), max(1, int(counts.max())), 2))
    for i, route in enumerate(routes):
        vias[i, : counts[i]] = route
    return vias, counts


def _strips(
    sweep: Sweep, vehicles: Vehicles, order: tuple[int, ...], to_border: float, to_end: float
) -> list[BackboneStrip]:
    """Return the strips of the vehicles in the order in which they lie across the lines."""
    u, left_m = sweep.to_uv(vehicles.en_m)[list(order), 0], vehicles.left_m[list(order)]
    cuts = sweep.shares(np.maximum(left_m, 1.0))
    away = np.maximum(0.0, np.maximum(cuts[:-1] - u, u - cuts[1:]))
    cuts = sweep.shares(np.maximum(np.maximum(left_m - away, LEAST_STRIP * left_m), 1.0))
    last = len(order) - 1
    return [
        BackboneStrip(
            float(cuts[k]), float(cuts[k + 1]), to_border if k == 0 else 0.5, to_border if k == last else 0.5, to_end
        )
        for k in range(len(order))
    ]


def _best_share(
    sweep: Sweep, vehicles: Vehicles, i: int, strip: BackboneStrip, nodes: UncertaintyNodes, objective: SurveyObjective
) -> tuple[Share, float]:
    u = sweep.to_uv(nodes.en_m)[:, 0]
    inside = (u >= strip.low_u) & (u <= strip.high_u)
    mine = make_nodes(nodes.en_m[inside], nodes.weight[inside])
    unknown = np.full(len(mine.x), np.inf)
    alone = Vehicles(vehicles.en_m[i : i + 1], vehicles.headings_rad[i : i + 1], vehicles.left_m[i : i + 1])

    def affordable(n: int) -> bool:
        share = _there_and_back(sweep, alone.en_m[0], strip, n, forward=True, upwards=True)
        return way_m(alone, objective.turns, 0, share.stops) <= float(alone.left_m[0])

    most = most_lines(affordable)
    best: tuple[float, Share] | None = None
    for n in {max(1, most - 1), most, most + 1}:
        for forward, upwards in itertools.product((True, False), repeat=2):
            share = _there_and_back(sweep, alone.en_m[0], strip, n, forward=forward, upwards=upwards)
            left = plan_value(unknown, mine, objective, alone, *packed([share.stops]))
            if len(share.stops):
                away = float(np.hypot(*(share.stops[0] - alone.en_m[0])))
                left *= 1.0 + TRANSIT_PENALTY * away / max(float(alone.left_m[0]), away, 1e-9)
            if best is None or left < best[0] * (1 - 1e-9):
                best = left, share
    assert best is not None  # noqa: S101 - at least one number of lines was tried
    return best[1], best[0]


def _there_and_back(
    sweep: Sweep, start: FloatArray, strip: BackboneStrip, n: int, *, forward: bool, upwards: bool
) -> Share:
    lines = strip.lines(n)
    lines = lines if forward else lines[::-1]
    out, back = lines[::2], lines[1::2][::-1]
    first = sweep.free.connect(start, sweep.stops(out, upwards=upwards, inset_m=strip.inset_m(n)))
    rest_upwards = upwards if len(out) % 2 == 0 else not upwards
    here = first[-1] if len(first) else start
    second = sweep.free.connect(here, sweep.stops(back, upwards=rest_upwards, inset_m=strip.inset_m(n)))
    return Share(np.vstack([first, second]), len(first))
