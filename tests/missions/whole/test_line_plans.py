"""Whole missions along a line plan: every line is flown, the log calls it by its name, and the end says what is not."""

import csv
import io
from typing import Any

import pytest

from app.missions.operations.history import events_after
from app.missions.operations.maps.mission_maps import export
from app.missions.service import MissionService
from app.missions.states import MissionState
from tests.support.missions.harbour import act, sim_spec, until_state
from tests.support.missions.specs import lon_lat

LIMITS = {"max_step_m": 30.0, "max_depth_m": 2.0, "min_depth_m": 2.0}


def line(name: str, *corners_m: tuple[float, float]) -> dict[str, Any]:
    return {"name": name, "coordinates": [list(lon_lat(*corner)) for corner in corners_m]}


PLAN = [line(f"1{k:02}", (10.0 + 16.0 * k, 8.0), (10.0 + 16.0 * k, 92.0)) for k in range(6)]
PLAN.append(line("X1", (5.0, 50.0), (50.0, 55.0), (95.0, 50.0)))


def along(**changes: Any) -> Any:
    shape: dict[str, Any] = {
        "side_m": 100.0,
        "cell_m": 4.0,
        "limits": LIMITS,
        "planner": {"name": "lawnmower"},
        "budget": {"minutes": 90.0},
        "survey_lines": PLAN,
    }
    return sim_spec(**shape | changes)


@pytest.mark.slow
@pytest.mark.usefixtures("simulated_time")
async def test_a_mission_ends_when_the_lines_of_its_plan_are_flown_and_logs_them_by_name(
    service: MissionService,
) -> None:
    mission = (await service.create(along(recovery={"point": list(lon_lat(-10.0, -10.0))}))).id
    await act(service, mission, "start")
    await until_state(service, mission, MissionState.FINISHED)
    live = await service.get(mission)
    assert live.header.reason == "all lines are flown"
    flown_s = [member.flown.survey_s for member in live.team]
    lines_s = (6 * 84.0 + 90.6) / live.spec.speed_mps
    assert lines_s < sum(flown_s) < 2.5 * lines_s
    assert max(flown_s) - min(flown_s) < 0.6 * lines_s, "they are done at about the same time"
    told = [event.message for event in await events_after(live)]
    assert {f"{name} goes home: no line is left for it" for name in "ab"} <= set(told)
    made = await export(live, service.maps, service.settings.provider, service.compute, "lines.csv")
    rows = [*csv.DictReader(io.StringIO(made.content.whole().decode().partition("\n")[2]))]
    length_m = {one["name"]: 0.0 for one in PLAN}
    for row in rows:
        if row["planned_line"]:
            length_m[row["planned_line"]] += float(row["length_m"])
    assert all(length_m[one["name"]] >= 84.0 - 12.0 for one in PLAN[:6]), length_m
    assert sum(length_m.values()) < 1.5 * (6 * 84.0 + 90.6), "but for giving way none is flown twice"
    assert length_m["X1"] >= 75.0


@pytest.mark.slow
@pytest.mark.usefixtures("simulated_time")
async def test_lines_for_which_the_budget_is_too_short_are_named_at_the_end(service: MissionService) -> None:
    mission = (await service.create(along(budget={"km_per_vehicle": 0.15}))).id
    await act(service, mission, "start")
    await until_state(service, mission, MissionState.FINISHED)
    reason = (await service.get(mission)).header.reason
    assert "km of lines are not flown: " in reason
    left = [one["name"] for one in PLAN if f"{one['name']} (" in reason]
    assert 2 <= len(left) < len(PLAN)
