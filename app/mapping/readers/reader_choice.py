"""Which reader takes which file."""

from typing import BinaryIO

from app.mapping.readers.file_extensions import ENC, MULTIBEAM, NETCDF, PACKED, S102, TEXT
from app.mapping.readers.text import read_text
from app.mapping.readers.types import MapExtent, Points, Raster


def read_file(file: BinaryIO, kind: str, place: MapExtent) -> Points | Raster:
    """Return what is in an open file; nothing else is opened for it.

    Parameters
    ----------
    kind
        Its ending, see :func:`ending`.
    place
        Where soundings are of use; of files with very many those elsewhere may only be counted.

    Raises
    ------
    ReadError
        When it cannot be used.
    """
    if kind.removesuffix(PACKED) in TEXT:
        return read_text(file, packed=kind.endswith(PACKED))
    if kind in MULTIBEAM:
        from app.mapping.readers.multibeam.points import read_multibeam

        return read_multibeam(file, kind, place)
    # The libraries for grids look into neighbouring files where they are given a path; in memory there are none.
    content = file.read()
    # Loaded for the files that they are for: text is read in a third less memory without them.
    if kind in NETCDF:
        from app.mapping.readers.netcdf import read_netcdf

        return read_netcdf(content)
    if kind in ENC:
        from app.mapping.readers.enc import read_enc

        return read_enc(content)
    if kind in S102:
        from app.mapping.readers.s102 import read_s102

        return read_s102(content)
    from app.mapping.readers.raster import read_raster

    return read_raster(content, kind)
