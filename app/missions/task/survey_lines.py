"""The lines of a mission's line plan in its local frame, and what of them is not flown."""

import itertools
from collections.abc import Mapping

import shapely
from shapely import LineString

from app.exploration.core.free_space import free_region
from app.exploration.lines.given_lines import GivenLine
from app.exploration.lines.lawnmower import BORDER_MARGIN_M
from app.missions.spec.mission import MissionSpec
from app.missions.task.constraints import make_constraints

LEAST_TOLD_M = 1.5
"""Less that is not flown of a line is not told: on the border itself nothing can be."""
MOST_NAMED = 8


def given_lines(spec: MissionSpec) -> list[GivenLine]:
    """Return the lines of a mission's plan, in its order."""
    return [GivenLine(line.name, spec.local_line(line), line.keep_direction) for line in spec.survey_lines]


def not_flyable_m(spec: MissionSpec) -> dict[str, float]:
    """Return how much of lines lies outside the area or in keep-out zones, by name; none of which all can be flown."""
    constraints = make_constraints(spec)
    free = free_region(constraints.for_plans, BORDER_MARGIN_M)
    shapely.prepare(free)
    found = {}
    lines = given_lines(spec)
    # Most lie inside as a whole, which is quick to tell of all at once.
    inside = shapely.covers(free, [LineString(line.en_m) for line in lines])
    for line in itertools.compress(lines, ~inside):
        inside_m = sum(GivenLine(line.name, piece).length_m for piece in line.within(free))
        if line.length_m - inside_m > LEAST_TOLD_M:
            found[line.name] = line.length_m - inside_m
    return found


def line_remarks(spec: MissionSpec) -> list[str]:
    """Return what is to be known of a mission's lines before they are flown, in words."""
    cut = not_flyable_m(spec) if spec.survey_lines else {}
    if not cut:
        return []
    count = "1 line" if len(cut) == 1 else f"{len(cut)} lines"
    return [f"parts of {count} lie outside the area or in keep-out zones and are not flown: {lengths_words(cut)}"]


def lengths_words(lengths_m: Mapping[str, float]) -> str:
    """Return names of lines with how much of each, as words; of many only the first ones."""
    named = [f"{name} ({length_m:.0f} m)" for name, length_m in list(lengths_m.items())[:MOST_NAMED]]
    others = len(lengths_m) - len(named)
    return ", ".join(named) + (f" and {others} more" if others else "")
