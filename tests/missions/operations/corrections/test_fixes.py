"""How far off a vehicle was at a fix that came between two of its positions."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.missions.errors import InvalidRequestError
from app.missions.operations.corrections.fixes import jumps, reckoned_at, sent_fixes
from app.missions.views.measurements.adjustment import FixRequest
from tests.support.missions.specs import FRAME, lon_lat

SPEED_MPS = 1.5


def straight(every_s: float, until_s: float = 120.0) -> np.ndarray:
    """Positions of a vehicle that goes east from the origin."""
    time_s = np.arange(0.0, until_s + 0.5 * every_s, every_s)
    return np.column_stack([time_s, SPEED_MPS * time_s, np.zeros_like(time_s), np.full_like(time_s, 0.2)])


def fix_at(time_s: float, east_m: float, north_m: float = 0.0, **more: Any) -> FixRequest:
    lon, lat = lon_lat(east_m, north_m)
    return FixRequest(vehicle="a", time_s=time_s, lat_deg=lat, lon_deg=lon, sd_m=0.5, **more)


@given(st.sampled_from([1.0, 5.0, 10.0, 25.0]), st.floats(30.0, 119.0), st.booleans())
def test_a_vehicle_that_reckons_right_is_not_off(every_s: float, time_s: float, resets: bool) -> None:
    track = straight(every_s)
    [(_, (at_s, east_m, north_m, sd_m, again))] = sent_fixes(
        [fix_at(time_s, SPEED_MPS * time_s, resets=resets)], {"a": track}, {"a": track}, FRAME
    )
    assert (at_s, again) == (time_s, resets)
    assert abs(east_m) < 0.01
    assert abs(north_m) < 0.01
    assert sd_m >= 0.5


def test_what_is_less_sure_counts_less() -> None:
    track = straight(10.0)
    _, at_it = reckoned_at(track, 60.0, resets=True)
    _, soon = reckoned_at(track, 61.0, resets=True)
    _, late = reckoned_at(track, 69.0, resets=True)
    _, between = reckoned_at(track, 65.0, resets=False)
    assert at_it == 0.0 < soon < late
    assert between < late


def test_a_place_where_it_sounded_counts_where_no_position_is_near() -> None:
    """It turned round after its last position: only its soundings know."""
    told, sounded = straight(10.0, 50.0), straight(1.0)
    sounded[sounded[:, 0] > 50.0, 1] = SPEED_MPS * (100.0 - sounded[sounded[:, 0] > 50.0, 0])
    [(_, (_, east_m, north_m, _, _))] = sent_fixes([fix_at(58.0, SPEED_MPS * 42.0)], {"a": told}, {"a": sounded}, FRAME)
    assert (east_m, north_m) == pytest.approx((0.0, 0.0), abs=0.01)


def test_who_reckons_on_from_a_fix_is_not_taken_for_where_it_is_told_to_be() -> None:
    """From 60 s on it is 8 m to the north."""
    track = straight(10.0)
    track[track[:, 0] > 55.0, 2] = 8.0
    track = np.delete(track, 6, axis=0)
    [(_, (_, east_m, north_m, _, _))] = sent_fixes(
        [fix_at(59.0, SPEED_MPS * 59.0, 8.0)], {"a": track}, {"a": track}, FRAME
    )
    assert (east_m, north_m) == pytest.approx((0.0, -8.0), abs=0.01)


def test_a_jump_at_the_surface_is_a_fix_and_a_way_is_none() -> None:
    time_s = np.arange(0.0, 60.0, 5.0)
    east = 1.5 * time_s
    depth = np.where(time_s >= 30.0, 0.1, 5.0)
    track = np.column_stack([time_s, east, 0.0 * east, depth])
    assert jumps(track) == []
    track[time_s >= 40.0, 2] -= 40.0
    ((at_s, off_east, off_north, _, resets),) = jumps(track)
    assert (at_s, resets) == (35.0, True)
    np.testing.assert_allclose((off_east, off_north), (0.0, 40.0), atol=1e-9)
    track[:, 3] = 5.0
    assert jumps(track) == []  # under water it is no fix


@pytest.mark.parametrize(("lat", "lon"), [(10.0, -8.7), (41.18, 171.0), (90.0, 0.0)])
def test_a_fix_that_is_nowhere_near_is_refused_by_its_name(lat: float, lon: float) -> None:
    far = FixRequest(vehicle="a", time_s=60.0, lat_deg=lat, lon_deg=lon)
    track = straight(5.0)
    with pytest.raises(InvalidRequestError) as refused:
        list(sent_fixes([fix_at(50.0, 75.0), far], {"a": track}, {"a": track}, FRAME))
    assert refused.value.field == "fixes.1.lat_deg"
