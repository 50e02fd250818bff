"""Soundings as text: XYZ and CSV, with or without names for the columns."""

import math
import re
from collections.abc import Sequence
from typing import BinaryIO, Literal

import numpy as np
import pyproj

from app.arrays import FloatArray
from app.mapping.readers.line_blocks import LineBlock, blocks
from app.mapping.readers.types import LOCAL, MAX_SOUNDINGS, Points, Positive, ReadError

NAMES = {
    "lon": ("lon", "lon_deg", "longitude", "long", "lng"),
    "lat": ("lat", "lat_deg", "latitude"),
    "x": ("x", "easting", "x_m", "easting_m"),
    "y": ("y", "northing", "y_m", "northing_m"),
    "east": ("east_m", "east"),
    "north": ("north_m", "north"),
    "down": ("depth", "depth_m", "corrected_depth", "corrected_depth_m"),
    "up": ("elevation", "elevation_m", "height", "height_m", "altitude"),
    "z": ("z", "z_m"),
    "sd": ("sd", "sd_m", "uncertainty", "uncertainty_m", "std", "sigma", "standard_deviation"),
    "verdict": ("verdict",),
}
"""What columns may be called, without regard to case."""

WITH_COMMA = re.compile(r"[+-]?[0-9]+(,[0-9]+)?")
"""A number, perhaps with a decimal comma."""
WHOLE_DEGREES = re.compile(r"[+-]?[0-9]{1,3}")

EPSG_4326 = 4326
MAX_COLUMNS = 256
ACCEPTED = "accepted"


def read_text(file: BinaryIO, *, packed: bool = False) -> Points:
    """Return the soundings of a text file, read a block at a time.

    A first line of names, also behind ``#``, says what the columns are; without one they are x, y and z. Other lines
    behind ``#`` are comments. Where there is a column ``verdict`` only accepted soundings are taken.

    Raises
    ------
    ReadError
        For the first line that cannot be read, with its number and column.
    """
    table = _Table()
    layout: _Layout | None = None
    for block in blocks(file, packed=packed):
        begin = 0
        if layout is None:
            found = ((index, _layout(line, block.first + index)) for index, line in enumerate(block.lines))
            begin, layout = next(((index, layout) for index, layout in found if layout), (0, None))
            if layout is None:
                continue
            begin += layout.named
        lines = block.lines[begin:]
        if not table.size and lines:
            _check_decimals(lines[0], layout, block.first + begin)
        rows = _at_once(lines, layout) if layout.verdict is None else None
        if rows is not None:
            table.add(rows, range(block.first + begin, block.first + len(block.lines)))
            continue
        lines, numbers = _taken(block, begin, layout)
        if lines:
            rows = _at_once(lines, layout)
            table.add(_one_by_one(lines, numbers, layout) if rows is None else rows, numbers)
    if layout is None or not table.size:
        raise ReadError("file", "there is no sounding in it", "send lines of x, y and depth")
    return _points(table, [name for name, _ in layout.wanted])


class _Layout:
    """How lines are divided and which of their columns count.

    Attributes
    ----------
    named
        Whether the line that showed it names the columns, so that it is no sounding itself.
    wanted
        Names and numbers of the columns that are read: x, y, depth, and the standard deviation if there is one.
    verdict
        Number of the column that says whether a sounding is taken.
    count
        How many columns the line has.
    """

    def __init__(self, columns: dict[str, int], separator: str, count: int, *, named: bool) -> None:
        self.named = named
        self.count = count
        self.separator = separator
        self.wanted = _wanted(columns)
        self.verdict = columns.get("verdict")


class _Table:
    """Soundings as they come; the memory of those that never come is not touched."""

    def __init__(self) -> None:
        self.size = 0
        self.values = np.empty((4, MAX_SOUNDINGS))
        self.lines = np.empty(MAX_SOUNDINGS, np.int32)

    def add(self, rows: FloatArray, numbers: Sequence[int]) -> None:
        """Append (n, 3 or 4) values and the numbers of their lines."""
        end = self.size + len(rows)
        if end > MAX_SOUNDINGS:
            number = numbers[MAX_SOUNDINGS - self.size]
            raise ReadError(f"line {number}", f"more than {MAX_SOUNDINGS} soundings", "split or thin the file")
        self.values[: rows.shape[1], self.size : end] = rows.T
        self.lines[self.size : end] = numbers
        self.size = end


def _layout(line: str, number: int) -> _Layout | None:
    """Return what a line shows of the columns; None for an empty one and for a comment that names none."""
    bare = line.strip().lstrip("\ufeff")
    text = bare.lstrip("# ")
    cells = _split(text, _separator(text))
    if len(cells) > MAX_COLUMNS:
        raise ReadError(f"line {number}", f"it has more than {MAX_COLUMNS} columns", "send fewer columns")
    columns = _named(text)
    if columns is not None:
        return _Layout(columns, _separator(text), len(cells), named=True)
    if not bare or bare.startswith("#"):
        return None
    _check_names(cells, number)
    return _Layout({"x": 0, "y": 1, "z": 2}, _separator(bare), len(cells), named=False)


def _check_names(cells: Sequence[str], number: int) -> None:
    """Refuse a line of names that does not say where position and depth are. Raises ReadError."""
    words = [cell.strip().strip('"') for cell in cells]
    if len(words) < 2 or not all(word[:1].isalpha() for word in words):
        return
    known = {name for names in NAMES.values() for name in names}
    strange = [word[:40] for word in words if word.lower() not in known]
    raise ReadError(
        f"line {number}",
        f"column {', '.join(strange[:5])} is not known" if strange else "it names no position, or no depth",
        "name position and depth, in metres, by two of lon, lat, x, y, east_m, north_m and by one of depth_m (down), "
        "elevation_m (up) or z; known are " + ", ".join(sorted(known)),
    )


def _check_decimals(line: str, layout: _Layout, number: int) -> None:
    """Refuse decimal commas in the first line of numbers, where commas are between columns, too. Raises ReadError."""
    if layout.separator != "," or "." in line:
        return
    cells = _split(line.strip().lstrip("\ufeff"), ",")
    halves = [cell for cell in cells if cell]
    if layout.named:
        torn = len(halves) > layout.count + 1 and all(map(WITH_COMMA.fullmatch, halves))
    else:  # degrees: a few digits, then many
        torn = len(halves) >= 5 and all(_is_degrees(*halves[i : i + 2]) for i in (0, 2))
    if torn or _decimal_commas(line.split()):
        raise _decimal_comma(f"line {number}")


def _is_degrees(whole: str, fraction: str) -> bool:
    return WHOLE_DEGREES.fullmatch(whole) is not None and fraction.isdecimal() and len(fraction) >= 4


def _decimal_commas(cells: Sequence[str]) -> bool:
    """Tell whether cells are numbers, some of them with a decimal comma."""
    return len(cells) > 1 and all(map(WITH_COMMA.fullmatch, cells)) and any("," in cell for cell in cells)


def _decimal_comma(place: str) -> ReadError:
    return ReadError(place, "its numbers have decimal commas", "write numbers with a decimal point, such as 41.1851")


def _taken(block: LineBlock, begin: int, layout: _Layout) -> tuple[list[str], list[int]]:
    """Return a block's lines from ``begin`` on that are soundings to be taken, and their numbers."""
    lines, numbers = [], []
    for number, line in enumerate(block.lines[begin:], start=block.first + begin):
        bare = line.strip()
        if not bare or bare.startswith("#"):
            continue
        if layout.verdict is not None:
            cells = _split(bare, layout.separator)
            if layout.verdict >= len(cells) or cells[layout.verdict] != ACCEPTED:
                continue
        lines.append(bare)
        numbers.append(number)
    return lines, numbers


def _at_once(lines: list[str], layout: _Layout) -> FloatArray | None:
    """Return soundings, (n, columns), one a line; None where a line is none, or has something to be said about."""
    if not lines:
        return None
    try:
        rows = np.loadtxt(
            lines,
            delimiter=None if layout.separator == " " else layout.separator,
            usecols=[column for _, column in layout.wanted],
            comments=None,
            ndmin=2,
        )
    except ValueError:
        return None
    # Empty lines are passed over: then the numbers of the others are not known.
    return rows if len(rows) == len(lines) and np.isfinite(rows).all() else None


def _one_by_one(lines: list[str], numbers: list[int], layout: _Layout) -> FloatArray:
    """Return the rows of lines, some without a deviation. Raises ReadError for the first that has no number."""
    return np.array([_row(line, layout, number) for line, number in zip(lines, numbers, strict=True)])


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


def _row(line: str, layout: _Layout, number: int) -> tuple[float, ...]:
    cells = _split(line.lstrip("\ufeff"), layout.separator)
    values = []
    for name, column in layout.wanted:
        said = cells[column] if column < len(cells) else ""
        if not said and name == "sd":
            values.append(math.nan)
            continue
        try:
            value = float(said)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            if "," in said and WITH_COMMA.fullmatch(said):
                raise _decimal_comma(f"line {number}, column {column + 1}")
            seen = "it is not a number" if column < len(cells) else f"the line has only {len(cells)} columns"
            what = {"down": "depth", "up": "height"}.get(name, name)
            raise ReadError(
                f"line {number}, column {column + 1} ({what})",
                seen,
                "write a number with a decimal point, or leave the line out",
            )
        values.append(value)
    return tuple(values)


def _points(table: _Table, names: Sequence[str]) -> Points:
    x, y, z, sd = table.values[:, : table.size]
    if len(names) == 3:
        sd = np.broadcast_to(np.nan, z.shape)
    positive: Positive | None = {"down": "down", "up": "up"}.get(names[2])  # type: ignore[assignment]
    crs: pyproj.CRS | Literal["local"] | None = None
    if names[0] == "lon":
        crs = pyproj.CRS.from_epsg(EPSG_4326)
    elif names[0] == "east":
        crs = LOCAL
    return Points(x, y, z, sd, crs, positive, table.lines[: table.size])
