"""What ``bathyfleet evaluate home`` says of missions that were flown."""

from typing import Any

from app.commands.home import drawn, summary


def vehicle(from_point_m: float | None, energy_left_pct: float | None, surveyed_pct: float | None) -> dict[str, Any]:
    return {"from_point_m": from_point_m, "energy_left_pct": energy_left_pct, "surveyed_pct": surveyed_pct}


def mission(*vehicles: dict[str, Any]) -> dict[str, Any]:
    return {"vehicles": {str(k): vehicle for k, vehicle in enumerate(vehicles)}, "zones_entered": 1, "too_close": 2}


def test_who_is_far_off_or_never_arrived_is_not_home() -> None:
    flown = [mission(vehicle(4.0, 12.0, 90.0), vehicle(25.1, 3.0, 96.0)), mission(vehicle(None, None, None))]
    assert summary(flown) == {
        "missions": 2,
        "vehicles": 3,
        "home_pct": 33.33,
        "worst_m": 25.1,
        "least_energy_pct": 0.0,
        "survey_share_pct": 93.0,
        "least_survey_share_pct": 90.0,
        "zones_entered": 2,
        "too_close": 4,
    }


def test_missions_follow_from_their_seed() -> None:
    assert drawn(7, still=False) == drawn(7, still=False)
    assert drawn(7, still=False) != drawn(8, still=False)
    _, sea, _ = drawn(7, still=True)
    assert sea.current_mps == (0.0, 0.0)
    assert [drawn(seed, still=False)[1].consumption_factor for seed in range(5)] == [1.0, 1.0, 1.0, 1.0, 1.3]
