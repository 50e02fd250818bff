"""A mission over IMC beside another console, which may take a vehicle away; only our operator gives it back."""

from collections.abc import Awaitable, Callable

import imcpy

from app.missions.fleet.interface import LinkState
from app.missions.operations.history import events_after
from app.missions.service import MissionService
from app.missions.settings import ImcSettings, ServiceSettings
from app.missions.views.mission import Level
from imc_bridge import BridgeSettings
from simulator.dune import DuneFleet, DuneOptions, default_specs
from simulator.floors.seafloors import generate
from tests.support.imc.sea import Peer
from tests.support.missions.harbour import Harbour, act, view_of
from tests.support.missions.specs import make_spec
from tests.support.ports import free_ports
from tests.support.waiting import until

SPEED = 20.0
ORIGIN = (41.185, -8.705)
NAME = "lauv-sim-1"


async def test_a_vehicle_aborted_elsewhere_is_left_alone_until_the_mission_is_resumed(
    make_settings: Callable[..., ServiceSettings],
) -> None:
    *announce_ports, port, base_port = free_ports(5)
    imc = ImcSettings(port=port, announce_ports=tuple(announce_ports), loopback_only=True)
    floor = generate("slope", 0, width_m=60.0, height_m=60.0, origin=ORIGIN)
    specs = default_specs(1, floor, base_port=base_port)
    harbour = Harbour(make_settings)
    console = Peer(BridgeSettings(port=port, announce_ports=tuple(announce_ports)), 0x4001, "ccu-other")
    async with DuneFleet(floor, specs, speed=SPEED, options=DuneOptions(announce_ports=tuple(announce_ports))) as fleet:
        service = await harbour.open(imc=imc, time_scale=SPEED)
        try:
            for announce_port in announce_ports:
                console.announce(announce_port, sys_type=imcpy.SystemType.CCU)
            await until(lambda: link_of(service) is LinkState.READY, "the vehicle is ready")
            spec = make_spec(60.0, vehicles=[{"name": NAME, "kind": "imc"}], steps=1000)
            mission = (await service.create(spec)).id
            await act(service, mission, "start", actor="Ana")

            async def step() -> int:
                return (await view_of(service, mission)).progress.step

            await until(lambda: later_than(step, 2), "the mission is under way")
            abort = imcpy.Abort()
            abort.src, abort.dst, abort.timestamp = 0x4001, fleet.nodes[0].imc_id, 1.7e9
            console.sock.sendto(imcpy.Packet.serialize(abort), fleet.nodes[0].address)

            async def alarmed() -> bool:
                events = await events_after(await service.get(mission))
                return any(e.level is Level.ALARM and "abort" in e.message for e in events)

            await until(alarmed, "the operator is told")
            await until(lambda: link_of(service) is LinkState.READY, "it is back in service")
            before = fleet.nodes[0].vehicle.state.distance_m
            at = await step()
            [vehicle] = (await view_of(service, mission)).vehicles
            assert "abort" in vehicle.reason
            await act(service, mission, "pause", actor="Ana")
            assert await step() == at, "it was sent nowhere"
            assert fleet.nodes[0].vehicle.state.distance_m < before + 20.0
            await act(service, mission, "resume", actor="Ana")
            await until(lambda: later_than(step, at), "it goes on once the operator says so")
            await act(service, mission, "abort", actor="Ana")
            assert link_of(service) is not LinkState.ENGAGED
        finally:
            console.close()
            await harbour.close()


def link_of(service: MissionService) -> LinkState | None:
    return next((info.state for info, _ in service.hub.vehicles() if info.name == NAME), None)


async def later_than(step: Callable[[], Awaitable[int]], number: int) -> bool:
    return await step() > number
