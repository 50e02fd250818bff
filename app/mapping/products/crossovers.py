"""Where a survey crosses itself, as CSV."""

import csv
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.csv_cells import text_cell
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.quality.agreement import within
from app.mapping.quality.survey import SurveyCheck
from app.mapping.s44 import Order, max_tvu_m

COLUMNS = (
    "number",
    "lat_deg",
    "lon_deg",
    "east_m",
    "north_m",
    "vehicle_1",
    "line_1",
    "time_1_s",
    "depth_1_m",
    "sd_1_m",
    "vehicle_2",
    "line_2",
    "time_2_s",
    "depth_2_m",
    "sd_2_m",
    "difference_m",
    "predicted_sd_m",
    "angle_deg",
    "max_tvu_m",
    "within",
    "outlier",
)


def crossovers_csv(check: SurveyCheck, frame: LocalFrame, order: Order, *, vertical_datum: str) -> bytes:
    """Return a row for each crossing, the worst beside what the order allows first; 1 and 0 say yes and no."""
    rows = check.worst_first(order)
    found, lines = check.crossings.take(rows), check.lines
    lat, lon = frame.to_geographic(found.east_m, found.north_m)
    names = np.array([str(text_cell(name)) for name in check.names] or [""])
    columns: list[NDArray[Any]] = [
        np.arange(1, len(found) + 1),
        np.round(lat, 8),
        np.round(lon, 8),
        np.round(found.east_m, 3),
        np.round(found.north_m, 3),
    ]
    for side in (0, 1):
        line = found.line[:, side]
        columns += [
            names[lines.vehicle[line]],
            lines.number[line],
            np.round(found.time_s[:, side], 3),
            np.round(found.depth_m[:, side], 4),
            np.round(found.sd_m[:, side], 4),
        ]
    columns += [
        np.round(found.difference_m, 4),
        np.round(found.predicted_sd_m, 4),
        np.round(np.degrees(found.angle_rad), 1),
        np.round(max_tvu_m(found.mean_depth_m, order), 4),
        within(found.difference_m, found.mean_depth_m, order).astype(int),
        check.outliers(order)[rows].astype(int),
    ]
    text = io.StringIO()
    text.write(f"# depths: positive down, from {vertical_datum}; largest TVU: {order.spoken} of IHO S-44\n")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    writer.writerows(zip(*(column.tolist() for column in columns), strict=True))
    return text.getvalue().encode()
