"""The ways to lines: from which end the next one is flown, and how far it is to there."""

import numpy as np

from app.arrays import FloatArray
from app.exploration.motion.dubins import lengths_m
from app.exploration.swath.lines import Line
from app.exploration.swath.raster import LineRaster


def pose(path: FloatArray, *, end: bool = False) -> FloatArray:
    """Return place and heading (3,) at the beginning or the end of a path (k, 2)."""
    a, b = (path[-2], path[-1]) if end else (path[0], path[1])
    at = b if end else a
    return np.array([*at, np.arctan2(*(b - a))])


def path_m(path: FloatArray) -> float:
    """Return the length of a path (k, 2)."""
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def nearest_entry(
    raster: LineRaster, choice: list[Line], at: FloatArray | None, radius_m: float
) -> tuple[Line, FloatArray, float]:
    """Return the line whose closer end is reached first from a pose (3,), its path as flown, and the way there.

    ``at``: None, or with a heading of NaN where that is not known.
    """
    paths = [way for line in choice for there in (line.path(raster),) for way in (there, there[::-1])]
    if not paths:
        raise ValueError("there is no line to choose from")
    away_m = (
        np.zeros(len(paths)) if at is None else approaches_m(at, np.array([pose(path) for path in paths]), radius_m)
    )
    best = int(np.argmin(away_m))
    return choice[best // 2], paths[best], float(away_m[best])


def approaches_m(at: FloatArray, to: FloatArray, radius_m: float) -> FloatArray:
    """Return how long the ways from a pose (3,) to others (n, 3) are; straight where the first has no heading."""
    if np.isnan(at[2]):
        return np.asarray(np.hypot(*(to[:, :2] - at[:2]).T))
    return lengths_m(at, to, radius_m)
