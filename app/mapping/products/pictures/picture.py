"""Map as a picture for reports."""

import io
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from app.arrays import FloatArray
from app.mapping.layers import Fit
from app.mapping.products.pictures.colours import depth_range, palette
from app.mapping.types import BathymetricMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DPI = 150
LABEL_LETTERS = 45
"""So many letters of the colour bar's label are in one line."""


def picture_png(
    bathymetry: BathymetricMap,
    *,
    vertical_datum: str,
    title: str = "",
    range_m: tuple[float, float] | None = None,
    tracks: Mapping[str, FloatArray] | None = None,
) -> bytes:
    """Return a PNG with colour bar, axes in metres, scale bar and north arrow.

    Cells that were interpolated, not sounded, are hatched.

    Parameters
    ----------
    range_m
        Depths of the first and the last colour; by default whole metres that hold 98 % of the depths.
    tracks
        Per vehicle the positions, (n, 2) east and north.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    grid = bathymetry.grid
    low, high = depth_range(bathymetry) if range_m is None else range_m
    width_m, height_m = grid.cols * grid.cell_m, grid.rows * grid.cell_m
    map_inches = 6.0
    scale = map_inches / max(width_m, height_m)
    figure = Figure(figsize=(max(width_m * scale, 2.5) + 2.2, max(height_m * scale, 2.5) + 1.2), dpi=DPI)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    extent = (grid.west_m, grid.west_m + width_m, grid.south_m, grid.south_m + height_m)
    image = axes.imshow(
        np.ma.masked_invalid(bathymetry.depth_m),
        origin="lower",
        extent=extent,
        cmap=palette(Fit.DATA),
        vmin=low,
        vmax=high,
        interpolation="nearest",
    )
    interpolated = np.isfinite(bathymetry.depth_m) & ~bathymetry.sounded
    if interpolated.any() and min(grid.rows, grid.cols) >= 2:
        hatching = axes.contourf(
            grid.east_m,
            grid.north_m,
            interpolated.astype(float),
            levels=[0.5, 1.5],
            colors="none",
            hatches=["///"],
        )
        hatching.set(edgecolor=(1.0, 1.0, 1.0, 0.3), linewidth=0.0)  # faint: most cells of a survey are hatched
    for name, positions in (tracks or {}).items():
        axes.plot(positions[:, 0], positions[:, 1], linewidth=0.8, label=name)
    if tracks:
        axes.legend(loc="upper left", fontsize=7, framealpha=0.8)
    scale_bar(axes, extent)
    north_arrow(axes)
    axes.set(xlim=extent[:2], ylim=extent[2:], xlabel="east (m)", ylabel="north (m)", title=title)
    bar = figure.colorbar(image, ax=axes, extend="both", fraction=0.046, pad=0.03)
    bar.set_label(textwrap.fill(f"depth (m below {vertical_datum})", LABEL_LETTERS))
    bar.ax.invert_yaxis()
    share = float(bathymetry.sounded[np.isfinite(bathymetry.depth_m)].mean()) if np.any(interpolated) else 1.0
    figure.text(0.01, 0.01, f"hatched: interpolated; sounded cells {share:.0%}; {bathymetry.model}", fontsize=6)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", bbox_inches="tight")
    return stream.getvalue()


def north_arrow(axes: "Axes") -> None:
    """Draw where north is into the corner."""
    axes.annotate(
        "N",
        xy=(0.965, 0.97),
        xytext=(0.965, 0.89),
        xycoords="axes fraction",
        ha="center",
        fontsize=9,
        arrowprops={"arrowstyle": "-|>", "color": "black"},
    )


def scale_bar(axes: "Axes", extent: tuple[float, float, float, float]) -> None:
    """Draw how long some round number of metres is; ``extent`` is west, east, south, north."""
    span = extent[1] - extent[0]
    length = max(step for step in _round_lengths(span) if step <= 0.25 * span)
    x = extent[0] + 0.04 * span
    y = extent[2] + 0.035 * (extent[3] - extent[2])
    axes.plot([x, x + length], [y, y], color="black", linewidth=3, solid_capstyle="butt")
    axes.text(
        x + 0.5 * length,
        y,
        f"{length:g} m",
        ha="center",
        va="bottom",
        fontsize=7,
        bbox={"facecolor": "white", "alpha": 0.6, "edgecolor": "none", "pad": 1},
    )


def _round_lengths(span: float) -> list[float]:
    decade = 10.0 ** np.floor(np.log10(span))
    return [float(f * decade) for f in (0.05, 0.1, 0.2, 0.5, 1.0)]
