"""What web maps and GIS are shown of a mission's map: layers with colours that stay the same while the map grows."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from app.arrays import FloatArray
from app.mapping.coordinates.map_windows import geographic_bounds
from app.mapping.layers import ACCURATE, LAYERS, SOUNDED, VISIBLE
from app.mapping.products.pictures.tile_pictures import Pixels, coarser, coarser_grid, paint, paint_classes, shade
from app.mapping.swath.density import LEAST_SOUNDINGS
from app.mapping.types import Grid
from app.missions.maps.snapshot import MapSnapshot
from app.missions.spec.limits import Limits

Range = tuple[float, float]
"""Values of the first and of the last colour."""

SURE_TIMES = 4.0
"""Uncertainty is coloured up to so many times the accuracy that a mission asks for."""


class Ranging(Protocol):
    """What the colours of a mission's layers follow from."""

    @property
    def limits(self) -> Limits:
        """How deep vehicles may go, and how near to the bottom."""

    @property
    def accuracy_m(self) -> float:
        """The standard deviation that is asked for."""


@dataclass(frozen=True)
class WebLayer:
    """A layer in tiles.

    Attributes
    ----------
    meaning
        What is to be seen.
    unit
        Of ``min`` and ``max``; empty for layers by classes, which have neither.
    default_range
        Returns the range of a mission's colours, from what it is to do: it never changes while the map grows.
    classes
        Words for the classes 1, 2 and so on of layers without a unit.
    """

    name: str
    title: str
    meaning: str
    unit: str
    default_range: Callable[[Ranging], Range]
    paint: Callable[[MapSnapshot, Range], Pixels]
    classes: tuple[str, ...] = ()


def _depth_range(spec: Ranging) -> Range:
    """Return from the surface to the deepest bottom that vehicles may follow."""
    return 0.0, spec.limits.max_depth_m + spec.limits.min_altitude_m


def _depth(snapshot: MapSnapshot, range_: Range) -> Pixels:
    depth_m, bathymetry = _with_live(snapshot)[0], snapshot.built.map
    light = shade(depth_m, bathymetry.grid.cell_m)
    return paint(depth_m, range_, LAYERS["depth"].fit, sounded=_count(snapshot) > 0, light=light)


def _uncertainty(snapshot: MapSnapshot, range_: Range) -> Pixels:
    return paint(_with_live(snapshot)[1], range_, LAYERS["uncertainty"].fit)


def _density(snapshot: MapSnapshot, _: Range) -> Pixels:
    classes = LAYERS["density"].compute(snapshot.source())
    if classes is None:  # no swath sonar: by the cells themselves
        classes = np.digitize(_count(snapshot), (1, LEAST_SOUNDINGS)).astype(np.float64)
    return paint_classes(classes)


def _coverage(snapshot: MapSnapshot, _: Range) -> Pixels:
    flags = LAYERS["flags"].compute(snapshot.source())
    bits = np.nan_to_num(np.zeros_like(snapshot.built.map.depth_m) if flags is None else flags).astype(np.int64)
    if snapshot.live is not None:
        bits[snapshot.live.cells] |= np.where(snapshot.live.count > 0, SOUNDED | VISIBLE, VISIBLE)
    return paint_classes(np.where(bits & ACCURATE, 2.0, np.where(bits & VISIBLE, 1.0, 0.0)))


def _with_live(snapshot: MapSnapshot) -> tuple[FloatArray, FloatArray]:
    """Return depth and deviation of the cells, with what was sounded since the map was made."""
    depth_m, sd_m, live = snapshot.built.map.depth_m, snapshot.built.map.sd_m, snapshot.live
    if live is not None:
        depth_m, sd_m = depth_m.copy(), sd_m.copy()
        depth_m[live.cells], sd_m[live.cells] = live.depth_m, live.sd_m
    return depth_m, sd_m


def _count(snapshot: MapSnapshot) -> FloatArray:
    count = snapshot.built.map.count.astype(np.float64)
    if snapshot.live is not None:
        count[snapshot.live.cells] = np.maximum(count[snapshot.live.cells], snapshot.live.count)
    return count


@dataclass(frozen=True)
class CellValues:
    """What a map knows of a place; ``soundings`` 0: its depth was estimated between soundings."""

    depth_m: float
    sd_m: float
    soundings: int
    vertical_datum: str


def values_at(snapshot: MapSnapshot, lat_deg: float, lon_deg: float) -> CellValues | None:
    """Return what the cell at a place holds; None where nothing is known."""
    grid, frame = snapshot.built.map.grid, snapshot.facts.frame
    south, west, north, east = geographic_bounds(grid, frame)
    if not (south <= lat_deg <= north and west <= lon_deg <= east):
        return None
    place_east, place_north = frame.to_local(lat_deg, lon_deg)
    row = int((place_north - grid.south_m) // grid.cell_m)
    col = int((place_east - grid.west_m) // grid.cell_m)
    if not (0 <= row < grid.rows and 0 <= col < grid.cols):
        return None
    depth_m, sd_m = (float(layer[row, col]) for layer in _with_live(snapshot))
    if not math.isfinite(depth_m):
        return None
    return CellValues(depth_m, sd_m, int(_count(snapshot)[row, col]), snapshot.facts.vertical_datum.statement)


def _two_classes(_: Ranging) -> Range:
    return 0.0, 2.0


WEB_LAYERS = {
    layer.name: layer
    for layer in (
        WebLayer(
            "depth",
            "Depth",
            "depth below the vertical datum in colours, lit from the north-west; paler between soundings",
            LAYERS["depth"].unit,
            _depth_range,
            _depth,
        ),
        WebLayer(
            "uncertainty",
            "Uncertainty",
            LAYERS["uncertainty"].meaning,
            LAYERS["uncertainty"].unit,
            lambda spec: (0.0, SURE_TIMES * spec.accuracy_m),
            _uncertainty,
        ),
        WebLayer(
            "density",
            "Density",
            f"yellow: 1 to {LEAST_SOUNDINGS - 1} soundings in the cell, green: {LEAST_SOUNDINGS} and more",
            "",
            _two_classes,
            _density,
            (f"1 to {LEAST_SOUNDINGS - 1} soundings in the cell", f"{LEAST_SOUNDINGS} and more"),
        ),
        WebLayer(
            "coverage",
            "Coverage",
            "yellow: near a sounding, green: known to the accuracy that the mission asks for",
            "",
            _two_classes,
            _coverage,
            ("near a sounding", "known to the accuracy asked for"),
        ),
    )
}
"""Every layer in tiles by its name."""


@dataclass(frozen=True)
class Painted:
    """A painted layer and the grid that its cells lie on."""

    grid: Grid
    pixels: Pixels


def painted(snapshot: MapSnapshot, layer: WebLayer, range_: Range) -> Painted:
    """Return a layer of the map in colours."""
    return Painted(snapshot.source().map.grid, layer.paint(snapshot, range_))


def halved(finer: Painted) -> Painted:
    """Return a painted layer with half as many cells along each side."""
    return Painted(coarser_grid(finer.grid), coarser(finer.pixels))
