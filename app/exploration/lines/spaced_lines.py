"""Lines at the distance that an operator asks for, dealt so that all vehicles are done at about the same time."""

import math
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.routes import Turns, Vehicles
from app.exploration.lines.even_survey import EvenSurvey, Pattern, survey_of
from app.exploration.lines.lattice import MAX_LINES, Sweep, axes_of, even_lines, route_length
from app.exploration.lines.line_shares import PARTS, WHOLE_LINES, least_share
from app.exploration.lines.parts import parts_of

SPARE = 0.05
"""A line more is flown where the outer ones would lie farther than half a spacing, and this part of one, inside."""
LEAST_LEFT = 0.01
"""Less of the area counts as nothing left out."""


def line_count(area: FloatArray, direction_rad: float, spacing_m: float) -> int:
    """Return how many lines at a distance an area (n, 2) takes in a direction, anticlockwise from east."""
    return max(1, math.ceil(_width_m(area, direction_rad) / spacing_m - 2 * SPARE))


def check_line_count(area: FloatArray, direction_rad: float, spacing_m: float) -> None:
    """Raise ValueError where that is more than one survey can have."""
    count, width_m = line_count(area, direction_rad, spacing_m), _width_m(area, direction_rad)
    if count > MAX_LINES:
        raise ValueError(
            f"{spacing_m:g} m makes {count} lines of an area that is {width_m:.0f} m wide, and a survey has at most "
            f"{MAX_LINES}: give at least {width_m / MAX_LINES:.2g} m"
        )


@dataclass(frozen=True)
class SpacedLines:
    """Each vehicle's route (k, 2), and the metres of lines in parts of the area that no vehicle can reach or fly in."""

    routes: list[FloatArray]
    left_out_m: float


def spaced_lines(
    constraints: Constraints,
    margin_m: float,
    direction_rad: float,
    spacing_m: float,
    vehicles: Vehicles,
    turns: list[Turns],
) -> SpacedLines:
    """Return each vehicle's route over lines at a distance.

    Neighbouring lines go to one vehicle, by what each can fly: as large a share of it from all. Where the lines take
    more than the team can fly, everybody's route is longer than it can fly, by the same share. Where keep-out zones cut
    the area into parts between which no way leads, the vehicles in each part share the lines of that part.

    Parameters
    ----------
    margin_m
        How far lines keep off borders and zones.
    direction_rad
        Of the lines, anticlockwise from east.
    spacing_m
        From line to line; less by a trifle where the outer ones would else lie on the border.
    vehicles
        The team.
    turns
        What they cost each vehicle.
    """
    routes: list[FloatArray] = [np.zeros((0, 2))] * len(vehicles.en_m)
    free = FreeSpace(constraints, margin_m)
    left_m2 = free.region.area
    for part, members in parts_of(constraints, free, vehicles.en_m):
        sweep = Sweep(part, FreeSpace(part, margin_m), direction_rad)
        there = Vehicles(*(of_all[members] for of_all in vehicles))
        survey = _fairest_survey(sweep, there, [turns[i] for i in members], spacing_m)
        if survey is None:
            continue
        left_m2 -= sweep.free.region.area
        for i, route in zip(members, survey.routes, strict=True):
            routes[i] = route
    # Parts that are narrower than a vehicle may fly in are nobody's.
    return SpacedLines(routes, left_m2 / spacing_m if left_m2 > LEAST_LEFT * free.region.area else 0.0)


def with_crosslines(
    constraints: Constraints,
    margin_m: float,
    direction_rad: float,
    length_m: float,
    vehicles: Vehicles,
    routes: list[FloatArray],
) -> list[FloatArray]:
    """Return routes with evenly spaced lines across all others at their ends, at least one in each part of the area.

    Each goes to the vehicle that can be done with it first, by the share of what it can fly. Parts in which nobody
    flies lines get none.

    Parameters
    ----------
    length_m
        How long they are in all, nearly.
    vehicles, routes
        The team, and each vehicle's route (k, 2) so far. The rest as for :func:`spaced_lines`.
    """
    found, area_m2 = list(routes), FreeSpace(constraints, margin_m).region.area
    for part, members in parts_of(constraints, FreeSpace(constraints, margin_m), vehicles.en_m):
        flying = [i for i in members if vehicles.left_m[i] > 0.0]
        sweep = Sweep(part, FreeSpace(part, margin_m), direction_rad + np.pi / 2)
        u, mine_m2 = sweep.to_uv(part.area)[:, 0], sweep.free.region.area
        line_m = mine_m2 / max(float(np.ptp(u)), margin_m)
        count = min(max(1, round(length_m * mine_m2 / area_m2 / line_m)), MAX_LINES)
        for line_u in even_lines(float(u.min()), float(u.max()), count):
            tries = []
            for upwards in (True, False):
                stops = sweep.stops(np.array([line_u]), upwards=upwards)
                for i in flying if len(stops) else ():
                    end_m = found[i][-1] if len(found[i]) else vehicles.en_m[i]
                    route = np.vstack([found[i], sweep.free.connect(end_m, stops)])
                    tries.append((route_length(vehicles.en_m[i], route) / max(vehicles.left_m[i], 1.0), i, route))
            if tries:
                _, i, route = min(tries, key=lambda one: one[0])
                found[i] = route
    return found


def _fairest_survey(sweep: Sweep, vehicles: Vehicles, turns: list[Turns], spacing_m: float) -> EvenSurvey | None:
    """Return the lines dealt so that the largest share of its way that any vehicle needs is as small as may be."""
    area, direction_rad = sweep.constraints.area, sweep.direction_rad
    n = line_count(area, direction_rad, spacing_m)
    inside = (_width_m(area, direction_rad) / spacing_m - (n - 1)) / 2
    # On the border itself nothing can be flown.
    to_side = max(inside, 2.0 * sweep.free.margin_m / spacing_m)
    pattern = Pattern(to_side=to_side, parts=1 if n >= WHOLE_LINES * len(vehicles.en_m) else PARTS)

    def dealt(share: float) -> EvenSurvey | None:
        return survey_of(sweep, vehicles._replace(left_m=share * vehicles.left_m), turns, pattern, n)

    return least_share(dealt)


def _width_m(area: FloatArray, direction_rad: float) -> float:
    return float(np.ptp(area @ axes_of(direction_rad)[0]))
