"""One layer of a map as a sheet of a report: shaded, with contours and marks, lettered in the reader's language."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.mapping.layers import Palette
from app.mapping.products.pictures.colours import page_colours
from app.mapping.products.pictures.picture import north_arrow, scale_bar
from app.mapping.swath.holidays import Holiday
from app.mapping.types import Grid

DPI = 150
LONGER_SIDE_IN = 5.4
"""Of the map itself."""
MOST_CELLS = 1000
"""Along a side: of larger maps every second cell is drawn, or fewer."""
SHADOW = 0.75
"""Part of the colours' brightness that depends on the light."""
MOST_NUMBERED = 40
"""At most so many holidays have their numbers beside them."""


@dataclass(frozen=True)
class Sheet:
    """What a sheet shows.

    Attributes
    ----------
    values
        Of the layer, (rows, cols), row 0 south.
    range_m
        Values of the first and the last colour.
    label
        Of the colour bar.
    axes
        Names of the axes to the east and to the north.
    classes
        Words for the values 0, 1, 2 and so on of a layer that has no others.
    shaded
        Light on each cell; None: flat colours.
    depth_m, interval_m
        Of which contours are drawn, and how far these are apart; None: none are.
    interpolated
        Which cells are to be paler, as they were not sounded.
    holidays
        Outlined, and numbered from 1 in their order.
    """

    grid: Grid
    values: FloatArray
    palette: Palette
    range_m: tuple[float, float]
    label: str
    axes: tuple[str, str]
    classes: Sequence[str] = ()
    shaded: FloatArray | None = None
    depth_m: FloatArray | None = None
    interval_m: float | None = None
    interpolated: BoolArray | None = None
    holidays: Sequence[Holiday] = field(default=())


def sheet_png(sheet: Sheet) -> bytes:
    """Return the sheet as a PNG with axes in metres, colour bar, scale bar and north arrow."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm, Normalize
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    grid = sheet.grid
    width_m, height_m = grid.cols * grid.cell_m, grid.rows * grid.cell_m
    inches = LONGER_SIDE_IN / max(width_m, height_m)
    size = max(width_m * inches, 1.6), max(height_m * inches, 1.6)
    left, right, below, above = 0.75, 1.05, 0.55, 0.15
    whole = size[0] + left + right, size[1] + below + above
    figure = Figure(figsize=whole, dpi=DPI)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((left / whole[0], below / whole[1], size[0] / whole[0], size[1] / whole[1]))
    extent = (grid.west_m, grid.west_m + width_m, grid.south_m, grid.south_m + height_m)
    colours = page_colours(sheet.palette)
    bounds = np.arange(len(sheet.classes) + 1) - 0.5
    norm = BoundaryNorm(bounds, colours.N) if sheet.classes else Normalize(*sheet.range_m)
    every = int(np.ceil(max(grid.rows, grid.cols) / MOST_CELLS))
    values = sheet.values[::every, ::every]
    pixels = colours(norm(np.nan_to_num(values)))
    if sheet.interpolated is not None:
        pale = sheet.interpolated[::every, ::every, None]
        pixels[..., :3] = np.where(pale, 0.35 + 0.65 * pixels[..., :3], pixels[..., :3])
    if sheet.shaded is not None:
        light = 1.0 - SHADOW + SHADOW * sheet.shaded[::every, ::every]
        pixels[..., :3] = np.clip(pixels[..., :3] * light[..., None], 0.0, 1.0)
    pixels[..., 3] = np.isfinite(values)
    axes.imshow(pixels, origin="lower", extent=extent, interpolation="nearest", aspect="equal")
    if sheet.depth_m is not None and sheet.interval_m is not None and min(grid.rows, grid.cols) >= 2:
        depth_m = sheet.depth_m[::every, ::every]
        first, last = np.nanmin(depth_m) // sheet.interval_m, np.nanmax(depth_m) // sheet.interval_m
        levels = np.arange(first + 1, last + 1) * sheet.interval_m
        if len(levels) and min(depth_m.shape) >= 2:
            places = grid.east_m[::every], grid.north_m[::every]
            lines = axes.contour(
                *places, np.ma.masked_invalid(depth_m), levels=levels, colors="black", linewidths=0.5, alpha=0.75
            )
            axes.clabel(lines, fontsize=6, fmt="%g")
    for number, holiday in enumerate(sheet.holidays, start=1):
        corner = holiday.west_m, holiday.south_m
        axes.add_patch(Rectangle(corner, holiday.width_m, holiday.height_m, fill=False, color="black", linewidth=0.7))
        if number <= MOST_NUMBERED:
            axes.annotate(
                str(number),
                (holiday.west_m + holiday.width_m, holiday.south_m + holiday.height_m),
                xytext=(1, 1),
                textcoords="offset points",
                fontsize=6,
            )
    scale_bar(axes, extent)
    north_arrow(axes)
    axes.set(xlim=extent[:2], ylim=extent[2:])
    axes.set_xlabel(sheet.axes[0], fontsize=8)
    axes.set_ylabel(sheet.axes[1], fontsize=8)
    axes.tick_params(labelsize=7)
    bar_axes = figure.add_axes(
        ((left + size[0] + 0.15) / whole[0], below / whole[1], 0.16 / whole[0], size[1] / whole[1])
    )
    if sheet.classes:
        bar = figure.colorbar(ScalarMappable(norm, colours), cax=bar_axes, ticks=range(len(sheet.classes)))
        bar.set_ticklabels(sheet.classes, rotation=90, va="center")
    else:
        low, high = sheet.range_m
        beyond = bool(np.nanmin(values) < low), bool(np.nanmax(values) > high)
        extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[beyond]
        bar = figure.colorbar(ScalarMappable(norm, colours), cax=bar_axes, extend=extend)
        bar.set_label(sheet.label, fontsize=8)
        if sheet.palette is Palette.DEEP:
            bar_axes.invert_yaxis()
    bar_axes.tick_params(labelsize=7)
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue()
