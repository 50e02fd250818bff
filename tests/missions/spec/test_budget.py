"""How long a mission is, by each of its units."""

from typing import Any

import pytest
from pydantic import ValidationError

from app.missions.spec.budget import MOST_STEPS, Allowance, Budget
from app.missions.spec.mission import MissionSpec
from tests.support.missions.searches import search_json
from tests.support.missions.specs import spec_json


def spec_with(**changes: Any) -> MissionSpec:
    """A mission with legs of 8 m at 1.3 m/s by default, and no length but the one that is given."""
    values = spec_json(**changes)
    if "steps" not in changes:
        values.pop("steps", None)
    return MissionSpec.model_validate(values)


FAST_AND_SLOW = [{"name": "fast", "kind": "rest", "speed_mps": 2.0}, {"name": "slow", "kind": "rest"}]


@pytest.mark.parametrize(
    ("given", "steps", "budget"),
    [
        ({}, 100, {"steps": 100}),
        ({"steps": 7}, 7, {"steps": 7}),
        ({"budget": {"steps": 7}}, 7, {"steps": 7}),
        ({"budget": {"steps": 7}, "steps": 7}, 7, {"steps": 7}),
        ({"budget": {"minutes": 10, "steps": None}}, 98, {"minutes": 10}),
        ({"budget": {"minutes": 10}, "vehicles": FAST_AND_SLOW}, 150, {"minutes": 10}),
        ({"budget": {"minutes": 10}, "vehicles": []}, 98, {"minutes": 10}),
        ({"budget": {"km_per_vehicle": 0.8}, "vehicles": FAST_AND_SLOW}, 100, {"km_per_vehicle": 0.8}),
        ({"budget": {"km_per_vehicle": 0.001}}, 1, {"km_per_vehicle": 0.001}),
        ({"budget": {"km_per_vehicle": 1000}, "limits": {"max_step_m": 1}}, MOST_STEPS, {"km_per_vehicle": 1000}),
    ],
)
def test_a_mission_has_both_its_budget_and_its_steps(given: dict[str, Any], steps: int, budget: dict[str, Any]) -> None:
    spec = spec_with(**given)
    assert spec.steps == steps
    shown = spec.model_dump(mode="json")
    assert shown["steps"] == steps
    assert shown["budget"] == budget


@pytest.mark.parametrize("budget", [{"minutes": 12.7}, {"km_per_vehicle": 1.1}, {"steps": 12}])
def test_what_is_shown_and_what_is_stored_is_the_same_mission_again(budget: dict[str, Any]) -> None:
    spec = spec_with(budget=budget, vehicles=FAST_AND_SLOW)
    assert MissionSpec.model_validate_json(spec.model_dump_json()) == spec
    assert MissionSpec.model_validate(spec.model_dump(mode="json", exclude={"steps"})) == spec


def test_what_an_earlier_version_stored_has_a_budget_in_steps() -> None:
    stored = spec_with(steps=12).model_dump(mode="json", exclude={"budget"})
    assert MissionSpec.model_validate(stored).budget == Budget(steps=12)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"budget": {}}, "nothing given: give exactly one of minutes, km_per_vehicle, steps"),
        ({"budget": {"minutes": 1, "steps": 2}}, "minutes and steps given"),
        ({"budget": {"steps": 5}, "steps": 6}, 'steps is 6 but budget, {"steps":5}, comes to 5'),
        ({"budget": {"minutes": 10}, "steps": 99}, "comes to 98: give one of them"),
        ({"budget": {"minutes": 0}}, "greater than 0"),
        ({"budget": {"minutes": 10_081}}, "less than or equal to 10080"),
        ({"budget": {"km_per_vehicle": 1001}}, "less than or equal to 1000"),
        ({"budget": {"hours": 1}}, "budget.hours"),
        ({"vehicles": [{"name": "a", "speed_mps": 0}]}, "greater than 0"),
        ({"vehicles": [{"name": "a", "speed_mps": 5.1}]}, "less than or equal to 5"),
        ({"vehicles": [{"name": "a", "turn_radius_m": 201}]}, "less than or equal to 200"),
    ],
)
def test_a_length_that_is_none_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError) as refused:
        spec_with(**given)
    assert words in str(refused.value)


def test_a_vehicle_flies_at_its_own_speed_for_as_long_as_the_others() -> None:
    spec = spec_with(budget={"minutes": 10}, vehicles=FAST_AND_SLOW)
    assert [spec.speed_of(name) for name in ("fast", "slow", "unknown")] == [2.0, 1.3, 1.3]
    assert spec.speed_of(spec.vehicles[0]) == 2.0
    assert spec.allowance("fast") == Allowance(metres=1200.0)
    assert spec.allowance("slow") == Allowance(metres=780.0)


def test_an_allowance_is_legs_or_metres_and_says_what_it_comes_to_in_both() -> None:
    by_way = spec_with(budget={"km_per_vehicle": 0.1}, vehicles=FAST_AND_SLOW).allowance("fast")
    assert by_way == Allowance(metres=100.0)
    assert (by_way.most_m(8.0), by_way.most_legs(8.0)) == (100.0, 13)
    by_legs = spec_with(steps=4).allowance("a")
    assert by_legs == Allowance(legs=4)
    assert (by_legs.most_m(8.0), by_legs.most_legs(8.0)) == (32.0, 4)


def test_a_search_has_its_time_window_and_steps_at_most() -> None:
    known = MissionSpec.model_validate(search_json())
    assert known.budget == Budget(steps=known.steps)
    assert MissionSpec.model_validate(search_json(budget={"steps": 9})).steps == 9
    with pytest.raises(ValidationError, match="leave budget out, or give it in steps"):
        MissionSpec.model_validate(search_json(budget={"minutes": 30}))
