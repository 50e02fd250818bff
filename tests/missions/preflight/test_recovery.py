"""What the checklist says of the way home."""

import pytest

from app.missions.preflight.recovery import recovery_checks
from app.missions.service import MissionService
from tests.support.missions.harbour import sim_spec


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
