"""What lines have missed: which of it one pass sees, and what is passed on the way to a line."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.ndimage import label

from app.arrays import BoolArray, FloatArray
from app.exploration.swath.assignment import Assignment, Question
from app.exploration.swath.entries import approaches_m
from app.exploration.swath.entries import pose as pose_of
from app.exploration.swath.passes import FILLING_OVERLAP, MOST_TOURED, Pass, Passable, pieces, shared, tour
from app.exploration.swath.raster import LineRaster
from app.exploration.swath.shares import free_at

STUBBORN_OVERLAP = 0.95
"""What was looked at in vain lies within so large a share less of half a swath: a line is over it."""

EARLY = 0.4
"""Missed ground is passed on the way to a line where the detour is less than so much of the way back from the last."""


def passable(
    left: LineRaster, small: BoolArray, tried_twice: BoolArray, asked: Question
) -> tuple[list[Passable], BoolArray, float]:
    """Return the pieces of missed ground that a pass sees, cells of the others, and the overlap of lines to these.

    What two lines looked at in vain is led over: something stands in between.

    Parameters
    ----------
    small, tried_twice
        What was missed, and what two lines were to see and did not, (along, across) both.
    """
    flying, here = asked.flying, asked.pose[:2]
    stubborn = small & touching(small, tried_twice)
    found, wide = pieces(left, small & ~stubborn, replace(flying, overlap=FILLING_OVERLAP), here)
    over, not_over = pieces(left, stubborn, replace(flying, overlap=STUBBORN_OVERLAP), here)
    return found + over, wide | not_over, STUBBORN_OVERLAP if not_over.any() else FILLING_OVERLAP


def on_the_way(
    sweeps: Mapping[str, Assignment],
    asked: Question,
    left: LineRaster,
    swept: BoolArray,
    found: list[Passable],
    line: tuple[FloatArray, float],
) -> Pass | None:
    """Return a pass over missed ground that is a small detour on the way to a line; None where none is.

    Parameters
    ----------
    swept
        What the vehicle has still to sweep, (along, across).
    found
        What lines have missed.
    line
        Its path (k, 2) and the way to it.
    """
    path, away_m = line
    radius_m = asked.flying.radius_m
    rows = np.flatnonzero(swept.any(axis=0))
    ends_m = left.across_m[rows[[0, -1]]]
    best: tuple[float, Pass] | None = None
    for piece in shared(found, *free_at(sweeps, asked.vehicle, asked.team))[asked.vehicle][:MOST_TOURED]:
        (one,) = tour([piece], asked.pose, radius_m)
        onward_m = approaches_m(pose_of(one.path, end=True), pose_of(path)[None], radius_m)
        detour_m = one.way_m + float(onward_m[0]) - away_m
        later_m = float(np.abs(ends_m - left.axes.turned(piece.middle_m)[1]).max())
        if detour_m < EARLY * later_m and (best is None or detour_m < best[0]):
            best = detour_m, one
    return None if best is None else best[1]


def touching(cells: BoolArray, others: BoolArray) -> BoolArray:
    """Return those of some cells (along, across) whose piece shares any with others."""
    number, count = label(cells, np.ones((3, 3)))
    touched = np.zeros(count + 1, dtype=bool)
    touched[number[cells & others]] = True
    return np.asarray(touched[number])
