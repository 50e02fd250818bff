"""An announce that is not the vehicle's: it is told of, and it does not take the vehicle from us for good."""

import imcpy

from imc_bridge import Bridge, BridgeSettings

VEHICLE, HOME, ELSEWHERE = 0x1E, ("127.0.0.1", 6002), ("127.0.0.1", 6666)
PERIOD_S = 10.0


class Listener:
    """A bridge without sockets, whose clock we turn."""

    def __init__(self) -> None:
        self.now = 0.0
        self.bridge = Bridge(BridgeSettings(loopback_only=True), clock=lambda: self.now)

    def announced(self, address: tuple[str, int], uid: int) -> None:
        message = imcpy.Announce()
        message.src, message.timestamp = VEHICLE, 1.7e9 + self.now
        message.sys_name, message.sys_type = "lauv-xplore-1", imcpy.SystemType.UUV
        message.services = f"dune://0.0.0.0/uid/{uid};imc+udp://{address[0]}:{address[1]}/"
        self.bridge.on_announce(bytes(message.serialize()), address)

    def believes_the_vehicle(self) -> bool:
        """Whether a packet from the vehicle's own address counts as its word."""
        message = imcpy.Heartbeat()
        message.src, message.timestamp = VEHICLE, 1.7e9 + self.now
        before = self.bridge.decoder.decoded.total()
        self.bridge.on_packet(bytes(message.serialize()), HOME)
        return self.bridge.decoder.decoded.total() > before


def test_one_forged_announce_is_told_of_and_forgotten() -> None:
    listener = Listener()
    for _ in range(3):
        listener.announced(HOME, uid=1)
        listener.now += PERIOD_S
    assert listener.believes_the_vehicle()
    listener.announced(ELSEWHERE, uid=666)
    listener.announced(HOME, uid=1)
    (node,) = listener.bridge.nodes()
    assert node.conflict is not None
    assert "two nodes named 'lauv-xplore-1'" in node.conflict
    for _ in range(6):
        listener.now += PERIOD_S
        listener.bridge.pass_time()
        listener.announced(HOME, uid=1)
    assert listener.believes_the_vehicle()
    listener.now += 3 * PERIOD_S + 1
    listener.bridge.pass_time()
    (node,) = listener.bridge.nodes()
    assert node.conflict is None


def test_two_that_go_on_announcing_stay_a_conflict() -> None:
    listener = Listener()
    listener.announced(HOME, uid=1)
    for _ in range(10):
        listener.now += PERIOD_S / 2
        listener.announced(ELSEWHERE, uid=666)
        listener.now += PERIOD_S / 2
        listener.announced(HOME, uid=1)
        listener.bridge.pass_time()
    (node,) = listener.bridge.nodes()
    assert node.conflict is not None
