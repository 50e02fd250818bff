"""Which line of a line plan a vehicle flew, told from where it was."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import LineString, STRtree

from app.arrays import FloatArray
from app.mapping.quality.tracks import between_rad

MOST_OFF_M = 10.0
"""A vehicle that is farther off a line, on average, does not fly it."""
PARALLEL_RAD = np.radians(25.0)
"""Nor does one whose course differs by more from the line's."""
SAMPLES = 9
AROUND_M = 5.0
"""The course of a line at a place is told from so much of it to both sides."""


@dataclass(frozen=True)
class PlannedLine:
    """A line of a plan: its name and its vertices (k, 2), east and north."""

    name: str
    en_m: FloatArray


def planned_names(begin_m: FloatArray, end_m: FloatArray, planned: Sequence[PlannedLine]) -> list[str]:
    """Return for each straight line that was flown the name of the planned one that it lies on; empty: on none.

    Of planned lines side by side the nearest counts. Several lines that were flown may be parts of one.

    Parameters
    ----------
    begin_m, end_m : (m, 2)
        Where lines that were flown begin and end.
    """
    if not planned:
        return [""] * len(begin_m)
    shapes = [LineString(line.en_m) for line in planned]
    tree = STRtree(shapes)
    names = []
    for begin, end in zip(begin_m, end_m, strict=True):
        places = shapely.points(begin + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (end - begin))
        heading_rad = np.arctan2(*(end - begin))
        best, least_m = "", MOST_OFF_M
        for number in tree.query(places[SAMPLES // 2], predicate="dwithin", distance=SAMPLES * MOST_OFF_M):
            off_m = float(np.mean(shapely.distance(shapes[number], places)))
            beside = between_rad(_heading_rad(shapes[number], places[SAMPLES // 2]), heading_rad) <= PARALLEL_RAD
            if off_m < least_m and beside:
                best, least_m = planned[number].name, off_m
        names.append(best)
    return names


def _heading_rad(line: LineString, place: shapely.Point) -> FloatArray:
    """Return the direction of a line where it is nearest to a place, clockwise from north."""
    at_m = line.project(place)
    before, after = (line.interpolate(max(at_m + by_m, 0.0)) for by_m in (-AROUND_M, AROUND_M))
    return np.asarray(np.arctan2(after.x - before.x, after.y - before.y))
