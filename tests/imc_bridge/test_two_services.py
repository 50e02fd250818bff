"""Two services on one network, each with its id and port: neither takes the other's plan for its own."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import imcpy
import pytest

from imc_bridge import Bridge, Guidance, NodeState, RefusedError
from imc_bridge.network.codec import peek
from imc_bridge.network.transport import Address
from tests.support.imc.sea import Sea, open_sea
from tests.support.ports import free_ports
from tests.support.waiting import until

FOLLOW_STATE = int(imcpy.FollowRefState().msg_id)


class Service:
    """A second service, which notes what it asks of plan control and hears no FollowRefState."""

    def __init__(self, sea: Sea, **changes: Any) -> None:
        self.bridge = Bridge(sea.settings.changed(id=0x3F02, port=free_ports(1)[0], **changes))
        self.asked: list[imcpy.Message] = []
        transport = self.bridge.transport
        send = transport.send

        def noted(packet: bytes, address: Address) -> bool:
            message = imcpy.Packet.deserialize(packet)
            self.asked += [message] if isinstance(message, (imcpy.PlanControl, imcpy.Abort)) else []
            return send(packet, address)

        def heard(packet: bytes, address: Address) -> None:
            if getattr(peek(packet), "msg_id", 0) != FOLLOW_STATE:
                self.bridge.on_packet(packet, address)

        transport.send, transport._on_packet = noted, heard

    def state(self, name: str) -> NodeState | None:
        return next((node.state for node in self.bridge.nodes() if node.name == name), None)


@asynccontextmanager
async def second(sea: Sea, **changes: Any) -> AsyncIterator[Service]:
    service = Service(sea, **changes)
    await service.bridge.start(lambda event: None)
    try:
        yield service
    finally:
        await service.bridge.close()


@pytest.mark.slow
@pytest.mark.parametrize("guidance", [Guidance.FOLLOW, Guidance.LEGS])
async def test_a_second_service_neither_engages_nor_stops_a_vehicle_of_the_first(guidance: Guidance) -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name, guidance)
        sea.bridge.goto(name, sea.waypoint(0, 50, 95, 1.0))
        plan = sea.fleet.nodes[0].plan
        await until(lambda: plan.maneuver is not None, "the vehicle is under way")
        async with second(sea) as other:
            await until(lambda: other.state(name) is NodeState.IN_PLAN, "the second service sees it in a plan")
            with pytest.raises(RefusedError, match="'bathyfleet-3F01' of another console"):
                await other.bridge.engage(name, guidance)
            stop = await other.bridge.stop(name)
            assert "another console" in stop.detail
            assert other.asked == []
        await sea.reached(name, 0)


async def test_a_peer_of_a_service_that_died_ends_its_plan_and_leads_on() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await sea.bridge.engage(name, Guidance.LEGS)
        sea.bridge.goto(name, sea.waypoint(0, 50, 95, 1.0))
        plan = sea.fleet.nodes[0].plan
        await until(lambda: plan.maneuver is not None, "the vehicle is under way")
        sea.bridge._task.cancel()  # as kill -9 does
        sea.bridge.transport.close()
        async with second(sea) as other:
            other.bridge.know_peers([sea.settings.id])
            await until(lambda: other.state(name) is NodeState.IN_PLAN, "its peer sees it in a plan")
            assert "of a peer" in other.bridge.nodes()[0].reason
            await other.bridge.engage(name)
            assert plan.plan_control_state().plan_id == "bathyfleet-3F02"
