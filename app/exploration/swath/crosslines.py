"""Lines across all others, by which these are checked."""

import numpy as np

from app.arrays import FloatArray
from app.exploration.swath.raster import Flying, LineRaster
from app.exploration.swath.shares import work_m


def crosslines(raster: LineRaster, flying: Flying, part: float) -> list[FloatArray]:
    """Return evenly spaced lines (2, 2) across an area, as long in all as a part of its lines."""
    length_m = part * float(work_m(raster, raster.wanted, flying).sum())
    columns = np.flatnonzero(raster.wanted.any(axis=1))
    wide_m = float(raster.wanted.sum(axis=1)[columns].mean()) * raster.cell_m
    count = min(max(1, round(length_m / wide_m)), len(columns)) if length_m > 0.0 else 0
    found = []
    for some in np.array_split(columns, count) if count else []:
        column = int(some[len(some) // 2])
        rows = np.flatnonzero(raster.wanted[column])
        # The longest piece where keep-out zones part it.
        piece = max(np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1), key=len)
        across_m = raster.across_m[[piece[0], piece[-1]]]
        found.append(raster.axes.to_en(np.column_stack([np.full(2, raster.along_m[column]), across_m])))
    return found
