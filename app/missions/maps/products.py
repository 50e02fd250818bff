"""The files that leave with a mission: what there is, and how each is made."""

import io
import zipfile
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import orjson
from shapely.geometry import Polygon, mapping

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.coordinates.projected import Frame, ProjectedFrame
from app.mapping.layers import Layer, LayerSource, file_layers
from app.mapping.products.bag import bag
from app.mapping.products.contours import (
    Contour,
    contours_geojson,
    contours_in_metres,
    find_contours,
    usual_interval_m,
)
from app.mapping.products.crossovers import crossovers_csv
from app.mapping.products.crowdsourced import Provider
from app.mapping.products.dxf import contours_dxf
from app.mapping.products.geotiff import geotiff
from app.mapping.products.holidays import holidays_geojson
from app.mapping.products.kml import contours_kml, tracks_kml
from app.mapping.products.line_log import lines_csv
from app.mapping.products.netcdf import netcdf
from app.mapping.products.pictures.overlay import overlay_png
from app.mapping.products.pictures.picture import picture_png
from app.mapping.products.s102 import SurveyFacts, file_name, s102
from app.mapping.products.text import map_xyz
from app.mapping.products.tracks import Track, tracks_geojson, tracks_gpx
from app.mapping.products.vr_bag import vr_bag
from app.mapping.quality.planned_lines import PlannedLine
from app.mapping.quality.survey import SurveyCheck
from app.mapping.s44 import Order, thu_m
from app.mapping.tiers import tiers
from app.mapping.types import BathymetricMap
from app.missions.errors import ConflictError, InvalidRequestError, MapNotReadyError
from app.missions.maps.file_content import FileContent
from app.missions.maps.projection import NOT_SOUNDED, placed, projected_frame
from app.missions.maps.snapshot import MapSnapshot, MissionFacts
from app.missions.search.obstacles import obstacles_geojson
from app.missions.search.state import Search
from app.missions.views.maps.map import FileOption

MAP, SOUNDINGS, ACCEPTED, RAW, POINTS, TRACKS, SEARCH, SWATHS, SURVEY, TIERS, CROSSOVERS = (
    "map",
    "soundings",
    "accepted soundings",
    "raw soundings of a vehicle",
    "soundings as a point cloud",
    "tracks",
    "search",
    "swaths",
    "survey",
    "tiers",
    "crossovers",
)
"""What files are made of."""

CONTOURS = "contours"
"""A resource whose files are made of the map."""

LEAST_DEPTH = "least depth below the vertical datum of the smallest cells in each, positive down"

ZIP_EPOCH = (1980, 1, 1, 0, 0, 0)
"""The same content is the same archive."""

GEOJSON, KML, DXF, TEXT, CSV = (
    "application/geo+json",
    "application/vnd.google-earth.kml+xml",
    "image/vnd.dxf",
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
    crs
        The projected system of its positions, ``utm`` or ``EPSG:nnnn``; None: the mission's own frame, or degrees.
    """

    order: Order = Order.ORDER_1A
    interval_m: float | None = None
    range_m: tuple[float, float] | None = None
    vehicle: str | None = None
    crs: str | None = None


@dataclass(frozen=True)
class SurveyTimes:
    """When a mission's soundings were made, and the largest deviation of a position that they state.

    All None without soundings, the last one also where some state none.
    """

    first_time_s: float | None = None
    last_time_s: float | None = None
    position_sd_m: float | None = None


@dataclass(frozen=True)
class Material:
    """What files are made of; only what the kind needs is there."""

    facts: MissionFacts
    created: datetime
    provider: Provider | None = None
    map: MapSnapshot | None = None
    soundings: FileContent | None = None
    tracks: Sequence[Track] = ()
    search: Search | None = None
    surveyed: SurveyTimes = SurveyTimes()
    crossovers: SurveyCheck | None = None

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
    content: FileContent


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
    options
        What makes a difference to it.
    filename
        Returns what it is saved as, where a standard says so; None: the mission's name.
    """

    resource: str
    extension: str
    media_type: str
    title: str
    make: Callable[[Material, ProductOptions], bytes | FileContent]
    needs: Collection[str]
    options: Collection[FileOption] = ()
    filename: Callable[[MissionFacts], str] | None = None

    @property
    def name(self) -> str:
        """Return its name on the command line; without a part before the point it is one of the map's."""
        return f"{self.part}.{self.extension}".removeprefix(f"{MAP}.")

    @property
    def part(self) -> str:
        """Return which part of what is known it shows."""
        return self.resource.rpartition("/")[2]


def frame_of(facts: MissionFacts, options: ProductOptions) -> Frame:
    """Return what positions are in. Raises InvalidRequestError for a system that cannot be."""
    return facts.frame if options.crs is None else projected_frame(options.crs, facts.spec.area, facts.frame)


def _placed(
    material: Material, options: ProductOptions, layers: Sequence[Layer] = ()
) -> tuple[BathymetricMap, Sequence[Layer], Frame]:
    """Return the map and layers of it on the grid that is asked for. Raises ConflictError where no cell is known."""
    frame = frame_of(material.facts, options)
    return *placed(material.snapshot.built.map, layers, frame), frame


def _geotiff(material: Material, options: ProductOptions) -> bytes:
    layers = file_layers(material.snapshot.source(options.order))
    return geotiff(*_placed(material, options, layers), vertical_datum=material.facts.vertical_datum)


def _netcdf(material: Material, options: ProductOptions) -> bytes:
    facts = material.facts
    return netcdf(
        *_placed(material, options, file_layers(material.snapshot.source(options.order))),
        vertical_datum=facts.vertical_datum,
        title=facts.title,
        created=material.created,
    )


def _bag(material: Material, options: ProductOptions) -> bytes:
    facts = material.facts
    bathymetry, _, frame = _placed(material, options)
    return bag(
        bathymetry,
        frame,
        vertical_datum=facts.vertical_datum,
        title=facts.title,
        common_sd_m=facts.common_sd_m,
    )


def _s102(material: Material, _: ProductOptions) -> bytes:
    facts, surveyed, bathymetry = material.facts, material.surveyed, material.snapshot.built.map
    if facts.vertical_datum.s100 is None:
        raise ConflictError(
            f"S-102 asks for a chart datum, and depths are below {facts.vertical_datum.statement}",
            "state the tide with one of its datums, for example datum_epsg 5861 (LAT depth)",
        )
    if not (bathymetry.sounded.any() or bathymetry.prior is not None):
        raise ConflictError(*NOT_SOUNDED)
    swept = material.snapshot.ensonified()
    position_sd_m = surveyed.position_sd_m
    survey = SurveyFacts(
        source_id=f"{facts.title} ({facts.mission_id})",
        authority="" if material.provider is None else material.provider.organization,
        first_time_s=surveyed.first_time_s,
        last_time_s=surveyed.last_time_s,
        position_95_m=None if position_sd_m is None else float(thu_m(np.array(position_sd_m))),
        common_sd_m=facts.common_sd_m,
        full_coverage=swept is not None and swept.full_coverage,
    )
    return s102(bathymetry, facts.frame, survey, vertical_datum=facts.vertical_datum, issued=material.created)


def _vr_bag(material: Material, _: ProductOptions) -> bytes:
    facts, bathymetry = material.facts, material.snapshot.built.map
    share = _cell_of_depth(material)
    return vr_bag(
        bathymetry,
        share,
        facts.frame,
        vertical_datum=facts.vertical_datum,
        title=facts.title,
        common_sd_m=facts.common_sd_m,
    )


def _tiers(material: Material, options: ProductOptions) -> bytes:
    """Return a GeoTIFF of each tier in one archive; they are compressed by themselves."""
    facts = material.facts
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        for tier in tiers(material.snapshot.built.map, _cell_of_depth(material)):
            source = LayerSource(tier.map, options.order, facts.common_sd_m, shoal_depth_m=facts.spec.shoal_depth_m)
            layers = [*file_layers(source), Layer("least_depth", LEAST_DEPTH, "metre", tier.least_depth_m)]
            content = geotiff(tier.map, layers, facts.frame, vertical_datum=facts.vertical_datum)
            name = zipfile.ZipInfo(f"{slug(facts.spec.name)}-{tier.map.grid.cell_m:g}m.tif", ZIP_EPOCH)
            file.writestr(name, content)
    return archive.getvalue()


def _cell_of_depth(material: Material) -> float:
    """Return the share of depth that cells are of. Raises ConflictError where there are no tiers."""
    share = material.facts.spec.coverage.cell_of_depth
    if share is None:
        raise ConflictError(
            "the mission has cells of one size", "create it with coverage.cell_of_depth, for example 0.05"
        )
    if not material.snapshot.built.map.sounded.any():
        raise ConflictError(*NOT_SOUNDED)
    return share


def _map_xyz(material: Material, options: ProductOptions) -> bytes:
    bathymetry, _, frame = _placed(material, options)
    return map_xyz(
        bathymetry,
        frame,
        vertical_datum=material.datum,
        common_sd_m=material.facts.common_sd_m,
        geographic=isinstance(frame, LocalFrame),
    )


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


def _obstacles(material: Material, _: ProductOptions) -> bytes:
    if material.search is None:
        raise InvalidRequestError("format", "the mission is no search", "ask for another file")
    return obstacles_geojson(material.search, material.facts.frame)


def _crossovers(material: Material, options: ProductOptions) -> bytes:
    frame = material.facts.frame
    return crossovers_csv(_checked(material), frame, options.order, vertical_datum=material.datum)


def _checked(material: Material) -> SurveyCheck:
    """Return what the survey says of itself. Raises MapNotReadyError while there is nothing."""
    if material.crossovers is None:
        raise MapNotReadyError("nothing was sounded yet", "start the mission or post measurements")
    return material.crossovers


def _lines(material: Material, options: ProductOptions) -> bytes:
    spec = material.facts.spec
    planned = [PlannedLine(line.name, spec.local_line(line)) for line in spec.survey_lines]
    return lines_csv(_checked(material), material.facts.frame, options.order, planned)


def snapshot_holidays(snapshot: MapSnapshot) -> bytes:
    """Return the holidays of a map as GeoJSON. Raises ConflictError where it is not one of swaths."""
    built, frame = snapshot.built, snapshot.facts.frame
    swept = snapshot.ensonified()
    if swept is None:
        raise ConflictError(
            "no swath sonar has measured in this mission, so nothing is known of holidays",
            "send pings of a vehicle with sensor multibeam, or start a mission with one",
        )
    return holidays_geojson(swept.holidays, built.map.grid.cell_m, frame, version=built.version)


def _local_track(facts: MissionFacts, track: Track) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    lat, lon = np.array([(point.lat_deg, point.lon_deg) for point in track.points]).T
    return np.column_stack(facts.frame.to_local(lat, lon))


def _contours(material: Material, options: ProductOptions) -> list[Contour]:
    return _at_intervals(material, options, lambda map_, m: find_contours(map_, material.facts.frame, m))


def _contours_dxf(material: Material, options: ProductOptions) -> bytes:
    frame = frame_of(material.facts, options)
    return contours_dxf(
        _at_intervals(material, options, lambda map_, m: contours_in_metres(map_, frame, m)),
        _interval_m(material, options),
        title=material.facts.title,
        positions=frame.statement,
        vertical_datum=material.datum,
    )


def _interval_m(material: Material, options: ProductOptions) -> float:
    given = options.interval_m
    return usual_interval_m(material.snapshot.built.map.depth_m) if given is None else given


def _at_intervals(
    material: Material, options: ProductOptions, find: Callable[[BathymetricMap, float], list[Contour]]
) -> list[Contour]:
    """Return contours. Raises InvalidRequestError for an interval that cannot be."""
    try:
        return find(material.snapshot.built.map, _interval_m(material, options))
    except ValueError as error:
        raise InvalidRequestError("interval_m", str(error), "choose a larger one") from error


def _soundings(material: Material, _: ProductOptions) -> FileContent:
    if material.soundings is None:
        raise ValueError("soundings are files already when others are made of them")
    return material.soundings


ORDER, INTERVAL, CRS, VEHICLE = FileOption.ORDER, FileOption.INTERVAL, FileOption.CRS, FileOption.VEHICLE
EVERY_SOUNDING = "every sounding, raw and corrected, with its verdict"
TIMED_TRACKS = "the vehicles' tracks with times and depths"

PRODUCTS = {
    kind.name: kind
    for kind in (
        ProductKind(
            MAP,
            "tif",
            "image/tiff; application=geotiff",
            "Cloud-Optimized GeoTIFF with every layer",
            _geotiff,
            {MAP},
            options=(ORDER, CRS),
        ),
        ProductKind(
            MAP,
            "nc",
            "application/x-netcdf",
            "CF-NetCDF with every layer",
            _netcdf,
            {MAP},
            options=(ORDER, CRS),
        ),
        ProductKind(
            MAP,
            "bag",
            "application/x-bag",
            "Bathymetric Attributed Grid: elevation, uncertainty and numbers of soundings",
            _bag,
            {MAP},
            options=(CRS,),
        ),
        ProductKind(
            MAP,
            "vr.bag",
            "application/x-bag",
            "Bathymetric Attributed Grid of variable resolution: cells by depth",
            _vr_bag,
            {MAP, TIERS},
        ),
        ProductKind(
            MAP,
            "tiers.zip",
            "application/zip",
            "a GeoTIFF of each tier of cells by depth",
            _tiers,
            {MAP, TIERS},
            options=(ORDER,),
        ),
        ProductKind(
            MAP,
            "s102",
            "application/x-hdf5",
            "Bathymetric Surface for charts (IHO S-102 3.0): depth, uncertainty and quality",
            _s102,
            {MAP, SURVEY},
            filename=lambda facts: file_name(facts.title, facts.mission_id),
        ),
        ProductKind(
            MAP,
            "xyz",
            TEXT,
            "positions and depths of all cells: degrees, or easting and northing",
            _map_xyz,
            {MAP},
            options=(CRS,),
        ),
        ProductKind(MAP, "csv", CSV, EVERY_SOUNDING, _soundings, {SOUNDINGS}),
        ProductKind(
            MAP, "geojson", GEOJSON, "depth contours, area and tracks", _map_geojson, {MAP, TRACKS}, options=(INTERVAL,)
        ),
        ProductKind(MAP, "kml", KML, "depth contours", _map_kml, {MAP}, options=(INTERVAL,)),
        ProductKind(
            CONTOURS,
            "dxf",
            DXF,
            "depth contours for CAD (DXF R12), in metres",
            _contours_dxf,
            {MAP},
            options=(INTERVAL, CRS),
        ),
        ProductKind(MAP, "png", "image/png", "a picture with axes, colour bar and scale", _picture, {MAP, TRACKS}),
        ProductKind(MAP, "overlay.png", "image/png", "a bare picture to lay over a web map", _overlay, {MAP}),
        ProductKind(SOUNDINGS, "csv", CSV, EVERY_SOUNDING, _soundings, {SOUNDINGS}),
        ProductKind(
            SOUNDINGS,
            "xyz",
            TEXT,
            "positions and corrected depths of accepted soundings: degrees, or easting and northing",
            _soundings,
            {ACCEPTED},
            options=(CRS,),
        ),
        ProductKind(
            SOUNDINGS,
            "laz",
            "application/vnd.laszip",
            "point cloud (LAZ, in UTM unless asked otherwise) of the accepted soundings of every sonar, beams included",
            _soundings,
            {POINTS},
            options=(CRS,),
        ),
        ProductKind(
            SOUNDINGS,
            "geojson",
            GEOJSON,
            "raw soundings of one vehicle as crowdsourced bathymetry (IHO B-12)",
            _soundings,
            {RAW},
            options=(VEHICLE,),
        ),
        ProductKind(TRACKS, "geojson", GEOJSON, TIMED_TRACKS, lambda m, _: tracks_geojson(m.tracks), {TRACKS}),
        ProductKind(TRACKS, "kml", KML, TIMED_TRACKS, lambda m, _: tracks_kml(m.tracks, title=m.facts.title), {TRACKS}),
        ProductKind(
            TRACKS,
            "gpx",
            "application/gpx+xml",
            TIMED_TRACKS,
            lambda m, _: tracks_gpx(m.tracks, title=m.facts.title),
            {TRACKS},
        ),
        ProductKind(
            "holidays",
            "geojson",
            GEOJSON,
            "what swath sonars missed inside of what was swept",
            lambda m, _: snapshot_holidays(m.snapshot),
            {MAP, SWATHS},
        ),
        ProductKind(
            CROSSOVERS,
            "csv",
            CSV,
            "where lines cross, with both depths and their difference",
            _crossovers,
            {CROSSOVERS},
            options=(ORDER,),
        ),
        ProductKind(
            "lines",
            "csv",
            CSV,
            "the lines that were flown: when, where, how long and how straight, and what crosses them",
            _lines,
            {CROSSOVERS},
            options=(ORDER,),
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


def check_options(name: str, facts: MissionFacts, options: ProductOptions) -> None:
    """Raise InvalidRequestError for a system of positions that a file cannot be in."""
    if options.crs is not None and CRS not in product_kind(name).options:
        able = ", ".join(other for other, kind in PRODUCTS.items() if CRS in kind.options)
        raise InvalidRequestError(CRS, f"{name} is not made in {options.crs[:40]}", f"leave it out, or ask for {able}")
    frame_of(facts, options)


def make_product(name: str, material: Material, options: ProductOptions) -> Product:
    """Return one file. Raises InvalidRequestError for an unknown format or options that cannot be."""
    kind = product_kind(name)
    made = kind.make(material, options)
    content = FileContent(made) if isinstance(made, bytes) else made
    if kind.filename is not None:
        return Product(kind.filename(material.facts), kind.media_type, content)
    part = (options.vehicle or "") if VEHICLE in kind.options else kind.part.removeprefix(MAP)
    frame = frame_of(material.facts, options)
    if isinstance(frame, ProjectedFrame):
        part = f"{part}-epsg{frame.epsg}".removeprefix("-")
    return Product(product_name(material.facts, part, kind.extension), kind.media_type, content)


def product_name(facts: MissionFacts, part: str, extension: str) -> str:
    """Return what a file is saved as; ``part`` says what it shows of the mission, empty for the map."""
    return f"{slug(facts.spec.name)}{part and f'-{part}'}.{extension}"


def slug(name: str) -> str:
    """Return a name as part of a file's name."""
    words = "".join(c if c.isascii() and c.isalnum() else " " for c in name).split()
    return "-".join(words).lower() or "mission"
