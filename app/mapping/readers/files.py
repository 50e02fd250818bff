"""Which reader takes which file."""

import zlib
from pathlib import Path

from app.mapping.readers.netcdf import read_netcdf
from app.mapping.readers.raster import DRIVERS, read_raster
from app.mapping.readers.text import read_text
from app.mapping.readers.types import Points, Raster, ReadError

TEXT = (".xyz", ".csv", ".txt")
NETCDF = (".nc",)
PACKED = ".gz"
ENDINGS = (*TEXT, *NETCDF, *DRIVERS)

MAX_TEXT_BYTES = 512 * 2**20


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


def read_file(path: Path) -> Points | Raster:
    """Return what is in a file, by its ending. Raises ReadError."""
    kind = ending(path.name)
    if kind.removesuffix(PACKED) in TEXT:
        return read_text(_text(path, packed=kind.endswith(PACKED)))
    if kind in NETCDF:
        return read_netcdf(path)
    return read_raster(path)


def _text(path: Path, *, packed: bool) -> str:
    content = path.read_bytes()
    if packed:
        unpacker = zlib.decompressobj(wbits=31)
        try:
            content = unpacker.decompress(content, MAX_TEXT_BYTES)
        except zlib.error as error:
            raise ReadError("file", f"it cannot be unpacked: {error}", "send it without .gz") from None
        if unpacker.unconsumed_tail or not unpacker.eof:
            raise ReadError("file", "it is cut off, or larger than 512 MiB unpacked", "send it whole, or in parts")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ReadError(f"line {line}", "it is not text in UTF-8", "send numbers as plain text") from None
