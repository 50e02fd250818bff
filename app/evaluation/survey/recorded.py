"""Soundings of a track that was really flown, where a terrain file holds one."""

from pathlib import Path

import numpy as np

from app.mapping.types import Soundings

SD_M = 0.05


def recorded_soundings(path: Path) -> Soundings | None:
    """Return the cells of ``usual_practice_mask`` of an ``.npz`` terrain as soundings; None without such a mask.

    Their depths are ``usual_practice_z``.
    """
    if path.suffix != ".npz":
        return None
    with np.load(path, allow_pickle=False) as file:
        if "usual_practice_mask" not in file:
            return None
        mask, depth, cell = file["usual_practice_mask"].astype(bool), file["usual_practice_z"], float(file["cell_m"])
    rows, cols = np.nonzero(mask)
    z = (depth[mask] if depth.shape == mask.shape else depth).astype(np.float64)
    known = np.isfinite(z)
    east, north = (cols[known] + 0.5) * cell, (rows[known] + 0.5) * cell
    return Soundings(east, north, z[known], np.full(int(known.sum()), SD_M))
