"""A mission's map as it leaves the service: as JSON and as files."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import orjson
from shapely.geometry import Polygon, mapping

from app.mapping.georeference import LocalFrame
from app.mapping.products.contours import contours_geojson
from app.mapping.products.geotiff import geotiff
from app.mapping.products.overlay import overlay_corners, overlay_png
from app.mapping.products.picture import picture_png
from app.mapping.products.text import map_xyz
from app.mapping.types import FloatArray
from app.missions.errors import InvalidRequestError
from app.missions.map_builder import BuiltMap
from app.missions.spec import MissionSpec
from app.missions.views import MapView
from app.storage.models import SoundingRow

CONTOURS_PER_MAP = 10
CONTOUR_INTERVALS_M = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)

FORMATS = {
    "tif": "image/tiff; application=geotiff",
    "xyz": "text/plain; charset=utf-8",
    "csv": "text/csv; charset=utf-8",
    "geojson": "application/geo+json",
    "png": "image/png",
    "overlay.png": "image/png",
}
"""What can be exported, with the media types: map as GeoTIFF, as XYZ, all soundings as CSV, contours with tracks as
GeoJSON, a picture with axes, and a bare picture to lay over a web map."""


@dataclass(frozen=True)
class Product:
    """A file that leaves the service."""

    filename: str
    media_type: str
    content: bytes


@dataclass(frozen=True)
class MapSnapshot:
    """A mission's map at one moment, with where it lies."""

    mission_id: str
    spec: MissionSpec
    frame: LocalFrame
    area: FloatArray
    built: BuiltMap
    step: int

    @property
    def version(self) -> int:
        """Grows with every new map of the mission."""
        return self.built.version

    @property
    def vertical_datum(self) -> str:
        """What depths are counted from."""
        tide = self.spec.tide
        if tide.level_m == 0.0:
            return f"instantaneous water level (tide: {tide.source})"
        return f"water level minus {tide.level_m:+.2f} m (tide: {tide.source})"

    def view(self) -> MapView:
        """Return the map as JSON shows it."""
        bathymetry = self.built.map
        grid = bathymetry.grid
        depths = bathymetry.depth_m[np.isfinite(bathymetry.depth_m)]
        return MapView.model_construct(
            mission_id=self.mission_id,
            version=self.version,
            step=self.step,
            west_m=grid.west_m,
            south_m=grid.south_m,
            cell_m=grid.cell_m,
            rows=grid.rows,
            cols=grid.cols,
            corners=overlay_corners(grid, self.frame),
            min_depth_m=round(float(depths.min()), 3) if depths.size else None,
            max_depth_m=round(float(depths.max()), 3) if depths.size else None,
            model=bathymetry.model,
            depth_m=_nullable(bathymetry.depth_m),
            sd_m=_nullable(bathymetry.sd_m),
            count=bathymetry.count.tolist(),
            sounded=bathymetry.sounded.tolist(),
        )


def _nullable(layer: FloatArray) -> list[list[float | None]]:
    rounded = np.round(layer, 3).astype(object)
    rounded[~np.isfinite(layer)] = None
    return rounded.tolist()  # type: ignore[no-any-return]


def make_product(
    snapshot: MapSnapshot,
    soundings: Sequence[SoundingRow],
    tracks: Mapping[str, Sequence[tuple[float, float]]],
    extension: str,
    options: Mapping[str, float],
) -> Product:
    """Return one product file.

    Parameters
    ----------
    tracks
        Per vehicle (longitude, latitude).
    extension
        One of ``FORMATS``.
    options
        ``min`` and ``max``: depths of the first and last colour of pictures.

    Raises
    ------
    InvalidRequestError
        For an unknown format or an empty colour range.
    """
    if extension not in FORMATS:
        raise InvalidRequestError("format", f"there is no format {extension!r}", f"use one of {', '.join(FORMATS)}")
    bathymetry, frame, datum = snapshot.built.map, snapshot.frame, snapshot.vertical_datum
    range_m = _colour_range(options)
    match extension:
        case "tif":
            content = geotiff(bathymetry, frame, vertical_datum=datum)
        case "xyz":
            content = map_xyz(bathymetry, frame, vertical_datum=datum, geographic=True)
        case "csv":
            content = _soundings_csv(soundings, datum)
        case "geojson":
            content = _geojson(snapshot, tracks)
        case "png":
            local = {name: _local_track(frame, track) for name, track in tracks.items() if track}
            content = picture_png(
                bathymetry, vertical_datum=datum, title=snapshot.spec.name, range_m=range_m, tracks=local
            )
        case _:
            depths = bathymetry.depth_m[np.isfinite(bathymetry.depth_m)]
            content = overlay_png(bathymetry, range_m or (float(depths.min()), float(depths.max()) + 1e-3))
    return Product(f"{_slug(snapshot.spec.name)}.{extension}", FORMATS[extension], content)


def _colour_range(options: Mapping[str, float]) -> tuple[float, float] | None:
    low, high = options.get("min"), options.get("max")
    if low is None and high is None:
        return None
    if low is None or high is None or not low < high:
        raise InvalidRequestError("min", f"colour range {low} to {high}", "give both min and max, min smaller than max")
    return low, high


def _local_track(frame: LocalFrame, track: Sequence[tuple[float, float]]) -> FloatArray:
    lon, lat = np.array(track).T
    return np.column_stack(frame.to_local(lat, lon))


def _geojson(snapshot: MapSnapshot, tracks: Mapping[str, Sequence[tuple[float, float]]]) -> bytes:
    """Return contours, the area and the tracks as one feature collection."""
    depths = snapshot.built.map.depth_m
    span = float(np.nanmax(depths) - np.nanmin(depths))
    interval = next((i for i in CONTOUR_INTERVALS_M if span / i <= CONTOURS_PER_MAP), CONTOUR_INTERVALS_M[-1])
    collection = orjson.loads(
        contours_geojson(
            snapshot.built.map, snapshot.frame, interval_m=interval, vertical_datum=snapshot.vertical_datum
        )
    )
    area = {"type": "Feature", "properties": {"kind": "area"}, "geometry": mapping(Polygon(snapshot.spec.area.ring))}
    lines = [
        {
            "type": "Feature",
            "properties": {"kind": "track", "vehicle": name},
            "geometry": {"type": "LineString", "coordinates": [list(point) for point in track]},
        }
        for name, track in tracks.items()
        if len(track) >= 2
    ]
    collection["features"] += [area, *lines]
    return orjson.dumps(collection)


def _soundings_csv(soundings: Sequence[SoundingRow], vertical_datum: str) -> bytes:
    """Return every sounding, rejected ones with their reason; raw and corrected depth side by side."""
    columns = (
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
        "step",
        "verdict",
        "reason",
    )
    text = io.StringIO()
    text.write(f"# depth_m: positive down, from {vertical_datum}\n")
    writer = csv.writer(text)
    writer.writerow(columns)
    writer.writerows([getattr(row, column) for column in columns] for row in soundings)
    return text.getvalue().encode()


def _slug(name: str) -> str:
    words = "".join(c if c.isascii() and c.isalnum() else " " for c in name).split()
    return "-".join(words).lower() or "mission"
