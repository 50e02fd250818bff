"""Vehicles wait apart at home, and go there at depths apart."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.missions.recovery.berths import berth_m, berth_spacing_m, farthest_m, home_of, is_home, layer_of, room_of_m
from app.missions.spec.mission import MissionSpec
from tests.support.missions.harbour import sim_spec
from tests.support.missions.specs import lon_lat

HOME_M = np.array([3.0, 4.0])


def spec_of(*kinds: str, **more: Any) -> MissionSpec:
    names = [f"v{k}" for k in range(len(kinds))]
    given_so = sim_spec(*names, side_m=200.0).model_dump(mode="json", exclude={"steps"})
    vehicles = [{"name": name, "kind": kind} for name, kind in zip(names, kinds, strict=True)]
    return MissionSpec.model_validate(given_so | {"vehicles": vehicles} | more)


@given(sharing=st.integers(2, 40), spacing_m=st.floats(1.0, 60.0))
def test_berths_are_a_spacing_apart_and_about_the_point(sharing: int, spacing_m: float) -> None:
    berths = [berth_m(HOME_M, slot, sharing, spacing_m) for slot in range(sharing)]
    assert min(float(np.hypot(*(a - b))) for a, b in combinations(berths, 2)) >= spacing_m * (1 - 1e-9)
    # Each takes the area of two triangles: no more than a disc of so many of them, and its rim.
    reach_m = spacing_m * (np.sqrt(sharing * np.sqrt(0.75) / np.pi) + 0.6)
    assert max(float(np.hypot(*(berth - HOME_M))) for berth in berths) <= reach_m


def test_who_is_alone_waits_at_the_point_itself() -> None:
    np.testing.assert_allclose(berth_m(HOME_M, 0, 1, 25.0), HOME_M)
    # One that joins later does not wait there, too.
    assert float(np.hypot(*(berth_m(HOME_M, 1, 1, 25.0) - HOME_M))) > 10.0


def test_vehicles_that_drift_about_their_berths_stay_a_separation_apart() -> None:
    spec = spec_of("imc", "imc", "imc")
    room_m, separation_m = room_of_m(spec.vehicles[0], spec), spec.limits.min_separation_m
    assert room_m >= 10.0, "DUNE's StationKeeping takes no less"
    assert berth_spacing_m(spec, spec.vehicles) - 2 * room_m == pytest.approx(separation_m)


@pytest.mark.parametrize(("kinds", "within"), [(("imc",) * 3, True), (("sim",) * 6, True), (("imc",) * 4, False)])
def test_as_many_as_there_is_room_for_wait_within_25_m(kinds: tuple[str, ...], within: bool) -> None:
    spec = spec_of(*kinds)
    assert (farthest_m(spec, range(len(kinds)), spec.vehicles) <= 25.0) is within


@pytest.mark.parametrize("declared", [0, 1])
def test_berths_are_as_far_apart_for_vehicles_that_joined_later(declared: int) -> None:
    recovery = {"point": lon_lat(50.0, 50.0)}
    whole = spec_of("imc", "imc", "imc", recovery=recovery)
    fewer = whole.model_copy(update={"vehicles": whole.vehicles[:declared]})
    berths = [home_of(vehicle, slot, fewer, whole.vehicles) for slot, vehicle in enumerate(whole.vehicles)]
    apart_m = min(float(np.hypot(*(a - b))) for a, b in combinations(berths, 2) if a is not None and b is not None)
    assert apart_m >= berth_spacing_m(whole, whole.vehicles) * (1 - 1e-9)


depths = st.lists(st.floats(1.0, 20.0), min_size=1, max_size=6).map(lambda d: {f"v{k}": x for k, x in enumerate(d)})


@given(cruise_m=depths, limit_m=st.floats(0.5, 30.0), spacing_m=st.floats(0.5, 3.0))
def test_nobody_goes_home_at_the_depth_of_another(cruise_m: dict[str, float], limit_m: float, spacing_m: float) -> None:
    deepest_m = max(cruise_m.values())
    allowed_m = min(limit_m, deepest_m)
    found = {name: layer_of(name, cruise_m, spacing_m).depth_m(allowed_m) for name in cruise_m}
    assert all(0.0 < found[name] <= min(cruise_m[name], allowed_m) for name in found)
    water_m = [min(depth_m, limit_m) / k for k, depth_m in enumerate(sorted(cruise_m.values()), 1)]
    least_m = min(spacing_m, *water_m)
    for a, b in combinations(found.values(), 2):
        assert abs(a - b) >= least_m * (1 - 1e-9)


def test_vehicles_that_are_apart_already_keep_their_depths() -> None:
    cruise_m = {"a": 3.0, "b": 2.0}
    assert [layer_of(name, cruise_m, 1.0).depth_m(3.0) for name in cruise_m] == [3.0, 2.0]
    assert [layer_of(name, cruise_m, 1.0).depth_m(2.0) for name in cruise_m] == [2.0, 1.0]
    assert [layer_of(name, {"a": 3.0, "b": 3.0}, 1.0).depth_m(3.0) for name in cruise_m] == [2.0, 3.0]


@pytest.mark.parametrize(
    ("place_m", "here_m", "home"),
    [
        ((8.0, 0.0), (24.0, 0.0), True),
        # 18 m from its place, and 26 m from the point.
        ((8.0, 0.0), (26.0, 0.0), False),
        ((8.0, 0.0), (-20.0, 0.0), True),
        # There is no room for its place within the radius.
        ((40.0, 0.0), (50.0, 0.0), True),
        ((40.0, 0.0), (10.0, 0.0), False),
    ],
)
def test_home_is_near_the_point_unless_ones_place_is_farther(
    place_m: tuple[float, float], here_m: tuple[float, float], home: bool
) -> None:
    assert is_home(np.array(here_m), np.array(place_m), np.zeros(2), 5.0, 25.0) is home
