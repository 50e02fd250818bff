"""The layers of a map as products and the API show them, each declared once."""

from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.mapping.s44 import Order, tvu_fraction
from app.mapping.types import BathymetricMap

INTERPOLATED, SOUNDED, PRIOR = 0, 1, 2
"""Values of the layer ``sounded``."""


@dataclass(frozen=True)
class Layer:
    """One value per cell, (rows, cols), row 0 south; NaN outside the area."""

    name: str
    meaning: str
    unit: str
    values: FloatArray


def slope_deg(depth_m: FloatArray, cell_m: float) -> FloatArray:
    """Return the steepest inclination of the sea floor per cell, degrees from horizontal.

    Central differences of the neighbours, one-sided ones where a neighbour is unknown; NaN where the cell is unknown
    or has no known neighbour along one of the axes.
    """
    return np.degrees(np.arctan(np.hypot(_along(depth_m, cell_m), _along(depth_m.T, cell_m).T)))


def _along(depth_m: FloatArray, cell_m: float) -> FloatArray:
    """Return the derivative over the second axis."""
    gap = np.full((len(depth_m), 1), np.nan)
    ahead = np.hstack([depth_m[:, 1:] - depth_m[:, :-1], gap])
    behind = np.hstack([gap, depth_m[:, 1:] - depth_m[:, :-1]])
    both = np.where(np.isnan(ahead), behind, np.where(np.isnan(behind), ahead, 0.5 * (ahead + behind)))
    return both / cell_m


def sounded_flag(bathymetry: BathymetricMap) -> FloatArray:
    """Return SOUNDED, PRIOR or INTERPOLATED per cell, NaN outside the area."""
    flag = np.where(bathymetry.sounded, float(SOUNDED), float(INTERPOLATED))
    if bathymetry.prior is not None:
        flag[bathymetry.prior & ~bathymetry.sounded] = PRIOR
    flag[~np.isfinite(bathymetry.depth_m)] = np.nan
    return flag


def make_layers(
    bathymetry: BathymetricMap, *, order: Order, common_sd_m: float = 0.0, reference_m: FloatArray | None = None
) -> list[Layer]:
    """Return every layer of a map; ``difference`` only where there is a reference grid of the same shape.

    Parameters
    ----------
    order
        The S-44 order whose largest TVU the layer ``tvu_fraction`` is relative to.
    common_sd_m
        Standard deviation of what all soundings share.
    """
    depth, sd = bathymetry.depth_m, bathymetry.sd_m
    known = np.isfinite(depth)
    tvu = tvu_fraction(depth, sd, order, common_sd_m=common_sd_m)
    layers = [
        Layer("depth", "depth below the vertical datum, positive down", "metre", depth),
        Layer("uncertainty", "standard deviation of the depth", "metre", sd),
        Layer("count", "soundings in the cell", "1", np.where(known, bathymetry.count, np.nan)),
        Layer(
            "sounded", "1 sounded, 0 interpolated, 2 only imported soundings in the cell", "1", sounded_flag(bathymetry)
        ),
        Layer("slope", "inclination of the sea floor", "degree", slope_deg(depth, bathymetry.grid.cell_m)),
        Layer("tvu_fraction", f"TVU estimate (95 %) over the largest TVU of S-44 {order.spoken}", "1", tvu),
    ]
    if reference_m is not None:
        layers.append(Layer("difference", "depth minus the reference grid's depth", "metre", depth - reference_m))
    return layers
