"""What the checklist says of the way home."""

import pytest

from app.missions.fleet.interface import Position, VehicleReport
from app.missions.preflight.recovery import recovery_checks
from app.missions.service import MissionService
from app.missions.views.mission import CheckStatus
from tests.support.missions.harbour import sim_spec
from tests.support.missions.specs import lon_lat


@pytest.mark.parametrize(("radius_m", "told"), [(25.0, False), (12.0, True)])
async def test_it_says_when_vehicles_wait_farther_from_their_point_than_asked_for(
    service: MissionService, radius_m: float, told: bool
) -> None:
    spec = sim_spec("a", "b", "c", side_m=100.0).model_dump(mode="json", exclude={"steps"})
    lon, lat = spec["area"]["coordinates"][0][0]
    recovery = {"point": [lon + 3e-4, lat + 3e-4], "radius_m": radius_m}
    view = await service.create(type(sim_spec("a")).model_validate(spec | {"recovery": recovery}))
    checks = {check.id: check for check in recovery_checks(await service.get(view.id))}
    assert ("recovery.room" in checks) is told
    if told:
        words = checks["recovery.room"].message
        assert words == "3 vehicles wait up to 14 m from it, with 15 m between their places: recovery.radius_m is 12 m"


@pytest.mark.parametrize(("endurance_min", "surveys"), [(4.0, False), (60.0, True)])
async def test_a_vehicle_that_turns_home_before_its_first_line_is_a_problem(
    service: MissionService, endurance_min: float, surveys: bool
) -> None:
    away = lon_lat(-100.0, 15.0)
    spec = sim_spec("a", budget={"minutes": 12}, planner={"name": "lawnmower"}, recovery={"point": away})
    vehicles = [vehicle.model_copy(update={"endurance_min": endurance_min}) for vehicle in spec.vehicles]
    live = await service.get((await service.create(spec.model_copy(update={"vehicles": vehicles}))).id)
    (a,) = live.team
    lon, lat = away
    a.report = VehicleReport("a", 0.0, Position(lat, lon, 0.0))
    (check,) = [check for check in recovery_checks(live) if check.id == "recovery.a"]
    assert (check.status is CheckStatus.PROBLEM) is not surveys
    assert ("it turns home before its first line: its energy lasts " in check.message) is not surveys
