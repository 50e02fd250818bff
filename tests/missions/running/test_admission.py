"""Limits that no team can keep to are refused with both fields and values; those that are only narrow are taken."""

from typing import Any

import pytest
from sqlalchemy import update

from app.exploration.pcao.model import default_model
from app.exploration.planner.options import PlannerOptions
from app.missions.errors import InvalidRequestError
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from app.storage.models import MissionRow
from tests.support.missions.harbour import Harbour, sim_spec
from tests.support.missions.specs import rectangle, spec_json


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        (
            {"arrival_radius_m": 8.0},
            "arrival_radius_m",
            "arrival_radius_m is 8 m and limits.max_step_m is 8 m: a leg would count as flown where it begins",
        ),
        (
            {"limits": {"max_step_m": 8.0, "com_range_m": 0.5}},
            "limits.com_range_m",
            "limits.com_range_m is 0.5 m and limits.min_separation_m is 5 m: no two vehicles",
        ),
        (
            {"limits": {"max_step_m": 8.0, "com_range_m": 4.0, "min_depth_m": 2.0, "max_depth_m": 2.5}},
            "limits.com_range_m",
            "limits.com_range_m is 4 m and limits.min_separation_m is 5 m: no two vehicles",
        ),
    ],
    ids=["arrives where it begins", "nowhere near enough", "not one above the other"],
)
async def test_limits_that_contradict_each_other_are_refused(
    service: MissionService, changes: dict[str, Any], field: str, words: str
) -> None:
    with pytest.raises(InvalidRequestError, match=words) as caught:
        await service.create(sim_spec("a", "b", **changes))
    assert caught.value.field == field
    assert await service.rows() == []


@pytest.mark.parametrize("planner", ["cao", "lawnmower", "rollout"])
async def test_a_trained_controller_is_refused_for_planners_that_do_not_fly_with_one(
    service: MissionService, planner: str
) -> None:
    """It was taken, and the mission flown without it."""
    options = {"model": default_model().model_dump(mode="json")}
    with pytest.raises(InvalidRequestError, match=f"planner '{planner}' does not fly with one") as caught:
        await service.create(sim_spec("a", planner={"name": planner, "options": options}))
    assert (caught.value.field, "only pcao" in str(caught.value.remedy)) == ("planner.options.model", True)
    assert (await service.create(sim_spec("a", planner={"name": "pcao", "options": options}))).state == "ready"


@pytest.mark.parametrize(
    ("planner", "options", "refused"),
    [
        ("lawnmower", {"rollouts": 5, "candidates": 9}, "candidates"),
        ("cao", {"rollouts": 5}, "rollouts"),
        ("spsa", {"candidates": 9}, "candidates"),
        ("random", {"accuracy_sd_m": 0.1}, "accuracy_sd_m"),
    ],
)
async def test_options_that_a_planner_does_not_read_are_refused_with_those_that_it_does(
    service: MissionService, planner: str, options: dict[str, Any], refused: str
) -> None:
    with pytest.raises(InvalidRequestError, match=f"planner '{planner}' has no option {refused}") as caught:
        await service.create(sim_spec("a", planner={"name": planner, "options": options}))
    assert caught.value.field == f"planner.options.{refused}"
    assert "cruise_depth_m" in caught.value.remedy
    assert refused not in caught.value.remedy
    assert await service.rows() == []


async def test_options_as_they_are_anyway_are_taken_for_any_planner(service: MissionService) -> None:
    """A mission that is read and sent again has them all."""
    options = PlannerOptions().model_dump(mode="json") | {"turn_radius_m": 6.0}
    assert await service.create(sim_spec("a", planner={"name": "lawnmower", "options": options}))


async def test_a_mission_that_was_stored_with_options_of_another_planner_opens(harbour: Harbour) -> None:
    mission = await harbour.service.create(sim_spec("a", planner={"name": "lawnmower"}))
    spec = (await harbour.service.get(mission.id)).spec.model_dump(mode="json")
    spec["planner"]["options"]["rollouts"] = 5
    async with harbour.database.writing() as session:
        await session.execute(update(MissionRow).where(MissionRow.id == mission.id).values(spec=spec))
    service = await harbour.reopen()
    assert (await service.get(mission.id)).spec.planner.options.rollouts == 5


async def test_a_mission_that_was_stored_with_a_controller_for_another_planner_opens(harbour: Harbour) -> None:
    mission = await harbour.service.create(sim_spec("a", planner={"name": "cao"}))
    spec = (await harbour.service.get(mission.id)).spec.model_dump(mode="json")
    spec["planner"]["options"]["model"] = default_model().model_dump(mode="json")
    async with harbour.database.writing() as session:
        await session.execute(update(MissionRow).where(MissionRow.id == mission.id).values(spec=spec))
    service = await harbour.reopen()
    assert (await service.get(mission.id)).spec.planner.options.model is not None


async def test_lines_too_close_for_an_area_are_refused_with_the_least_distance(service: MissionService) -> None:
    options = {"line_spacing_m": 0.5}
    vehicles = [{"name": "a", "kind": "sim"}]
    area = spec_json(2000.0, vehicles=vehicles, cell_m=10.0, planner={"name": "lawnmower", "options": options})
    with pytest.raises(InvalidRequestError, match=r"0\.5 m makes \d+ lines") as caught:
        await service.create(MissionSpec.model_validate(area))
    assert caught.value.field == "planner.options.line_spacing_m"
    assert caught.value.remedy.startswith("give at least 1")
    assert await service.rows() == []


@pytest.mark.parametrize(
    ("budget", "field", "words"),
    [
        ({"minutes": 0.001}, "budget.minutes", "0.001 comes to 0.078 m for each vehicle, and one with 3 m"),
        ({"km_per_vehicle": 0.001}, "budget.km_per_vehicle", "0.001 comes to 1 m for each vehicle, and one with 1 m"),
    ],
)
async def test_budgets_that_are_flown_before_anybody_moves_are_refused(
    service: MissionService, budget: dict[str, float], field: str, words: str
) -> None:
    """Such a mission ended as one that was flown, without a sounding."""
    with pytest.raises(InvalidRequestError, match=words) as caught:
        await service.create(sim_spec("a", "b", budget=budget))
    assert caught.value.field == field
    name = field.removeprefix("budget.")
    assert (await service.create(sim_spec("a", budget={name: 50 * budget[name]}))).state == "ready"


async def test_a_sonar_that_never_reaches_the_bottom_is_refused(service: MissionService) -> None:
    sonar = {"name": "a", "kind": "sim", "sensor": "multibeam", "sonar": {"range_m": 10.0}}
    with pytest.raises(
        InvalidRequestError, match=r"10 m does not reach the bottom from limits\.min_altitude_m"
    ) as caught:
        await service.create(sim_spec(vehicles=[sonar], limits={"min_altitude_m": 10.0}))
    assert caught.value.field == "vehicles.0.sonar.range_m"
    assert (await service.create(sim_spec(vehicles=[sonar], limits={"min_altitude_m": 9.0}))).state == "ready"


async def test_zones_that_leave_nothing_of_the_area_are_refused(service: MissionService) -> None:
    """Such a mission was taken, engaged its vehicles, and failed with its first leg."""
    zone = rectangle(6.0, 6.0, 54.0, 54.0)
    with pytest.raises(InvalidRequestError, match=r"margin of 10 m leave nothing of the area") as caught:
        await service.create(sim_spec("a", side_m=60.0, keep_out=[zone]))
    assert caught.value.field == "keep_out"
    narrow = {"max_step_m": 8.0, "keep_out_margin_m": 2.0}
    assert (await service.create(sim_spec("a", side_m=60.0, keep_out=[zone], limits=narrow))).state == "ready"


@pytest.mark.parametrize(
    "changes",
    [
        {"arrival_radius_m": 7.9},
        {"limits": {"max_step_m": 8.0, "com_range_m": 4.0}},
        {"limits": {"max_step_m": 8.0, "com_range_m": 5.1, "min_depth_m": 2.0, "max_depth_m": 2.0}},
    ],
    ids=["nearly a step", "one above the other", "side by side"],
)
async def test_narrow_limits_are_taken(service: MissionService, changes: dict[str, Any]) -> None:
    assert (await service.create(sim_spec("a", "b", **changes))).state == "ready"


@pytest.mark.parametrize(
    ("given", "radius_m"), [({"max_step_m": 2.0}, 1.0), ({"max_step_m": 5.9}, 2.95), ({"max_step_m": 50.0}, 3.0)]
)
def test_unless_asked_for_a_leg_is_not_flown_where_it_begins(given: dict[str, float], radius_m: float) -> None:
    assert sim_spec(limits=given).arrival_radius_m == pytest.approx(radius_m)
    assert sim_spec(limits=given, arrival_radius_m=1.9).arrival_radius_m == 1.9
