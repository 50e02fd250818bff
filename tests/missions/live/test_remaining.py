"""What is left of a mission, in minutes and kilometres."""

from typing import Any

import pytest

from app.missions.live.remaining import Remaining, left_words, remaining
from app.missions.spec.failsafes import Response
from app.missions.spec.mission import MissionSpec
from app.missions.team import Team, Withdrawal
from tests.support.missions.specs import spec_json

FAST_AND_SLOW = [{"name": "fast", "kind": "rest", "speed_mps": 2.0}, {"name": "slow", "kind": "rest", "speed_mps": 1.0}]


def described(**length: Any) -> tuple[MissionSpec, Team]:
    values = spec_json(vehicles=FAST_AND_SLOW)
    del values["steps"]
    spec, team = MissionSpec.model_validate(values | length), Team()
    for slot, vehicle in enumerate(spec.vehicles):
        team.join(vehicle, slot)
    return spec, team


def test_before_the_start_the_whole_budget_is_left() -> None:
    assert remaining(*described(budget={"minutes": 30})) == Remaining(30.0, 3.6)
    assert remaining(*described(budget={"km_per_vehicle": 0.9})) == Remaining(15.0, 0.9)
    assert remaining(*described(steps=40)) == Remaining(None, None)


@pytest.mark.parametrize("length", [{"budget": {"minutes": 30}}, {"steps": 40}])
def test_under_way_it_is_what_the_vehicle_with_most_has(length: dict[str, Any]) -> None:
    spec, team = described(**length)
    for member, left_m in zip(team, (600.0, 450.0), strict=True):
        member.flown.left_m = left_m
    assert remaining(spec, team) == Remaining(7.5, 0.6)


@pytest.mark.parametrize(("response", "left"), [(Response.RETURN, 3.0), (Response.HOLD, 10.0)])
def test_what_a_vehicle_leaves_that_goes_home_does_not_count(response: Response, left: float) -> None:
    spec, team = described(budget={"minutes": 30})
    fast, slow = team
    fast.flown.left_m, slow.flown.left_m = 1200.0, 180.0
    fast.withdrawal = Withdrawal(response, "asked by Ana", asked=True)
    assert remaining(spec, team).minutes == left


def test_without_vehicles_nothing_is_known() -> None:
    spec, _ = described(budget={"minutes": 30})
    assert remaining(spec, Team()) == Remaining(None, None)


@pytest.mark.parametrize(
    ("length", "words", "left"),
    [
        ({"budget": {"minutes": 12}}, ": fast 7 min before its time was up; slow never surveyed", 7.0),
        ({"budget": {"km_per_vehicle": 1.2}}, ": fast 0.8 km before it had flown its way; slow never surveyed", 7.0),
    ],
)
def test_when_nobody_goes_on_each_vehicle_is_told_of(length: dict[str, Any], words: str, left: float) -> None:
    spec, team = described(**length)
    fast, slow = team
    for member in team:
        member.withdrawal = Withdrawal(Response.RETURN, "its energy lasts 160 s for sure")
    fast.flown.survey_s, fast.flown.left_m, slow.flown.left_m = 300.0, 840.0, None
    assert left_words(spec, team) == words
    assert remaining(spec, team).minutes == left
    fast.flown.left_m = 0.0
    assert left_words(spec, team) == ": slow never surveyed"


def test_of_a_mission_in_steps_no_length_is_told() -> None:
    assert left_words(*described(steps=40)) == ""
