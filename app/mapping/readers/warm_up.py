"""Libraries load files when they are first used. A process that will be locked in uses them once before."""

import contextlib
import io
import struct
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyproj
import rasterio
from affine import Affine
from netCDF4 import Dataset

from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.file_extensions import ENC, GSF, KMALL, NETCDF, PACKED, S102, TEXT
from app.mapping.readers.files import read_file
from app.mapping.readers.georeferencing import place_reference, place_soundings
from app.mapping.readers.s102 import INSTANCE, VALUES
from app.mapping.readers.types import MapExtent, ReadError, ReadOptions
from app.mapping.types import Grid
from app.mapping.water.vertical import LOWEST_ASTRONOMICAL_TIDE, VerticalDatum, datum_words, same_datum

SMALL_CELL = Path(__file__).with_name("small.000")
"""A cell with one object of each class that is read."""
SMALL_CELL_AT = (41.1800, -8.7000)

_ROWS = 8
_GRID = Grid(-_ROWS, -_ROWS, 2.0, _ROWS, _ROWS)
_OPTIONS = ReadOptions(crs="EPSG:4326", sd_m=1.0, positive="down")


def data_folders() -> list[Path]:
    """Return where PROJ and GDAL keep tables, which they look things up in while they work."""
    named = [*pyproj.datadir.get_data_dir().split(":")]
    beside = Path(rasterio.__file__).parent
    vector = Path(found.origin).parent if (found := find_spec("pyogrio")) and found.origin else beside
    folders = [*map(Path, named), *(one / data for one in (beside, vector) for data in ("proj_data", "gdal_data"))]
    return [folder for folder in dict.fromkeys(folders) if folder.is_dir()]


def warm_up(task: dict[str, Any]) -> None:
    """Read small files of the kind that the task is about, good and bad ones, in every way that it may be used."""
    frame = LocalFrame(*task["origin"])
    kind = task["kind"].removesuffix(PACKED)
    if kind in TEXT:
        content = _text(frame)
    elif kind in NETCDF:
        content = _netcdf(frame)
    elif kind in ENC:
        from app.mapping.readers.enc import read_zones

        content = SMALL_CELL.read_bytes()
        frame = LocalFrame(*SMALL_CELL_AT)
        read_zones(content, MapExtent(frame, _GRID, 1000.0), 10.0)
    elif kind in S102:
        content = _s102(frame)
    elif kind == GSF:
        content = _gsf(frame)
    elif kind == KMALL:
        content = _kmall(frame)
    else:
        # BAG is HDF5, and the other grids go through GDAL as this one does.
        read_file(io.BytesIO(_netcdf(frame)), NETCDF[0], MapExtent(frame, _GRID, _GRID.cell_m))
        kind, content = ".tif", _geotiff(frame)
    place = MapExtent(frame, _GRID, _GRID.cell_m)
    found = read_file(io.BytesIO(content), kind, place)
    place_reference(found, _OPTIONS, place)
    place_soundings(found, _OPTIONS, place)
    in_space = pyproj.CRS.from_epsg(4979)
    datum_words(in_space)
    same_datum(VerticalDatum(LOWEST_ASTRONOMICAL_TIDE, "").heights, in_space)
    for content in (b"", b"x,y,z\na,b,c\n", b"\x89HDF\r\n\x1a\n", b"000263LE1 0900201   " + 40 * b"0"):
        with contextlib.suppress(ReadError):
            read_file(io.BytesIO(content), kind, place)


def _text(frame: LocalFrame) -> bytes:
    return f"lon,lat,depth,sd\n{frame.origin_lon_deg!r},{frame.origin_lat_deg!r},5,\n".encode()


def _netcdf(frame: LocalFrame) -> bytes:
    file = Dataset("small.nc", "w", memory=1 << 14)
    for name, middle in (("lat", frame.origin_lat_deg), ("lon", frame.origin_lon_deg)):
        file.createDimension(name, _ROWS)
        file.createVariable(name, "f8", (name,))[:] = middle + 1e-5 * (np.arange(_ROWS) - 0.5 * _ROWS)
    file.createVariable("depth", "f4", ("lat", "lon"), zlib=True)[:] = 5.0
    return bytes(file.close())


def _s102(frame: LocalFrame) -> bytes:
    """Return the least that is read of an S-102 file."""
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        file.attrs["horizontalCRS"] = 4326
        cells = np.full((_ROWS, _ROWS), 5.0, [("depth", "<f4"), ("uncertainty", "<f4")])
        instance = file.create_group(INSTANCE)
        file.create_dataset(VALUES, data=cells, compression="gzip")
        for axis, middle in (("Longitude", frame.origin_lon_deg), ("Latitude", frame.origin_lat_deg)):
            instance.attrs[f"gridOrigin{axis}"] = middle - 5e-5
            instance.attrs[f"gridSpacing{axis.removesuffix('e')}inal"] = 1e-5
    return content.getvalue()


def _gsf(frame: LocalFrame) -> bytes:
    """Return a ping of one beam."""
    at = (round(1e7 * frame.origin_lon_deg), round(1e7 * frame.origin_lat_deg))
    ping = struct.pack(">iiiiHHHhhiHhhhHHiiih", 0, 0, *at, 1, *[0] * 15)
    scales = struct.pack(">II", 100 << 24 | 28, 2) + b"".join(struct.pack(">Bxxxii", kind, 10, 0) for kind in (1, 2))
    arrays = struct.pack(">IHIh", 1 << 24 | 2, 50, 2 << 24 | 2, 0)
    records = ((1, b"GSF-v03.09\0\0"), (2, ping + scales + arrays))
    return b"".join(struct.pack(">II", len(content), kind) + content for kind, content in records)


def _kmall(frame: LocalFrame) -> bytes:
    """Return a ping of one beam straight down."""
    at = (frame.origin_lat_deg, frame.origin_lon_deg)
    ping = struct.pack("<H90xHH16x8x4xdd4x", 144, 0, 0, *at)
    receiver = struct.pack("<HHHH16x8x", 32, 1, 1, 120)
    sounding = struct.pack("<4xB91xf20x", 1, 5.0)
    content = struct.pack("<HHH10x", 1, 1, 12) + ping + receiver + sounding
    size = 24 + len(content)
    return struct.pack("<I4s12x", size, b"#MRZ") + content + struct.pack("<I", size)


def _geotiff(frame: LocalFrame) -> bytes:
    with rasterio.MemoryFile() as memory:
        with memory.open(
            driver="GTiff", width=_ROWS, height=_ROWS, count=1, dtype="float32", crs=frame.crs.to_wkt(),
            transform=Affine(2, 0, -_ROWS, 0, -2, _ROWS), compress="deflate",
        ) as file:  # fmt: skip
            file.write(np.full((_ROWS, _ROWS), 5.0, np.float32), 1)
        return bytes(memory.read())
