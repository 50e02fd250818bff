"""The log of the lines that were flown, as CSV."""

import csv
import io
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from app.csv_cells import text_cell
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.quality.planned_lines import PlannedLine, planned_names
from app.mapping.quality.survey import SurveyCheck
from app.mapping.s44 import Order

COLUMNS = (
    "vehicle",
    "line",
    "kind",
    "start_utc",
    "end_utc",
    "start_lat_deg",
    "start_lon_deg",
    "end_lat_deg",
    "end_lon_deg",
    "course_deg",
    "length_m",
    "duration_s",
    "speed_mps",
    "soundings",
    "off_line_rms_m",
    "off_line_max_m",
    "crossings",
    "mean_difference_m",
    "within_pct",
    "planned_line",
)


def lines_csv(check: SurveyCheck, frame: LocalFrame, order: Order, planned: Sequence[PlannedLine] = ()) -> bytes:
    """Return a row for each line, by vehicle and in the order in which they were flown.

    ``kind`` is ``main`` or ``cross``. Of its crossings with other lines: how many there are, the mean of its depths
    minus the others', and which share of them is within what ``order`` allows; empty without any. ``planned_line`` is
    the name of the line of a plan that it lies on.
    """
    lines, log, by_line = check.lines, check.log, check.by_line(order)
    begins, ends = frame.to_geographic(*log.begin_m.T), frame.to_geographic(*log.end_m.T)
    names = planned_names(log.begin_m, log.end_m, planned)
    text = io.StringIO()
    text.write(f"# times: UTC by the vehicle's clock; within_pct: of {order.spoken} of IHO S-44\n")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for k in range(len(lines)):
        duration_s, length_m, crossed = lines.end_s[k] - lines.start_s[k], lines.length_m[k], by_line.get(k)
        writer.writerow(
            (
                text_cell(check.names[lines.vehicle[k]]),
                lines.number[k],
                "cross" if check.is_crossline[k] else "main",
                _utc(lines.start_s[k]),
                _utc(lines.end_s[k]),
                *(round(float(of[k]), 8) for of in (*begins, *ends)),
                round(float(np.degrees(lines.heading_rad[k])), 1) % 360.0,
                round(float(length_m), 2),
                round(float(duration_s), 2),
                round(float(length_m / duration_s), 3) if duration_s > 0.0 else "",
                log.soundings[k],
                round(float(log.off_line_rms_m[k]), 2),
                round(float(log.off_line_max_m[k]), 2),
                *(
                    (0, "", "")
                    if crossed is None
                    else (crossed.count, round(crossed.mean_m, 4), round(crossed.within_pct, 1))
                ),
                text_cell(names[k]),
            )
        )
    return text.getvalue().encode()


def _utc(time_s: float) -> str:
    return datetime.fromtimestamp(float(time_s), UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
