"""Survey lines as text: tables of names and positions, and Hypack's line files (LNW)."""

import csv
import itertools
import math

from app.mapping.readers.types import ReadError

MAX_ROWS = 100_000

Places = list[tuple[float, float]]
NamedLines = list[tuple[str, Places]]

NAMES = ("name", "line", "line_name", "linename", "id")
EASTS = ("lon", "long", "longitude", "lon_deg", "x", "e", "east", "easting")
NORTHS = ("lat", "latitude", "lat_deg", "y", "n", "north", "northing")
DEGREES = frozenset(("lon", "long", "longitude", "lon_deg"))


def decoded(content: bytes) -> str:
    """Return text in UTF-8, or else in Latin 1, which old programs write."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def read_table(content: bytes) -> tuple[NamedLines, bool]:
    """Return the lines of a table, and whether its header says that positions are degrees.

    Each row is the name of a line and a position, rows of a name one after the other are a line. Without a header the
    columns are name, x and y, or name and both ends of a line.

    Raises
    ------
    ReadError
        When it is no such table.
    """
    text = decoded(content)
    try:
        rows = [
            _filled(row) for row in csv.reader(text.splitlines(), delimiter=_delimiter(text), skipinitialspace=True)
        ]
    except csv.Error as error:
        raise ReadError("file", f"it is no table: {error}", "give rows of a name and a position") from None
    rows = [row for row in rows if row and not row[0].startswith("#")]
    if not rows or len(rows) > MAX_ROWS:
        raise ReadError("file", f"it has {len(rows) or 'no'} rows", f"give at least one and at most {MAX_ROWS}")
    header = [cell.strip().lower() for cell in rows[0]]
    east = next((k for k, cell in enumerate(header) if cell in EASTS), None)
    north = next((k for k, cell in enumerate(header) if cell in NORTHS), None)
    if east is None or north is None:
        return _without_header(rows), False
    name = next((k for k, cell in enumerate(header) if cell in NAMES), None)
    found: NamedLines = []
    for number, row in enumerate(rows[1:], 2):
        place = _number(row, east, number), _number(row, north, number)
        called = "" if name is None or name >= len(row) else row[name].strip()
        if found and found[-1][0] == called:
            found[-1][1].append(place)
        else:
            found.append((called, [place]))
    return found, header[east] in DEGREES


def _without_header(rows: list[list[str]]) -> NamedLines:
    width = len(rows[0])
    if width not in (3, 5):
        raise ReadError(
            "file",
            f"its first row has {width} columns and no names of columns",
            "begin it with a row name,lon,lat or name,x,y, or give rows of a name and both ends: name,x,y,x,y",
        )
    if width == 5:
        ends = [[_number(row, k, number) for k in range(1, 5)] for number, row in enumerate(rows, 1)]
        return [(row[0].strip(), [(one[0], one[1]), (one[2], one[3])]) for row, one in zip(rows, ends, strict=True)]
    places = [(row[0].strip(), (_number(row, 1, k), _number(row, 2, k))) for k, row in enumerate(rows, 1)]
    return [(name, [place for _, place in one]) for name, one in itertools.groupby(places, lambda place: place[0])]


def read_lnw(content: bytes) -> NamedLines:
    """Return the lines of a line file of Hypack: of each its points (PTS) and its number or name (LNN).

    Raises
    ------
    ReadError
        When it is no such file.
    """
    found: NamedLines = []
    places: Places = []
    name = ""
    rows = decoded(content).splitlines()
    if len(rows) > MAX_ROWS:
        raise ReadError("file", f"it has more than {MAX_ROWS} rows", "divide it")
    if not any(row.startswith("LIN ") for row in rows):
        raise ReadError("file", "it has no line (LIN): it is no line file of Hypack", "send an .LNW file")
    for number, row in enumerate(rows, 1):
        word, _, rest = row.strip().partition(" ")
        if word == "PTS":
            cells = rest.split()
            places.append((_number(cells, 0, number), _number(cells, 1, number)))
        elif word == "LNN":
            name = rest.strip()
        if word in ("LIN", "EOL"):
            if places:
                found.append((name, places))
            places, name = [], ""
    return [*found, (name, places)] if places else found


def _filled(row: list[str]) -> list[str]:
    """Return a row without the empty cells at its end, which blanks and spreadsheets leave there."""
    count = max((k for k, cell in enumerate(row, 1) if cell.strip()), default=0)
    return row[:count]


def _delimiter(text: str) -> str:
    first = next((row for row in text.splitlines() if row.strip() and not row.startswith("#")), "")
    # Commas last but for blanks: beside semicolons or tabs they are decimal ones.
    return next((one for one in (";", "\t", ",") if one in first), " ")


def _number(row: list[str], column: int, number: int) -> float:
    try:
        value = float(row[column].replace(",", "."))
    except (IndexError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise ReadError(f"line {number}", f"column {column + 1} is no number", "give positions as decimal numbers")
    return value
