"""What operators are shown of vehicles."""

from dataclasses import replace

import numpy as np
import pytest

from app.missions.clock import now
from app.missions.fleet.interface import FleetEvent, LinkState, Position, VehicleInfo
from app.missions.flown import Phase
from app.missions.running.mission_views import mission_view
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
        member.committed.legs, member.flown.phase = 40, Phase.STOPPED
    live.team.members["b"].committed.legs = 39
    reasons = {vehicle.name: vehicle.reason for vehicle in live.vehicles.all()}
    waits = "it has flown all of the length that it was given, and waits for the others"
    assert (reasons["a"], reasons["b"] == waits) == (waits, False)

    # Nobody waits any more when the mission is over.
    live.team.members["a"].engaged = False
    assert {vehicle.reason == waits for vehicle in live.vehicles.all()} == {False}


async def test_once_its_mission_is_over_a_vehicle_is_shown_where_its_link_hears_it_until_another_one_takes_it(
    service: MissionService, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = await service.get((await service.create(sim_spec("a", side_m=60.0))).id)
    member = PlacedVehicles(live, service.hub, monkeypatch).put("a", (5.0, 5.0, 3.0), (50.0, 5.0, 3.0))
    assert member.report is not None
    member.heard_s = now().timestamp() - 100.0
    lat, lon = live.frame.to_geographic(np.array(20.0), np.array(5.0))
    drifted = replace(member.report, position=Position(float(lat), float(lon), 0.0))
    info = VehicleInfo("a", "sim", LinkState.READY, age_s=1.0, report=drifted)
    monkeypatch.setattr(service.hub, "infos", lambda: {member.key: info})

    def shown() -> tuple[float | None, float | None, float | None]:
        [view] = live.vehicles.all()
        return view.east_m, view.depth_m, view.age_s

    def ignore(_event: FleetEvent) -> None:
        """Of no interest here."""

    service.hub.claim(member.key, live.id, ignore, name="this one")
    assert shown()[:2] == (pytest.approx(5.0, abs=0.01), 3.0)
    service.hub.release(member.key, live.id)
    assert shown() == (pytest.approx(20.0, abs=0.01), 0.0, pytest.approx(1.0, abs=0.5))
    service.hub.claim(member.key, "another", ignore, name="the other one")
    assert shown() == (pytest.approx(5.0, abs=0.01), 3.0, pytest.approx(100.0, abs=1.0))


@pytest.mark.parametrize(
    ("told", "shown"),
    [
        ([None, None], None),
        ([(0.3, 0.0), None], (0.3, 90.0)),
        ([(-0.2, 0.0), (0.0, -0.2)], (0.141, 225.0)),
        ([(0.0, 0.0), None], (0.0, 0.0)),
        ([(-0.00001, 0.4), None], (0.4, 0.0)),
    ],
)
async def test_the_current_is_what_vehicles_tell_of_it_on_average_and_whither_it_goes(
    service: MissionService,
    monkeypatch: pytest.MonkeyPatch,
    told: list[tuple[float, float] | None],
    shown: tuple[float, float] | None,
) -> None:
    live = await service.get((await service.create(sim_spec("a", "b", side_m=60.0))).id)
    placed = PlacedVehicles(live, service.hub, monkeypatch)
    assert mission_view(live).current is None
    for name, current_mps in zip(("a", "b"), told, strict=True):
        member = placed.put(name, (5.0, 5.0, 3.0), (50.0, 5.0, 3.0))
        assert member.report is not None
        member.report = replace(member.report, current_mps=current_mps)
    current = mission_view(live).current
    assert (None if current is None else (current.speed_mps, current.toward_deg)) == shown
    assert live.vehicles.message().current == current
