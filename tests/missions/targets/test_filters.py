"""Ranges to moving targets: which of them count, and what they make known."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from app.missions.fleet.interface import Position, RangeReport
from app.missions.spec.mission import MissionSpec
from app.missions.targets.filters import ECHOES, LATEST_S, Arrived, TargetFilters
from app.missions.targets.views import ellipse, target_views
from app.missions.views.targets import TargetState, TargetView
from tests.support.missions.specs import FRAME, lon_lat, make_spec

TAG = np.array([40.0, 25.0, 6.0])
TRACKING = {"accuracy_m": 5.0, "range_noise": 0.01, "range_sd_m": 0.3}


def spec_with(**changes: Any) -> MissionSpec:
    values = {"targets": [{"name": "tag-1"}, {"name": "tag-2", "acoustic_name": "lbl-7"}], "tracking": TRACKING}
    return make_spec(60.0, **(values | changes))


def tracking(**changes: Any) -> TargetFilters:
    spec = spec_with(**changes)
    return TargetFilters(spec, spec.frame())


def report(east: float, north: float, depth: float, range_m: float, **changes: Any) -> RangeReport:
    lon, lat = lon_lat(east, north)
    return replace(RangeReport("a", 100.0, "tag-1", range_m, Position(lat, lon, depth), "rest"), **changes)


def heard(from_: np.ndarray, at_s: float, target: np.ndarray = TAG, **changes: Any) -> Arrived:
    range_m = float(np.linalg.norm(from_ - target))
    east, north, depth = from_
    return Arrived(report(east, north, depth, range_m, time_s=at_s, **changes), at_s)


def around(count: int, begin_s: float = 100.0, target: np.ndarray = TAG) -> list[Arrived]:
    """Ranges from vehicles that go round at several depths."""
    places = [np.array([30 + 22 * math.cos(k), 30 + 22 * math.sin(k), 2.0 + 5.0 * (k % 2)]) for k in range(count)]
    return [heard(place, begin_s + k, target) for k, place in enumerate(places)]


def told(tracks: TargetFilters, ranges: list[Arrived]) -> list[str]:
    judged, known = tracks.judge(ranges)
    tracks.adopt(known)
    return [one.reason for one in judged]


def view_of(tracks: TargetFilters, name: str = "tag-1", now_s: float = 160.0) -> TargetView:
    (found,) = [v for v in target_views(tracks, FRAME, spec_with().local_area(), now_s, {}) if v.name == name]
    return found


def test_ranges_from_several_places_find_the_target_and_only_that_one() -> None:
    tracks = tracking()
    assert set(told(tracks, around(60))) == {""}
    seen, other = view_of(tracks), view_of(tracks, "tag-2")
    assert seen.state is TargetState.ACCURATE
    assert seen.accurate
    assert math.hypot(seen.east_m - TAG[0], seen.north_m - TAG[1]) < 2.0
    assert seen.in_area
    assert seen.ranges == 60
    assert seen.age_s == 1.0
    assert other.state is TargetState.UNHEARD
    assert other.lat_deg is None


def test_what_is_not_heard_is_known_ever_worse_until_it_is_looked_for_anew() -> None:
    tracks = tracking()
    told(tracks, around(60))
    later = [view_of(tracks, now_s=160.0 + wait) for wait in (0.0, 60.0, 600.0)]
    sd_east_m = [view.sd_east_m or 0.0 for view in later]
    assert sd_east_m[0] < sd_east_m[1] < sd_east_m[2]
    assert not later[2].accurate
    assert view_of(tracks, now_s=1e6).state is TargetState.UNHEARD
    assert told(tracks, around(60, 1e6)) == [""] * 60
    assert view_of(tracks, now_s=1e6 + 60).accurate


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"range_m": -1.0}, "target_range_m: -1 is not positive"),
        ({"range_m": math.nan}, "target_range_m: nan is not a finite number"),
        ({"range_m": 21_000.0}, "more than the 20000 m at which targets are heard"),
        ({"time_s": math.inf}, "time_s: inf is not a finite number"),
        ({"position": Position(41.185, -8.705, 20_000.0)}, "depth_m: 20000 is not between"),
        ({"position": Position(0.0, 100.0, 2.0)}, "lat_deg, lon_deg"),
    ],
)
def test_a_range_that_cannot_be_is_refused_by_the_name_of_its_value(changes: dict[str, Any], said: str) -> None:
    tracks = tracking()
    (reason,) = told(tracks, [Arrived(replace(report(10, 10, 2, 30.0), **changes), 100.0)])
    assert said in reason
    assert not tracks.known["tag-1"].track.known
    assert tracks.known["tag-1"].rejected == 1


def test_echoes_are_refused_unless_there_is_nothing_but_them() -> None:
    tracks = tracking()
    told(tracks, around(60))
    (reason,) = told(tracks, [Arrived(report(10, 10, 2, 250.0), 161.0)])
    assert reason.startswith("target_range_m: 250.0 m where ")
    before = view_of(tracks, now_s=161.0)
    assert math.hypot(before.east_m - TAG[0], before.north_m - TAG[1]) < 2.0
    # Now it really is somewhere else: after a few the filter is begun anew.
    elsewhere = np.array([-20.0, 55.0, 3.0])
    reasons = told(tracks, around(80, 162.0, elsewhere))
    assert ECHOES - 2 <= sum(map(bool, reasons)) <= 3 * ECHOES
    after = view_of(tracks, now_s=242.0)
    assert math.hypot(after.east_m - elsewhere[0], after.north_m - elsewhere[1]) < 3.0
    assert not after.in_area


def test_a_range_that_comes_too_late_is_refused_and_a_little_late_one_is_used() -> None:
    tracks = tracking()
    told(tracks, around(10))
    place = np.array([10.0, 10.0, 2.0])
    late, little = told(tracks, [heard(place, 109.0 - LATEST_S - 1.0), heard(place, 109.0 - LATEST_S + 1.0)])
    assert "time_s: measured 6 s before the newest range used" in late
    assert little == ""


def test_names_that_modems_use_lead_to_targets_and_others_are_named() -> None:
    tracks = tracking()
    assert tracks.name_of("lbl-7") == "tag-2"
    assert tracks.name_of("tag-2") is None
    assert tracks.stranger("buoy") == "target: 'buoy' is not among the targets of this mission (tag-1, lbl-7)"


ANY_RANGE = st.tuples(
    st.floats(-200, 200), st.floats(-200, 200), st.floats(-3, 40), st.floats(-10, 400), st.floats(-20, 300)
)


@given(st.lists(ANY_RANGE, max_size=25), st.integers(0, 25))
@settings(max_examples=40, deadline=None)
def test_whatever_comes_filters_stay_sound_and_a_restart_takes_them_up(
    rows: list[tuple[float, float, float, float, float]], cut: int
) -> None:
    """Any ranges in any order: covariances stay proper, every refusal has a reason, and memory plus replay is exact."""
    ranges = [Arrived(report(e, n, d, r, time_s=t), t) for e, n, d, r, t in rows]
    tracks, again = tracking(), tracking()
    first, _ = told(tracks, ranges[:cut]), again.recall(tracks.remember(7))
    rest = told(tracks, ranges[cut:])
    again.replay(ranges[cut:])
    known, other = tracks.known["tag-1"], again.known["tag-1"]
    np.testing.assert_array_equal(known.track.means, other.track.means)
    np.testing.assert_array_equal(known.track.covariances, other.track.covariances)
    assert (known.used, known.rejected, known.at_s) == (other.used, other.rejected, other.at_s)
    assert known.used == sum(reason == "" for reason in first + rest)
    assert known.used + known.rejected == len(rows)
    if known.track.known:
        assert np.isfinite(known.track.state).all()
        assert (np.linalg.eigvalsh(known.track.covariance) > -1e-9).all()
    if ranges[:cut]:
        assert again.recall(tracks.remember(9)) == 9


@given(st.floats(0.1, 50), st.floats(0.1, 50), st.floats(0, math.pi))
@settings(max_examples=40, deadline=None)
def test_the_ellipse_holds_95_percent(a: float, b: float, turn: float) -> None:
    axes = np.array([[math.sin(turn), math.cos(turn)], [math.cos(turn), -math.sin(turn)]]).T
    found = ellipse(axes @ np.diag([a**2, b**2]) @ axes.T)
    assert found.semi_major_m == pytest.approx(2.4477 * max(a, b), rel=1e-3, abs=2e-3)
    assert found.semi_minor_m == pytest.approx(2.4477 * min(a, b), rel=1e-3, abs=2e-3)
    if abs(a - b) > 0.1 * a:
        expected = math.degrees(turn if a > b else turn + math.pi / 2) % 180.0
        off = abs(found.orientation_deg - expected) % 180.0
        assert min(off, 180.0 - off) < 0.2


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"targets": [{"name": "a"}]}, "'a' is the name of a vehicle already"),
        ({"targets": [{"name": "t"}, {"name": "u", "acoustic_name": "t"}]}, "'t' is the name of target 't' already"),
        ({"targets": [{"name": "t", "min_depth_m": 9, "max_depth_m": 3}]}, "max_depth_m must be larger"),
        ({"targets": [{"name": "t", "depth": 9}]}, "Extra inputs are not permitted"),
    ],
)
def test_targets_that_cannot_be_are_refused_with_what_would_be_right(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        spec_with(**changes)


def test_who_is_passed_close_by_stays_where_it_is_known() -> None:
    """From afar its depth is not told; the range of a vehicle that is near is of that size."""
    tracks = tracking(limits={"max_depth_m": 30.0})
    from_afar = [
        heard(np.array([TAG[0] + 80 * math.cos(0.3 * k), TAG[1] + 80 * math.sin(0.3 * k), 6.0]), 100.0 + k)
        for k in range(60)
    ]
    told(tracks, from_afar)
    before = view_of(tracks)
    assert before.sd_depth_m is not None
    assert before.sd_depth_m > 5.0
    assert told(
        tracks, [heard(TAG + np.array([7.0, 0.0, -2.0]), 160.5), heard(TAG + np.array([2.0, 1.0, -2.0]), 162.0)]
    ) == ["", ""]
    after = view_of(tracks, now_s=162.0)
    assert after.state in {TargetState.UNCERTAIN, TargetState.ACCURATE}
    assert math.hypot(after.east_m - TAG[0], after.north_m - TAG[1]) < 2.0
    assert max(after.sd_east_m or math.inf, after.sd_north_m or math.inf) < 2.0
    assert (after.sd_depth_m or math.inf) < 0.6 * before.sd_depth_m


def test_speed_and_course_are_told_once_ranges_tell_them() -> None:
    tracks = tracking()
    told(tracks, around(3))
    early = view_of(tracks, now_s=103.0)
    assert (early.speed_mps, early.course_deg) == (None, None)
    assert early.east_m is not None
    told(tracks, around(120, 103.0))
    still = view_of(tracks, now_s=223.0)
    assert still.speed_mps is not None
    assert still.speed_mps < 0.1
    assert still.course_deg is None


def test_the_course_of_a_target_that_moves_is_told() -> None:
    tracks = tracking()
    places = [np.array([30 + 22 * math.cos(k), 30 + 22 * math.sin(k), 2.0 + 5.0 * (k % 2)]) for k in range(150)]
    told(tracks, [heard(place, 100.0 + k, TAG + np.array([0.25 * k, 0.0, 0.0])) for k, place in enumerate(places)])
    moving = view_of(tracks, now_s=249.0)
    assert moving.speed_mps == pytest.approx(0.25, abs=0.06)
    assert moving.course_deg == pytest.approx(90.0, abs=15.0)
