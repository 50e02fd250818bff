"""Map as Bathymetric Attributed Grid of variable resolution: cells by depth, the finest where the water is shoalest."""

import io

import h5py
import numpy as np
from numpy.typing import NDArray

from app.arrays import BoolArray, IntArray
from app.mapping.bag_values import NODATA, NOT_REFINED
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.products.bag import bag
from app.mapping.tiers import coarsened, doublings
from app.mapping.types import BathymetricMap
from app.mapping.water.vertical import VerticalDatum

REFINED_CELLS = 32
"""Finest cells along a side of a coarse one, which is refined as a whole, unless the deepest tier asks for more."""

REFINEMENT = np.dtype(
    [
        ("index", "<u4"),
        ("dimensions_x", "<u4"),
        ("dimensions_y", "<u4"),
        ("resolution_x", "<f4"),
        ("resolution_y", "<f4"),
        ("sw_corner_x", "<f4"),
        ("sw_corner_y", "<f4"),
    ]
)
NODE = np.dtype([("depth", "<f4"), ("depth_uncrt", "<f4")])
SAMPLES = np.dtype([("hyp_strength", "<f4"), ("num_hypotheses", "<u4"), ("n_samples", "<u4")])
CHANGE = np.dtype(
    [
        ("row", "<u4"),
        ("col", "<u4"),
        ("sub_row", "<u4"),
        ("sub_col", "<u4"),
        ("depth", "<f4"),
        ("uncertainty", "<f4"),
        ("track_code", "u1"),
        ("list_series", "<u2"),
    ]
)


def vr_bag(
    bathymetry: BathymetricMap,
    cell_of_depth: float,
    frame: LocalFrame,
    *,
    vertical_datum: VerticalDatum,
    title: str,
    common_sd_m: float,
) -> bytes:
    """Return a BAG whose coarse cells are refined by what the shoalest sounded depth in each asks for.

    Elevations are minus the depth; their deviations include ``common_sd_m``, that of what all soundings share. Cells
    without a sounding are empty, coarse and refined ones. The numbers of soundings stand in the layer of samples, of
    one hypothesis each.

    Raises
    ------
    ValueError
        When nothing was sounded.
    """
    depth = np.where(bathymetry.sounded, bathymetry.depth_m, np.nan)
    if not np.isfinite(depth).any():
        raise ValueError("no cell of the map was sounded")
    number = doublings(depth, bathymetry.grid.cell_m, cell_of_depth)
    times = max(REFINED_CELLS, 2 ** int(number.max()))
    coarse = coarsened(bathymetry, times)
    shoalest = _least(np.where(np.isfinite(depth), number, np.iinfo(np.int64).max), times)
    refinements, nodes, samples = _refine(bathymetry, times, shoalest, coarse.sounded, common_sd_m)

    made = bag(coarse, frame, vertical_datum=vertical_datum, title=title, common_sd_m=common_sd_m)
    content = io.BytesIO(made)
    with h5py.File(content, "r+") as file:
        root = file["BAG_root"]
        layer = root.create_dataset("varres_metadata", data=refinements, chunks=refinements.shape, compression="gzip")
        refined = refinements[coarse.sounded]
        for name in ("dimensions_x", "dimensions_y", "resolution_x", "resolution_y"):
            layer.attrs[f"min_{name}"], layer.attrs[f"max_{name}"] = refined[name].min(), refined[name].max()
        compressed = {"chunks": (1, min(len(nodes), 65_536)), "compression": "gzip", "shuffle": True}
        layer = root.create_dataset("varres_refinements", data=nodes[None], **compressed)
        known = nodes["depth"] != NODATA
        for name, of in (("depth", nodes["depth"][known]), ("uncrt", nodes["depth_uncrt"][known])):
            layer.attrs[f"min_{name}"], layer.attrs[f"max_{name}"] = of.min(), of.max()
        layer = root.create_dataset("varres_nodes", data=samples[None], **compressed)
        for name in SAMPLES.names or ():
            layer.attrs[f"min_{name}"], layer.attrs[f"max_{name}"] = samples[name].min(), samples[name].max()
        layer = root.create_dataset("varres_tracking_list", (0,), CHANGE, maxshape=(None,), chunks=(1024,))
        layer.attrs["VR Tracking List Length"] = np.uint32(0)
    return content.getvalue()


def _refine(
    bathymetry: BathymetricMap, times: int, number: IntArray, refined: BoolArray, common_sd_m: float
) -> tuple[NDArray[np.void], NDArray[np.void], NDArray[np.void]]:
    """Return where the refinement of each coarse cell, (rows, cols), begins, and of all in a row the nodes and samples.

    ``number`` says how often the finest cell is doubled in a coarse one. Coarse cells follow each other from the
    south-west, row by row, and so do the nodes in each.
    """
    sides = np.where(refined, times >> np.where(refined, number, 0), 0)
    begins = np.cumsum(sides**2).reshape(sides.shape) - sides**2
    cell_m = bathymetry.grid.cell_m * times / np.maximum(sides, 1)
    found = np.empty(sides.shape, REFINEMENT)
    found["index"] = np.where(refined, begins, NOT_REFINED)
    for axis in "xy":
        found[f"dimensions_{axis}"] = sides
        found[f"resolution_{axis}"] = np.where(refined, cell_m, -1.0)
        found[f"sw_corner_{axis}"] = np.where(refined, 0.5 * cell_m, -1.0)
    nodes, samples = (np.zeros(int((sides**2).sum()), kind) for kind in (NODE, SAMPLES))
    for side in np.unique(sides[refined]).tolist():
        tier = coarsened(bathymetry, times // side).charted(common_sd_m)
        at = begins[sides == side][:, None] + np.arange(side**2)
        for row, name, layer in (
            (nodes, "depth", np.where(tier.sounded, -tier.depth_m, NODATA)),
            (nodes, "depth_uncrt", np.where(tier.sounded, tier.sd_m, NODATA)),
            (samples, "n_samples", tier.count),
            (samples, "num_hypotheses", tier.sounded),
        ):
            rows, cols = sides.shape
            beyond = NODATA if row is nodes else 0
            whole = np.full((rows * side, cols * side), beyond, dtype=float)
            whole[: layer.shape[0], : layer.shape[1]] = layer
            row[name][at] = whole.reshape(rows, side, cols, side).swapaxes(1, 2)[sides == side].reshape(len(at), -1)
    return found, nodes, samples


def _least(numbers: IntArray, times: int) -> IntArray:
    """Return the least number in each square of so many cells a side."""
    rows, cols = numbers.shape
    most = np.iinfo(np.int64).max
    padded = np.pad(numbers, ((0, -rows % times), (0, -cols % times)), constant_values=most)
    return np.asarray(padded.reshape(-1, times, padded.shape[1] // times, times).min(axis=(1, 3)))
