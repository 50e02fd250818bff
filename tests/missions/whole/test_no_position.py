"""A vehicle that tells no position while it surveys: somebody is told, and it goes on when it can."""

import pytest

from app.missions.alarm_kinds import AlarmKind
from app.missions.errors import ConflictError
from app.missions.live.mission import LiveMission
from app.missions.operations.polling import waypoint
from app.missions.settings import ImcSettings
from app.missions.spec.vehicle import VehicleKind
from app.missions.states import MissionState
from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.floors.seafloors import generate
from tests.support.missions.harbour import Harbour, Rover, act, until_state, view_of
from tests.support.missions.specs import LAT, LON, make_spec
from tests.support.ports import free_ports
from tests.support.waiting import until

SPEED = 10.0


def told(live: LiveMission, vehicle: str) -> bool:
    return (AlarmKind.NO_POSITION, vehicle) in live.journal.alarms.standing([AlarmKind.NO_POSITION])


@pytest.mark.slow
async def test_a_vehicle_that_tells_no_position_comes_up_and_is_told_of_and_goes_on_with_its_mission(
    harbour_closed: Harbour,
) -> None:
    *announce_ports, port, base_port = free_ports(5)
    imc = ImcSettings(port=port, announce_ports=tuple(announce_ports), loopback_only=True)
    floor = generate("slope", 0, width_m=150.0, height_m=150.0, origin=(LAT, LON))
    specs = default_specs(1, floor, base_port=base_port)
    options = DuneOptions(announce_ports=tuple(announce_ports))
    async with DuneFleet(floor, specs, speed=SPEED, options=options) as fleet:
        service = await harbour_closed.open(imc=imc, time_scale=SPEED)
        (node,) = fleet.nodes
        await until(lambda: any(info.state.value == "ready" for info, _ in service.hub.vehicles()), "it is ready")
        spec = make_spec(150.0, vehicles=[{"name": node.name, "kind": "imc"}], steps=1000)
        mission_id = (await service.create(spec)).id
        await act(service, mission_id, "start")
        live = await service.get(mission_id)
        await until(lambda: live.header.step >= 2 and node.vehicle.true_position.depth_m > 1.0, "it surveys")
        node.fail("navigation")

        await until(lambda: told(live, node.name), "somebody is told")
        await until(lambda: node.vehicle.true_position.depth_m < 0.3, "it has come up")
        (vehicle,) = (await view_of(service, mission_id)).vehicles
        assert "tells no position" in vehicle.reason
        assert vehicle.age_s is not None
        assert vehicle.age_s > 0.5, "that of its position, not of its packets"
        step = live.header.step
        node.mend()
        await until(lambda: not told(live, node.name), "that is over")
        await until(lambda: live.header.step > step + 1, "it goes on")
        await act(service, mission_id, "abort")


async def test_a_vehicle_that_polls_on_and_posts_nothing_is_told_of(
    harbour_closed: Harbour, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = await harbour_closed.open(time_scale=100.0)
    mission = await service.create(make_spec(150.0, vehicles=[{"name": "r", "kind": "rest"}], steps=1000))
    live, rover = await service.get(mission.id), Rover(service, mission.id, "r")
    monkeypatch.setattr(service.hub.polled[VehicleKind.REST], "_lost_after_s", 1.0)
    await rover.post()
    await act(service, mission.id, "start")
    await until_state(service, mission.id, MissionState.RUNNING)

    async def asks_on() -> bool:
        """Ask as one does that is under way; whether somebody is told."""
        found = await waypoint(live, "r", after_step=rover.steps[-1] if rover.steps else None)
        if found is not None:
            rover.steps.append(found.step)
        return told(live, "r")

    await until(asks_on, "somebody is told")
    assert rover.steps
    await rover.post()
    await until(lambda: not told(live, "r"), "that is over")
    await act(service, mission.id, "abort")
    with pytest.raises(ConflictError):
        await rover.poll()
