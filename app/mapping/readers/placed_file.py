"""From an open file and a task to depths in the mission's frame, written as plain numbers."""

from typing import Any, BinaryIO

import numpy as np

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.readers.georeferencing import place_reference, place_soundings
from app.mapping.readers.reader_choice import read_file
from app.mapping.readers.types import MapExtent, ReadOptions
from app.mapping.types import Grid


def place_file(file: BinaryIO, task: dict[str, Any], out: BinaryIO) -> dict[str, Any]:
    """Read a file and write what it says of the mission's place as little-endian float64.

    Soundings are four columns one after the other, east, north, depth and standard deviation (metres); a reference
    grid is the depths at the map's cells, row after row.

    Returns
    -------
    ``shape``, ``notes`` and, of soundings, how many were ``found``; of zones to keep out of also ``zones``, of lines
    and areas ``drawings``.

    Raises
    ------
    ReadError
        When the file cannot be used.
    """
    if task["what"] == "drawings":
        return _drawings(file, task, out)
    place = MapExtent(LocalFrame(*task["origin"]), Grid(**task["grid"]), task["margin_m"], task.get("datum_epsg"))
    if task["what"] == "zones":
        return _zones(file, place, float(task["around_m"]), out)
    options = ReadOptions(**task["options"])
    content = read_file(file, task["kind"], place)
    if task["what"] == "reference":
        depths, notes = place_reference(content, options, place)
        _write(out, depths)
        return {"shape": depths.shape, "notes": notes}
    placed = place_soundings(content, options, place)
    found = placed.soundings
    for column in (found.east_m, found.north_m, found.depth_m, found.sd_m):
        _write(out, column)
    return {"shape": (4, len(found)), "notes": placed.notes, "found": placed.found}


def _zones(file: BinaryIO, place: MapExtent, around_m: float, out: BinaryIO) -> dict[str, Any]:
    """Write the corners of what to keep out of: which zone, longitude and latitude, one column after the other."""
    from app.mapping.readers.enc import read_zones  # GDAL's vector part is loaded for what it is for

    zones, notes = read_zones(file.read(), place, around_m)
    number = np.concatenate([np.full(len(zone.ring), i, np.float64) for i, zone in enumerate(zones)] or [np.empty(0)])
    corners = np.concatenate([zone.ring for zone in zones] or [np.empty((0, 2))])
    for column in (number, *corners.T):
        _write(out, column)
    told = [{name: getattr(zone, name) for name in ("kind", "name", "depth_m", "position_m")} for zone in zones]
    return {"shape": (3, len(number)), "notes": notes, "found": len(zones), "zones": told}


def _drawings(file: BinaryIO, task: dict[str, Any], out: BinaryIO) -> dict[str, Any]:
    """Write the positions of lines and areas: which one, longitude and latitude, one column after the other."""
    from app.mapping.readers.drawings import read_drawings  # GDAL's vector part is loaded for what it is for

    found, notes = read_drawings(file.read(), task["kind"], task["crs"])
    number = np.repeat(np.arange(len(found), dtype=np.float64), [len(one.places) for one in found])
    for column in (number, *np.concatenate([one.places for one in found]).T):
        _write(out, column)
    told = [{"kind": one.kind, "name": one.name} for one in found]
    return {"shape": (3, len(number)), "notes": notes, "found": len(found), "drawings": told}


def _write(out: BinaryIO, values: FloatArray) -> None:
    out.write(np.ascontiguousarray(values, "<f8").data)
