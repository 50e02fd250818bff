"""The files that leave with a mission: what there is, and how each is made."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np
import orjson
from shapely.geometry import Polygon, mapping

from app import __version__
from app.csv_cells import text_cell
from app.mapping.layers import file_layers
from app.mapping.products.bag import bag
from app.mapping.products.contours import Contour, contours_geojson, find_contours
from app.mapping.products.crowdsourced import Provider, RawSounding, crowdsourced_geojson
from app.mapping.products.geotiff import geotiff
from app.mapping.products.kml import contours_kml, tracks_kml
from app.mapping.products.netcdf import netcdf
from app.mapping.products.overlay import overlay_png
from app.mapping.products.picture import picture_png
from app.mapping.products.text import map_xyz, soundings_xyz
from app.mapping.products.tracks import Track, tracks_geojson, tracks_gpx
from app.mapping.s44 import Order
from app.mapping.types import Soundings
from app.missions.errors import InvalidRequestError, MapNotReadyError
from app.missions.maps.snapshot import MapSnapshot, MissionFacts
from app.missions.views.soundings import Verdict
from app.storage.models import SoundingRow

CONTOURS_PER_MAP = 10
CONTOUR_INTERVALS_M = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)

MAP, SOUNDINGS, TRACKS = "map", "soundings", "tracks"


@dataclass(frozen=True)
class ProductKind:
    """A kind of file.

    Attributes
    ----------
    resource
        What it shows and where the REST interface has it: ``/missions/{id}/{resource}.{extension}``.
    needs
        What has to be loaded to make it.
    """

    resource: str
    extension: str
    media_type: str
    title: str
    needs: frozenset[str]


def _kind(resource: str, extension: str, media_type: str, title: str, *also: str) -> ProductKind:
    return ProductKind(resource, extension, media_type, title, frozenset({resource, *also}))


GEOJSON, KML, TEXT, CSV = (
    "application/geo+json",
    "application/vnd.google-earth.kml+xml",
    "text/plain; charset=utf-8",
    "text/csv; charset=utf-8",
)

PRODUCTS = {
    "tif": _kind(MAP, "tif", "image/tiff; application=geotiff", "Cloud-Optimized GeoTIFF with every layer"),
    "nc": _kind(MAP, "nc", "application/x-netcdf", "CF-NetCDF with every layer"),
    "bag": _kind(MAP, "bag", "application/x-bag", "Bathymetric Attributed Grid: elevation and uncertainty"),
    "xyz": _kind(MAP, "xyz", TEXT, "longitude, latitude and depth of every cell"),
    "csv": ProductKind(MAP, "csv", CSV, "every sounding, raw and corrected, with its verdict", frozenset({SOUNDINGS})),
    "geojson": _kind(MAP, "geojson", GEOJSON, "depth contours, area and tracks", TRACKS),
    "kml": _kind(MAP, "kml", KML, "depth contours"),
    "png": _kind(MAP, "png", "image/png", "a picture with axes, colour bar and scale", TRACKS),
    "overlay.png": _kind(MAP, "overlay.png", "image/png", "a bare picture to lay over a web map"),
    "soundings.csv": _kind(SOUNDINGS, "csv", CSV, "every sounding, raw and corrected, with its verdict"),
    "soundings.xyz": _kind(SOUNDINGS, "xyz", TEXT, "longitude, latitude and corrected depth of accepted soundings"),
    "soundings.geojson": _kind(
        SOUNDINGS, "geojson", GEOJSON, "raw soundings of one vehicle as crowdsourced bathymetry (IHO B-12)"
    ),
    "tracks.geojson": _kind(TRACKS, "geojson", GEOJSON, "the vehicles' tracks with times and depths"),
    "tracks.kml": _kind(TRACKS, "kml", KML, "the vehicles' tracks"),
    "tracks.gpx": _kind(TRACKS, "gpx", "application/gpx+xml", "the vehicles' tracks with times and depths"),
}
"""Every file by its name on the command line; without a resource before the point it is one of the map's."""


@dataclass(frozen=True)
class ProductOptions:
    """What may be asked of a file.

    Attributes
    ----------
    order
        S-44 order that the TVU is compared with.
    interval_m
        Between contours; None: about ten of them.
    range_m
        Depths of a picture's first and last colour; None: the map's own.
    vehicle
        Whose soundings, where a file holds those of one vehicle; None: of the only one.
    """

    order: Order = Order.ORDER_1A
    interval_m: float | None = None
    range_m: tuple[float, float] | None = None
    vehicle: str | None = None


@dataclass(frozen=True)
class Material:
    """What files are made of; only what the kind needs is there."""

    facts: MissionFacts
    created: datetime
    provider: Provider | None = None
    map: MapSnapshot | None = None
    soundings: Sequence[SoundingRow] = ()
    tracks: Sequence[Track] = field(default=())


@dataclass(frozen=True)
class Product:
    """A file that leaves the service."""

    filename: str
    media_type: str
    content: bytes


def product_kind(name: str) -> ProductKind:
    """Return a kind of file by its name. Raises InvalidRequestError when there is none."""
    if name not in PRODUCTS:
        raise InvalidRequestError("format", f"there is no format {name!r}", f"use one of {', '.join(PRODUCTS)}")
    return PRODUCTS[name]


def make_product(name: str, material: Material, options: ProductOptions) -> Product:
    """Return one file. Raises InvalidRequestError for an unknown format or options that cannot be."""
    kind = product_kind(name)
    makers = {MAP: _map_file, SOUNDINGS: _soundings_file, TRACKS: _tracks_file}
    content = makers[SOUNDINGS if kind.needs == {SOUNDINGS} else kind.resource](kind, material, options)
    part = "" if kind.resource == MAP else f"-{kind.resource}"
    if name == "soundings.geojson":
        part = f"-{_only_vehicle(material.soundings, options.vehicle)}"
    return Product(f"{_slug(material.facts.spec.name)}{part}.{kind.extension}", kind.media_type, content)


def _map_file(kind: ProductKind, material: Material, options: ProductOptions) -> bytes:
    snapshot = material.map
    if snapshot is None:
        raise MapNotReadyError("there is no map yet", "start the mission or post measurements")
    facts, bathymetry = material.facts, snapshot.built.map
    frame, datum, title = facts.frame, facts.vertical_datum, facts.title
    match kind.extension:
        case "tif":
            return geotiff(bathymetry, file_layers(snapshot.source(options.order)), frame, vertical_datum=datum)
        case "nc":
            layers = file_layers(snapshot.source(options.order))
            return netcdf(bathymetry, layers, frame, vertical_datum=datum, title=title, created=material.created)
        case "bag":
            return bag(bathymetry, frame, vertical_datum=datum, title=title)
        case "xyz":
            return map_xyz(bathymetry, frame, vertical_datum=datum.statement, geographic=True)
        case "geojson":
            return _contours_with_tracks(_contours(snapshot, options.interval_m), material)
        case "kml":
            contours = _contours(snapshot, options.interval_m)
            return contours_kml(contours, title=title, vertical_datum=datum.statement)
        case "png":
            local = {track.vehicle: _local_track(facts, track) for track in material.tracks if track.points}
            return picture_png(
                bathymetry, vertical_datum=datum.statement, title=title, range_m=options.range_m, tracks=local
            )
        case _:
            depths = bathymetry.depth_m[np.isfinite(bathymetry.depth_m)]
            range_m = options.range_m or (float(depths.min()), float(depths.max()) + 1e-3)
            return overlay_png(bathymetry.depth_m, bathymetry.sounded, range_m)


def _soundings_file(kind: ProductKind, material: Material, options: ProductOptions) -> bytes:
    facts = material.facts
    match kind.extension:
        case "csv":
            return _soundings_csv(material.soundings, facts.vertical_datum.statement)
        case "xyz":
            rows = [row for row in material.soundings if row.verdict == Verdict.ACCEPTED]
            table = np.array([(row.east_m, row.north_m, row.depth_m, row.sd_m) for row in rows]).reshape(-1, 4)
            corrected = Soundings(*table.T.copy())
            return soundings_xyz(corrected, facts.frame, vertical_datum=facts.vertical_datum.statement, geographic=True)
        case _:
            return _crowdsourced(material, options.vehicle)


def _tracks_file(kind: ProductKind, material: Material, options: ProductOptions) -> bytes:
    title = material.facts.title
    match kind.extension:
        case "geojson":
            return tracks_geojson(material.tracks)
        case "kml":
            return tracks_kml(material.tracks, title=title)
        case _:
            return tracks_gpx(material.tracks, title=title)


def _local_track(facts: MissionFacts, track: Track) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    lat, lon = np.array([(point.lat_deg, point.lon_deg) for point in track.points]).T
    return np.column_stack(facts.frame.to_local(lat, lon))


def _contours(snapshot: MapSnapshot, interval_m: float | None) -> list[Contour]:
    if interval_m is None:
        depths = snapshot.built.map.depth_m
        span = float(np.nanmax(depths) - np.nanmin(depths))
        interval_m = next((i for i in CONTOUR_INTERVALS_M if span / i <= CONTOURS_PER_MAP), CONTOUR_INTERVALS_M[-1])
    try:
        return find_contours(snapshot.built.map, snapshot.facts.frame, interval_m)
    except ValueError as error:
        raise InvalidRequestError("interval_m", str(error), "choose a larger one") from error


def _contours_with_tracks(contours: Sequence[Contour], material: Material) -> bytes:
    """Return contours, the area and the tracks as one feature collection."""
    facts = material.facts
    collection = orjson.loads(contours_geojson(contours, vertical_datum=facts.vertical_datum.statement))
    area = {"type": "Feature", "properties": {"kind": "area"}, "geometry": mapping(Polygon(facts.spec.area.ring))}
    collection["features"] += [area, *orjson.loads(tracks_geojson(material.tracks))["features"]]
    return orjson.dumps(collection)


def _crowdsourced(material: Material, vehicle: str | None) -> bytes:
    if material.provider is None:
        raise InvalidRequestError(
            "provider",
            "IHO B-12 asks who hands soundings in, and the settings do not say",
            "set provider.organization and provider.email in bathyfleet.toml",
        )
    name = _only_vehicle(material.soundings, vehicle)
    raw = [
        RawSounding(row.lon_deg, row.lat_deg, row.raw_depth_m, row.sd_m, row.time_s, row.position_sd_m)
        for row in material.soundings
        if row.vehicle == name and row.verdict == Verdict.ACCEPTED
    ]
    return crowdsourced_geojson(raw, name, material.provider, version=__version__, created=material.created)


def _only_vehicle(soundings: Sequence[SoundingRow], vehicle: str | None) -> str:
    """Return the vehicle that is meant. Raises InvalidRequestError when that is not clear."""
    present = sorted({row.vehicle for row in soundings if row.verdict == Verdict.ACCEPTED})
    if vehicle is None and len(present) == 1:
        return present[0]
    if vehicle not in present:
        said = "several vehicles have soundings" if vehicle is None else f"{vehicle!r} has no accepted sounding"
        raise InvalidRequestError("vehicle", said, "name one of " + (", ".join(present) or "none so far"))
    return vehicle


COLUMNS = (
    "id",
    "vehicle",
    "time_s",
    "beam",
    "source",
    "lat_deg",
    "lon_deg",
    "east_m",
    "north_m",
    "vehicle_depth_m",
    "range_m",
    "raw_depth_m",
    "depth_m",
    "sd_m",
    "position_sd_m",
    "level_m",
    "vehicle_lat_deg",
    "vehicle_lon_deg",
    "roll_deg",
    "pitch_deg",
    "heading_deg",
    "beam_azimuth_deg",
    "beam_off_nadir_deg",
    "step",
    "verdict",
    "reason",
)


def _soundings_csv(soundings: Sequence[SoundingRow], vertical_datum: str) -> bytes:
    """Return every sounding, rejected ones with their reason; raw and corrected depth side by side."""
    text = io.StringIO()
    text.write(f"# depth_m: positive down, from {vertical_datum}\n")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    writer.writerows([text_cell(getattr(row, column)) for column in COLUMNS] for row in soundings)
    return text.getvalue().encode()


def _slug(name: str) -> str:
    words = "".join(c if c.isascii() and c.isalnum() else " " for c in name).split()
    return "-".join(words).lower() or "mission"
