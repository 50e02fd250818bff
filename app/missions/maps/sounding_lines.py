"""A mission's soundings as lines of CSV."""

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

from app.csv_cells import text_cell

COLUMNS = (
    "id",
    "vehicle",
    "time_s",
    "beam",
    "source",
    "lat_deg",
    "lon_deg",
    "east_m",
    "north_m",
    "vehicle_depth_m",
    "range_m",
    "raw_depth_m",
    "depth_m",
    "sd_m",
    "position_sd_m",
    "level_m",
    "vehicle_lat_deg",
    "vehicle_lon_deg",
    "roll_deg",
    "pitch_deg",
    "heading_deg",
    "beam_azimuth_deg",
    "beam_off_nadir_deg",
    "step",
    "verdict",
    "reason",
)


def header_line(datum: str, left_out: str = "") -> bytes:
    """Return the begin of a file whose depths are counted from ``datum``: a comment and the names of the columns.

    ``left_out`` says what is not in it.
    """
    return f"# depth_m: positive down, from {datum}{left_out and f'; {left_out}'}\n".encode() + _lines([COLUMNS])


def sounding_lines(rows: Iterable[Sequence[Any]]) -> bytes:
    """Return rows of :data:`COLUMNS` as lines, rejected soundings with their reason; raw and corrected side by side."""
    return _lines([text_cell(value) for value in row] for row in rows)


def _lines(rows: Iterable[Sequence[Any]]) -> bytes:
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    return text.getvalue().encode()
