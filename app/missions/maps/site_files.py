"""A site's map and its changes as files."""

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.mapping.coordinates.projected import Frame
from app.mapping.layers import Fit
from app.mapping.products.bag import bag
from app.mapping.products.contours import (
    Contour,
    contours_geojson,
    contours_in_metres,
    find_contours,
    usual_interval_m,
)
from app.mapping.products.dxf import contours_dxf
from app.mapping.products.geotiff import geotiff
from app.mapping.products.kml import contours_kml
from app.mapping.products.pictures.overlay import overlay_png
from app.mapping.products.pictures.picture import picture_png
from app.mapping.products.text import map_xyz
from app.mapping.types import BathymetricMap
from app.missions.errors import InvalidRequestError, MapNotReadyError
from app.missions.maps.file_content import FileContent
from app.missions.maps.products import CSV, DXF, GEOJSON, KML, TEXT, Product, slug
from app.missions.maps.projection import placed, projected_frame
from app.missions.maps.site_maps import SiteChange, SiteMap, moment
from app.missions.views.maps.map import FileOption
from imc_bridge.printable import printable


def site_map_file(kind: str, site: SiteMap, crs: str | None = None) -> Product:
    """Return a site's map as a file, a key of ``MAP_FILES``; ``crs`` is the system of its positions.

    Raises InvalidRequestError for a system that cannot be, or that the file is not made in.
    """
    of = MAP_FILES[kind]
    part = ""
    frame: Frame = site.facts.frame
    if crs is not None:
        if not of.projected:
            able = ", ".join(other for other, one in MAP_FILES.items() if one.projected)
            raise InvalidRequestError(
                FileOption.CRS, f"{kind} is not made in {crs[:40]}", f"leave it out, or ask for {able}"
            )
        frame = projected_frame(crs, site.facts.area, site.facts.frame)
        part = f"-epsg{frame.epsg}"
    return Product(f"{slug(site.facts.name)}{part}.{kind}", of.media_type, FileContent(of.make(site, frame)))


def changes_file(kind: str, change: SiteChange) -> Product:
    """Return what changed as a file, a key of ``CHANGE_FILES``."""
    of = CHANGE_FILES[kind]
    return Product(f"{slug(change.facts.name)}-changes.{kind}", of.media_type, FileContent(of.make(change)))


def _map_tif(site: SiteMap, frame: Frame) -> bytes:
    bathymetry, layers = placed(_known(site), site.layers(), frame)
    return geotiff(bathymetry, layers, frame, vertical_datum=site.datum)


def _map_png(site: SiteMap, _: Frame) -> bytes:
    return picture_png(_known(site), vertical_datum=site.datum.statement, title=_title(site))


def _map_xyz(site: SiteMap, frame: Frame) -> bytes:
    bathymetry, _ = placed(_known(site), (), frame)
    # What a survey's soundings share is in the deviations of a site already.
    return map_xyz(bathymetry, frame, vertical_datum=site.datum.statement, common_sd_m=0.0)


def _map_bag(site: SiteMap, frame: Frame) -> bytes:
    bathymetry, _ = placed(_known(site), (), frame)
    # What a survey's soundings share is in the deviations of a site already, and it counts surveys, not soundings.
    return bag(
        bathymetry,
        frame,
        vertical_datum=site.datum,
        title=_title(site),
        common_sd_m=0.0,
        counts_soundings=False,
    )


def _contours(site: SiteMap) -> list[Contour]:
    bathymetry = _known(site)
    return find_contours(bathymetry, site.facts.frame, usual_interval_m(bathymetry.depth_m))


def _map_geojson(site: SiteMap, _: Frame) -> bytes:
    return contours_geojson(_contours(site), vertical_datum=site.datum.statement)


def _map_kml(site: SiteMap, _: Frame) -> bytes:
    return contours_kml(_contours(site), title=_title(site), vertical_datum=site.datum.statement)


def _map_dxf(site: SiteMap, frame: Frame) -> bytes:
    bathymetry = _known(site)
    interval_m = usual_interval_m(bathymetry.depth_m)
    return contours_dxf(
        contours_in_metres(bathymetry, frame, interval_m),
        interval_m,
        title=_title(site),
        positions=frame.statement,
        vertical_datum=site.datum.statement,
    )


def _known(site: SiteMap) -> BathymetricMap:
    """Return the map. Raises MapNotReadyError where it has no depth at all."""
    if not site.model.known.any():
        raise MapNotReadyError("no survey of the site knows a depth within its area", "see its surveys")
    return site.bathymetry


def _title(site: SiteMap) -> str:
    return printable(site.facts.name).strip()


def _changes_tif(change: SiteChange) -> bytes:
    shape = change.change.difference_m.shape
    names = [f"{one.mission_id} ({moment(one.last_time_s).date()})" for one in change.surveys]
    described = BathymetricMap(
        grid=change.change.grid,
        depth_m=change.later.depth_m,
        sd_m=change.later.sd_m,
        count=np.zeros(shape, dtype=np.int64),
        sounded=change.later.sounded,
        roughness=np.ones(shape),
        correlation_length_m=0.0,
        model=f"{names[1]} less {names[0]}",
    )
    datum = change.surveys[1].vertical_datum
    return geotiff(described, change.layers(), change.facts.frame, vertical_datum=datum)


def _changes_png(change: SiteChange) -> bytes:
    found = change.change
    return overlay_png(
        found.difference_m, found.significant, (-change.last_colour_m, change.last_colour_m), Fit.ABOUT_ZERO
    )


def _changes_csv(change: SiteChange) -> bytes:
    found, grid = change.change, change.change.grid
    rows, cols = np.nonzero(found.compared)
    lat, lon = change.facts.frame.to_geographic(grid.east_m[cols], grid.north_m[rows])
    columns: dict[str, Any] = {
        "lat_deg": np.round(lat, 8),
        "lon_deg": np.round(lon, 8),
        "east_m": np.round(grid.east_m[cols], 3),
        "north_m": np.round(grid.north_m[rows], 3),
        "earlier_depth_m": np.round(change.earlier.depth_m[rows, cols], 4),
        "later_depth_m": np.round(change.later.depth_m[rows, cols], 4),
        "difference_m": np.round(found.difference_m[rows, cols], 4),
        "sd_m": np.round(found.sd_m[rows, cols], 4),
        "significance": np.round(found.significance[rows, cols], 3),
        "significant": found.significant[rows, cols].astype(int),
    }
    stream = io.StringIO()
    datum = change.surveys[1].vertical_datum.statement
    stream.write(f"# depths: positive down, from {datum}; a positive difference: it is deeper now\n")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
    return stream.getvalue().encode()


@dataclass(frozen=True)
class MapFile:
    """A kind of file that shows a site's map; ``projected``: it is made in UTM and others, too."""

    media_type: str
    title: str
    make: Callable[[SiteMap, Frame], bytes]
    projected: bool = False


@dataclass(frozen=True)
class ChangeFile:
    """A kind of file that shows what changed at a site."""

    media_type: str
    title: str
    make: Callable[[SiteChange], bytes]


MAP_FILES: dict[str, MapFile] = {
    "tif": MapFile(
        "image/tiff", "GeoTIFF with depth, deviation, age and survey of each cell", _map_tif, projected=True
    ),
    "bag": MapFile(
        "application/x-bag", "BAG with elevation and deviation, for hydrographic offices", _map_bag, projected=True
    ),
    "png": MapFile("image/png", "the site's map as a picture", _map_png),
    "xyz": MapFile(TEXT, "text: position, depth, deviation, surveys, sounded", _map_xyz, projected=True),
    "geojson": MapFile(GEOJSON, "depth contours", _map_geojson),
    "kml": MapFile(KML, "depth contours for virtual globes", _map_kml),
    "dxf": MapFile(DXF, "depth contours for CAD (DXF R12), in metres", _map_dxf, projected=True),
}
CHANGE_FILES: dict[str, ChangeFile] = {
    "tif": ChangeFile("image/tiff", "GeoTIFF with difference, deviation, significance", _changes_tif),
    "csv": ChangeFile(CSV, "a row for each cell that both surveys know", _changes_csv),
    "png": ChangeFile(
        "image/png", "a picture to lay over a web map; pale where the change is not significant", _changes_png
    ),
}
"""Kinds of files by their ending."""
