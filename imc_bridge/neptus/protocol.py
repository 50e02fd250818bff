"""What Neptus' ConvCAO panel writes and reads, from bytes to :mod:`imc_bridge.neptus.values` and back."""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import replace
from typing import Any

import orjson

from imc_bridge.neptus import samples as sampling
from imc_bridge.neptus.values import Area, Bottom, CellPosition, CellSounding, Conventions, StepData

SESSION_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,47}")
MAX_VEHICLES = 20
MAX_SAMPLES = 50_000
MAX_TIME_STEP = 10**9
MAX_MAP_CELLS = 1_000_000
UNKNOWN_CELL = -1.0
WHOLE_METRE_SD = 1.0 / math.sqrt(12.0)
ALTITUDE_SD_M = 0.32
"""Of the altitude that a vehicle estimates, which the panel's ``Bathymeter`` is made of."""

BORDER = "on the border of the area, where the panel puts what lies outside"


class NeptusDataError(ValueError):
    """An upload that cannot be used; says which field, its value and what would be right."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(f"{field}: {message}")
        self.field = field


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


def count_vehicles(content: bytes, session: str) -> int:
    """Number of vehicles in a step.

    Raises
    ------
    NeptusDataError
    """
    places = _record(content, session).get("Location")
    if not isinstance(places, list) or not 1 <= len(places) <= MAX_VEHICLES:
        raise NeptusDataError("Location", f"it must be a list of the places of 1 to {MAX_VEHICLES} vehicles")
    return len(places)


def read_step(
    content: bytes, session: str, vehicles: int, conventions: Conventions, before: StepData | None = None
) -> StepData:
    """Read ``{SessionID, timeStep, Bathymeter[n], Location[n][3], MBSamples[m], SampleLocations[m][3]}``.

    Every place and number is checked before anything is made of them. A sample that means no depth is refused by
    itself; a place that cannot be refuses all. Of samples beyond :data:`MAX_SAMPLES` the oldest are refused.

    Parameters
    ----------
    before
        The step before, from where the vehicles came: it helps to judge the samples of the way.

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
    samples = _samples(record, area, refused) if conventions.samples != "off" else []
    whose = sampling.owners(samples, places, area.cell_m)
    samples = [replace(sample, vehicle=index) for sample, index in zip(samples, whose, strict=True)]
    if conventions.bathymeter == "off" or pairs:
        return StepData(session, step, places, tuple(samples), refused, pairs=pairs)
    exact = sampling.exact_depths(places, samples)
    bottoms, unknown = _bottoms(record, exact, conventions)
    samples = sampling.checked(
        samples, (*bottoms, *(before.bottoms if before is not None else ())), area.cell_m, refused
    )
    ratios = sampling.altitude_ratios(samples, bottoms, area.cell_m)
    for index in set(range(vehicles)) - {sample.vehicle for sample in samples}:
        bottom, (place, _) = bottoms[index], exact[index]
        refused[unknown[index]] += bottom is None
        if bottom is not None:
            samples.append(_under(index, place, bottom))
    return StepData(
        session, step, tuple(place for place, _ in exact), tuple(samples), +refused, bottoms, ratios, pairs=pairs
    )


def write_actions(session: str, time_step: int, places: list[CellPosition], area: Area, *, pairs: bool) -> bytes:
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


def _place(values: list[float], index: int, area: Area) -> CellPosition:
    row, col = values[0], values[1]
    if not (0.0 <= row <= area.rows and 0.0 <= col <= area.cols):
        raise NeptusDataError(
            f"Location[{index}]",
            f"row {row:g}, column {col:g} lies outside the area of {area.rows} rows and {area.cols} columns",
        )
    if len(values) == 2:
        return CellPosition(row, col, 0.0)
    if not 0.0 <= values[2] <= area.max_depth_m + 1.0:
        raise NeptusDataError(
            f"Location[{index}]",
            f"height {values[2]:g} must be from 0 to {area.max_depth_m:g}, counted from that depth upwards",
        )
    return CellPosition(row, col, area.depth_of(values[2]))


def _samples(record: dict[str, Any], area: Area, refused: Counter[str]) -> list[CellSounding]:
    depths, places = record.get("MBSamples") or [], record.get("SampleLocations") or []
    if not isinstance(depths, list):
        raise NeptusDataError("MBSamples", "it must be a list of numbers")
    if not isinstance(places, list) or len(places) != len(depths):
        found = f"{len(places)} entries" if isinstance(places, list) else repr(places)[:40]
        raise NeptusDataError("SampleLocations", f"{found}: it must have one entry for each of {len(depths)}")
    if len(depths) > MAX_SAMPLES:
        # The panel collects from the moment when the console was opened.
        refused[f"beyond the newest {MAX_SAMPLES}"] += len(depths) - MAX_SAMPLES
        depths, places = depths[-MAX_SAMPLES:], places[-MAX_SAMPLES:]
    depths = _numbers(depths, "MBSamples", len(depths))
    if not depths:
        return []
    samples = []
    table = _table({"SampleLocations": places}, "SampleLocations", len(depths), (3,))
    for depth, (row, col, vehicle_depth) in zip(depths, table, strict=True):
        if area.on_border(row, col):
            refused[BORDER] += 1
        elif reason := _no_depth(depth, vehicle_depth):
            refused[reason] += 1
        else:
            samples.append(CellSounding(row, col, max(vehicle_depth, 0.0), depth, "neptus DVL"))
    return samples


def _bottoms(
    record: dict[str, Any], places: list[tuple[CellPosition, bool]], conventions: Conventions
) -> tuple[tuple[Bottom | None, ...], list[str]]:
    """Return the bottom under each vehicle, None where it is not known, and why it is not."""
    area = conventions.area
    bottoms: list[Bottom | None] = []
    reasons = []
    heights = _numbers(record.get("Bathymeter"), "Bathymeter", len(places))
    for height, (place, exact) in zip(heights, places, strict=True):
        depth, sd = area.max_depth_m - height, ALTITUDE_SD_M
        if conventions.bathymeter == "twice":
            depth, sd = depth - place.depth_m, sd if exact else math.hypot(sd, WHOLE_METRE_SD)
        reason = BORDER if area.on_border(place.row, place.col) else _no_depth(depth, place.depth_m)
        bottoms.append(None if reason else Bottom(place.row, place.col, depth, sd))
        reasons.append(reason)
    return tuple(bottoms), reasons


def _under(index: int, place: CellPosition, bottom: Bottom) -> CellSounding:
    """Return the `Bathymeter` of a vehicle as a sounding."""
    return CellSounding(
        bottom.row, bottom.col, place.depth_m, bottom.depth_m, "neptus bathymeter", index, depth_sd_m=bottom.sd_m
    )


def _no_depth(depth_m: float, vehicle_depth_m: float) -> str:
    if vehicle_depth_m < -2.0:
        return "vehicle above the water"
    if depth_m <= max(vehicle_depth_m, 0.0):
        # An altitude of -1 means that the vehicle does not know it.
        return "bottom not below the vehicle"
    return ""
