"""A swath survey flown ahead over a level bottom: the lines that a team would fly if the depth were known and even."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.exploration.core.coverage import Coverage
from app.exploration.core.free_space import FreeSpace
from app.exploration.swath.raster import Flying
from app.exploration.swath.survey import SwathSurvey

SAME_M = 1e-3
"""Corners closer together are one."""


def lines_flown_ahead(
    survey: SwathSurvey,
    space: FreeSpace,
    coverage: Coverage,
    starts_m: Mapping[str, FloatArray],
    flying: Mapping[str, Flying],
    left_m: Mapping[str, float],
    *,
    stop: Callable[[], bool] = lambda: False,
) -> dict[str, FloatArray]:
    """Return the corners of each vehicle's way, (k, 2): whole lines, until nothing is left or its way is used up.

    Parameters
    ----------
    space
        Where vehicles may go.
    coverage
        What there is to ensonify, its depth everywhere known.
    starts_m : (2,) each
        Where the vehicles begin, by name.
    left_m
        How far each may fly.
    stop
        Asked before every line; the ways until then are returned.
    """
    ways = {name: [np.asarray(start)] for name, start in starts_m.items()}
    flown_m, done = dict.fromkeys(ways, 0.0), set[str]()
    heading = dict.fromkeys(ways, np.nan)
    while (able := [name for name in ways if name not in done and flown_m[name] < left_m[name]]) and not stop():
        name = min(able, key=lambda one: flown_m[one])
        poses = {one: np.array([*way[-1], heading[one]]) for one, way in ways.items() if one not in done}
        end = survey.next_leg(name, poses[name], flying[name], coverage, poses, np.inf)
        if end is None:
            done.add(name)
            continue
        here = ways[name][-1]
        piece = survey.piece_m(name)
        along = len(piece) > 0 and np.array_equal(piece[-1], end)
        way = space.connect(here, np.array([space.nearest(corner) for corner in (piece if along else end[None])]))
        corners = np.vstack([here, way])
        corners = corners[np.concatenate([[True], np.hypot(*np.diff(corners, axis=0).T) > SAME_M])]
        steps = np.diff(corners, axis=0)
        lengths = np.hypot(*steps.T)
        if not len(lengths):
            # It would stay where it is for ever: nothing there can be flown.
            done.add(name)
            continue
        for a, b in pairwise(corners):
            coverage = replace(coverage, done=coverage.done | seen_from(a, b, coverage, flying[name]))
        ways[name] += list(corners[1:])
        heading[name] = float(np.arctan2(*steps[-1]))
        flown_m[name] += float(lengths.sum())
    return {name: np.array(way[1:]).reshape(-1, 2) for name, way in ways.items()}


def seen_from(a: FloatArray, b: FloatArray, coverage: Coverage, flying: Flying) -> BoolArray:
    """Return which wanted cells are seen on a straight leg between two places (2,), (rows, cols)."""
    centres = coverage.places_m(coverage.wanted)
    leg = b - a
    length = max(float(np.hypot(*leg)), 1e-9)
    along = (centres - a) @ (leg / length)
    across = np.abs((centres - a) @ (np.array([-leg[1], leg[0]]) / length))
    half_m = flying.half_width_m(coverage.depth_m[coverage.wanted])
    seen = np.zeros_like(coverage.wanted)
    slack = 0.5 * coverage.cell_m
    seen[coverage.wanted] = (across <= half_m) & (along >= -slack) & (along <= length + slack)
    return seen
