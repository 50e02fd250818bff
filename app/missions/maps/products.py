"""The files that leave with a mission: what there is, and how each is made."""

import csv
import io
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
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
from app.missions.search.obstacles import obstacles_geojson
from app.missions.search.state import Search
from app.missions.views.soundings import Verdict
from app.storage.models import SoundingRow

CONTOURS_PER_MAP = 10
CONTOUR_INTERVALS_M = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)

MAP, SOUNDINGS, TRACKS, SEARCH = "map", "soundings", "tracks", "search"
"""What files are made of."""


GEOJSON, KML, TEXT, CSV = (
    "application/geo+json",
    "application/vnd.google-earth.kml+xml",
    "text/plain; charset=utf-8",
    "text/csv; charset=utf-8",
)


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
    tracks: Sequence[Track] = ()
    search: Search | None = None

    @property
    def snapshot(self) -> MapSnapshot:
        """Return the map. Raises MapNotReadyError without one."""
        if self.map is None:
            raise MapNotReadyError("there is no map yet", "start the mission or post measurements")
        return self.map

    @property
    def datum(self) -> str:
        """Return what depths are counted from."""
        return self.facts.vertical_datum.statement


@dataclass(frozen=True)
class Product:
    """A file that leaves the service."""

    filename: str
    media_type: str
    content: bytes


@dataclass(frozen=True)
class ProductKind:
    """A kind of file.

    Attributes
    ----------
    resource
        What it shows and where the REST interface has it: ``/missions/{id}/{resource}.{extension}``.
    make
        Returns the file. Raises InvalidRequestError for options that cannot be.
    needs
        What has to be loaded to make it.
    of_vehicle
        Whether it holds what one vehicle measured.
    """

    resource: str
    extension: str
    media_type: str
    title: str
    make: Callable[[Material, ProductOptions], bytes]
    needs: Collection[str]
    of_vehicle: bool = False

    @property
    def name(self) -> str:
        """Return its name on the command line; without a part before the point it is one of the map's."""
        return f"{self.part}.{self.extension}".removeprefix(f"{MAP}.")

    @property
    def part(self) -> str:
        """Return which part of what is known it shows."""
        return self.resource.rpartition("/")[2]


def _geotiff(material: Material, options: ProductOptions) -> bytes:
    snapshot, facts = material.snapshot, material.facts
    layers = file_layers(snapshot.source(options.order))
    return geotiff(snapshot.built.map, layers, facts.frame, vertical_datum=facts.vertical_datum)


def _netcdf(material: Material, options: ProductOptions) -> bytes:
    snapshot, facts = material.snapshot, material.facts
    return netcdf(
        snapshot.built.map,
        file_layers(snapshot.source(options.order)),
        facts.frame,
        vertical_datum=facts.vertical_datum,
        title=facts.title,
        created=material.created,
    )


def _bag(material: Material, _: ProductOptions) -> bytes:
    facts = material.facts
    return bag(material.snapshot.built.map, facts.frame, vertical_datum=facts.vertical_datum, title=facts.title)


def _map_xyz(material: Material, _: ProductOptions) -> bytes:
    return map_xyz(material.snapshot.built.map, material.facts.frame, vertical_datum=material.datum, geographic=True)


def _map_geojson(material: Material, options: ProductOptions) -> bytes:
    """Return contours, the area and the tracks as one feature collection."""
    collection = orjson.loads(contours_geojson(_contours(material, options), vertical_datum=material.datum))
    ring = Polygon(material.facts.spec.area.ring)
    area = {"type": "Feature", "properties": {"kind": "area"}, "geometry": mapping(ring)}
    collection["features"] += [area, *orjson.loads(tracks_geojson(material.tracks))["features"]]
    return orjson.dumps(collection)


def _map_kml(material: Material, options: ProductOptions) -> bytes:
    return contours_kml(_contours(material, options), title=material.facts.title, vertical_datum=material.datum)


def _picture(material: Material, options: ProductOptions) -> bytes:
    facts = material.facts
    return picture_png(
        material.snapshot.built.map,
        vertical_datum=material.datum,
        title=facts.title,
        range_m=options.range_m,
        tracks={track.vehicle: _local_track(facts, track) for track in material.tracks if track.points},
    )


def _overlay(material: Material, options: ProductOptions) -> bytes:
    bathymetry = material.snapshot.built.map
    depths = bathymetry.depth_m[np.isfinite(bathymetry.depth_m)]
    range_m = options.range_m or (float(depths.min()), float(depths.max()) + 1e-3)
    return overlay_png(bathymetry.depth_m, bathymetry.sounded, range_m)


def _soundings_xyz(material: Material, _: ProductOptions) -> bytes:
    rows = [row for row in material.soundings if row.verdict == Verdict.ACCEPTED]
    table = np.array([(row.east_m, row.north_m, row.depth_m, row.sd_m) for row in rows]).reshape(-1, 4)
    return soundings_xyz(Soundings.of_rows(table), material.facts.frame, vertical_datum=material.datum, geographic=True)


def _obstacles(material: Material, _: ProductOptions) -> bytes:
    if material.search is None:
        raise InvalidRequestError("format", "the mission is no search", "ask for another file")
    return obstacles_geojson(material.search, material.facts.frame)


def _local_track(facts: MissionFacts, track: Track) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    lat, lon = np.array([(point.lat_deg, point.lon_deg) for point in track.points]).T
    return np.column_stack(facts.frame.to_local(lat, lon))


def _contours(material: Material, options: ProductOptions) -> list[Contour]:
    snapshot, interval_m = material.snapshot, options.interval_m
    if interval_m is None:
        depths = snapshot.built.map.depth_m
        span = float(np.nanmax(depths) - np.nanmin(depths))
        interval_m = next((i for i in CONTOUR_INTERVALS_M if span / i <= CONTOURS_PER_MAP), CONTOUR_INTERVALS_M[-1])
    try:
        return find_contours(snapshot.built.map, snapshot.facts.frame, interval_m)
    except ValueError as error:
        raise InvalidRequestError("interval_m", str(error), "choose a larger one") from error


def _crowdsourced(material: Material, options: ProductOptions) -> bytes:
    if material.provider is None:
        raise InvalidRequestError(
            "provider",
            "IHO B-12 asks who hands soundings in, and the settings do not say",
            "set provider.organization and provider.email in bathyfleet.toml",
        )
    name = _only_vehicle(material.soundings, options.vehicle)
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


def _soundings_csv(material: Material, _: ProductOptions) -> bytes:
    """Return every sounding, rejected ones with their reason; raw and corrected depth side by side."""
    text = io.StringIO()
    text.write(f"# depth_m: positive down, from {material.datum}\n")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    writer.writerows([text_cell(getattr(row, column)) for column in COLUMNS] for row in material.soundings)
    return text.getvalue().encode()


EVERY_SOUNDING = "every sounding, raw and corrected, with its verdict"
TIMED_TRACKS = "the vehicles' tracks with times and depths"

PRODUCTS = {
    kind.name: kind
    for kind in (
        ProductKind(
            MAP, "tif", "image/tiff; application=geotiff", "Cloud-Optimized GeoTIFF with every layer", _geotiff, {MAP}
        ),
        ProductKind(MAP, "nc", "application/x-netcdf", "CF-NetCDF with every layer", _netcdf, {MAP}),
        ProductKind(
            MAP, "bag", "application/x-bag", "Bathymetric Attributed Grid: elevation and uncertainty", _bag, {MAP}
        ),
        ProductKind(MAP, "xyz", TEXT, "longitude, latitude and depth of every cell", _map_xyz, {MAP}),
        ProductKind(MAP, "csv", CSV, EVERY_SOUNDING, _soundings_csv, {SOUNDINGS}),
        ProductKind(MAP, "geojson", GEOJSON, "depth contours, area and tracks", _map_geojson, {MAP, TRACKS}),
        ProductKind(MAP, "kml", KML, "depth contours", _map_kml, {MAP}),
        ProductKind(MAP, "png", "image/png", "a picture with axes, colour bar and scale", _picture, {MAP, TRACKS}),
        ProductKind(MAP, "overlay.png", "image/png", "a bare picture to lay over a web map", _overlay, {MAP}),
        ProductKind(SOUNDINGS, "csv", CSV, EVERY_SOUNDING, _soundings_csv, {SOUNDINGS}),
        ProductKind(
            SOUNDINGS,
            "xyz",
            TEXT,
            "longitude, latitude and corrected depth of accepted soundings",
            _soundings_xyz,
            {SOUNDINGS},
        ),
        ProductKind(
            SOUNDINGS,
            "geojson",
            GEOJSON,
            "raw soundings of one vehicle as crowdsourced bathymetry (IHO B-12)",
            _crowdsourced,
            {SOUNDINGS},
            of_vehicle=True,
        ),
        ProductKind(TRACKS, "geojson", GEOJSON, TIMED_TRACKS, lambda m, _: tracks_geojson(m.tracks), {TRACKS}),
        ProductKind(
            TRACKS, "kml", KML, "the vehicles' tracks", lambda m, _: tracks_kml(m.tracks, title=m.facts.title), {TRACKS}
        ),
        ProductKind(
            TRACKS,
            "gpx",
            "application/gpx+xml",
            TIMED_TRACKS,
            lambda m, _: tracks_gpx(m.tracks, title=m.facts.title),
            {TRACKS},
        ),
        ProductKind(
            f"{SEARCH}/obstacles", "geojson", GEOJSON, "obstacles of the search, known and found", _obstacles, {SEARCH}
        ),
    )
}
"""Every file by its name."""


def product_kind(name: str) -> ProductKind:
    """Return a kind of file by its name. Raises InvalidRequestError when there is none."""
    if name not in PRODUCTS:
        raise InvalidRequestError("format", f"there is no format {name!r}", f"use one of {', '.join(PRODUCTS)}")
    return PRODUCTS[name]


def make_product(name: str, material: Material, options: ProductOptions) -> Product:
    """Return one file. Raises InvalidRequestError for an unknown format or options that cannot be."""
    kind = product_kind(name)
    content = kind.make(material, options)
    part = _only_vehicle(material.soundings, options.vehicle) if kind.of_vehicle else kind.part.removeprefix(MAP)
    return Product(f"{_slug(material.facts.spec.name)}{part and f'-{part}'}.{kind.extension}", kind.media_type, content)


def _slug(name: str) -> str:
    words = "".join(c if c.isascii() and c.isalnum() else " " for c in name).split()
    return "-".join(words).lower() or "mission"
