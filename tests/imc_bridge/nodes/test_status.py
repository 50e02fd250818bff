"""What is made of a vehicle's silence."""

import math

import imcpy
import pytest

from imc_bridge import Bridge, BridgeSettings, NodeState

ADDRESS = "127.0.0.1", 6002


class Listener:
    """A bridge without sockets, and a vehicle under water that executes a plan."""

    def __init__(self, plan: str, maneuver: str) -> None:
        self.now_s = 1000.0
        self.bridge = Bridge(
            BridgeSettings(loopback_only=True), clock=lambda: self.now_s, wall_clock=lambda: 1.7e9 + self.now_s
        )
        announce = imcpy.Announce()
        announce.sys_name, announce.sys_type, announce.services = "a", imcpy.SystemType.UUV, "imc+udp://127.0.0.1:6002/"
        self.bridge.on_announce(self.packet(announce), ADDRESS)
        mode = imcpy.VehicleState()
        mode.op_mode = imcpy.VehicleState.OperationModeEnum.MANEUVER
        doing = imcpy.PlanControlState()
        doing.state = imcpy.PlanControlState.StateEnum.EXECUTING
        doing.plan_id, doing.man_id = plan, maneuver
        place = imcpy.EstimatedState()
        place.lat, place.lon, place.depth = math.radians(41.0), math.radians(-8.7), 3.0
        for message in (mode, doing, place):
            self.bridge.on_packet(self.packet(message), ADDRESS)

    def packet(self, message: imcpy.Message) -> bytes:
        message.src, message.dst, message.timestamp = 0x15, 0xFFFF, 1.7e9 + self.now_s
        return bytes(imcpy.Packet.serialize(message))

    def after(self, silence_s: float) -> NodeState:
        self.now_s += silence_s
        self.bridge.pass_time()
        [node] = self.bridge.nodes()
        return node.state


@pytest.mark.parametrize(
    ("plan", "maneuver", "waits_s"),
    [("bathyfleet-3F01", "follow", 80.0), ("lostcomms", "bathyfleet-3F01 home 1", 3600.0), ("survey", "rows", 3600.0)],
    ids=["led by references", "on its way home", "in another console's plan"],
)
def test_who_is_silent_under_water_for_longer_than_it_can_be_is_lost(plan: str, maneuver: str, waits_s: float) -> None:
    listener = Listener(plan, maneuver)
    assert listener.after(0.0) is NodeState.IN_PLAN
    assert listener.after(waits_s - 5.0) is NodeState.EXPECTED_OFFLINE
    assert listener.after(10.0) is NodeState.LOST


@pytest.mark.parametrize("message", [imcpy.EstimatedState(), imcpy.EulerAngles()], ids=["wanted", "of no use"])
def test_damaged_packets_are_no_contact(message: imcpy.Message) -> None:
    listener = Listener("", "")
    for _ in range(40):
        listener.now_s += 1.0
        packet = bytearray(listener.packet(message))
        packet[-1] ^= 0xFF
        listener.bridge.on_packet(bytes(packet), ADDRESS)
    [node] = listener.bridge.nodes()
    assert node.age_s == 40.0
