"""What operators are shown of vehicles."""

import pytest

from app.missions.flown import Phase
from app.missions.service import MissionService
from tests.support.missions.harbour import sim_spec
from tests.support.missions.placed import PlacedVehicles


async def test_a_vehicle_that_has_flown_its_length_says_that_it_waits_for_the_others(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = await service.get((await service.create(sim_spec("a", "b", side_m=60.0, steps=40))).id)
    placed = PlacedVehicles(live, service.hub, monkeypatch)
    for name in ("a", "b"):
        member = placed.put(name, (5.0, 5.0, 3.0), (50.0, 5.0, 3.0))
        member.legs, member.flown.phase = 40, Phase.STOPPED
    live.team.members["b"].legs = 39
    reasons = {vehicle.name: vehicle.reason for vehicle in live.vehicles.all()}
    waits = "it has flown all of the length that it was given, and waits for the others"
    assert (reasons["a"], reasons["b"] == waits) == (waits, False)

    # Nobody waits any more when the mission is over.
    live.team.members["a"].engaged = False
    assert {vehicle.reason == waits for vehicle in live.vehicles.all()} == {False}
