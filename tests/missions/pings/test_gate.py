"""Which pings count, and in which words others are refused."""

import math
import re
from typing import Any

import numpy as np
import pytest

from app.missions.fleet.interface import Position
from app.missions.pings.gate import storable
from tests.support.missions.pings import make_gate, ping
from tests.support.missions.specs import LAT, LON


def test_a_plausible_ping_counts_and_ranges_that_cannot_be_are_none() -> None:
    ranges = np.array([10.0, 0.0, -3.0, np.nan, np.inf, 2e5, 12.0, 9.0], np.float32)
    angles = np.array([-1.0, -0.7, -0.4, -0.1, 0.1, 0.4, np.nan, 1.0], np.float32)
    report = ping(ranges_m=ranges, angles_rad=angles)
    checked, reason = make_gate().check(report)
    assert reason == ""
    assert np.isfinite(checked.ranges_m).tolist() == [True, *[False] * 6, True]
    assert checked.ranges_m.dtype == np.float32
    assert report.ranges_m[1] == 0.0, "the report stays as it came"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"time_s": math.nan}, "time_s: nan is not a finite number"),
        ({"time_s": -5.0}, "time_s: -5 is not between 0 and 1e\\+11"),
        ({"roll_rad": math.inf}, "roll_rad: inf is not a finite number"),
        ({"heading_rad": math.nan}, "heading_rad: nan is not a finite number"),
        ({"position": Position(95.0, LON, 2.0)}, "lat_deg: 95.0 is not between -90 and 90"),
        ({"position": Position(LAT, LON, 12_000.0)}, "vehicle_depth_m: 12000 is not between -2 and 11100"),
        ({"position": Position(LAT + 0.01, LON, 2.0)}, "position: too far"),
        ({"position": Position(LAT + 40.0, LON, 2.0)}, "position: "),
        ({"position_sd_m": -1.0}, "position_sd_m: -1.0 is not a standard deviation"),
        ({"angles_rad": np.full(8, 1.6, np.float32)}, "angle: beam 0 points 91.7 degrees aside, not within 90"),
        ({"angles_rad": np.full(8, np.nan, np.float32)}, "beams: there is none"),
        ({"angles_rad": np.zeros(0, np.float32), "ranges_m": np.zeros(0, np.float32)}, "beams: there is none"),
        ({"ranges_m": np.ones(3, np.float32)}, "beams: there are 8 angles and 3 ranges"),
    ],
)
def test_what_cannot_be_is_refused_with_the_value(changes: dict[str, Any], said: str) -> None:
    report = ping(**changes)
    checked, reason = make_gate().check(report)
    assert checked is report
    assert re.match(said, reason), reason


def test_only_what_can_be_told_apart_is_stored() -> None:
    assert storable(ping())
    assert storable(ping(roll_rad=math.nan))
    assert not storable(ping(time_s=math.nan))
    assert not storable(ping(ranges_m=np.ones(3, np.float32)))
