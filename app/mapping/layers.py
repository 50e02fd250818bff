"""The layers of a map, each declared once: files, tiles, REST and the dashboard show what stands in ``LAYERS``."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from scipy.ndimage import distance_transform_edt

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.s44 import Order, thu_m, tvu_fraction, tvu_m
from app.mapping.shoals import shoal_chance
from app.mapping.swath.density import LEAST_SOUNDINGS
from app.mapping.swath.gridded import area_of, is_of_swaths
from app.mapping.tiers import asked_of, by_depth
from app.mapping.types import CHARTED_SD, BathymetricMap

INTERPOLATED, SOUNDED, PRIOR = 0, 1, 2
"""Values of the layer ``sounded``; the latter two are bits of the layer ``flags``, too."""

ACCURATE, VISIBLE = 4, 8
"""Further bits of ``flags``: known to the asked accuracy and supported by soundings; near a sounding."""


class Palette(StrEnum):
    """Colours of the dashboard's map."""

    DEEP = "deep"
    VIOLET = "violet"
    MATTER = "matter"
    BALANCE = "balance"
    LANDMARKS = "landmarks"
    CLASSES = "classes"


class Fit(StrEnum):
    """How a range of colours follows the values: from the least, from zero, or as far below zero as above."""

    DATA = "data"
    FROM_ZERO = "from_zero"
    ABOUT_ZERO = "about_zero"


@dataclass(frozen=True)
class LayerSource:
    """What layers are computed from.

    Attributes
    ----------
    order
        The S-44 order whose largest TVU the layer ``tvu_fraction`` is relative to.
    common_sd_m
        Standard deviation of what all soundings share.
    accuracy_m
        To which cells are to be known.
    reference_m
        A reference grid's depths at the map's cells.
    live
        Returns the papers' interpolation of every sounding so far; None where there is none.
    cell_of_depth
        The share of its depth that a place's cell is judged by for density; None: all are judged by the map's cell.
    shoal_depth_m
        What the layer ``shoal_pct`` calls shoal is shallower; None: there is no such layer.
    """

    map: BathymetricMap
    order: Order = Order.ORDER_1A
    common_sd_m: float = 0.0
    accuracy_m: float = 0.0
    reference_m: FloatArray | None = None
    live: Callable[[], BathymetricMap | None] = lambda: None
    cell_of_depth: float | None = None
    shoal_depth_m: float | None = None


@dataclass(frozen=True)
class Layer:
    """One value per cell, (rows, cols), row 0 south; NaN outside the area."""

    name: str
    meaning: str
    unit: str
    values: FloatArray


@dataclass(frozen=True)
class LayerKind:
    """A layer and where it is shown.

    Attributes
    ----------
    meaning
        What its values say; ``{order}`` stands for the S-44 order.
    unit
        By its name in UDUNITS.
    compute
        Returns its values; None where the mission has none, which ``absence`` and ``remedy`` explain.
    range
        Values of the first and the last colour, where they do not follow the data.
    classes
        Words for the values 0, 1, 2 and so on of a layer that has no others.
    scale
        Tiles hold whole numbers, the value times this; None: no tile has it. Those not ``in_every_tile`` are asked for.
    in_json, in_pictures, in_files
        Whether it can be asked for beside what the map's JSON always has, as a picture, and stands in every file.
    live
        Whether it changes with every sounding, not only with the map.
    of_depths
        Whether its values are as sure as the depths: the dashboard fades them where those are guessed.
    """

    name: str
    title: str
    meaning: str
    unit: str
    compute: Callable[[LayerSource], FloatArray | None]
    palette: Palette
    fit: Fit = Fit.FROM_ZERO
    range: tuple[float, float] | None = None
    classes: tuple[str, ...] = ()
    scale: int | None = None
    in_every_tile: bool = False
    in_json: bool = True
    in_pictures: bool = True
    in_files: bool = True
    live: bool = False
    of_depths: bool = False
    absence: str = ""
    remedy: str = ""

    def of(self, source: LayerSource) -> Layer | None:
        """Return the layer of a map; None where the mission has none."""
        values = self.compute(source)
        return None if values is None else Layer(self.name, self.meaning_at(source.order), self.unit, values)

    def meaning_at(self, order: Order) -> str:
        """Return what the values say where they are compared with an order of S-44."""
        return self.meaning.format(order=order.spoken)


def slope_deg(depth_m: FloatArray, cell_m: float) -> FloatArray:
    """Return the steepest inclination of the sea floor per cell, degrees from horizontal.

    Central differences of the neighbours, one-sided ones where a neighbour is unknown; NaN where the cell is unknown
    or has no known neighbour along one of the axes.
    """
    return np.degrees(np.arctan(np.hypot(*gradient(depth_m, cell_m))))


def gradient(depth_m: FloatArray, cell_m: float) -> tuple[FloatArray, FloatArray]:
    """Return by how much the depth grows per metre to the east and to the north, as :func:`slope_deg` takes it."""
    return _along(depth_m, cell_m), _along(depth_m.T, cell_m).T


def _along(depth_m: FloatArray, cell_m: float) -> FloatArray:
    """Return the derivative over the second axis, one-sided where a neighbour is unknown; NaN where both are."""
    gap = np.full((len(depth_m), 1), np.nan)
    ahead = np.hstack([depth_m[:, 1:] - depth_m[:, :-1], gap])
    behind = np.hstack([gap, depth_m[:, 1:] - depth_m[:, :-1]])
    both = np.where(np.isnan(ahead), behind, np.where(np.isnan(behind), ahead, 0.5 * (ahead + behind)))
    return both / cell_m


def _inside(bathymetry: BathymetricMap, values: FloatArray | IntArray) -> FloatArray:
    return np.where(np.isfinite(bathymetry.depth_m), values, np.nan)


def _sounded(source: LayerSource) -> FloatArray:
    bathymetry = source.map
    imported = False if bathymetry.prior is None else bathymetry.prior
    return _inside(bathymetry, np.where(bathymetry.sounded, SOUNDED, np.where(imported, PRIOR, INTERPOLATED)))


def _flags(source: LayerSource) -> FloatArray:
    bathymetry = source.map
    imported = np.zeros_like(bathymetry.sounded) if bathymetry.prior is None else bathymetry.prior
    near = _near(bathymetry.sounded | imported, bathymetry.correlation_length_m / bathymetry.grid.cell_m)
    known = bathymetry.known(source.accuracy_m)
    bits = SOUNDED * bathymetry.sounded | PRIOR * imported | ACCURATE * known | VISIBLE * near
    return _inside(bathymetry, bits)


def _near(measured: BoolArray, cells: float) -> BoolArray:
    """Return which cells lie within so many cells of a measured one."""
    if not measured.any():
        return np.zeros_like(measured)
    near: BoolArray = distance_transform_edt(~measured) <= cells
    return near


def _difference(source: LayerSource) -> FloatArray | None:
    return None if source.reference_m is None else source.map.depth_m - source.reference_m


def _density(source: LayerSource) -> FloatArray | None:
    bathymetry = source.map
    if not is_of_swaths(bathymetry):
        return None
    area = area_of(bathymetry)
    asked = asked_of(bathymetry.depth_m, bathymetry.grid.cell_m, source.cell_of_depth)
    count = by_depth(bathymetry.count, area, asked, lambda count, _: count)
    return np.where(area, np.digitize(count, (1, LEAST_SOUNDINGS)), np.nan)


def _thu(source: LayerSource) -> FloatArray | None:
    horizontal = source.map.horizontal_sd_m
    return None if horizontal is None else thu_m(horizontal)


def _shoal_pct(source: LayerSource) -> FloatArray | None:
    if source.shoal_depth_m is None:
        return None
    return 100.0 * shoal_chance(source.map, source.shoal_depth_m, source.common_sd_m)


def _live(source: LayerSource) -> FloatArray | None:
    live = source.live()
    return None if live is None else live.depth_m


LAYERS = {
    kind.name: kind
    for kind in (
        LayerKind(
            "depth",
            "Depth",
            "depth below the vertical datum, positive down",
            "metre",
            lambda source: source.map.depth_m,
            Palette.DEEP,
            fit=Fit.DATA,
            scale=100,
            in_every_tile=True,
            in_json=False,
            of_depths=True,
        ),
        LayerKind(
            "uncertainty",
            "Uncertainty",
            "standard deviation of the depth",
            "metre",
            lambda source: source.map.sd_m,
            Palette.VIOLET,
            scale=1000,
            in_every_tile=True,
        ),
        LayerKind(
            "count",
            "Soundings",
            "soundings in the cell, those of swath sonars' beams included",
            "1",
            lambda source: _inside(source.map, source.map.count),
            Palette.MATTER,
            scale=1,
            in_every_tile=True,
        ),
        LayerKind(
            "flags",
            "Known",
            "never seen, seen but not known well enough, known to the asked accuracy",
            "1",
            _flags,
            Palette.LANDMARKS,
            range=(0, 2),
            scale=1,
            in_every_tile=True,
            in_json=False,
            in_pictures=False,
            in_files=False,
        ),
        LayerKind(
            "sounded",
            "Sounded",
            "1 sounded, 0 interpolated, 2 only imported soundings in the cell",
            "1",
            _sounded,
            Palette.MATTER,
            in_pictures=False,
        ),
        LayerKind(
            "density",
            "Density",
            f"0 missed, 1 fewer than {LEAST_SOUNDINGS} soundings in the cell, 2 as many as full coverage asks for",
            "1",
            _density,
            Palette.CLASSES,
            range=(0, 2),
            classes=("no sounding", f"1 to {LEAST_SOUNDINGS - 1} soundings", f"{LEAST_SOUNDINGS} and more"),
            scale=1,
            absence="no swath sonar has measured in this mission",
            remedy="Send pings of a vehicle with sensor multibeam, or start a mission with one",
        ),
        LayerKind(
            "slope",
            "Slope",
            "inclination of the sea floor",
            "degree",
            lambda source: slope_deg(source.map.depth_m, source.map.grid.cell_m),
            Palette.MATTER,
            scale=10,
            of_depths=True,
        ),
        LayerKind(
            "tvu_fraction",
            "TVU / 1a",
            "TVU estimate (95 %) over the largest TVU of S-44 {order}",
            "1",
            lambda source: tvu_fraction(
                source.map.depth_m, source.map.sd_m, source.order, common_sd_m=source.common_sd_m
            ),
            Palette.BALANCE,
            range=(0, 2),
            scale=100,
        ),
        LayerKind(
            "difference",
            "Difference",
            "depth minus the reference grid's depth",
            "metre",
            _difference,
            Palette.BALANCE,
            fit=Fit.ABOUT_ZERO,
            scale=100,
            of_depths=True,
            absence="the mission has no reference grid to differ from",
            remedy="Send one: PUT /api/v1/missions/{id}/reference",
        ),
        LayerKind(
            "tvu",
            "TVU",
            "estimated total vertical uncertainty, 95 %",
            "metre",
            lambda source: tvu_m(source.map.sd_m, source.common_sd_m),
            Palette.VIOLET,
            scale=1000,
        ),
        LayerKind(
            "thu",
            "THU",
            "estimated total horizontal uncertainty of a cell's soundings, 95 %",
            "metre",
            _thu,
            Palette.VIOLET,
            scale=100,
            absence="no swath sonar has measured in this mission, so nothing is known of places",
            remedy="Send pings of a vehicle with sensor multibeam, or start a mission with one",
        ),
        LayerKind(
            "shoal_pct",
            "Chance of shoal water",
            "chance that the bottom is shallower than the mission's shoal_depth_m somewhere in the cell; none is given "
            "where no sounding supports the cell, which does not mean that it is safe",
            "percent",
            _shoal_pct,
            Palette.MATTER,
            range=(0, 100),
            scale=100,
            absence="the mission does not say what counts as shoal",
            remedy="Create it with shoal_depth_m, for example 5",
        ),
        LayerKind(
            "live",
            "Live depth",
            "depth by the papers' Gaussian interpolation of every sounding",
            "metre",
            _live,
            Palette.DEEP,
            fit=Fit.DATA,
            in_files=False,
            live=True,
            absence="nothing was sounded since the service has this mission in memory",
            remedy="Ask for the depth of the map itself, which holds every sounding",
        ),
    )
}
"""Every layer by its name, in the order of files."""


def file_layers(source: LayerSource) -> list[Layer]:
    """Return the layers that a file with every layer has; those that the mission has none of are left out.

    Their uncertainty is that of charted depths, as in every other file.
    """
    whole = replace(source, map=source.map.charted(source.common_sd_m), common_sd_m=0.0)
    made = (kind.of(whole) for kind in LAYERS.values() if kind.in_files)
    found = [layer for layer in made if layer is not None]
    return [replace(layer, meaning=CHARTED_SD) if layer.name == "uncertainty" else layer for layer in found]
