"""What the checklist and the log say of other missions in the same place."""

from typing import Any

import pytest

from app.missions.operations.history import events_after
from app.missions.preflight.survey import preflight
from app.missions.service import MissionService
from app.missions.spec.mission import MissionSpec
from tests.support.missions.harbour import act, sim_spec
from tests.support.missions.specs import spec_json


def rest_spec(vehicle: str, **changes: Any) -> MissionSpec:
    return MissionSpec.model_validate(spec_json(vehicles=[{"name": vehicle, "kind": "rest"}], **changes))


@pytest.mark.parametrize(
    ("east_m", "simulated", "told"),
    [(0.0, False, True), (110.0, False, True), (200.0, False, False), (0.0, True, True)],
    ids=["the same area", "turns reach over", "beside", "simulated ones"],
)
async def test_missions_at_sea_in_the_same_place_are_told_of(
    service: MissionService, east_m: float, simulated: bool, told: bool
) -> None:
    name = "Already there"
    there = sim_spec("there", side_m=100.0, name=name) if simulated else rest_spec("there", side_m=100.0, name=name)
    ring = [[lon + east_m / 83_700.0, lat] for lon, lat in [*there.area.ring, there.area.ring[0]]]
    area = {"type": "Polygon", "coordinates": [ring]}
    first = await service.create(there)
    second = await service.get((await service.create(rest_spec("new", area=area))).id)
    assert not [check for check in preflight(second, await service.at_sea()).checks if check.title == "Other mission"]
    await act(service, first.id, "start")
    checks = [check for check in preflight(second, await service.at_sea()).checks if check.title == "Other mission"]
    assert [check.status for check in checks] == (["warning"] if told else [])
    await act(service, second.id, "start")
    said = [event.message for event in await events_after(second) if event.kind == "safety"]
    assert said == [check.message for check in checks]
    assert all(name in message and "not planned apart" in message for message in said)
