"""Which files are read, by the endings of their names."""

from pathlib import Path

from app.mapping.readers.types import ReadError

TEXT = (".xyz", ".csv", ".txt")
NETCDF = (".nc",)
DRIVERS = {".tif": "GTiff", ".tiff": "GTiff", ".asc": "AAIGrid", ".bag": "BAG"}
"""Which of GDAL's drivers reads which ending; whatever else a file pretends to be is refused."""

ENC = (".000",)
S102 = (".h5",)

GSF, KMALL = ".gsf", ".kmall"
MULTIBEAM = (GSF, KMALL)
"""Files of multibeam sonars."""

TABLES = (".csv", ".txt")
LNW, KMZ = ".lnw", ".kmz"
SHAPES = (".zip",)
XML_OF = {".kml": b"<kml", KMZ: b"<kml", ".gpx": b"<gpx"}
"""With what files of these endings begin."""
DRAWINGS = (".geojson", ".json", ".kml", KMZ, ".gpx", ".dxf", *SHAPES, *TABLES, LNW)
"""Files with lines and areas."""

PACKED = ".gz"
ENDINGS = (*TEXT, *NETCDF, *DRIVERS, *ENC, *S102, *MULTIBEAM)


def drawing_ending(filename: str) -> str:
    """Return the ending of the name of a file with lines and areas. Raises ReadError for an unknown one."""
    found = Path(filename.lower()).suffix
    if found not in DRAWINGS:
        raise ReadError(
            "filename",
            f"{filename[:80]!r} has no ending that is read",
            f"one of {', '.join(DRAWINGS)}; .zip for a shapefile",
        )
    return found


def ending(filename: str) -> str:
    """Return a file name's ending with ``.gz`` behind text, as it may come. Raises ReadError for an unknown one."""
    path = Path(filename.lower())
    inner = Path(path.stem).suffix if path.suffix == PACKED else path.suffix
    if inner not in ENDINGS or (path.suffix == PACKED and inner not in TEXT):
        raise ReadError(
            "filename",
            f"{filename[:80]!r} has no ending that is read",
            f"one of {', '.join(ENDINGS)}; text also with .gz",
        )
    return inner + (PACKED if path.suffix == PACKED else "")
