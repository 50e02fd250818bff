"""How far a map is from a reference grid."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from app.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class Difference:
    """Estimate minus reference over the cells known to both.

    Attributes
    ----------
    rmse_m, bias_m
        Root mean square and mean difference.
    l2_norm
        Euclidean norm of the vector of all differences (AURO15 footnote 8, table 2); grows with the number
        of cells.
    p95_m, max_m
        95th percentile and maximum of the absolute difference.
    cells
        How many cells were compared.
    """

    rmse_m: float
    l2_norm: float
    bias_m: float
    p95_m: float
    max_m: float
    cells: int


def difference(estimate_m: FloatArray, reference_m: FloatArray, mask: BoolArray | None = None) -> Difference:
    """Compare two grids of the same shape; cells that are NaN in either, or outside ``mask``, do not count.

    Raises
    ------
    ValueError
        When the shapes differ or no cell is left to compare.
    """
    if estimate_m.shape != reference_m.shape:
        raise ValueError(f"estimate has shape {estimate_m.shape}; the reference has {reference_m.shape}")
    delta = estimate_m - reference_m
    known = np.isfinite(delta)
    if mask is not None:
        if mask.shape != delta.shape:
            raise ValueError(f"mask has shape {mask.shape}; the grids have {delta.shape}")
        known &= mask
    if not known.any():
        raise ValueError("no cell is known to both the estimate and the reference")
    delta = delta[known]
    size = np.abs(delta)
    return Difference(
        rmse_m=float(np.sqrt(np.mean(delta**2))),
        l2_norm=float(np.linalg.norm(delta)),
        bias_m=float(np.mean(delta)),
        p95_m=float(np.percentile(size, 95.0)),
        max_m=float(size.max()),
        cells=int(known.sum()),
    )


def interval_coverage(estimate_m: FloatArray, sd_m: FloatArray, reference_m: FloatArray, probability: float) -> float:
    """Fraction of cells whose true depth lies in the central normal interval of the given probability.

    A calibrated map returns about ``probability``.
    """
    half = float(ndtri(0.5 + 0.5 * probability)) * sd_m
    miss = np.abs(estimate_m - reference_m)
    known = np.isfinite(miss) & np.isfinite(half)
    return float(np.mean(miss[known] <= half[known]))
