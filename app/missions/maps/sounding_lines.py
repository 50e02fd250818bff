"""A mission's soundings as lines of CSV, made piece by piece as they are read."""

import csv
import io
from collections.abc import Sequence
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


class SoundingLines:
    """Every sounding that was read so far as a line, rejected ones with their reason; raw and corrected side by side.

    A sounding takes some hundred bytes like that, and several thousand as an object with all its fields.
    """

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def take(self, rows: Sequence[Any]) -> None:
        """Take rows of :data:`COLUMNS`."""
        text = io.StringIO()
        csv.writer(text).writerows([text_cell(value) for value in row] for row in rows)
        self._pieces.append(text.getvalue().encode())

    def csv(self, datum: str) -> bytes:
        """Return the file; ``datum`` is what depths are counted from."""
        text = io.StringIO()
        text.write(f"# depth_m: positive down, from {datum}\n")
        csv.writer(text).writerow(COLUMNS)
        return b"".join([text.getvalue().encode(), *self._pieces])
