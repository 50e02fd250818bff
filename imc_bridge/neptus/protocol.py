"""What Neptus' ConvCAO panel writes and reads, as values: depths in metres, positive down; places in cells.

Cells are counted from the south-western corner: rows to the north, columns to the east. The panel counts the depth of
a vehicle as a height above ``max_depth_m``; the depths of its multibeam samples are plain depths.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass
from typing import Any, Literal

import orjson
from imcpy.coordinates import WGS84

SESSION_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,47}")
MAX_VEHICLES = 20
MAX_SAMPLES = 50_000
MAX_TIME_STEP = 10**9
MAX_MAP_CELLS = 1_000_000
UNKNOWN_CELL = -1.0
WHOLE_METRE_SD = 1.0 / math.sqrt(12.0)
ALTITUDE_SD_M = 0.32
"""Of the altitude that a vehicle estimates, which the panel's ``Bathymeter`` is made of."""

BathymeterRule = Literal["twice", "once", "off"]


class NeptusDataError(ValueError):
    """An upload that cannot be used; says which field, its value and what would be right."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(f"{field}: {message}")
        self.field = field


@dataclass(frozen=True, slots=True)
class Place:
    """Where a vehicle is: row and column in cells, depth in metres."""

    row: float
    col: float
    depth_m: float


@dataclass(frozen=True, slots=True)
class Area:
    """The rectangle of the panel's settings (``conf/noptcoords.properties`` of Neptus).

    ``max_depth_m`` is the depth from which the panel counts heights.
    """

    centre_lat_deg: float
    centre_lon_deg: float
    rows: int = 240
    cols: int = 240
    cell_m: float = 1.0
    max_depth_m: float = 50.0

    def to_geographic(self, row: float, col: float) -> tuple[float, float]:
        """Latitude and longitude (degrees) of a place."""
        lat, lon = WGS84.displace(
            math.radians(self.centre_lat_deg),
            math.radians(self.centre_lon_deg),
            (row - self.rows / 2) * self.cell_m,
            (col - self.cols / 2) * self.cell_m,
        )
        return math.degrees(lat), math.degrees(lon)

    def to_cells(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """Row and column of a place."""
        north, east, _ = WGS84.displacement(
            math.radians(self.centre_lat_deg),
            math.radians(self.centre_lon_deg),
            0.0,
            math.radians(lat_deg),
            math.radians(lon_deg),
            0.0,
        )
        return float(north) / self.cell_m + self.rows / 2, float(east) / self.cell_m + self.cols / 2

    def corners(self) -> list[tuple[float, float]]:
        """Latitude and longitude (degrees): south-west, south-east, north-east, north-west."""
        return [
            self.to_geographic(row, col)
            for row, col in ((0, 0), (0, self.cols), (self.rows, self.cols), (self.rows, 0))
        ]

    def depth_of(self, height_m: float) -> float:
        """Depth of a vehicle whose height the panel gave: cut to whole metres, so the middle of that metre."""
        whole = float(height_m).is_integer()
        return max(self.max_depth_m - height_m - (0.5 if whole and height_m < self.max_depth_m else 0.0), 0.0)

    def on_border(self, row: float, col: float) -> bool:
        """Whether the panel may have moved a place here that was outside: it puts those on the border, silently."""
        return not (0.0 < row < self.rows - 1 and 0.0 < col < self.cols - 1)


@dataclass(frozen=True, slots=True)
class Conventions:
    """How the panel's figures are meant.

    ``bathymeter``: ``twice``: the unmodified panel, which subtracts the vehicle's depth and the bottom's depth, which
    holds the vehicle's depth already, from ``max_depth_m``; ``once``: a panel that was corrected, ``max_depth_m`` minus
    the bottom's depth; ``off``: not used.
    """

    area: Area
    bathymeter: BathymeterRule = "twice"


@dataclass(frozen=True, slots=True)
class CellSounding:
    """A measurement of the bottom at a place in cells."""

    row: float
    col: float
    vehicle_depth_m: float
    bottom_depth_m: float
    source: str
    vehicle: int | None = None
    """Index of the vehicle that measured; None where the panel does not tell."""
    depth_sd_m: float | None = None


@dataclass(frozen=True, slots=True)
class StepData:
    """One step: where the vehicles are and what was sounded since the last step."""

    session: str
    time_step: int
    places: tuple[Place, ...]
    soundings: tuple[CellSounding, ...]
    refused: Counter[str]
    pairs: bool = False
    """Written by a panel of 2013, which knows whole cells only and no depth, and cannot read anything else."""


def read_session(content: bytes, session: str) -> int:
    """Number of vehicles in a session's first file ``{DateTime, SessionID, DemoMode, AUVs}``.

    Raises
    ------
    NeptusDataError
    """
    record = _record(content, session)
    text = record.get("AUVs")
    count = int(text) if isinstance(text, str | int) and not isinstance(text, bool) and str(text).isdigit() else 0
    if not 1 <= count <= MAX_VEHICLES:
        raise NeptusDataError("AUVs", f"{text!r} must be a number of vehicles from 1 to {MAX_VEHICLES}")
    return count


def read_step(content: bytes, session: str, vehicles: int, conventions: Conventions) -> StepData:
    """Read ``{SessionID, timeStep, Bathymeter[n], Location[n][3], MBSamples[m], SampleLocations[m][3]}``.

    Every place and number is checked before anything is made of them. A sample that means no depth is refused by
    itself; a place that cannot be refuses all.

    Raises
    ------
    NeptusDataError
    """
    record = _record(content, session)
    step = record.get("timeStep")
    if not isinstance(step, int) or isinstance(step, bool) or not 1 <= step <= MAX_TIME_STEP:
        raise NeptusDataError("timeStep", f"{step!r} must be a whole number from 1 on")
    rows = _table(record, "Location", vehicles, (2, 3))
    pairs = len(rows[0]) == 2
    area = conventions.area
    places = tuple(_place(row, index, area) for index, row in enumerate(rows))
    refused: Counter[str] = Counter()
    samples = _samples(record, area, refused)
    if not samples and conventions.bathymeter != "off" and not pairs:
        samples = _bathymeter(record, places, conventions, refused)
    return StepData(session, step, places, tuple(samples), refused, pairs)


def write_actions(session: str, time_step: int, places: list[Place], area: Area, *, pairs: bool) -> bytes:
    """One line of JSON, as the panel reads it: ``{SessionID, timeStep, Location[n][3]}``."""
    locations = [
        [round(place.row), round(place.col)]
        if pairs
        else [round(place.row, 3), round(place.col, 3), round(area.max_depth_m - place.depth_m, 3)]
        for place in places
    ]
    return orjson.dumps({"SessionID": session, "timeStep": time_step, "Location": locations}) + b"\n"


def read_map(content: bytes, limit: int = MAX_MAP_CELLS) -> list[tuple[int, int, float]]:
    """Row, column and value of the known cells of a sparse map: ``rows cols …``, an empty line, then the rows.

    Raises
    ------
    NeptusDataError
    """
    lines = [line.split() for line in content.decode("ascii", "replace").splitlines() if line.strip()]
    try:
        rows, cols = int(lines[0][0]), int(lines[0][1])
    except (IndexError, ValueError):
        raise NeptusDataError("map", "the first line must begin with the numbers of rows and columns") from None
    if rows < 1 or cols < 1 or rows * cols > limit:
        raise NeptusDataError("map", f"{rows} x {cols} cells: from 1 to {limit} are taken")
    if len(lines) != rows + 1 or any(len(line) != cols for line in lines[1:]):
        raise NeptusDataError("map", f"the first line says {rows} rows of {cols} values, which do not follow")
    known = []
    for row, line in enumerate(lines[1:]):
        for col, text in enumerate(line):
            try:
                value = float(text)
            except ValueError:
                raise NeptusDataError("map", f"row {row}, column {col}: {text[:20]!r} is not a number") from None
            if not math.isfinite(value):
                raise NeptusDataError("map", f"row {row}, column {col}: {text[:20]!r} is not finite")
            if value != UNKNOWN_CELL:
                known.append((row, col, value))
    return known


def _record(content: bytes, session: str) -> dict[str, Any]:
    try:
        record = orjson.loads(content)
    except orjson.JSONDecodeError as error:
        raise NeptusDataError("file", f"it is not JSON: {error}") from None
    if not isinstance(record, dict):
        raise NeptusDataError("file", "it must be a JSON object")
    if record.get("SessionID") != session:
        raise NeptusDataError(
            "SessionID", f"{str(record.get('SessionID'))[:60]!r} must be {session!r}, as the file is named"
        )
    return record


def _numbers(values: Any, field: str, length: int) -> list[float]:
    if not isinstance(values, list) or len(values) != length:
        found = f"{len(values)} values" if isinstance(values, list) else repr(values)[:40]
        raise NeptusDataError(field, f"{found}: it must be a list of {length}")
    for value in values:
        if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
            raise NeptusDataError(field, f"{str(value)[:40]!r} must be a finite number")
    return [float(value) for value in values]


def _table(record: dict[str, Any], field: str, length: int, widths: tuple[int, ...]) -> list[list[float]]:
    values = record.get(field)
    if not isinstance(values, list) or len(values) != length:
        found = f"{len(values)} entries" if isinstance(values, list) else repr(values)[:40]
        raise NeptusDataError(field, f"{found}: it must have one entry for each of {length}")
    width = len(values[0]) if values and isinstance(values[0], list) else 0
    if values and width not in widths:
        raise NeptusDataError(field, f"{repr(values[0])[:40]} must have {' or '.join(map(str, widths))} numbers")
    return [_numbers(value, f"{field}[{index}]", width) for index, value in enumerate(values)]


def _place(values: list[float], index: int, area: Area) -> Place:
    row, col = values[0], values[1]
    if not (0.0 <= row <= area.rows and 0.0 <= col <= area.cols):
        raise NeptusDataError(
            f"Location[{index}]",
            f"row {row:g}, column {col:g} lies outside the area of {area.rows} rows and {area.cols} columns",
        )
    if len(values) == 2:
        return Place(row, col, 0.0)
    if not 0.0 <= values[2] <= area.max_depth_m + 1.0:
        raise NeptusDataError(
            f"Location[{index}]",
            f"height {values[2]:g} must be from 0 to {area.max_depth_m:g}, counted from that depth upwards",
        )
    return Place(row, col, area.depth_of(values[2]))


def _samples(record: dict[str, Any], area: Area, refused: Counter[str]) -> list[CellSounding]:
    depths = record.get("MBSamples") or []
    if not isinstance(depths, list) or len(depths) > MAX_SAMPLES:
        raise NeptusDataError("MBSamples", f"it must be a list of at most {MAX_SAMPLES} numbers")
    depths = _numbers(depths, "MBSamples", len(depths))
    if not depths:
        return []
    samples = []
    for depth, (row, col, vehicle_depth) in zip(
        depths, _table(record, "SampleLocations", len(depths), (3,)), strict=True
    ):
        if area.on_border(row, col):
            refused["on the border of the area, where the panel puts what lies outside"] += 1
        elif reason := _no_depth(depth, vehicle_depth):
            refused[reason] += 1
        else:
            samples.append(CellSounding(row, col, max(vehicle_depth, 0.0), depth, "neptus DVL"))
    return samples


def _bathymeter(
    record: dict[str, Any], places: tuple[Place, ...], conventions: Conventions, refused: Counter[str]
) -> list[CellSounding]:
    area = conventions.area
    samples = []
    for index, (height, place) in enumerate(
        zip(_numbers(record.get("Bathymeter"), "Bathymeter", len(places)), places, strict=True)
    ):
        depth, sd = area.max_depth_m - height, ALTITUDE_SD_M
        if conventions.bathymeter == "twice":
            depth, sd = depth - place.depth_m, math.hypot(ALTITUDE_SD_M, WHOLE_METRE_SD)
        if area.on_border(place.row, place.col):
            refused["on the border of the area, where the panel puts what lies outside"] += 1
        elif reason := _no_depth(depth, place.depth_m):
            refused[reason] += 1
        else:
            samples.append(
                CellSounding(place.row, place.col, place.depth_m, depth, "neptus bathymeter", index, depth_sd_m=sd)
            )
    return samples


def _no_depth(depth_m: float, vehicle_depth_m: float) -> str:
    if vehicle_depth_m < -2.0:
        return "vehicle above the water"
    if depth_m <= max(vehicle_depth_m, 0.0):
        # An altitude of -1 means that the vehicle does not know it.
        return "bottom not below the vehicle"
    return ""
