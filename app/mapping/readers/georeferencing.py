"""From what a file holds to depths in the mission's frame."""

from dataclasses import dataclass, replace

import numpy as np
import pyproj
import rasterio.crs
from affine import Affine
from numpy.typing import ArrayLike
from pyproj.exceptions import CRSError, ProjError
from rasterio._err import CPLE_BaseError
from rasterio.errors import RasterioError
from rasterio.warp import Resampling, reproject

from app.arrays import BoolArray, FloatArray
from app.mapping.cell_index import cell_numbers
from app.mapping.readers.types import (
    DATUM_NOTE,
    LOCAL,
    MAX_DEPTH_M,
    MAX_SOUNDINGS,
    MIN_DEPTH_M,
    MIN_SD_M,
    MapExtent,
    Points,
    Positive,
    Raster,
    ReadError,
    ReadOptions,
)
from app.mapping.s44 import NORMAL_95, Order, max_tvu_m
from app.mapping.types import MAX_SD_M, Grid, Soundings
from app.mapping.water.vertical import datum_words, same_datum, vertical_part, vertical_unit

SAME_UNIT = 1e-4
"""Files seldom tell which of the feet theirs are, whose lengths differ by less than this: their systems do."""

_BOTH = 0.99
"""Where this share of the values has one sign, the sign says which way they grow."""


@dataclass(frozen=True)
class Placed:
    """Depths in the local frame.

    Attributes
    ----------
    found
        How many the file holds, wherever they lie.
    notes
        What was assumed, in words.
    """

    soundings: Soundings
    found: int
    notes: list[str]


def place_soundings(content: Points | Raster, options: ReadOptions, place: MapExtent) -> Placed:
    """Return the soundings near the mission's grid with depth and standard deviation.

    Of a grid finer than the map's the mean of each cell is taken, of a coarser one every cell.

    Raises
    ------
    ReadError
        When something that has to be known is not, when a value cannot be, when depths are below another datum than
        the mission's and no offset is stated, or when nothing lies near the grid.
    """
    notes = list(content.notes)
    positive = _positive(content, options, notes)
    depth = (content.z if positive == "down" else -content.z) + options.offset_m
    crs = _crs(content.crs, options, notes)
    _check_datum(crs, options, place, notes)
    if isinstance(content, Points):
        east, north = _to_local(content.x, content.y, crs, place)
        near = _is_near(east, north, place)
        _check_depths(depth, near, content, notes)
        sd, found = content.sd_m, len(content.z) if content.found is None else content.found
    else:
        raster = _in_unit_of(content, crs)
        _check_depths(depth, _cells_near(raster, crs, place), content, notes)
        found = int(np.isfinite(depth).sum())
        east, north, depth, sd = _cells(raster, depth, crs, place, notes)
        near = _is_near(east, north, place)
    near &= np.isfinite(depth)
    if not near.any():
        raise _none_near(content, options, place)
    if near.sum() > MAX_SOUNDINGS:
        raise ReadError("file", f"{near.sum()} depths are more than {MAX_SOUNDINGS}", "thin the file")
    if not near.all():  # else two million soundings need not be copied
        east, north, depth, sd = east[near], north[near], depth[near], sd[near]
    _check_side(depth, options)
    total = _deviations(sd, depth, options, notes)
    if isinstance(content, Points) and content.detection_sd_m is not None:
        total = np.where(sd > 0.0, total, np.minimum(np.hypot(total, content.detection_sd_m[near]), MAX_SD_M))
    return Placed(Soundings(east, north, depth, total), found, notes)


def place_reference(content: Points | Raster, options: ReadOptions, place: MapExtent) -> tuple[FloatArray, list[str]]:
    """Return a file's depths at the cells of the mission's grid, (rows, cols), NaN where it says nothing.

    A grid is interpolated linearly, or averaged where it is finer than the map; soundings are averaged in each cell.
    """
    notes = list(content.notes)
    positive = _positive(content, options, notes)
    depth = (content.z if positive == "down" else -content.z) + options.offset_m
    crs = _crs(content.crs, options, notes)
    _check_datum(crs, options, place, notes)
    if isinstance(content, Raster):
        raster = _in_unit_of(content, crs)
        _check_depths(depth, _cells_near(raster, crs, place), content, notes)
        sampled = _resampled(raster, depth, crs, place, place.grid)
    else:
        east, north = _to_local(content.x, content.y, crs, place)
        _check_depths(depth, _is_near(east, north, place), content, notes)
        cells = cell_numbers(place.grid, Soundings(east, north, depth, depth))
        n = place.grid.rows * place.grid.cols
        inside = cells >= 0
        total = np.bincount(cells[inside], weights=depth[inside], minlength=n)
        count = np.bincount(cells[inside], minlength=n)
        with np.errstate(invalid="ignore"):
            sampled = (total / np.where(count, count, np.nan)).reshape(place.grid.rows, place.grid.cols)
    if not np.isfinite(sampled).any():
        raise ReadError("file", "none of its depths lies in the mission's grid", "check the file and its crs")
    _check_side(sampled, options)
    return sampled, notes


def _check_datum(crs: pyproj.CRS | None, options: ReadOptions, place: MapExtent, notes: list[str]) -> None:
    """Refuse depths below another datum than the mission's; note where only one of the two states its datum."""
    if options.datum_offset_m is not None:
        return
    of_file = vertical_part(crs)
    of_mission = None if place.datum_epsg is None else vertical_part(pyproj.CRS.from_epsg(place.datum_epsg))
    if of_file is not None and of_mission is not None:
        if not same_datum(of_file, of_mission):
            raise ReadError(
                "datum_offset_m",
                f"its values count from {datum_words(of_file)}, the mission's depths from {datum_words(of_mission)}",
                "say datum_offset_m, the metres to add to its depths, or 0 where both are the same there",
            )
        return
    for known, who, other in ((of_file, "the file", "the mission"), (of_mission, "the mission", "the file")):
        if known is not None:
            notes.append(
                f"{DATUM_NOTE}{who} states {datum_words(known)}, {other} none; they are taken for the same, and depths "
                "are off by as much as they differ. State datum_offset_m where they do"
            )


def _none_near(content: Points | Raster, options: ReadOptions, place: MapExtent) -> ReadError:
    """Return what is wrong with a file that has no depth near the mission's grid."""
    if isinstance(content, Raster):
        crs = _crs(content.crs, options, [])
        grid = _in_unit_of(content, crs)
        if np.isfinite(_resampled(grid, content.z, crs, place, place.grid)).any():
            return ReadError(
                "file",
                f"its cells of {_cell_m(grid, crs, place):.3g} m are too large: the area lies among them, and none has "
                "its middle near",
                "send a finer grid, or depths about the area as XYZ",
            )
    return ReadError("file", "none of its depths lies near the mission's area", "check the file and its crs")


def with_margin(place: MapExtent) -> Grid:
    """Return a mission's grid with as many cells around it as hold the margin."""
    grid = place.grid
    border = int(np.ceil(place.margin_m / grid.cell_m))
    return Grid(
        grid.west_m - border * grid.cell_m,
        grid.south_m - border * grid.cell_m,
        grid.cell_m,
        grid.rows + 2 * border,
        grid.cols + 2 * border,
    )


def _positive(content: Points | Raster, options: ReadOptions, notes: list[str]) -> Positive:
    if options.positive is not None:
        return options.positive
    if content.positive is not None:
        return content.positive
    z = content.z[np.isfinite(content.z)]
    if np.mean(z >= 0) >= _BOTH or np.mean(z <= 0) >= _BOTH:
        downwards = bool(np.mean(z >= 0) >= _BOTH)
        notes.append(f"values are taken to be positive {'down' if downwards else 'up'}, from their sign")
        return "down" if downwards else "up"
    raise ReadError(
        "positive",
        "the file does not say which way its values grow, and they have both signs",
        "say positive=down for depths or positive=up for heights",
    )


def _is_near(east: FloatArray, north: FloatArray, place: MapExtent) -> BoolArray:
    low_e, low_n = place.grid.west_m - place.margin_m, place.grid.south_m - place.margin_m
    high_e = place.grid.west_m + place.grid.cols * place.grid.cell_m + place.margin_m
    high_n = place.grid.south_m + place.grid.rows * place.grid.cell_m + place.margin_m
    return np.asarray((east >= low_e) & (east <= high_e) & (north >= low_n) & (north <= high_n))


def _cells_near(raster: Raster, crs: pyproj.CRS | None, place: MapExtent) -> BoolArray:
    """Return which cells of a grid, (rows, cols), lie about the mission's grid: a rectangle that holds all of it."""
    wide = with_margin(place)
    along = np.linspace(0.0, 1.0, 9)
    across, up = np.meshgrid(
        wide.west_m + along * wide.cols * wide.cell_m, wide.south_m + along * wide.rows * wide.cell_m
    )
    x, y = across, up
    if crs is not None:
        horizontal = crs.sub_crs_list[0] if crs.is_compound else crs
        try:
            x, y = pyproj.Transformer.from_crs(place.frame.crs, horizontal, always_xy=True).transform(across, up)
        except ProjError:
            raise _no_way() from None
        if horizontal.is_geographic:
            middle, _ = raster.transform @ (0.5 * raster.z.shape[1], 0.5 * raster.z.shape[0])
            x = x + 360.0 * np.round((middle - x) / 360.0)
    if raster.transform.is_degenerate:
        raise ReadError("file", "its cells have no size", "check its georeferencing")
    a, b, c, d, e, f = tuple(~raster.transform)[:6]
    col, row = a * x + b * y + c, d * x + e * y + f
    near = np.zeros(raster.z.shape, np.bool_)
    if np.isfinite(col).all() and np.isfinite(row).all():
        low_col, low_row = (max(int(np.floor(ends.min())) - 1, 0) for ends in (col, row))
        near[low_row : max(int(row.max()) + 2, 0), low_col : max(int(col.max()) + 2, 0)] = True
    return near


def _check_depths(depth: FloatArray, near: BoolArray, content: Points | Raster, notes: list[str]) -> None:
    """Refuse depths that cannot be; heights of land away from the area become unknown."""
    with np.errstate(invalid="ignore"):
        land = (depth < MIN_DEPTH_M) & ~near
        depth[land] = np.nan
        wrong = (depth < MIN_DEPTH_M) | (depth > MAX_DEPTH_M)
    if land.any():
        notes.append(
            f"{land.sum()} values more than {-MIN_DEPTH_M:g} m above the water, away from the area, are left out"
        )
    if wrong.any():
        index = np.unravel_index(int(np.argmax(wrong)), depth.shape)
        raise ReadError(
            _where(content, index),
            f"its depth is not between {MIN_DEPTH_M:g} and {MAX_DEPTH_M:g} m",
            "check units, sign and nodata value",
        )


def _check_side(depth: FloatArray, options: ReadOptions) -> None:
    """Refuse depths of which nearly all lie above zero, where nobody but the file said which way they grow."""
    if options.positive is None and np.mean(depth[np.isfinite(depth)] < options.offset_m) >= _BOTH:
        raise ReadError(
            "positive",
            "by what the file says of its values nearly all there lie above the water",
            "say positive=up for heights, or positive=down where they are depths",
        )


def _where(content: Points | Raster, index: tuple[np.intp, ...]) -> str:
    if isinstance(content, Points):
        return f"{content.counted} {content.lines[index[0]]}"
    return f"row {index[0] + 1}, column {index[1] + 1}"


def _crs(found: "pyproj.CRS | str | None", options: ReadOptions, notes: list[str]) -> pyproj.CRS | None:
    """Return the system of the positions; None for the mission's own frame."""
    if found is not None and not isinstance(found, str):
        if options.crs is not None:
            notes.append("the file states its own coordinate reference system; crs is not used")
        return found
    named = options.crs or found
    if named is None:
        raise ReadError(
            "crs",
            "the file does not say what its positions are in",
            "say for example crs=EPSG:4326 or crs=EPSG:32629, or crs=local for the mission's own frame",
        )
    if named == LOCAL:
        return None
    try:
        crs = pyproj.CRS.from_user_input(named)
    except CRSError:
        raise ReadError(
            "crs", f"{named[:60]!r} is no coordinate reference system", "say for example EPSG:32629"
        ) from None
    if not (crs.is_projected or crs.is_geographic or crs.is_compound):
        raise ReadError("crs", "it has no horizontal axes", "say for example EPSG:32629")
    unit_m, unit = vertical_unit(crs)
    if unit_m != 1.0:
        raise ReadError(
            "crs",
            f"its vertical axis counts in {unit!r}, depths are taken in metres",
            "send depths in metres and say a vertical system in metres, as in EPSG:32629+5715",
        )
    return crs


def _to_local(x: FloatArray, y: FloatArray, crs: pyproj.CRS | None, place: MapExtent) -> tuple[FloatArray, FloatArray]:
    if crs is None:
        return x, y
    horizontal = crs.sub_crs_list[0] if crs.is_compound else crs
    if horizontal.is_geographic:
        wrong = (np.abs(y) > 90.0) | (np.abs(x) > 360.0)
        if wrong.any():
            i = int(np.argmax(wrong))
            raise ReadError(
                f"position {i + 1}",
                "it is no longitude and latitude",
                "longitude comes first; say crs where positions are metres",
            )
    try:
        to_frame = pyproj.Transformer.from_crs(horizontal, place.frame.crs, always_xy=True)
        east, north = to_frame.transform(x, y)
    except ProjError:
        raise _no_way() from None
    return np.asarray(east, float), np.asarray(north, float)


def _no_way() -> ReadError:
    return ReadError(
        "crs", "there is no way from it to the mission's frame", "say crs as EPSG:32629, or send the file in WGS 84"
    )


def _cells(
    raster: Raster, depth: FloatArray, crs: pyproj.CRS | None, place: MapExtent, notes: list[str]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    size = _cell_m(raster, crs, place)
    if size < 0.99 * place.grid.cell_m:
        grid, wide = place.grid, with_margin(place)
        notes.append(f"cells of {size:.3g} m were averaged to the map's {grid.cell_m:g} m")
        means = [_resampled(raster, layer, crs, place, wide).ravel() for layer in (depth, raster.sd_m)]
        return *wide.centres_m.T, means[0], means[1]
    rows_known, cols_known = np.nonzero(np.isfinite(depth))
    east, north = _to_local(*_positions(raster, cols_known + 0.5, rows_known + 0.5), crs, place)
    return east, north, depth[rows_known, cols_known], raster.sd_m[rows_known, cols_known]


def _cell_m(raster: Raster, crs: pyproj.CRS | None, place: MapExtent) -> float:
    """Return how large a grid's cells are, as the side of a square."""
    rows, cols = raster.z.shape
    # One cell in the middle, by its corner and the two beside it.
    col, row = 0.5 * cols + np.array([0.0, 1.0, 0.0]), 0.5 * rows + np.array([0.0, 0.0, 1.0])
    east, north = _to_local(*_positions(raster, col, row), crs, place)
    sides = np.array([east[1:] - east[0], north[1:] - north[0]])
    return float(np.sqrt(abs(np.linalg.det(sides))))


def _in_unit_of(raster: Raster, crs: pyproj.CRS | None) -> Raster:
    """Return a grid with positions in the unit of their system, None: the mission's frame."""
    if raster.unit_m is None or (crs is not None and not crs.is_projected):
        return raster
    factor = raster.unit_m / (1.0 if crs is None else crs.axis_info[0].unit_conversion_factor)
    if abs(factor - 1.0) < SAME_UNIT:
        return raster
    return replace(raster, transform=Affine.scale(factor) @ raster.transform)


def _positions(raster: Raster, col: ArrayLike, row: ArrayLike) -> tuple[FloatArray, FloatArray]:
    col, row = np.asarray(col, np.float64), np.asarray(row, np.float64)
    a, b, c, d, e, f = tuple(raster.transform)[:6]
    return a * col + b * row + c, d * col + e * row + f


def _resampled(raster: Raster, values: FloatArray, crs: pyproj.CRS | None, place: MapExtent, grid: Grid) -> FloatArray:
    """Return values at a grid's cells; means of the source's cells where these are smaller."""
    frame = rasterio.crs.CRS.from_wkt(place.frame.crs.to_wkt())
    source = frame
    if crs is not None:
        source = rasterio.crs.CRS.from_wkt((crs.sub_crs_list[0] if crs.is_compound else crs).to_wkt())
    north_m = grid.south_m + grid.rows * grid.cell_m
    target = np.full((grid.rows, grid.cols), np.nan)
    lat, lon = place.frame.to_geographic([grid.west_m, grid.west_m + grid.cols * grid.cell_m], [grid.south_m, north_m])
    try:
        reproject(
            values,
            target,
            src_transform=raster.transform,
            src_crs=source,
            src_nodata=np.nan,
            dst_transform=Affine(grid.cell_m, 0.0, grid.west_m, 0.0, -grid.cell_m, north_m),
            dst_crs=frame,
            dst_nodata=np.nan,
            # GDAL's bilinear kernel widens to an average where the source is finer.
            resampling=Resampling.bilinear,
            # By itself GDAL takes longitudes from another meridian than Greenwich's for those of a place elsewhere, to
            # which another way leads, or none.
            AREA_OF_INTEREST=f"{lon[0]},{lat[0]},{lon[1]},{lat[1]}",
        )
    except (RasterioError, CPLE_BaseError):
        raise _no_way() from None
    return target[::-1].copy()


def _deviations(sd: FloatArray, depth: FloatArray, options: ReadOptions, notes: list[str]) -> FloatArray:
    stated = np.isfinite(sd) & (sd > 0.0)
    if not stated.all():
        if options.sd_m is not None:
            assumed = np.full(len(depth), options.sd_m)
            said = f"{options.sd_m:g} m"
        elif options.order is not None:
            order = Order(options.order)
            assumed = max_tvu_m(np.maximum(depth, 0.0), order) / NORMAL_95
            said = f"the largest TVU of S-44 {order.spoken}"
        else:
            raise ReadError(
                "sd_m",
                f"{np.sum(~stated)} of its depths state no uncertainty",
                "say sd_m, their standard deviation in metres, or order, the S-44 order surveyed to",
            )
        notes.append(f"{np.sum(~stated)} depths state no uncertainty: {said} is assumed")
        sd = np.where(stated, sd, assumed)
    if np.max(sd) > MAX_SD_M:
        raise ReadError(
            "uncertainty", f"a standard deviation is above {MAX_SD_M:g} m", "check its unit and nodata value"
        )
    return np.maximum(sd, MIN_SD_M)
