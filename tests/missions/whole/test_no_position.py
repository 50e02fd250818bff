"""A vehicle whose navigation fails while it surveys: it is brought up, somebody is told, and it goes on when it can."""

import pytest

from app.missions.alarm_kinds import AlarmKind
from app.missions.settings import ImcSettings
from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.floors.seafloors import generate
from tests.support.missions.harbour import Harbour, act, view_of
from tests.support.missions.specs import LAT, LON, make_spec
from tests.support.ports import free_ports
from tests.support.waiting import until

SPEED = 10.0


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

        def told() -> bool:
            return (AlarmKind.NO_POSITION, node.name) in live.journal.alarms.standing([AlarmKind.NO_POSITION])

        await until(told, "somebody is told")
        await until(lambda: node.vehicle.true_position.depth_m < 0.3, "it has come up")
        (vehicle,) = (await view_of(service, mission_id)).vehicles
        assert "tells no position" in vehicle.reason
        assert vehicle.age_s is not None
        assert vehicle.age_s > 0.5, "that of its position, not of its packets"
        step = live.header.step
        node.mend()
        await until(lambda: not told(), "that is over")
        await until(lambda: live.header.step > step + 1, "it goes on")
        await act(service, mission_id, "abort")
