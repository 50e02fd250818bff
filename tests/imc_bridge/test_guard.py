"""References stay off the bottom."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imc_bridge.guard import AltitudeGuard

LAT, LON = 41.185, -8.705
NORTH_100_M = 100.0 / 111_000.0


def guard_over(*depths_m, lat=LAT, at_s=0.0):
    guard = AltitudeGuard(radius_m=20.0, window_s=30.0, unknown_bottom_depth_m=2.0)
    for depth in depths_m:
        guard.add(at_s, lat, LON, depth)
    return guard


def limit(guard, asked_m, min_altitude_m=3.0, at_s=1.0):
    return guard.limit(asked_m, min_altitude_m, at_s, LAT, LON)


def test_depth_above_the_clearance_is_left_alone():
    assert limit(guard_over(*[20.0] * 20), 10.0) == limit(guard_over(*[20.0] * 20), 10.0)
    assert limit(guard_over(*[20.0] * 20), 10.0).depth_m == 10.0
    assert limit(guard_over(*[20.0] * 20), 10.0).reason == ""


def test_depth_below_the_clearance_is_raised_and_explained():
    limited = limit(guard_over(*[10.0] * 20), 9.0)
    assert limited.depth_m == 7.0
    assert "3 m above the bottom measured at 10.0 m" in limited.reason


@pytest.mark.parametrize(
    "guard",
    [guard_over(), guard_over(*[9.0] * 20, lat=LAT + NORTH_100_M), guard_over(*[9.0] * 20, at_s=-100.0)],
    ids=["nothing measured", "measured elsewhere", "measured long ago"],
)
def test_unknown_bottom_keeps_the_vehicle_shallow(guard):
    assert limit(guard, 9.0).depth_m == 2.0
    assert "no bottom measured" in limit(guard, 9.0).reason
    assert limit(guard, 1.0).depth_m == 1.0


def test_one_false_echo_does_not_lift_the_vehicle_but_three_in_a_row_do():
    assert limit(guard_over(*[20.0] * 30, 1.0), 10.0).depth_m == 10.0
    assert limit(guard_over(*[20.0] * 30, 5.0, 5.0, 5.0), 10.0).depth_m == 2.0


def test_water_shallower_than_the_clearance_means_the_surface():
    assert limit(guard_over(*[2.0] * 20), 5.0).depth_m == 0.0


@given(st.lists(st.floats(0.5, 100.0), min_size=1, max_size=200), st.floats(-5.0, 100.0), st.floats(0.0, 20.0))
def test_limit_is_never_deeper_than_asked_nor_than_the_shallowest_confirmed_bottom(depths, asked, clearance):
    limited = limit(guard_over(*depths), asked, clearance)
    assert 0.0 <= limited.depth_m <= max(asked, 0.0)
    assert limited.depth_m <= max(max(depths[-3:]) - clearance, 0.0)
