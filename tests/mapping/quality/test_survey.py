"""A survey held against itself: what one vehicle or line does wrong is told of it."""

import csv
import io

import numpy as np
import pytest

from app.arrays import FloatArray
from app.mapping.coordinates.georeference import LocalFrame
from app.mapping.products.crossovers import crossovers_csv
from app.mapping.quality.survey import SurveyCheck
from app.mapping.quality.tracks import Tracks
from app.mapping.s44 import Order
from tests.support.mapping.tracks import flown, lawnmower


def floor(table: FloatArray, offset_m: float = 0.0) -> FloatArray:
    table[:, 3] = 20.0 + 0.05 * table[:, 1] - 0.02 * table[:, 2] + offset_m
    return table


@pytest.fixture
def check() -> SurveyCheck:
    """A main survey, a second vehicle that reads 0.3 m too deep along a crosslines, and one sounding that is wrong."""
    main = floor(flown(lawnmower(100, 200, 10)))
    across = floor(flown([(-15, 60), (115, 60), (115, 140), (-15, 140)], start_s=1e5), 0.3)
    across[130 + 80 + 15, 3] += 5.0
    return SurveyCheck.of(Tracks.of({"main": main, "across": across}))


def test_pairs_of_vehicles_and_lines_tell_who_is_wrong(check: SurveyCheck) -> None:
    everything = check.statistics(Order.ORDER_1A)
    assert everything is not None
    assert everything.count == 22
    assert everything.median_m == pytest.approx(0.3)
    assert check.at_crosslines(Order.ORDER_1A) == everything
    pairs = check.by_vehicles(Order.ORDER_1A)
    assert list(pairs) == [("across", "main")]
    by_line = check.by_line(Order.ORDER_1A)
    first = next(line for line in by_line if check.is_crossline[line])
    assert by_line[first].count == 11
    assert by_line[first].mean_m == pytest.approx(0.3)
    main = next(line for line in by_line if check.names[check.lines.vehicle[line]] == "main")
    assert by_line[main].median_m < -0.29, "its depths minus those of the others"


def test_lengths_are_told(check: SurveyCheck) -> None:
    assert check.crosslines_m == pytest.approx(2 * 130.0)
    assert check.length_m == pytest.approx(11 * 200 + 100 + 2 * 130 + 80)


def test_times_on_crosslines_are_told(check: SurveyCheck) -> None:
    times_s = 1e5 + np.array([-5.0, 50.0, 170.0, 230.0, 900.0])
    assert check.crossed_at("across", times_s).tolist() == [False, True, False, True, False]
    assert not check.crossed_at("main", np.array([30.0, 40.0])).any()
    assert not check.crossed_at("nobody", np.array([30.0])).any()


def test_a_file_has_all_crossings_worst_first(check: SurveyCheck) -> None:
    frame = LocalFrame(41.0, -8.0)
    text = crossovers_csv(check, frame, Order.ORDER_1A, vertical_datum="mean sea level").decode()
    assert text.startswith("# depths: positive down, from mean sea level; largest TVU: Order 1a")
    rows = list(csv.DictReader(io.StringIO(text.partition("\n")[2])))
    assert len(rows) == 22
    assert float(rows[0]["difference_m"]) == pytest.approx(5.3, abs=0.01)
    assert (rows[0]["vehicle_1"], rows[0]["vehicle_2"]) == ("across", "main")
    assert (rows[0]["within"], rows[0]["outlier"]) == ("0", "1")
    assert (rows[-1]["within"], rows[-1]["outlier"]) == ("1", "0")
    at = frame.to_local(float(rows[0]["lat_deg"]), float(rows[0]["lon_deg"]))
    assert at == pytest.approx((float(rows[0]["east_m"]), float(rows[0]["north_m"])), abs=0.01)


def test_a_survey_of_nothing() -> None:
    nothing = SurveyCheck.of(Tracks.of({}))
    assert nothing.statistics(Order.ORDER_1A) is None
    assert nothing.at_crosslines(Order.ORDER_1A) is None
    assert nothing.by_vehicles(Order.ORDER_1A) == {}
    assert nothing.by_line(Order.ORDER_1A) == {}
    assert nothing.length_m == 0.0
    text = crossovers_csv(nothing, LocalFrame(41.0, -8.0), Order.ORDER_1A, vertical_datum="chart")
    assert len(text.decode().splitlines()) == 2
