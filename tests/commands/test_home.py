"""What ``bathyfleet evaluate home`` flies, and what it says of missions that were flown."""

from typing import Any

import numpy as np
import pytest

from app.commands import home, home_watch
from app.commands.home import drawn, fly_mission, summary, wrong_with
from app.commands.home_watch import Seen, leads_on
from app.missions.fleet.interface import Position, WaypointOrder, WaypointStatus
from app.missions.settings import SimulationSettings
from app.missions.spec.vehicle import VehicleSpec
from app.missions.team import Team
from tests.support.missions.harbour import sim_spec
from tests.support.missions.specs import lon_lat


def vehicle(from_point_m: float | None, energy_left_pct: float | None, surveyed_pct: float | None) -> dict[str, Any]:
    return {"from_point_m": from_point_m, "energy_left_pct": energy_left_pct, "surveyed_pct": surveyed_pct}


def mission(*vehicles: dict[str, Any], **other: Any) -> dict[str, Any]:
    flown = {
        "seed": 3,
        "current_mps": 0.05,
        "state": "finished",
        "vehicles": {f"v{k}": vehicle for k, vehicle in enumerate(vehicles)},
        "links_lost": 1,
        "zones_entered": 0,
        "zones_drifted_into": 1,
        "too_close": 0,
        "touched": 0,
        "touched_before": 1,
        "closest_m": 7.0,
    } | other
    return flown | {"wrong": wrong_with(flown)}


GOOD = vehicle(4.0, 12.0, 95.0)


def test_who_is_far_off_or_never_arrived_is_not_home() -> None:
    flown = [
        mission(GOOD, vehicle(25.1, 3.0, 96.0), closest_m=6.0),
        mission(vehicle(None, None, None), state="running", closest_m=None),
    ]
    assert summary(flown, still=False) == {
        "missions": 2,
        "vehicles": 3,
        "home_pct": 33.33,
        "median_m": 14.6,
        "worst_m": 25.1,
        "median_energy_pct": 3.0,
        "least_energy_pct": 0.0,
        "survey_share_pct": 95.5,
        "least_survey_share_pct": 95.0,
        "survey_share_in_still_water_pct": 95.5,
        "vehicles_in_still_water": 2,
        "links_lost": 2,
        "zones_entered": 0,
        "zones_drifted_into": 2,
        "too_close": 0,
        "touched": 0,
        "touched_before": 2,
        "closest_m": 6.0,
        "wrong": [
            "seed 3: v1 is 25.1 m from its recovery point",
            "seed 3: the mission is running",
            "seed 3: v0 is not home",
        ],
    }


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, None),
        ({"zones_entered": 1}, "in a keep-out zone: 1"),
        ({"too_close": 2}, "too close to each other on the way home: 2"),
        ({"touched": 1}, "touched each other on the way home: 1"),
        ({"vehicles": {"a": vehicle(1.0, 0.0, 90.0)}}, "a has no energy left"),
    ],
)
def test_everything_that_coming_home_asks_for_is_checked(changes: dict[str, Any], words: str | None) -> None:
    flown = mission(GOOD) | changes
    assert wrong_with(flown) == ([] if words is None else [words])


def test_in_still_water_most_of_the_energy_has_to_be_used_for_the_survey() -> None:
    flown = [mission(vehicle(4.0, 12.0, 80.0))]
    assert summary(flown, still=False)["wrong"] == []
    assert summary(flown, still=True)["wrong"] == ["survey_share_pct is 80.0, at least 90 is asked for in still water"]
    assert summary([mission(GOOD)], still=True)["wrong"] == []


def test_ways_there_and_home_do_not_count_as_survey_nor_against_it() -> None:
    seen = Seen(surveys_at_pct=95.0, turned_at_pct=25.0, home_at_pct=10.0, why="its energy lasts no longer")
    assert seen.surveyed_pct == pytest.approx(100.0 * 70.0 / 80.0)
    seen.why = "called home"
    assert seen.surveyed_pct is None


def test_circling_is_no_survey() -> None:
    seen = Seen(surveys_at_pct=95.0, turned_at_pct=25.0, home_at_pct=10.0, waited_pct=20.0, why="its energy")
    assert seen.surveyed_pct == pytest.approx(100.0 * 50.0 / 80.0)
    member = Team().join(VehicleSpec.model_validate({"name": "a", "kind": "sim"}), 0)
    assert not leads_on(member), "it has no leg"
    order = WaypointOrder("m1", 1, "a", Position(41.0, -8.0, 2.0), 1.3, 3.0, 2.0)
    for start_m, leads in (((0.0, 0.0), True), ((20.0, 0.0), False)):
        member.set_order(order, np.array([20.0, 0.0]))
        member.status, member.leg.start_m = WaypointStatus.SENT, np.array(start_m)
        assert leads_on(member) is leads


def test_the_share_in_still_water_is_told_by_itself() -> None:
    flown = [mission(GOOD), mission(vehicle(4.0, 12.0, 60.0), current_mps=0.4)]
    told = summary(flown, still=False)
    assert told["survey_share_in_still_water_pct"] == 95.0
    assert told["vehicles_in_still_water"] == 1


def test_missions_follow_from_their_seed() -> None:
    assert drawn(7, still=False) == drawn(7, still=False)
    assert drawn(7, still=False) != drawn(8, still=False)
    _, sea, _ = drawn(7, still=True)
    assert sea.current_mps == (0.0, 0.0)
    assert [drawn(seed, still=False)[1].consumption_factor for seed in range(5)] == [1.0, 1.0, 1.0, 1.0, 1.3]


@pytest.mark.slow
def test_everybody_comes_home_although_links_are_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(home, "WITHIN_REACH_S", (15.0, 40.0))
    monkeypatch.setattr(home, "OUT_OF_REACH_S", (5.0, 30.0))
    spec = sim_spec("a", "b", side_m=60.0, steps=8, recovery={"point": lon_lat(30.0, -40.0)})
    flown = fly_mission(spec, SimulationSettings(current_mps=(0.1, 0.0)), None, 1, 20.0)
    assert flown["wrong"] == [], flown
    assert flown["links_lost"] > 0
    assert flown["minutes"] > 2.0
    assert len(flown["vehicles"]) == 2
    assert all(vehicle["from_point_m"] <= 25.0 for vehicle in flown["vehicles"].values())


@pytest.mark.slow
def test_who_has_energy_for_the_legs_it_has_and_no_further_one_keeps_nobody_busy() -> None:
    """It was looked at and decided for without a pause meanwhile: here time stood still, elsewhere others waited."""
    vehicles = [{"name": "a", "kind": "sim", "endurance_min": 5.0}, {"name": "b", "kind": "sim", "endurance_min": 7.0}]
    spec = sim_spec(side_m=60.0, steps=1000, recovery={"point": lon_lat(30.0, -40.0)}, vehicles=vehicles)
    found = fly_mission(spec, SimulationSettings(), None, 0, 20.0)
    assert found["wrong"] == [], found
    assert all("energy" in vehicle["why"] for vehicle in found["vehicles"].values())


def test_vehicles_that_the_end_takes_out_count_where_they_were_seen_last(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(home_watch, "TICK_S", 0.5)  # ten seconds of the vehicle's time
    spec = sim_spec("a", side_m=60.0, steps=2, recovery={"point": lon_lat(30.0, -10.0)})
    found = fly_mission(spec, SimulationSettings(), None, 0, 20.0)
    assert found["state"] == "finished"
    assert found["vehicles"]["a"]["from_point_m"] < 40.0
