"""References stay off the bottom."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imc_bridge.control.altitude_guard import AltitudeGuard, DepthLimit
from imc_bridge.control.seabed import CELL_M, Seabed
from imc_bridge.distances import distance_m
from imc_bridge.events import BottomPoint

LAT, LON = 41.185, -8.705
NORTH_100_M = 100.0 / 111_000.0


EAST_M = 1.0 / (111_194.9 * math.cos(math.radians(LAT)))
"""Degrees of longitude per metre."""


def guard_over(*depths_m: float, lat: Any = LAT, lon: Any = LON, at_s: float = 0.0, now: float = 0.0) -> AltitudeGuard:
    guard = AltitudeGuard(radius_m=20.0, window_s=30.0, unknown_bottom_depth_m=2.0)
    for depth in depths_m:
        guard.add(at_s, lat, lon, depth, now)
    return guard


def limit(
    guard: AltitudeGuard, asked_m: float, min_altitude_m: float = 3.0, at_s: float = 1.0, **kwargs: Any
) -> DepthLimit:
    return guard.limit(asked_m, min_altitude_m, at_s, LAT, LON, **kwargs)


def east(metres: float) -> tuple[float, float]:
    return LAT, LON + metres * EAST_M


def test_depth_above_the_clearance_is_left_alone() -> None:
    assert limit(guard_over(*[20.0] * 20), 10.0) == limit(guard_over(*[20.0] * 20), 10.0)
    assert limit(guard_over(*[20.0] * 20), 10.0).depth_m == 10.0
    assert limit(guard_over(*[20.0] * 20), 10.0).reason == ""


def test_depth_below_the_clearance_is_raised_and_explained() -> None:
    limited = limit(guard_over(*[10.0] * 20), 9.0)
    assert limited.depth_m == 7.0
    assert "3 m above the bottom measured at 10.0 m" in limited.reason


@pytest.mark.parametrize(
    "guard",
    [guard_over(), guard_over(*[9.0] * 20, lat=LAT + NORTH_100_M), guard_over(*[9.0] * 20, at_s=-100.0, now=-4000.0)],
    ids=["nothing measured", "measured elsewhere", "measured before the tide changed"],
)
def test_unknown_bottom_keeps_the_vehicle_shallow(guard: AltitudeGuard) -> None:
    assert limit(guard, 9.0).depth_m == 2.0
    assert "no bottom measured" in limit(guard, 9.0).reason
    assert limit(guard, 1.0).depth_m == 1.0


def test_one_false_echo_does_not_lift_the_vehicle_but_three_in_a_row_do() -> None:
    assert limit(guard_over(*[20.0] * 30, 1.0), 10.0).depth_m == 10.0
    assert limit(guard_over(*[20.0] * 30, 5.0, 5.0, 5.0), 10.0).depth_m == 2.0


def test_water_shallower_than_the_clearance_means_the_surface() -> None:
    assert limit(guard_over(*[2.0] * 20), 5.0).depth_m == 0.0


@given(st.lists(st.floats(0.5, 100.0), min_size=1, max_size=200), st.floats(-5.0, 100.0), st.floats(0.0, 20.0))
def test_limit_is_never_deeper_than_asked_nor_than_the_shallowest_confirmed_bottom(
    depths: list[float], asked: float, clearance: float
) -> None:
    limited = limit(guard_over(*depths), asked, clearance)
    assert 0.0 <= limited.depth_m <= max(asked, 0.0)
    assert limited.depth_m <= max(max(depths[-3:]) - clearance, 0.0)


def test_what_was_measured_a_while_ago_is_still_the_bottom() -> None:
    assert limit(guard_over(*[9.0] * 20, at_s=-100.0), 9.0).depth_m == 6.0


def test_shoal_on_the_way_that_another_vehicle_has_found_counts_at_once() -> None:
    seabed = Seabed()
    guard = AltitudeGuard(20.0, 30.0, 2.0, seabed)
    for _ in range(10):
        guard.add(0.0, LAT, LON, 20.0)
    assert limit(guard, 15.0, towards=[east(150)]).depth_m == 15.0
    for _ in range(2):
        seabed.add(0.0, *east(100), 8.0)
    limited = limit(guard, 15.0, towards=[east(150)])
    assert limited.depth_m == 5.0
    assert "measured on the way at 8.0 m" in limited.reason
    assert limit(guard, 15.0, towards=[east(60)]).depth_m == 15.0
    assert limit(guard, 15.0, towards=[east(60), east(130)]).depth_m == 5.0


@pytest.mark.parametrize("lat", [0.0, 41.185, -33.9, 60.4, 78.2])
@pytest.mark.parametrize("first", [None, (0.0, 0.0), (80.0, 10.0)])
def test_a_corridor_is_as_wide_wherever_the_first_sounding_was(lat: float, first: tuple[float, float] | None) -> None:
    east_m, north_m, lon = 1.0 / (111_194.9 * math.cos(math.radians(lat))), 1.0 / 111_194.9, 151.3
    seabed = Seabed()
    if first is not None:
        seabed.add(0.0, *first, 30.0)
    for _ in range(2):
        seabed.add(0.0, lat, lon, 8.0)
    for off_m, found in ((9.0, 8.0), (-9.0, 8.0), (21.0, None), (-21.0, None)):
        along = [(lat + north * north_m, lon + off_m * east_m) for north in (-50.0, 50.0)]
        assert seabed.shallowest(0.0, along[0], along[1], 10.0) == found
        across = [(lat + off_m * north_m, lon + east * east_m) for east in (-50.0, 50.0)]
        assert seabed.shallowest(0.0, across[0], across[1], 10.0) == found


def test_a_lonely_echo_is_confirmed_by_one_in_the_next_row() -> None:
    for lat in (-60.4, 41.185, 78.2):
        for east in range(12):
            east_m, lon = 1.0 / (111_194.9 * math.cos(math.radians(lat))), 179.0
            seabed, place = Seabed(), (lat, lon + east * east_m)
            seabed.add(0.0, *place, 4.0)
            seabed.add(0.0, lat + 5.0 / 111_194.9, place[1], 5.0)
            assert seabed.shallowest(0.0, place, place, 10.0) == 4.0


def test_one_false_echo_ahead_does_not_count_and_a_second_one_beside_it_does() -> None:
    guard = guard_over(*[20.0] * 10)
    guard._seabed.add(0.0, *east(60), 4.0)
    assert limit(guard, 15.0, towards=[east(80)]).depth_m == 15.0
    guard._seabed.add(0.0, *east(60 + CELL_M), 5.0)
    assert limit(guard, 15.0, towards=[east(80)]).depth_m == 1.0


def test_mapped_bottom_on_the_way_counts_and_beside_it_does_not() -> None:
    guard = guard_over(*[20.0] * 10)
    shoal = BottomPoint(*east(70), 9.0)
    limited = limit(guard, 15.0, towards=[east(100)], mapped=[shoal])
    assert limited.depth_m == 6.0
    assert "mapped on the way at 9.0 m" in limited.reason
    north = BottomPoint(LAT + NORTH_100_M, LON, 9.0)
    assert limit(guard, 15.0, towards=[east(100)], mapped=[north]).depth_m == 15.0


def test_mapped_bottom_under_the_vehicle_makes_it_known() -> None:
    guard = guard_over()
    assert limit(guard, 15.0, towards=[east(50)]).depth_m == 2.0
    charted = [BottomPoint(*east(metres), 20.0) for metres in range(0, 60, 5)]
    assert limit(guard, 15.0, towards=[east(50)], mapped=charted).depth_m == 15.0


def test_rising_bottom_is_expected_to_go_on_rising() -> None:
    guard = guard_over()
    for k in range(15):
        guard.add(0.1 * k, *east(k - 14), 20.0 - 0.5 * k)
    limited = limit(guard, 15.0, at_s=2.0)
    assert limited.depth_m < 13.0 - 3.0 - 4.0


def test_falling_bottom_gives_no_credit() -> None:
    guard = guard_over()
    for k in range(15):
        guard.add(0.1 * k, *east(k - 14), 10.0 + 0.5 * k)
    assert limit(guard, 30.0, at_s=2.0).depth_m <= 17.0 - 3.0


@given(
    st.lists(st.tuples(st.floats(-30.0, 130.0), st.floats(-30.0, 30.0), st.floats(1.0, 50.0)), min_size=1, max_size=60),
    st.floats(1.0, 120.0),
    st.floats(0.0, 60.0),
)
def test_no_reference_is_deeper_than_any_twice_measured_place_on_its_way(
    places: Any, length: float, asked: float
) -> None:
    seabed = Seabed()
    guard = AltitudeGuard(20.0, 30.0, 2.0, seabed)
    for x, y, depth in places:
        for _ in range(2):
            seabed.add(0.0, LAT + y / 111_194.9, LON + x * EAST_M, depth)
    limited = limit(guard, asked, towards=[east(length)])
    on_the_way = [d for x, y, d in places if -5.0 <= x <= length + 5.0 and abs(y) <= 5.0]
    # Two readings confirm each other; of many in one cell some may be false.
    crowded = len({(x // CELL_M, y // CELL_M) for x, y, _ in places}) < len(places)
    if on_the_way and not crowded:
        assert limited.depth_m <= max(min(on_the_way) - 3.0, 0.0) + 1e-9


def test_seabed_stays_small_and_distances_are_metres() -> None:
    seabed = Seabed()
    for k in range(50):
        for _ in range(40):
            seabed.add(0.0, *east(CELL_M * k), 10.0)
    assert len(seabed) in (49, 50, 51)
    assert distance_m(east(0), east(100)) == pytest.approx(100.0, rel=0.01)
