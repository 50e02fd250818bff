"""Even surveys: parallel lines over the whole area, dealt to the vehicles by what each can fly.

A vehicle gets neighbouring lines, or parts of lines where these may be shared, and flies all of them: no line is left
half flown. There are as many lines as the team can pay for, transits and turns included.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.routes import Turns, Vehicles
from app.exploration.lines.lattice import Sweep, even_lines, most_lines
from app.exploration.lines.line_shares import LinePath, dealt, path_over, way_m

MOST_ORDERS = 3
"""Teams up to this size are dealt the lines in every order."""
MOST_TO_END = 0.5
"""Lines end at most so many spacings inside the border: there the ways between them lie as an outer line would."""
HALVINGS = 6
"""How often the place of the lines' ends is halved in: to less than a hundredth of a spacing."""


@dataclass(frozen=True)
class Pattern:
    """How even lines lie: distances from the border in spacings, and into how many parts vehicles may share a line.

    ``to_side`` is that of the outer lines, ``to_end`` that of the ends of all lines.
    """

    to_side: float = 0.5
    to_end: float = 0.0
    parts: int = 1


@dataclass(frozen=True)
class EvenSurvey:
    """The routes (k, 2) of all vehicles and the distance of the lines."""

    routes: list[FloatArray]
    spacing_m: float


def even_survey(sweep: Sweep, vehicles: Vehicles, turns: Turns, pattern: Pattern) -> EvenSurvey | None:
    """Return the survey of the most lines in the direction of ``sweep`` that the team can fly; None without any."""
    dealt: dict[int, EvenSurvey | None] = {}

    def survey(n: int) -> EvenSurvey | None:
        if n not in dealt:
            dealt[n] = survey_of(sweep, vehicles, [turns] * len(vehicles.en_m), pattern, n)
        return dealt[n]

    return survey(most_lines(lambda n: survey(n) is not None))


def fullest_surveys(sweep: Sweep, vehicles: Vehicles, turns: Sequence[Turns], pattern: Pattern) -> list[EvenSurvey]:
    """Return even surveys in the direction of ``sweep`` that leave the team as little to fly as may be.

    How far lines end inside the border, up to half a spacing, makes up for what a whole line more or less would cost:
    that far inside, the ways from line to line lie as an outer line would. Two numbers of lines, the largest that the
    team can fly and one line less, each with ends as near to the border as it can fly. No survey is returned where the
    team can fly none.

    Parameters
    ----------
    turns
        What they cost each vehicle.
    pattern
        How lines lie; where they end is found.
    """

    def ending(to_end: float) -> Pattern:
        return replace(pattern, to_end=to_end)

    def affordable(n: int, to_end: float) -> bool:
        return next(_ways(sweep, vehicles, turns, ending(to_end), n), None) is not None

    most = most_lines(lambda n: affordable(n, MOST_TO_END))
    found: list[EvenSurvey] = []
    for n in range(max(1, most - 1), most + 1):
        low, high = 0.0, MOST_TO_END
        if affordable(n, low):
            high = low
        for _ in range(HALVINGS if high > low else 0):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if affordable(n, middle) else (middle, high)
        survey = survey_of(sweep, vehicles, turns, ending(high), n)
        found += [] if survey is None else [survey]
    return found


def survey_of(sweep: Sweep, vehicles: Vehicles, turns: Sequence[Turns], pattern: Pattern, n: int) -> EvenSurvey | None:
    """Return the survey of ``n`` lines of a pattern that takes the least way; None where the team cannot fly it.

    ``turns`` are what they cost each vehicle.
    """

    def length_m(way: list[FloatArray]) -> float:
        return sum(way_m(vehicles, turns[i], i, route) for i, route in enumerate(way))

    found = min(_ways(sweep, vehicles, turns, pattern, n), key=length_m, default=None)
    return None if found is None else EvenSurvey(found, _spacing_m(sweep, pattern, n))


def _ways(
    sweep: Sweep, vehicles: Vehicles, turns: Sequence[Turns], pattern: Pattern, n: int
) -> Iterator[list[FloatArray]]:
    """Return the routes of all vehicles over ``n`` lines of a pattern, in every order in which the team can fly it."""
    u = sweep.to_uv(sweep.constraints.area)[:, 0]
    lines_u = even_lines(float(u.min()), float(u.max()), n, pattern.to_side, pattern.to_side)
    inset_m = pattern.to_end * _spacing_m(sweep, pattern, n)
    orders = orders_across(sweep.to_uv(vehicles.en_m)[:, 0])
    for upwards in (True, False):
        path = _path(sweep, lines_u, inset_m, pattern.parts, upwards=upwards)
        for order in orders:
            way = dealt(sweep.free, vehicles, turns, path, order)
            if way is not None:
                yield way


def _spacing_m(sweep: Sweep, pattern: Pattern, n: int) -> float:
    return float(np.ptp(sweep.to_uv(sweep.constraints.area)[:, 0])) / (n - 1 + 2 * pattern.to_side)


def orders_across(u: FloatArray) -> list[tuple[int, ...]]:
    """Return in which orders vehicles may stand across the lines: all for a few, else as they do, there or back."""
    if len(u) <= MOST_ORDERS:
        return list(itertools.permutations(range(len(u))))
    rank = tuple(int(k) for k in np.argsort(u, kind="stable"))
    return [rank, rank[::-1]]


def _path(sweep: Sweep, lines_u: FloatArray, inset_m: float, parts: int, *, upwards: bool) -> LinePath:
    lines: list[FloatArray] = []
    for pieces in sweep.lines(lines_u, inset_m):
        if not pieces:
            continue
        stops = np.vstack(pieces)
        lines.append(stops if upwards else stops[::-1])
        upwards = not upwards
    return path_over(sweep.free, lines, parts)
