"""Terrain files: .npz, ESRI ASCII grids, GeoTIFF and scattered soundings (.xyz, .csv, also gzipped)."""

from __future__ import annotations

import gzip
import io
import math
import zipfile
import zlib
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from simulator.arrays import FloatArray
from simulator.floors.terrain import Terrain, TerrainError
from simulator.geodesy import LocalFrame

Vertical = Literal["down", "up"]

MAX_CELLS = 25_000_000
"""Above this a file is refused: it would not fit into a small machine's memory once worked with."""

MAX_TEXT_BYTES = 256 * 2**20
MIN_EXTENT_M, MAX_EXTENT_M = 0.01, 1e7

_FORMATS = ".npz, .asc, .tif, .tiff, .xyz, .csv (the text formats also with .gz)"

_EAST_NAMES = frozenset({"east_m", "east", "easting", "x", "x_m"})
_NORTH_NAMES = frozenset({"north_m", "north", "northing", "y", "y_m"})
_LAT_NAMES = frozenset({"lat", "latitude", "lat_deg", "latitude_deg"})
_LON_NAMES = frozenset({"lon", "lng", "long", "longitude", "lon_deg", "longitude_deg"})
_DEPTH_NAMES = frozenset({"depth_m", "depth", "z", "z_m"})


def load_terrain(path: str | Path, *, vertical: Vertical = "down", cell_m: float | None = None) -> Terrain:
    """Read a terrain from any supported file.

    Parameters
    ----------
    path
        The file; its name's ending decides the format.
    vertical
        ``"down"`` where the file's values are depths (the contract), ``"up"`` where they are heights.
    cell_m
        Cell size for gridding scattered soundings; by default half their median spacing. Grids keep theirs.

    Raises
    ------
    TerrainError
        When the file is missing, of an unknown kind or malformed.
    """
    file = Path(path)
    name = file.name.lower()
    kind = Path(name.removesuffix(".gz")).suffix
    if not file.is_file():
        raise TerrainError(f"{file}: no such file; give the path of a terrain file ({_FORMATS})")
    if vertical not in ("down", "up"):
        raise TerrainError(f"{file}: vertical is {vertical!r}; it must be 'down' (depths) or 'up' (heights)")
    try:
        if kind == ".npz":
            terrain = _read_npz(file)
        elif kind == ".asc":
            terrain = _read_esri_ascii(file)
        elif kind in (".tif", ".tiff"):
            terrain = _read_geotiff(file)
        elif kind in (".xyz", ".csv"):
            terrain = _read_soundings(file, cell_m)
        else:
            raise TerrainError(f"{file}: the ending {kind or name!r} is not a terrain format; use {_FORMATS}")
    except (OSError, EOFError, zlib.error) as error:
        raise TerrainError(f"{file}: cannot be read: {error}") from error
    except MemoryError as error:
        raise TerrainError(f"{file}: reading it takes more memory than there is; crop or coarsen it") from error
    if vertical == "up":
        return Terrain(-terrain.z_m, terrain.cell_m, terrain.origin_lat_deg, terrain.origin_lon_deg, terrain.name)
    return terrain


def save_npz(terrain: Terrain, path: str | Path) -> None:
    """Write a terrain as ``.npz`` by the contract (z, cell_m, optional origin)."""
    fields: dict[str, Any] = {"z": terrain.z_m.astype(np.float32), "cell_m": np.float64(terrain.cell_m)}
    if terrain.origin_lat_deg is not None and terrain.origin_lon_deg is not None:
        fields["origin_lat"] = np.float64(terrain.origin_lat_deg)
        fields["origin_lon"] = np.float64(terrain.origin_lon_deg)
    np.savez_compressed(path, **fields)


def grid_soundings(
    east_m: FloatArray, north_m: FloatArray, depth_m: FloatArray, cell_m: float | None = None
) -> FloatArray:
    """Linear interpolation over a Delaunay triangulation, sampled at cell centres.

    Parameters
    ----------
    east_m, north_m, depth_m
        Soundings, shape (n,), south-western corner of their bounding box at (0, 0).
    cell_m
        Side of a cell; required to be positive.

    Returns
    -------
    Depths, shape (rows, cols), NaN outside the convex hull.
    """
    from scipy.interpolate import LinearNDInterpolator

    cell = default_cell_m(east_m, north_m) if cell_m is None else cell_m
    cols = max(2, math.ceil(float(np.max(east_m)) / cell))
    rows = max(2, math.ceil(float(np.max(north_m)) / cell))
    if rows * cols > MAX_CELLS:
        raise TerrainError(f"cell_m {cell} would make {rows} x {cols} cells; use a larger cell")
    interpolate = LinearNDInterpolator(np.column_stack([east_m, north_m]), depth_m)
    e, n = np.meshgrid((np.arange(cols) + 0.5) * cell, (np.arange(rows) + 0.5) * cell)
    return np.asarray(interpolate(e, n), dtype=float)


def default_cell_m(east_m: FloatArray, north_m: FloatArray) -> float:
    """Half the median distance between nearest soundings, rounded down to 1, 2 or 5 times a power of ten."""
    from scipy.spatial import cKDTree

    points = np.unique(np.column_stack([east_m, north_m]), axis=0)
    distance = np.asarray(cKDTree(points).query(points, k=2)[0])
    half = 0.5 * float(np.median(distance[:, 1]))
    power = 10.0 ** math.floor(math.log10(half))
    step = next(s for s in (5.0, 2.0, 1.0) if s * power <= half * (1 + 1e-9))
    extent = max(float(np.ptp(east_m)), float(np.ptp(north_m)))
    return max(step * power, extent / 4000.0)


def _read_npz(file: Path) -> Terrain:
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            missing = [key for key in ("z", "cell_m") if key not in archive.files]
            if missing:
                raise TerrainError(
                    f"{file}: field {missing[0]!r} is missing (found: {', '.join(archive.files)})"
                    "; a terrain needs z (2-D depths) and cell_m (metres)"
                )
            present = [key for key in ("z", "cell_m", "origin_lat", "origin_lon") if key in archive.files]
            for key in present:
                _check_claim(file, archive, key)
            fields = {key: archive[key] for key in present}
    except TerrainError:
        raise
    except (ValueError, zipfile.BadZipFile, KeyError, RuntimeError, TypeError) as error:  # also NotImplementedError
        raise TerrainError(
            f"{file}: not a readable .npz archive of plain arrays ({error}); write it with numpy.savez_compressed"
        ) from error
    z = fields["z"]
    if z.dtype.kind not in "fiu":
        raise TerrainError(f"{file}: z has type {z.dtype}; it must be numbers (metres, positive down)")
    if z.size > MAX_CELLS:
        raise TerrainError(f"{file}: z has {z.size} cells; at most {MAX_CELLS} are read, crop or coarsen it")
    numbers = {key: _scalar(file, key, value) for key, value in fields.items() if key != "z"}
    return Terrain(
        z.astype(np.float64),
        numbers["cell_m"],
        numbers.get("origin_lat"),
        numbers.get("origin_lon"),
        name=str(file),
    )


def _check_claim(file: Path, archive: Any, key: str) -> None:
    """Refuse an array that claims more cells than are read, before room is made for them."""
    with archive.zip.open(f"{key}.npy") as member:
        version = np.lib.format.read_magic(member)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, _ = read(member)
    if math.prod(shape) > MAX_CELLS:
        raise TerrainError(
            f"{file}: {key} has {math.prod(shape)} cells; at most {MAX_CELLS} are read, crop or coarsen it"
        )


def _scalar(file: Path, key: str, value: NDArray[Any]) -> float:
    if value.size != 1 or value.dtype.kind not in "fiu":
        raise TerrainError(f"{file}: {key} has shape {value.shape} and type {value.dtype}; it must be one number")
    number = float(value.reshape(-1)[0])
    if not math.isfinite(number):
        raise TerrainError(f"{file}: {key} is {number}; it must be a finite number")
    return number


def _read_text(file: Path) -> str:
    raw = file.read_bytes()
    if file.name.lower().endswith(".gz"):
        try:
            with gzip.open(io.BytesIO(raw)) as stream:
                raw = stream.read(MAX_TEXT_BYTES + 1)
        except gzip.BadGzipFile as error:
            raise TerrainError(f"{file}: ends in .gz but is not gzip ({error})") from error
    if len(raw) > MAX_TEXT_BYTES:
        raise TerrainError(f"{file}: more than {MAX_TEXT_BYTES >> 20} MiB of text; crop or thin it, or make it a .npz")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TerrainError(f"{file}: byte {error.start} is not text; a text grid must be UTF-8") from error


def _read_esri_ascii(file: Path) -> Terrain:
    lines = _read_text(file).splitlines()
    header: dict[str, float] = {}
    first_row = 0
    for number, line in enumerate(lines):
        parts = line.split()
        if not parts:
            continue
        if not parts[0][0].isalpha() or parts[0].lower() == "nan":
            first_row = number
            break
        if len(parts) != 2:
            raise TerrainError(f"{file}: line {number + 1} is {line!r}; a header line is one name and one number")
        try:
            header[parts[0].lower()] = float(parts[1])
        except ValueError as error:
            raise TerrainError(f"{file}: line {number + 1}: {parts[0]} is {parts[1]!r}; it must be a number") from error
    for key in ("ncols", "nrows", "cellsize"):
        if key not in header:
            raise TerrainError(
                f"{file}: header field {key!r} is missing; an ESRI grid starts with ncols, nrows, "
                "xllcorner, yllcorner, cellsize and optionally NODATA_value"
            )
    cols, rows = header["ncols"], header["nrows"]
    for key, value in (("ncols", cols), ("nrows", rows)):
        if not value.is_integer() or value < 2:
            raise TerrainError(f"{file}: {key} is {value:g}; it must be a whole number of at least 2")
    if rows * cols > MAX_CELLS:
        raise TerrainError(f"{file}: {rows:g} x {cols:g} cells; at most {MAX_CELLS} are read")
    try:
        values = np.array(" ".join(lines[first_row:]).split(), dtype=np.float64)
    except ValueError as error:
        raise TerrainError(f"{file}: a grid value is not a number ({error})") from error
    if values.size != int(rows) * int(cols):
        raise TerrainError(f"{file}: {values.size} values where nrows x ncols = {int(rows) * int(cols)} are announced")
    z = values.reshape(int(rows), int(cols))[::-1].copy()
    z[z == header.get("nodata_value", -9999.0)] = np.nan
    return Terrain(z, header["cellsize"], name=str(file))


def _read_geotiff(file: Path) -> Terrain:
    import warnings

    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            # No other format by this name: some name further files, or places on the internet, to be read.
            with rasterio.open(file, driver="GTiff") as source:
                if source.width * source.height > MAX_CELLS:
                    raise TerrainError(f"{file}: {source.height} x {source.width} cells; at most {MAX_CELLS} are read")
                z = source.read(1, masked=True).astype(np.float64).filled(np.nan)
                transform, crs = source.transform, source.crs
    except RasterioError as error:
        raise TerrainError(f"{file}: not a readable GeoTIFF ({error})") from error
    if transform.b or transform.d:
        raise TerrainError(f"{file}: the raster is rotated ({transform!r}); store it north up")
    if transform.e > 0:
        z, north_edge = z[::-1], transform.f + transform.e * z.shape[0]
    else:
        north_edge = transform.f
    height = abs(transform.e)
    west, south = transform.c, north_edge - height * z.shape[0]
    if crs is not None and crs.is_geographic:
        return _reproject(file, z, west, south, transform.a, height, crs)
    if not math.isclose(transform.a, height, rel_tol=1e-6):
        raise TerrainError(f"{file}: cells are {transform.a} x {height}; they must be square, resample the raster")
    unit = 1.0 if crs is None else float(crs.linear_units_factor[1])
    lat = lon = None
    if crs is not None:
        import pyproj

        lon, lat = pyproj.Transformer.from_crs(crs.to_wkt(), "EPSG:4326", always_xy=True).transform(west, south)
    return Terrain(z[::-1].copy(), transform.a * unit, lat, lon, name=str(file))


def _reproject(file: Path, z: FloatArray, west: float, south: float, dlon: float, dlat: float, crs: Any) -> Terrain:
    """Bring a raster in degrees onto square metres around its south-west corner."""
    from rasterio.transform import from_origin
    from rasterio.warp import Resampling, reproject

    frame = LocalFrame(south, west)
    rows, cols = z.shape
    width, _ = frame.to_local(south, west + cols * dlon)
    _, height = frame.to_local(south + rows * dlat, west)
    cell = min(width / cols, height / rows)
    shape = (max(2, round(height / cell)), max(2, round(width / cell)))
    if shape[0] * shape[1] > MAX_CELLS:
        raise TerrainError(f"{file}: {shape[0]} x {shape[1]} cells after projection; at most {MAX_CELLS} are read")
    out = np.full(shape, np.nan)
    reproject(
        z,
        out,
        src_transform=from_origin(west, south + rows * dlat, dlon, dlat),
        src_crs=crs,
        src_nodata=np.nan,
        dst_transform=from_origin(0.0, shape[0] * cell, cell, cell),
        dst_crs=frame.definition,
        dst_nodata=np.nan,
        resampling=Resampling.bilinear,
    )
    return Terrain(out[::-1].copy(), cell, south, west, name=str(file))


def _read_soundings(file: Path, cell_m: float | None) -> Terrain:
    rows = [line.strip() for line in _read_text(file).splitlines()]
    header: list[str] | None = None
    values: list[tuple[float, ...]] = []
    columns = (0, 1, 2)
    geographic = False
    for number, line in enumerate(rows, start=1):
        text = line.lstrip("#").strip()
        if not text:
            continue
        parts = [
            part.strip() for part in (text.replace(";", ",").split(",") if "," in text or ";" in text else text.split())
        ]
        if line.startswith("#") or (header is None and not values and not _is_number(parts[0])):
            lowered = [part.lower() for part in parts]
            if header is None and not values and _DEPTH_NAMES & set(lowered):
                header = lowered
                columns, geographic = _columns(file, header)
            elif not line.startswith("#"):
                raise TerrainError(
                    f"{file}: line {number} is {line!r}; name the columns east_m,north_m,depth_m or "
                    "lat,lon,depth_m, or give three numbers"
                )
            continue
        try:
            values.append(tuple(float(parts[k]) for k in columns))
        except (ValueError, IndexError) as error:
            raise TerrainError(
                f"{file}: line {number} is {line!r}; it must hold {max(columns) + 1} or more numbers"
            ) from error
    table = np.array(values, dtype=np.float64).reshape(-1, 3)
    table = table[np.isfinite(table).all(axis=1)]
    if len(np.unique(table[:, :2], axis=0)) < 3:
        raise TerrainError(f"{file}: {len(table)} soundings; at least 3 at different places are needed")
    if cell_m is not None and not (math.isfinite(cell_m) and cell_m > 0.0):
        raise TerrainError(f"{file}: cell_m is {cell_m}; it must be a positive number of metres")
    lat = lon = None
    if geographic:
        lat, lon = float(table[:, 1].min()), float(table[:, 0].min())
        if not (lat >= -90.0 and float(table[:, 1].max()) <= 90.0):
            raise TerrainError(f"{file}: latitude {lat} to {table[:, 1].max()}; it must be -90 to 90 degrees")
        east, north = LocalFrame(lat, lon).to_local_many(table[:, 1], table[:, 0])
        # Meridians converge: the corner of the bounding box need not be the least easting.
        east, north = np.maximum(east, 0.0), np.maximum(north, 0.0)
    else:
        with np.errstate(over="ignore"):
            east, north = table[:, 0] - table[:, 0].min(), table[:, 1] - table[:, 1].min()
    extent_m = max(float(east.max()), float(north.max()))
    if not MIN_EXTENT_M <= extent_m <= MAX_EXTENT_M:
        raise TerrainError(
            f"{file}: its soundings lie within {extent_m:g} m; {MIN_EXTENT_M:g} to {MAX_EXTENT_M:g} m can be gridded, "
            "see that positions are metres, or named lat and lon"
        )
    cell = default_cell_m(east, north) if cell_m is None else cell_m
    try:
        z = grid_soundings(east, north, table[:, 2], cell)
    except TerrainError as error:
        raise TerrainError(f"{file}: {error}") from error
    except Exception as error:
        from scipy.spatial import QhullError

        if not isinstance(error, QhullError):
            raise
        raise TerrainError(f"{file}: the soundings lie on one line; they must spread over an area") from error
    return Terrain(z, cell, lat, lon, name=str(file))


def _columns(file: Path, header: list[str]) -> tuple[tuple[int, int, int], bool]:
    def find(names: frozenset[str]) -> int | None:
        return next((k for k, name in enumerate(header) if name in names), None)

    depth = find(_DEPTH_NAMES)
    for first, second, geographic in ((_EAST_NAMES, _NORTH_NAMES, False), (_LON_NAMES, _LAT_NAMES, True)):
        a, b = find(first), find(second)
        if a is not None and b is not None and depth is not None:
            return (a, b, depth), geographic
    raise TerrainError(
        f"{file}: columns are {', '.join(header)}; they must include east_m, north_m, depth_m or lat, lon, depth_m"
    )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
