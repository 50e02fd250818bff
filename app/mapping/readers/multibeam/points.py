"""Soundings of multibeam files near a place."""

from typing import BinaryIO

from app.mapping.readers.file_extensions import GSF, KMALL
from app.mapping.readers.multibeam.gsf import GsfFile
from app.mapping.readers.multibeam.kmall import KmallFile
from app.mapping.readers.multibeam.table import SwathTable
from app.mapping.readers.multibeam.types import MultibeamFile
from app.mapping.readers.types import MapExtent, Points

OPENERS: dict[str, type[GsfFile | KmallFile]] = {GSF: GsfFile, KMALL: KmallFile}
"""What reads which ending."""


def open_multibeam(file: BinaryIO, kind: str) -> MultibeamFile:
    """Return an open file as pings; ``kind`` is the ending of its name. Raises ReadError when it is none of these."""
    return OPENERS[kind](file)


def read_multibeam(file: BinaryIO, kind: str, place: MapExtent) -> Points:
    """Return the soundings near a place that a file does not reject, read a ping at a time.

    Raises
    ------
    ReadError
        When the file is damaged or cut off, or has no sounding that can be used.
    """
    opened, table = open_multibeam(file, kind), SwathTable(place)
    for ping in opened.pings():
        table.add(ping)
    return table.points(opened.notes(), opened.incomplete)
