"""ENC cells (IHO S-57): soundings and contours with their quality, and what vehicles should keep out of.

Depths of a chart are chosen to be safe: soundings are true, contours are drawn on the shoal side. Depth areas bound
depths and measure none, so they are no soundings.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyogrio.errors
import pyogrio.raw
import pyproj
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.types import MAX_CORNERS, MAX_SOUNDINGS, MAX_ZONES, MapExtent, Points, ReadError
from app.mapping.s44 import NORMAL_95

MAX_FEATURES = 100_000
DETAIL_M = 1.0
"""Corners of coasts are told apart from this distance on."""

ZONES_OF_CONFIDENCE: dict[int, tuple[float, float, float]] = {
    1: (0.50, 0.01, 5.0),
    2: (1.00, 0.02, 20.0),
    3: (1.00, 0.02, 50.0),
    4: (2.00, 0.05, 500.0),
}
"""By CATZOC (A1, A2, B, C): a and b of the depth's accuracy a + b d (m), and the position's (m), both at 95 %, of S-57,
Appendix A, chapter 2 (CATZOC). D and U state none."""

NO_ZONE_POSITION_M = 500.0
"""Where nothing states how well positions are known, they may be as wrong as in zone C."""

NO_BOTTOM = {"2", "5", "7"}
"""Of QUASOU: the depth is unknown, no bottom was found at it, or it is safe and the bottom lies somewhere below."""

DOUBTFUL = {"3", "4", "8", "9"}
"""Of QUASOU: doubtful, unreliable, or reported and not surveyed or not confirmed."""

DANGERS = ("OBSTRN", "WRECKS", "UWTROC")
"""What lies under water, where somebody surveyed it more or less well."""

# fmt: off
BUILT = (
    "SLCONS", "PONTON", "PILPNT", "OFSPLF", "MORFAC", "MARCUL", "FSHFAC", "HULKES", "FLODOC", "DAMCON", "GATCON",
)
# fmt: on
"""What stands or is moored in the water; where it lies along the shore, within land's own zone, it makes none."""

HAZARDS = ("LNDARE", *DANGERS, "RESARE", *BUILT)
"""Objects that vehicles should keep out of: land, dangers under water, restricted areas, and what stands or is moored
there: piers and moles, pontoons, piles, platforms, moorings, farms, nets and weirs, hulks, docks, dams, gates."""

SMALL_HOLE_M2 = 100.0
"""Free water that is enclosed by something and smaller than this is taken for a part of it."""


@dataclass(frozen=True)
class Zone:
    """Something to keep out of.

    Attributes
    ----------
    kind
        One of :data:`HAZARDS`.
    name
        What the chart calls it; it may be empty.
    depth_m
        Least depth over it; None: not known, or it is no danger of that kind.
    position_m
        How far from where it is charted it may be; this much is added about it.
    ring : (n, 2)
        Longitude, latitude; the first corner is not repeated.
    """

    kind: str
    name: str
    depth_m: float | None
    position_m: float
    ring: FloatArray


def read_enc(content: bytes) -> Points:
    """Return the soundings (SOUNDG) and the corners of contours (DEPCNT) of a cell, with the quality of M_QUAL.

    Soundings that met no bottom are left out, and doubtful ones are of no quality that is known (QUASOU).

    Raises
    ------
    ReadError
        When it is no cell, or has neither.
    """
    _check(content)
    quality = _Quality(content)
    places, doubtful, notes = np.empty((0, 3)), np.empty(0, np.bool_), []
    table = _layer(content, "SOUNDG")
    if table is not None and len(table.shapes):
        said = table.lists("QUASOU")
        met = np.array([not NO_BOTTOM & one for one in said])
        places, index = shapely.get_coordinates(table.shapes[met], include_z=True, return_index=True)
        doubtful = np.array([bool(DOUBTFUL & one) for one in said])[met][index]
        if not met.all():
            notes.append(f"{np.sum(~met)} soundings that met no bottom, or whose depth is unknown, are left out")
    table = _layer(content, "DEPCNT")
    if table is not None and len(table.shapes):
        corners, index = shapely.get_coordinates(table.shapes, return_index=True)
        places = np.concatenate([places, np.column_stack([corners, table.numbers("VALDCO")[index]])])
        doubtful = np.append(doubtful, np.zeros(len(corners), np.bool_))
    known = np.isfinite(places).all(axis=1)
    places, doubtful = places[known], doubtful[known]
    if len(places) == 0:
        raise ReadError("file", "it has neither soundings (SOUNDG) nor contours (DEPCNT)", "send another cell")
    if len(places) > MAX_SOUNDINGS:
        raise ReadError("file", f"it has more than {MAX_SOUNDINGS} depths", "send a smaller cell")
    lon, lat, depth = places.T
    a, b, _ = quality.at(lon, lat)
    sd = np.where(doubtful, np.nan, (a + b * np.maximum(depth, 0.0)) / NORMAL_95)
    lines = np.arange(1, len(places) + 1)
    return Points(lon, lat, depth, sd, pyproj.CRS.from_epsg(4326), "down", lines, notes=tuple(notes))


def read_zones(content: bytes, place: MapExtent, margin_m: float) -> tuple[list[Zone], list[str]]:
    """Return what vehicles should keep out of near a place, the nearest first, and notes in words.

    What may be where it is not charted is enlarged by how well positions are known there, and all by ``margin_m``.

    Raises
    ------
    ReadError
        When it is no cell, or what lies there has too many corners.
    """
    _check(content)
    quality = _Quality(content)
    frame, grid = place.frame, place.grid
    box = shapely.box(
        grid.west_m - place.margin_m,
        grid.south_m - place.margin_m,
        grid.west_m + grid.cols * grid.cell_m + place.margin_m,
        grid.south_m + grid.rows * grid.cell_m + place.margin_m,
    )
    around = _around(frame, box.buffer(NO_ZONE_POSITION_M + margin_m))
    found: list[tuple[float, Zone]] = []
    land: list[BaseGeometry] = []
    for kind in HAZARDS:
        table = _layer(content, kind)
        if table is None:
            continue
        depths, names = table.numbers("VALSOU"), table.texts("OBJNAM")
        for number, shape in enumerate(table.shapes):
            if shape is None or shape.is_empty:
                continue
            near = (shape if shape.is_valid else shapely.make_valid(shape)).intersection(around)
            if near.is_empty:
                continue
            local = shapely.transform(near, lambda lonlat: _local(frame, lonlat))
            middle = shapely.get_coordinates(near.representative_point())
            [position_m] = quality.at(*middle.T)[2]
            # Limits that somebody drew are where they are drawn, and what is to be seen is not surveyed from the water.
            position_m = float(position_m) if kind in DANGERS else 0.0
            about = local.buffer(position_m + margin_m, quad_segs=4)
            if kind == "LNDARE":
                land.append(about.buffer(DETAIL_M))
            elif kind in BUILT and any(one.contains(about) for one in land):
                continue
            for part in _polygons(about.intersection(box)):
                ring = shapely.get_coordinates(part.simplify(DETAIL_M))[:-1]
                lat, lon = frame.to_geographic(ring[:, 0], ring[:, 1])
                depth = float(depths[number])
                told = Zone(
                    kind,
                    names[number],
                    depth if np.isfinite(depth) else None,
                    position_m,
                    np.column_stack([lon, lat]),
                )
                found.append((part.distance(shapely.Point(box.centroid)), told))
    found.sort(key=lambda one: one[0])
    notes = []
    if len(found) > MAX_ZONES:
        notes.append(f"{len(found) - MAX_ZONES} that lie farther off are left out")
    if not quality.known:
        notes.append(f"nothing states the chart's quality: positions may be {NO_ZONE_POSITION_M:g} m off")
    zones = [zone for _, zone in found[:MAX_ZONES]]
    if sum(len(zone.ring) for zone in zones) > MAX_CORNERS:
        raise ReadError("file", f"what lies there has more than {MAX_CORNERS} corners", "ask for a smaller area")
    return zones, notes


class _Quality:
    """The zones of confidence of a cell."""

    def __init__(self, content: bytes) -> None:
        table = _layer(content, "M_QUAL")
        self.known = table is not None and len(table.shapes) > 0
        self._shapes: list[BaseGeometry] = []
        self._zones: list[tuple[float, float, float]] = []
        if table is None:
            return
        for shape, zone in zip(table.shapes, table.numbers("CATZOC"), strict=True):
            if shape is not None:
                self._shapes.append(shape if shape.is_valid else shapely.make_valid(shape))
                none = (np.nan, np.nan, NO_ZONE_POSITION_M)
                self._zones.append(none if not np.isfinite(zone) else ZONES_OF_CONFIDENCE.get(int(zone), none))

    def at(self, lon_deg: FloatArray, lat_deg: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return a, b and the position's accuracy at places, (n,) each; where zones overlap the worst of them."""
        a, b = np.full(len(lon_deg), -np.inf), np.full(len(lon_deg), -np.inf)
        position = np.full(len(lon_deg), -np.inf)
        for shape, zone in zip(self._shapes, self._zones, strict=True):
            shapely.prepare(shape)
            inside = shapely.intersects_xy(shape, lon_deg, lat_deg)
            for values, value in zip((a, b, position), zone, strict=True):
                values[inside] = np.maximum(values[inside], value)
        outside = np.isneginf(position)
        a[outside] = b[outside] = np.nan
        position[outside] = NO_ZONE_POSITION_M
        return a, b, position


@dataclass(frozen=True)
class _Table:
    """The objects of one class."""

    shapes: Any
    columns: dict[str, Any]

    def numbers(self, name: str) -> FloatArray:
        """Return an attribute, NaN where it is not told."""
        if name not in self.columns:
            return np.full(len(self.shapes), np.nan)
        values = self.columns[name]
        return np.array([_number(value) for value in values], dtype=np.float64)

    def lists(self, name: str) -> list[set[str]]:
        """Return the members of a list, each in words; none where it is not told."""
        values = self.columns.get(name, [None] * len(self.shapes))
        return [set() if value is None else set(np.atleast_1d(value).astype(str)) for value in values]

    def texts(self, name: str) -> list[str]:
        """Return a text, printable and short; empty where it is not told."""
        values = self.columns.get(name, [None] * len(self.shapes))
        return ["".join(c for c in str(value or "") if c.isprintable())[:60] for value in values]


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return np.nan


def _check(content: bytes) -> None:
    """Refuse what is no exchange file of ISO 8211, before GDAL guesses what else it may be."""
    if len(content) < 24 or content[5:6] not in (b"1", b"2", b"3") or content[6:7] != b"L":
        raise _unreadable()
    try:
        _read(content, layer="DSID", read_geometry=False)
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError, ValueError, RuntimeError):
        raise _unreadable() from None


def _layer(content: bytes, name: str) -> _Table | None:
    """Return the objects of a class; None where the cell has none."""
    options = {"SPLIT_MULTIPOINT": "ON"} if name == "SOUNDG" else {}
    try:
        about, _, shapes, columns = _read(content, layer=name, max_features=MAX_FEATURES + 1, **options)
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError):
        return None
    except (ValueError, RuntimeError):
        raise _unreadable() from None
    if len(shapes) > MAX_FEATURES:
        raise ReadError("file", f"it has more than {MAX_FEATURES} objects of a class", "send a smaller cell")
    told = dict(zip(about["fields"], columns, strict=True))
    kept = [number for number, shape in enumerate(shapes) if shape is not None]
    return _Table(
        shapely.from_wkb(shapes[kept], on_invalid="ignore"), {key: values[kept] for key, values in told.items()}
    )


def _read(content: bytes, **options: Any) -> Any:
    """Read a class of a cell; updates that may lie beside it are not looked for."""
    with warnings.catch_warnings():
        # What GDAL finds odd about a cell, it tells word by word.
        warnings.simplefilter("ignore", RuntimeWarning)
        return pyogrio.raw.read(content, UPDATES="IGNORE", **options)


def _unreadable() -> ReadError:
    return ReadError(
        "file", "it cannot be read as an ENC cell (S-57)", "send the cell's .000 file, whole and decrypted"
    )


def _local(frame: LocalFrame, lonlat: FloatArray) -> FloatArray:
    east, north = frame.to_local(lonlat[:, 1], lonlat[:, 0])
    return np.column_stack([east, north])


def _around(frame: LocalFrame, box: BaseGeometry) -> BaseGeometry:
    """Return degrees that hold a part of the frame: what lies elsewhere cannot be placed in it, and need not be."""
    west, south, east, north = box.bounds
    lat, lon = frame.to_geographic(np.array([west, west, east, east]), np.array([south, north, south, north]))
    return Polygon(shapely.get_coordinates(shapely.box(lon.min(), lat.min(), lon.max(), lat.max())))


def _polygons(geometry: BaseGeometry) -> list[Polygon]:
    """Return a geometry's polygons; what has a hole is cut through it, since zones have none."""
    whole: list[Polygon] = []
    rest = [part for part in getattr(geometry, "geoms", [geometry]) if isinstance(part, Polygon) and not part.is_empty]
    while rest:
        part = rest.pop()
        holes = [hole for hole in part.interiors if Polygon(hole).area >= SMALL_HOLE_M2]
        if not holes:
            whole.append(Polygon(part.exterior))
            continue
        west, south, east, north = part.bounds
        middle = Polygon(holes[0]).representative_point().x
        for half in (shapely.box(west, south, middle, north), shapely.box(middle, south, east, north)):
            cut = Polygon(part.exterior, holes).intersection(half)
            rest += [one for one in getattr(cut, "geoms", [cut]) if isinstance(one, Polygon) and not one.is_empty]
    return whole
