"""What may enter the map, and what is kept with the reason."""

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from app.missions.fleet.interface import Position, SoundingReport
from app.missions.soundings.corrections import Corrections
from app.missions.soundings.gate import JUMP_ALLOWANCE_M, MAX_VEHICLE_SPEED_MPS, Gate
from app.missions.spec.water import Tide
from tests.support.missions.specs import FRAME, lon_lat

AREA = Polygon([(0, 0), (100, 0), (100, 100), (0, 100)])
MARGIN_M = 20.0
TIDE_M = 1.5


def make_gate() -> Gate:
    corrections = Corrections(FRAME, Tide(level_m=TIDE_M))
    return Gate(corrections, AREA, margin_m=MARGIN_M, noise=0.01)


def sounding(east_m: float = 50.0, north_m: float = 50.0, time_s: float = 1000.0, **changes: Any) -> SoundingReport:
    lon, lat = lon_lat(east_m, north_m)
    report = SoundingReport("a", time_s, Position(lat, lon, 12.0), vehicle_depth_m=2.0, range_m=10.0, source="test")
    return replace(report, **changes)


def at(lat: float | None = None, lon: float | None = None, depth: float = 12.0) -> Position:
    here = sounding().footprint
    return Position(here.lat_deg if lat is None else lat, here.lon_deg if lon is None else lon, depth)


def test_a_plausible_sounding_is_placed_and_corrected_for_the_tide() -> None:
    (result,) = make_gate().check([sounding(30.0, 40.0)])
    assert result.accepted
    assert (result.east_m, result.north_m) == pytest.approx((30.0, 40.0), abs=0.01)
    assert result.depth_m == pytest.approx(12.0 - TIDE_M)
    assert result.sd_m == pytest.approx(0.1)
    assert result.report.footprint.depth_m == 12.0


def test_the_vehicles_own_accuracy_counts_where_it_states_one() -> None:
    stated, short = make_gate().check([sounding(depth_sd_m=0.33), sounding(range_m=0.2)])
    assert stated.sd_m == 0.33
    assert short.sd_m == 0.01


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"time_s": math.nan}, "time_s: nan is not a finite number"),
        ({"footprint": at(lat=math.inf)}, "lat_deg: inf is not a finite number"),
        ({"footprint": at(lon=math.nan)}, "lon_deg: nan is not a finite number"),
        ({"footprint": at(depth=math.inf)}, "depth_m: inf is not a finite number"),
        ({"vehicle_depth_m": math.nan}, "vehicle_depth_m: nan is not a finite number"),
        ({"range_m": math.inf}, "range_m: inf is not a finite number"),
        ({"footprint": at(lat=91.0)}, "lat_deg: 91.0 is not between -90 and 90"),
        ({"footprint": at(lon=-181.0)}, "lon_deg: -181.0 is not between -180 and 180"),
        ({"range_m": 0.0}, "range_m: 0 is not positive"),
        ({"range_m": -3.0}, "range_m: -3 is not positive"),
        ({"vehicle_depth_m": -3.0}, "vehicle_depth_m: -3 is not between -2 and 11100"),
        ({"footprint": at(depth=0.0)}, "depth_m: 0 is not between 0 and 11100"),
        ({"footprint": at(depth=12_000.0)}, "depth_m: 12000 is not between 0 and 11100"),
        ({"depth_sd_m": 0.0}, "depth_sd_m: 0.0"),
        ({"depth_sd_m": -1.0}, "depth_sd_m: -1.0"),
        ({"depth_sd_m": math.nan}, "depth_sd_m: nan"),
        ({"depth_sd_m": math.inf}, "depth_sd_m: inf"),
        ({"depth_sd_m": 1e-300}, "depth_sd_m: 1e-300"),
        ({"depth_sd_m": 1e300}, "depth_sd_m: 1e+300"),
        ({"footprint": at(lat=-41.0, lon=171.0)}, "position: "),
        ({"footprint": at(lat=90.0, lon=0.0)}, "position: "),
        ({"footprint": at(lon=0.0)}, "position: "),
    ],
)
def test_every_implausible_value_is_refused_by_field_and_value(changes: dict[str, Any], reason: str) -> None:
    gate = make_gate()
    (result,) = gate.check([sounding(**changes)])
    assert not result.accepted
    assert result.reason.startswith(reason)
    assert all(math.isfinite(v) for v in (result.east_m, result.north_m, result.depth_m, result.sd_m))
    assert gate.check([sounding()])[0].accepted


def test_just_outside_helps_the_edge_and_further_out_is_refused() -> None:
    near, far = make_gate().check([sounding(-MARGIN_M + 1, 50), replace(sounding(-MARGIN_M - 1, 50), vehicle="b")])
    assert near.accepted
    assert "more than 20 m outside the area" in far.reason
    assert far.east_m == pytest.approx(-MARGIN_M - 1, abs=0.01)


def test_a_jump_is_refused_and_the_vehicle_recovers() -> None:
    gate = make_gate()
    jumped = 0.9 * 10.0 + JUMP_ALLOWANCE_M + MAX_VEHICLE_SPEED_MPS + 10.0
    there = [sounding(10, 50), sounding(11, 50, 1001.0), sounding(11 + jumped, 50, 1002.0), sounding(12, 50, 1003.0)]
    results = gate.check(there)
    assert [r.accepted for r in results] == [True, True, False, True]
    assert "jumped" in results[2].reason
    assert f"{jumped:.1f} m in 1.0 s" in results[2].reason


def test_a_vehicle_whose_first_fix_was_wrong_is_believed_again_in_time() -> None:
    gate = make_gate()
    accepted = [r.accepted for r in gate.check(sounding(90 if i == 0 else 5, 50, 1000.0 + i) for i in range(15))]
    assert accepted[0]
    assert not accepted[1]
    assert accepted[-1]
    assert accepted == sorted(accepted[1:], key=bool) or accepted[1:] == sorted(accepted[1:])


def test_a_vehicle_that_would_have_sunk_in_no_time_is_refused() -> None:
    there = [
        sounding(),
        sounding(time_s=1001.0, vehicle_depth_m=5000.0, footprint=at(depth=5009.0)),
        sounding(time_s=1002.0),
    ]
    results = make_gate().check(there)
    assert [r.accepted for r in results] == [True, False, True]
    assert "jumped 4998.0 m in 1.0 s" in results[1].reason


def test_vehicles_jump_on_their_own_account() -> None:
    other = replace(sounding(95, 95), vehicle="b")
    assert [r.accepted for r in make_gate().check([sounding(5, 5), other])] == [True, True]


anything = st.floats(allow_nan=True, allow_infinity=True)
reports = st.builds(
    SoundingReport,
    vehicle=st.sampled_from("ab"),
    time_s=anything | st.floats(0, 2e9),
    footprint=st.builds(
        Position,
        anything | st.floats(41.18, 41.19),
        anything | st.floats(-8.71, -8.70),
        anything | st.floats(0, 100),
    ),
    vehicle_depth_m=anything | st.floats(0, 10),
    range_m=anything | st.floats(0, 100),
    source=st.just("test"),
    depth_sd_m=st.none() | anything,
)


@settings(deadline=None)
@given(st.lists(reports, max_size=8))
def test_accepted_soundings_are_finite_and_inside_the_zone(batch: list[SoundingReport]) -> None:
    results = make_gate().check(batch)
    assert (
        [r.report for r in results] == batch or any(math.isnan(r.time_s) for r in batch) or len(results) == len(batch)
    )
    for result in results:
        assert result.accepted == (result.reason == "")
        assert all(math.isfinite(v) for v in (result.east_m, result.north_m, result.depth_m, result.sd_m))
        if result.accepted:
            assert AREA.distance(Point(result.east_m, result.north_m)) <= MARGIN_M + 1e-6
            assert result.sd_m > 0
            assert 0 < result.report.footprint.depth_m <= 11_100
