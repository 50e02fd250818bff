"""Libraries load files when they are first used. A process that will be locked in uses them once before."""

import contextlib
import io
import itertools
import struct
import zipfile
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
from app.mapping.readers.file_extensions import ENC, GSF, KMALL, KMZ, LNW, NETCDF, PACKED, S102, SHAPES, TABLES, TEXT
from app.mapping.readers.georeferencing import place_reference, place_soundings
from app.mapping.readers.reader_choice import read_file
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
    if task["what"] == "drawings":
        _warm_up_drawings(task["kind"])
        return
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


def _warm_up_drawings(kind: str) -> None:
    from app.mapping.readers.drawings import read_drawings

    places = "1.0,2.0 1.1,2.0"
    samples = {
        ".kml": f"<kml><Placemark><LineString><coordinates>{places}</coordinates></LineString></Placemark></kml>",
        ".gpx": '<gpx version="1.1"><rte><rtept lat="2" lon="1"/><rtept lat="2" lon="1.1"/></rte></gpx>',
        ".dxf": "0\nSECTION\n2\nENTITIES\n0\nLINE\n8\n0\n10\n1\n20\n2\n11\n2\n21\n2\n0\nENDSEC\n0\nEOF\n",
        ".csv": "name,x,y\n1,1,2\n1,2,2\n",
        LNW: "LIN 2\nPTS 1 2\nPTS 2 2\nLNN 1\nEOL\n",
        ".json": '{"type": "LineString", "coordinates": [[1, 2], [1.1, 2]]}',
    }
    sample = ".kml" if kind == KMZ else kind if kind in samples else ".csv" if kind in TABLES else ".json"
    content = samples[sample].encode()
    if kind == KMZ or kind in SHAPES:
        content = _packed({"doc.kml": content} if kind == KMZ else _shapefile())
    for one, crs in itertools.product((content, b"\xff", b""), ("EPSG:32629", "nowhere", None)):
        with contextlib.suppress(ReadError):
            read_drawings(one, kind, crs)


def _packed(files: dict[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return packed.getvalue()


def _shapefile() -> dict[str, bytes]:
    """Return a shapefile of one line without a name."""
    line = struct.pack("<i4diii4d", 3, 1.0, 2.0, 1.1, 2.0, 1, 2, 0, 1.0, 2.0, 1.1, 2.0)
    record = struct.pack(">ii", 1, len(line) // 2) + line
    bounds = struct.pack("<ii8d", 1000, 3, 1.0, 2.0, 1.1, 2.0, 0.0, 0.0, 0.0, 0.0)

    def headed(content: bytes) -> bytes:
        return struct.pack(">i20xi", 9994, (100 + len(content)) // 2) + bounds + content

    index = struct.pack(">ii", 50, len(line) // 2)
    system = pyproj.CRS.from_epsg(4326).to_wkt("WKT1_ESRI").encode()
    fields = struct.pack("<4BiHH20x", 3, 126, 1, 1, 1, 65, 9) + b"NAME\0\0\0\0\0\0\0C" + bytes(4) + b"\x08" + bytes(15)
    return {
        "s.shp": headed(record),
        "s.shx": headed(index),
        "s.prj": system,
        "s.dbf": fields + b"\r" + 9 * b" " + b"\x1a",
    }


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
