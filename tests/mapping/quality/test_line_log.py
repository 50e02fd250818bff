"""The log of survey lines says when and where each was flown, how straight, and what crosses it."""

import csv
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.products.line_log import lines_csv
from app.mapping.quality.line_log import LineLog
from app.mapping.quality.planned_lines import PlannedLine, planned_names
from app.mapping.quality.survey import SurveyCheck
from app.mapping.quality.tracks import Tracks, cut
from app.mapping.s44 import Order
from tests.support.mapping.tracks import flown, lawnmower

FRAME = LocalFrame(41.0, -8.0)


def swerving(length_m: float, aside_m: float) -> FloatArray:
    """Return soundings north along a line, off it by a half sine."""
    north = np.arange(0.0, length_m + 0.5, 1.0)
    table = np.zeros((len(north), 5))
    table[:, 0], table[:, 2] = north, north
    table[:, 1] = aside_m * np.sin(np.pi * north / length_m)
    table[:, 3:] = 10.0, 0.1
    return table


@given(length_m=st.integers(150, 400), aside_m=st.floats(0.0, 3.0))
def test_how_far_a_line_is_from_the_straight_way_between_its_ends(length_m: int, aside_m: float) -> None:
    tracks = Tracks.of({"a": swerving(float(length_m), aside_m)})
    lines = cut(tracks)
    assert len(lines) == 1, "so little is no turn"
    log = LineLog.of(tracks, lines)
    assert log.off_line_max_m[0] == pytest.approx(aside_m, rel=0.01, abs=1e-9)
    assert log.off_line_rms_m[0] == pytest.approx(aside_m / np.sqrt(2), rel=0.02, abs=1e-9)
    assert log.soundings[0] == length_m + 1
    assert log.begin_m[0] == pytest.approx([0.0, 0.0])
    assert log.end_m[0] == pytest.approx([0.0, length_m], abs=1e-6)


def rows_of(check: SurveyCheck) -> list[dict[str, str]]:
    text = lines_csv(check, FRAME, Order.ORDER_1A).decode()
    assert text.startswith("# times: UTC by the vehicle's clock; within_pct: of Order 1a of IHO S-44\n")
    return list(csv.DictReader(io.StringIO(text.partition("\n")[2])))


def test_the_file_has_a_row_for_each_line_with_what_crosses_it() -> None:
    start_s = 1_795_225_140.0
    main = flown(lawnmower(100, 200, 10), start_s=start_s)
    across = flown([(-10, 100), (110, 100)], start_s=start_s + 5000.0)
    across[:, 3] += 0.2
    check = SurveyCheck.of(Tracks.of({"=main": main, "across": across}))
    rows = rows_of(check)
    assert len(rows) == len(check.lines)
    [cross] = [row for row in rows if row["kind"] == "cross"]
    assert (cross["vehicle"], cross["line"], cross["crossings"]) == ("across", "1", "11")
    assert float(cross["mean_difference_m"]) == pytest.approx(0.2, abs=0.01)
    assert float(cross["course_deg"]) == pytest.approx(90.0, abs=0.1)
    assert float(cross["length_m"]) == pytest.approx(120.0, abs=1.5)
    at = FRAME.to_local(float(cross["start_lat_deg"]), float(cross["start_lon_deg"]))
    assert at == pytest.approx((-10.0, 100.0), abs=0.5)
    long = [row for row in rows if row["kind"] == "main" and float(row["length_m"]) > 150.0]
    assert len(long) == 11
    assert {row["vehicle"] for row in long} == {"'=main"}, "no spreadsheet takes a name for a formula"
    assert all(row["start_utc"] < row["end_utc"] and row["start_utc"].endswith("Z") for row in long)
    assert {row["within_pct"] for row in long} == {"100.0"}
    assert all(float(row["speed_mps"]) * float(row["duration_s"]) == pytest.approx(float(row["length_m"]), rel=0.01)
               for row in long)  # fmt: skip


def test_lines_of_a_plan_are_told_by_its_names() -> None:
    plan = [PlannedLine(f"L{k}", np.array([[10.0 * k + 1.0, -20.0], [10.0 * k + 1.0, 220.0]])) for k in range(11)]
    plan.append(PlannedLine("=X", np.array([[-20.0, 98.0], [50.0, 98.0], [120.0, 102.0]])))
    main, across = flown(lawnmower(100, 200, 10), start_s=1e9), flown([(-10, 100), (110, 100)], start_s=2e9)
    check = SurveyCheck.of(Tracks.of({"main": main, "across": across}))
    rows = [*csv.DictReader(io.StringIO(lines_csv(check, FRAME, Order.ORDER_1A, plan).decode().partition("\n")[2]))]
    long = [row["planned_line"] for row in rows if row["vehicle"] == "main" and float(row["length_m"]) > 150.0]
    assert long == [f"L{k}" for k in range(11)]
    assert [row["planned_line"] for row in rows if row["vehicle"] == "across"] == ["'=X"]
    between = {row["planned_line"] for row in rows if row["vehicle"] == "main" and float(row["length_m"]) < 150.0}
    assert between <= {""}, "ways from line to line are none of them"
    assert {row["planned_line"] for row in rows_of(check)} == {""}


def test_what_was_flown_far_from_a_line_or_at_an_angle_to_it_is_not_it() -> None:
    plan = [PlannedLine("a", np.array([[0.0, 0.0], [0.0, 100.0], [100.0, 200.0]]))]
    begin_m = np.array([[0.0, 0.0], [12.0, 0.0], [-8.0, 50.0], [90.0, 195.0], [5.0, 100.0]])
    end_m = np.array([[2.0, 90.0], [12.0, 90.0], [8.0, 50.0], [10.0, 115.0], [100.0, 100.0]])
    assert planned_names(begin_m, end_m, plan) == ["a", "", "", "a", ""]
    assert planned_names(begin_m[:0], end_m[:0], plan) == []


def test_nothing_has_no_rows() -> None:
    assert rows_of(SurveyCheck.of(Tracks.of({}))) == []
    assert rows_of(SurveyCheck.of(Tracks.of({"a": flown([(0, 0), (5, 0)])[:1]}))) == []
