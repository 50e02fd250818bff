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

PACKED = ".gz"
ENDINGS = (*TEXT, *NETCDF, *DRIVERS, *ENC, *S102, *MULTIBEAM)


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
