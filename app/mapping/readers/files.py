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
        content = _unpacked(content)
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ReadError(f"line {line}", "it is not text in UTF-8", "send numbers as plain text") from None


def _unpacked(packed: bytes) -> bytes:
    """Return what is in a gzip file, also one of several parts."""
    parts: list[bytes] = []
    room = MAX_TEXT_BYTES
    while packed:
        unpacker = zlib.decompressobj(wbits=31)
        try:
            parts.append(unpacker.decompress(packed, room + 1))
        except zlib.error as error:
            raise ReadError("file", f"it cannot be unpacked: {error}", "send it without .gz") from None
        room -= len(parts[-1])
        if room < 0 or not unpacker.eof:
            raise ReadError("file", "it is cut off, or larger than 512 MiB unpacked", "send it whole, or in parts")
        packed = unpacker.unused_data.lstrip(b"\0")  # some programs pad
    return b"".join(parts)
