"""Short passes over what lines have missed: each in the direction, and to the side, that take the shortest way."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import find_objects, label

from app.arrays import BoolArray, FloatArray
from app.exploration.motion.dubins import lengths_m
from app.exploration.swath.raster import Flying, LineRaster

HEADINGS = 24
MOST_PIECES = 10
"""So many pieces of missed ground, the nearest, are looked at."""

ASIDE = (-1.0, 0.0, 1.0)
"""Sides that a pass leaves a piece on, in what the swath is wider."""


@dataclass(frozen=True)
class Pass:
    """One straight way over a piece of ground that sees all of it.

    Attributes
    ----------
    path : (2, 2)
        East and north, as flown.
    away_m
        The way to its beginning.
    """

    path: FloatArray
    away_m: float

    @property
    def way_m(self) -> float:
        """The way to its end."""
        return self.away_m + float(np.hypot(*(self.path[1] - self.path[0])))


def passes(raster: LineRaster, missed: BoolArray, flying: Flying, pose: FloatArray) -> tuple[list[Pass], BoolArray]:
    """Return the shortest pass from a pose (3,) over each piece of missed cells (along, across), nearest first.

    The second are the cells of the pieces that no single pass sees. A pose without a heading (NaN) may begin in any.
    """
    number, _ = label(missed, np.ones((3, 3)))
    pieces = []
    for k, where in enumerate(find_objects(number), start=1):
        cells = np.argwhere(number[where] == k) + np.array([where[0].start, where[1].start])
        places = raster.axes.to_en(raster.corner_m + (cells + 0.5) * raster.cell_m)
        pieces.append((float(np.hypot(*(places - pose[:2]).T).min()), cells, places))
    pieces.sort(key=lambda piece: piece[0])
    wide = np.zeros_like(missed)
    found = []
    for _, cells, places in pieces[:MOST_PIECES]:
        width_m = float(raster.half_width_m(flying)[cells[:, 0], cells[:, 1]].min())
        best = _shortest(raster, places, max((1.0 - flying.overlap) * width_m, raster.cell_m), flying.radius_m, pose)
        if best is None:
            wide[cells[:, 0], cells[:, 1]] = True
        else:
            found.append(best)
    return sorted(found, key=lambda one: one.way_m), wide


def _shortest(raster: LineRaster, places: FloatArray, reach_m: float, radius_m: float, pose: FloatArray) -> Pass | None:
    """Return the shortest pass that has all places (n, 2) within its reach; None where they lie too far apart."""
    headings = np.arange(HEADINGS) * 2.0 * np.pi / HEADINGS
    towards = np.column_stack([np.sin(headings), np.cos(headings)])
    aside = np.column_stack([-towards[:, 1], towards[:, 0]])
    along_m, across_m = places @ towards.T, places @ aside.T
    slack_m = reach_m - 0.5 * (np.ptp(across_m, axis=0) + raster.cell_m)
    if not (slack_m >= 0.0).any():
        return None
    middle_m = 0.5 * (across_m.min(axis=0) + across_m.max(axis=0))
    at_m = middle_m + np.array(ASIDE)[:, None] * slack_m
    half = 0.5 * raster.cell_m
    begin = at_m[..., None] * aside + (along_m.min(axis=0) - half)[:, None] * towards
    end = at_m[..., None] * aside + (along_m.max(axis=0) + half)[:, None] * towards
    fit = (slack_m >= 0.0) & _inside(raster, begin) & _inside(raster, end)
    if not fit.any():
        return None
    goals = np.concatenate([begin, np.broadcast_to(headings[:, None], (*begin.shape[:2], 1))], axis=-1)
    away_m = np.hypot(*np.moveaxis(begin - pose[:2], -1, 0)) if np.isnan(pose[2]) else lengths_m(pose, goals, radius_m)
    way_m = np.where(fit, away_m + np.hypot(*np.moveaxis(end - begin, -1, 0)), np.inf)
    k = np.unravel_index(int(way_m.argmin()), way_m.shape)
    return Pass(np.stack([begin[k], end[k]]), float(away_m[k]))


def _inside(raster: LineRaster, places: FloatArray) -> BoolArray:
    """Return which places (..., 2), east and north, lie in the area, or hardly beyond it."""
    turned = raster.axes.turned(places)
    at = np.floor((turned - raster.corner_m) / raster.cell_m).astype(np.int64)
    shape = np.array(raster.wanted.shape)
    near = ((at >= -1) & (at <= shape)).all(axis=-1)
    at = np.clip(at, 0, shape - 1)
    return np.asarray(near & raster.wanted[at[..., 0], at[..., 1]])
