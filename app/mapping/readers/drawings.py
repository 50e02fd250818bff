"""Lines and outlines of areas from files of plans: GeoJSON, KML, KMZ, GPX, DXF, shapefiles, tables, Hypack's LNW.

What files call them is kept; what lies on a map is told in WGS 84.
"""

import io
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
import pyogrio
import pyogrio.errors
import pyogrio.raw
import pyproj
import shapely
from pyproj.exceptions import CRSError, ProjError

from app.arrays import FloatArray
from app.mapping.readers.file_extensions import KMZ, LNW, SHAPES, TABLES, XML_OF
from app.mapping.readers.survey_line_files import read_lnw, read_table
from app.mapping.readers.types import MAX_DRAWINGS, MAX_DRAWN_CORNERS, ReadError

MAX_FEATURES = 20_000
MAX_UNPACKED_BYTES = 100 * 2**20
MAX_LAYERS, MAX_MEMBERS = 200, 1000
MOST_CORNERS = 1000
"""Of one line or area; what has more is simplified first."""
DETAIL_DEG = 1e-6
"""So far simplified ones may be off: a decimetre."""
NAME_COLUMNS = ("name", "line_name", "linename", "line", "label", "title", "text", "id", "layer")
LONGEST_NAME = 56
SHAPE_PARTS = (".shp", ".shx", ".dbf", ".prj", ".cpg")
WGS84 = "EPSG:4326"
DEGREES = (WGS84, "EPSG:4979", "OGC:CRS84")
"""What GeoJSON is in that states nothing."""


@dataclass(frozen=True)
class Drawing:
    """A line, or the outline of an area.

    ``places`` (n, 2) are longitude and latitude; an outline's first one is not repeated.
    """

    kind: Literal["line", "area"]
    name: str
    places: FloatArray


@dataclass(frozen=True)
class _Drawn:
    """What a file has: names, shapes in x and y, and the system they are in, where it says."""

    names: list[str]
    shapes: list[shapely.Geometry]
    crs: str | None


@dataclass
class _LeftOut:
    """What is not taken of a file, and whether it is in the system that was given with it."""

    points: int = 0
    holes: int = 0
    used_crs: bool = False

    @property
    def notes(self) -> list[str]:
        """The same in words, however many parts the file has."""
        words = [f"{self.points} points are left out"] if self.points else []
        return words + ([f"{self.holes} holes in areas are left out"] if self.holes else [])


def read_drawings(content: bytes, kind: str, crs: str | None) -> tuple[list[Drawing], list[str]]:
    """Return the lines and areas of a file in its order, and notes in words.

    A closed line is the outline of an area. Lines without a name get their number, those of one name are told apart.

    Parameters
    ----------
    kind
        The ending of the file's name.
    crs
        What positions are in, where the file does not say.

    Raises
    ------
    ReadError
        When it cannot be used.
    """
    if kind in (*TABLES, LNW):
        drawn = [_of_text(content, kind, crs)]
    elif kind in SHAPES:
        drawn = [_of_layers(one) for one in _shapefiles(content)]
    else:
        drawn = [_of_layers(_checked(_unpacked_kml(content) if kind == KMZ else content, kind))]
    left_out = _LeftOut()
    found = [drawing for one in drawn for drawing in _drawings(one, crs, left_out)]
    notes = left_out.notes
    if crs is not None and not left_out.used_crs:
        notes.append("the file states its own coordinate reference system; crs is not used")
    if not found:
        raise ReadError("file", "it has neither lines nor areas", "send one with lines, polylines or polygons")
    if len(found) > MAX_DRAWINGS or sum(len(one.places) for one in found) > MAX_DRAWN_CORNERS:
        raise ReadError(
            "file",
            f"it has {len(found)} lines and areas with {sum(len(one.places) for one in found)} positions",
            f"divide or simplify it: at most {MAX_DRAWINGS} with {MAX_DRAWN_CORNERS} positions are read",
        )
    return _told_apart(found), notes


def _of_text(content: bytes, kind: str, crs: str | None) -> _Drawn:
    if kind == LNW:
        lines, degrees = read_lnw(content), False
    else:
        lines, degrees = read_table(content)
    lines = [(name, places) for name, places in lines if len(places) > 1]
    shapes: list[shapely.Geometry] = [shapely.LineString(places) for _, places in lines]
    if degrees and crs is not None and not _system(crs).is_geographic:
        raise ReadError("crs", "the header of the file says that its positions are degrees", "leave crs out")
    return _Drawn([name for name, _ in lines], shapes, WGS84 if degrees and crs is None else None)


def _unpacked_kml(content: bytes) -> bytes:
    """Return the document in a KMZ archive."""
    for name, member in _members(content):
        if name.lower().endswith(".kml"):
            return member()
    raise ReadError("file", "the archive holds no .kml", "send a KMZ with a document in it, or the .kml itself")


def _shapefiles(content: bytes) -> Iterator[bytes]:
    """Yield each shapefile of an archive with the files that belong to it, as an archive that is not compressed."""
    members = {name.lower(): member for name, member in _members(content)}
    stems = [name.removesuffix(".shp") for name in members if name.endswith(".shp")]
    if not stems:
        raise ReadError("file", "the archive holds no .shp", "pack .shp, .shx, .dbf and .prj into one .zip")
    _check_layers(len(stems))
    for stem in stems:
        if f"{stem}.shx" not in members:
            raise ReadError("file", "a .shp comes without its .shx", "pack .shp, .shx, .dbf and .prj into one .zip")
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            for part in SHAPE_PARTS:
                if stem + part in members:
                    archive.writestr(f"shape{part}", members[stem + part]())
        yield packed.getvalue()


def _members(content: bytes) -> Iterator[tuple[str, Callable[[], bytes]]]:
    """Yield name and a function that unpacks, of each member of an archive; all of them only so far."""
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
    except (zipfile.BadZipFile, ValueError, NotImplementedError):
        raise ReadError("file", "it is no .zip archive", "pack it anew") from None
    if len(archive.infolist()) > MAX_MEMBERS:
        raise ReadError("file", f"the archive has more than {MAX_MEMBERS} members", "pack only what is to be read")
    left = [MAX_UNPACKED_BYTES]

    def unpack(info: zipfile.ZipInfo) -> bytes:
        try:
            with archive.open(info) as member:
                found = member.read(left[0] + 1)
        except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, zlib.error, OSError):
            raise ReadError(
                "file", "the archive is damaged, encrypted or packed in an unusual way", "pack it anew"
            ) from None
        left[0] -= len(found)
        if left[0] < 0:
            raise ReadError(
                "file", f"it unpacks to more than {MAX_UNPACKED_BYTES >> 20} MB", "pack only what is needed"
            )
        return found

    for info in archive.infolist():
        # macOS packs a file ``._name`` beside each one, which says how its windows look.
        if not info.is_dir() and not info.filename.rpartition("/")[2].startswith("._"):
            yield info.filename, partial(unpack, info)


def _checked(content: bytes, kind: str) -> bytes:
    """Return a file that is what its name says, before GDAL guesses what else it may be. Raises ReadError."""
    head = content[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    root = XML_OF.get(kind)
    if root is not None:
        known = head.startswith(b"<") and root in head
        # What stands for other text, or for other files, has no business in one that is read.
        known &= not any(word in content for word in (b"<!DOCTYPE", b"<!ENTITY", b"<OGRVRT", b"<VRT"))
    elif kind == ".dxf":
        known = b"SECTION" in head
    else:
        known = head.startswith(b"{")
    if not known:
        advice = "save it as text (ASCII)" if kind == ".dxf" else "check the file"
        raise ReadError("file", f"it is no {kind.removeprefix('.').upper()} file", advice)
    return content


def _check_layers(count: int) -> None:
    if count > MAX_LAYERS:
        raise ReadError("file", f"it has {count} layers or folders", f"divide it: at most {MAX_LAYERS} are read")


def _of_layers(content: bytes) -> _Drawn:
    """Return what is in all layers of a file that GDAL reads."""
    names: list[str] = []
    shapes: list[shapely.Geometry] = []
    crs: str | None = None
    try:
        layers = pyogrio.list_layers(content)[:, 0]
        _check_layers(len(layers))
        for number, layer in enumerate(layers):
            if str(layer) in ("waypoints", "route_points", "track_points"):
                continue
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                about, _, wkb, columns = pyogrio.raw.read(content, layer=number, max_features=MAX_FEATURES + 1)
            if wkb is None:
                continue
            if len(wkb) > MAX_FEATURES:
                raise ReadError("file", f"it has more than {MAX_FEATURES} objects", "divide it")
            crs = crs or about["crs"]
            kept = [row for row, one in enumerate(wkb) if one is not None]
            names += _names(list(about["fields"]), columns, kept)
            shapes += list(np.atleast_1d(shapely.from_wkb(wkb[kept], on_invalid="ignore")))
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError, ValueError, RuntimeError) as error:
        if isinstance(error, ReadError):
            raise
        raise ReadError("file", "it cannot be read: it is damaged, or not what its name says", "check it") from None
    return _Drawn(names, shapes, crs)


def _names(fields: list[str], columns: list[Any], rows: list[int]) -> list[str]:
    """Return what a table calls each of some rows; empty where it says nothing."""
    by_name = {name.lower(): column for name, column in zip(fields, columns, strict=True)}
    told = [by_name[name] for name in NAME_COLUMNS if name in by_name]
    return [next((text for column in told if (text := _text(column[row]))), "") for row in rows]


def _text(value: Any) -> str:
    if value is None or (isinstance(value, float | np.floating) and not np.isfinite(value)):
        return ""
    if isinstance(value, float | np.floating) and float(value).is_integer():
        value = int(value)
    return "".join(c for c in str(value) if c.isprintable()).strip()[:LONGEST_NAME]


def _drawings(drawn: _Drawn, crs: str | None, left_out: _LeftOut) -> Iterator[Drawing]:
    """Yield the lines and areas of what a file has; what is nothing of that is counted."""
    kept: list[tuple[Literal["line", "area"], str, FloatArray]] = []
    for name, shape in zip(drawn.names, drawn.shapes, strict=True):
        for part in _parts(shape):
            if isinstance(part, shapely.Polygon) and not part.is_empty:
                left_out.holes += len(part.interiors)
                kept.append(("area", name, shapely.get_coordinates(part.exterior)[:-1]))
            elif isinstance(part, shapely.LineString) and part.length > 0.0:
                places = shapely.get_coordinates(part)
                closed = part.is_closed and len(places) > 3
                kept.append(("area", name, places[:-1]) if closed else ("line", name, places))
            elif isinstance(part, shapely.Point):
                left_out.points += 1
    if not kept:
        return
    xy = np.concatenate([places for *_, places in kept])
    # GeoJSON is in degrees unless it says otherwise, which those who draw in metres forget.
    uses_given = crs is not None and (drawn.crs is None or (drawn.crs in DEGREES and not _are_degrees(xy)))
    left_out.used_crs |= uses_given
    lonlat = _to_degrees(xy, crs if uses_given else drawn.crs)
    ends = np.cumsum([len(places) for *_, places in kept])[:-1]
    for (kind, name, _), places in zip(kept, np.split(lonlat, ends), strict=True):
        yield Drawing(kind, _text(name), _simplified(kind, places))


def _are_degrees(xy: FloatArray) -> bool:
    return bool((np.abs(xy) <= (180.0, 90.0)).all())


def _parts(shape: shapely.Geometry | None) -> Iterator[shapely.Geometry]:
    if shape is None:
        return
    if isinstance(
        shape, shapely.GeometryCollection | shapely.MultiLineString | shapely.MultiPolygon | shapely.MultiPoint
    ):
        for part in shape.geoms:
            yield from _parts(part)
    else:
        yield shape


def _to_degrees(xy: FloatArray, crs: str | None) -> FloatArray:
    """Return longitude and latitude of positions (n, 2)."""
    if crs is None:
        raise ReadError(
            "crs", "the file does not say what its positions are in", "give crs, for example EPSG:32629 or EPSG:4326"
        )
    try:
        change = pyproj.Transformer.from_crs(_system(crs), WGS84, always_xy=True)
        lon, lat = change.transform(xy[:, 0], xy[:, 1])
    except (CRSError, ProjError):
        raise _unknown_system() from None
    lonlat = np.column_stack([lon, lat])
    if not (np.isfinite(lonlat).all() and _are_degrees(lonlat)):
        raise ReadError(
            "crs", "positions lie nowhere on earth in that coordinate reference system", "give the one they are in"
        )
    return lonlat


def _system(crs: str) -> pyproj.CRS:
    try:
        return pyproj.CRS.from_user_input(crs)
    except CRSError:
        raise _unknown_system() from None


def _unknown_system() -> ReadError:
    return ReadError("crs", "it is no coordinate reference system that is known", "give EPSG:… or WKT")


def _simplified(kind: str, places: FloatArray) -> FloatArray:
    # The outline of an area ends where it began, which is one more.
    most = MOST_CORNERS - (kind == "area")
    if len(places) <= most:
        return places
    fewer = shapely.get_coordinates(shapely.simplify(shapely.LineString(places), DETAIL_DEG))
    if len(fewer) > most:
        raise ReadError("file", f"one {kind} has {len(fewer)} positions", f"simplify it to {most}")
    return fewer


def _told_apart(found: list[Drawing]) -> list[Drawing]:
    """Return drawings of which no two lines, and no two areas, have the same name."""
    taken: set[tuple[str, str]] = {(one.kind, one.name) for one in found if one.name}
    seen: set[tuple[str, str]] = set()
    named = []
    for number, one in enumerate(found, 1):
        name, count = one.name or str(number), 1
        while (one.kind, name) in seen or ((count > 1 or not one.name) and (one.kind, name) in taken):
            count += 1
            name = f"{one.name or number}-{count}"
        seen.add((one.kind, name))
        named.append(Drawing(one.kind, name, one.places))
    return named
