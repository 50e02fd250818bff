"""Soundings as text: XYZ and CSV, with or without names for the columns."""

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np
import pyproj

from app.mapping.readers.types import LOCAL, MAX_SOUNDINGS, Points, Positive, ReadError
from app.mapping.types import FloatArray, IntArray

NAMES = {
    "lon": ("lon", "lon_deg", "longitude", "long", "lng"),
    "lat": ("lat", "lat_deg", "latitude"),
    "x": ("x", "easting", "x_m"),
    "y": ("y", "northing", "y_m"),
    "east": ("east_m", "east"),
    "north": ("north_m", "north"),
    "down": ("depth", "depth_m", "corrected_depth", "corrected_depth_m"),
    "up": ("elevation", "elevation_m", "height", "height_m", "altitude"),
    "z": ("z", "z_m"),
    "sd": ("sd", "sd_m", "uncertainty", "uncertainty_m", "std", "sigma", "standard_deviation"),
    "verdict": ("verdict",),
}
"""What columns may be called, without regard to case."""

_SEPARATORS = re.compile(r"[,;\t ]+")
EPSG_4326 = 4326


def read_text(text: str) -> Points:
    """Return the soundings of a text file.

    A first line of names, also behind ``#``, says what the columns are; without one they are x, y and z. Other lines
    behind ``#`` are comments. Where there is a column ``verdict`` only accepted soundings are taken.

    Raises
    ------
    ReadError
        For the first line that cannot be read, with its number and column.
    """
    columns: dict[str, int] | None = None
    rows: list[tuple[float, ...]] = []
    lines: list[int] = []
    wanted: list[tuple[str, int]] = []
    separator = ","
    for number, line in enumerate(text.splitlines(), start=1):
        bare = line.strip().lstrip("\ufeff")
        if not bare:
            continue
        if bare.startswith("#") or columns is None:
            named = _named(bare.lstrip("# "))
            if columns is None and named is not None:
                columns, separator = named, _separator(bare.lstrip("# "))
                wanted = _wanted(columns)
                continue
            if bare.startswith("#"):
                continue
        if columns is None:
            columns, separator = {"x": 0, "y": 1, "z": 2}, _separator(bare)
            wanted = _wanted(columns)
        cells = _split(bare, separator)
        if "verdict" in columns and (columns["verdict"] >= len(cells) or cells[columns["verdict"]] != "accepted"):
            continue
        rows.append(_row(cells, wanted, number))
        lines.append(number)
        if len(rows) > MAX_SOUNDINGS:
            raise ReadError(f"line {number}", f"more than {MAX_SOUNDINGS} soundings", "split or thin the file")
    if not rows or columns is None:
        raise ReadError("file", "there is no sounding in it", "send lines of x, y and depth")
    return _points(np.array(rows), [name for name, _ in wanted], np.array(lines))


def _named(line: str) -> dict[str, int] | None:
    """Return which column is what; None when the line does not name position and depth."""
    words = [word.strip().strip('"').lower() for word in _split(line, _separator(line))]
    found = {kind: words.index(name) for kind, names in NAMES.items() for name in reversed(names) if name in words}
    placed = any(all(name in found for name in pair) for pair in (("lon", "lat"), ("x", "y"), ("east", "north")))
    return found if placed and any(name in found for name in ("down", "up", "z")) else None


def _wanted(columns: dict[str, int]) -> list[tuple[str, int]]:
    """Return the names and numbers of the columns that are read; geographic positions before others."""
    pair = next(p for p in (("lon", "lat"), ("x", "y"), ("east", "north")) if p[0] in columns and p[1] in columns)
    depth = next(name for name in ("down", "up", "z") if name in columns)
    return [(name, columns[name]) for name in (*pair, depth, "sd") if name in columns]


def _separator(line: str) -> str:
    return next((mark for mark in (";", ",", "\t") if mark in line), " ")


def _split(line: str, separator: str) -> Sequence[str]:
    return line.split() if separator == " " else [cell.strip() for cell in line.split(separator)]


def _row(cells: Sequence[str], wanted: Sequence[tuple[str, int]], number: int) -> tuple[float, ...]:
    values = []
    for name, column in wanted:
        said = cells[column] if column < len(cells) else ""
        if not said and name == "sd":
            values.append(np.nan)
            continue
        try:
            value = float(said)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            seen = f"{said[:40]!r} is not a number" if said else f"it has only {len(cells)} columns"
            what = {"down": "depth", "up": "height"}.get(name, name)
            raise ReadError(
                f"line {number}, column {column + 1} ({what})", seen, "write a number, or leave the line out"
            )
        values.append(value)
    return tuple(values)


def _points(table: FloatArray, names: Sequence[str], lines: IntArray) -> Points:
    x, y, z = table[:, 0], table[:, 1], table[:, 2]
    sd = table[:, 3] if len(names) > 3 else np.full(len(z), np.nan)
    positive: Positive | None = {"down": "down", "up": "up"}.get(names[2])  # type: ignore[assignment]
    crs: pyproj.CRS | Literal["local"] | None = None
    if names[0] == "lon":
        crs = pyproj.CRS.from_epsg(EPSG_4326)
    elif names[0] == "east":
        crs = LOCAL
    return Points(x, y, z, sd, crs, positive, lines)
