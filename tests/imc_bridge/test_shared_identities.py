"""Systems that share what should be one's own: our id, a vehicle's name, a vehicle's id at another address."""

import asyncio
import math
from typing import Any

import imcpy
import pytest

from imc_bridge import Bridge, BridgeSettings, RefusedError
from imc_bridge.control.control import Phase
from imc_bridge.doctor.diagnosis import Cause
from imc_bridge.doctor.doctor import judge
from imc_bridge.events import LinkChange, NodeState
from imc_bridge.network.discovery import own_announce
from imc_bridge.network.transport import Address
from imc_bridge.nodes.node import LONGEST_DIVE_S

START_S = 1.7e9
HERE, THERE = ("10.0.0.1", 6002), ("10.0.0.77", 6002)


class Scene:
    """A bridge without sockets, vehicles that say what they are told to, and time that passes when told to."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.plan = ""
        """What the vehicles execute."""
        self.depth_m = 0.0
        self.sent: list[tuple[Any, Address]] = []
        self.bridge = Bridge(BridgeSettings(), clock=lambda: self.now_s, wall_clock=lambda: START_S + self.now_s)
        self.bridge.listen(lambda event: None)
        self.bridge.transport.send = self._sent

    def _sent(self, packet: bytes, address: Address) -> bool:
        self.sent.append((imcpy.Packet.deserialize(packet), address))
        return True

    def packet(self, message: imcpy.Message, src: int) -> bytes:
        message.src, message.dst, message.timestamp = src, 0xFFFF, START_S + self.now_s
        return bytes(imcpy.Packet.serialize(message))

    def twin(self, run: str = "") -> None:
        """Another service with the default settings announces itself; with our ``run`` it is our own echo."""
        message = own_announce(self.bridge.settings, ["10.0.0.9"], run=run)
        self.bridge.on_announce(self.packet(message, self.bridge.settings.id), ("10.0.0.9", 6101))

    def announce(self, imc_id: int = 0x1E, address: Address = HERE, name: str = "lauv-x", uid: int = 1) -> None:
        message = imcpy.Announce()
        message.sys_name, message.sys_type = name, imcpy.SystemType.UUV
        message.services = f"dune://0.0.0.0/uid/{uid};imc+udp://{address[0]}:{address[1]}/"
        self.bridge.on_announce(self.packet(message, imc_id), (address[0], 30100))

    def live(self, seconds: float, *speakers: tuple[int, Address], announced: bool = False) -> None:
        """Let time pass, in which vehicles in service report themselves and announce themselves every 10 s."""
        for _ in range(round(seconds / 0.2)):
            self.now_s += 0.2
            for imc_id, address in speakers:
                if announced and self.now_s % 10.0 < 0.2:
                    self.announce(imc_id, address)
                self.say(imc_id, address)
            self.bridge.pass_time()

    def say(self, imc_id: int, address: Address) -> None:
        mode, doing, place = imcpy.VehicleState(), imcpy.PlanControlState(), imcpy.EstimatedState()
        mode.op_mode = imcpy.VehicleState.OperationModeEnum(3 if self.plan else 0)
        doing.state, doing.plan_id = imcpy.PlanControlState.StateEnum(3 if self.plan else 1), self.plan
        place.lat, place.lon, place.depth = math.radians(41.0), math.radians(-8.7), self.depth_m
        for message in (mode, doing, place):
            self.bridge.on_packet(self.packet(message, imc_id), address)

    def sent_to(self, address: Address, kind: str) -> int:
        return sum(to == address and type(message).__name__ == kind for message, to in self.sent)


async def test_a_second_service_with_the_same_settings_is_found_and_no_vehicle_engaged_meanwhile() -> None:
    scene = Scene()
    bridge = scene.bridge
    scene.announce()
    scene.live(3.0, (0x1E, HERE))
    scene.twin(bridge._sender.run)
    assert bridge.double == "", "our own announce has come back"
    scene.twin()
    assert "'bathyfleet' at 10.0.0.9" in bridge.double
    assert Cause.OUR_ID_TAKEN in judge(bridge, 1.0).causes
    with pytest.raises(RefusedError, match=r"our IMC id 0x3F01 is announced by 'bathyfleet' at 10\.0\.0\.9, too"):
        await bridge.engage("lauv-x")
    scene.live(31.0, (0x1E, HERE))
    assert bridge.double == ""
    assert Cause.OUR_ID_TAKEN not in judge(bridge, 1.0).causes


@pytest.mark.parametrize("leads", [True, False])
def test_a_service_that_never_led_a_vehicle_gives_way_to_another_under_its_id(*, leads: bool) -> None:
    """Vehicles send to who spoke last under an id: its heartbeats would take the other one's telemetry away."""
    scene = Scene()
    scene.bridge._has_led = leads
    scene.announce()
    scene.live(3.0, (0x1E, HERE))
    assert scene.sent_to(HERE, "Heartbeat") >= 2
    scene.twin()
    scene.sent.clear()
    scene.live(10.0, (0x1E, HERE))
    assert (scene.sent_to(HERE, "Heartbeat") > 0) == leads
    scene.live(30.0, (0x1E, HERE))
    assert scene.sent_to(HERE, "Heartbeat") > 0


@pytest.mark.parametrize("first", [0x1E, 0x1F])
async def test_of_two_vehicles_with_one_name_neither_is_engaged(first: int) -> None:
    scene = Scene()
    hulls = {first: HERE, 0x1E + 0x1F - first: ("10.0.0.2", 6002)}
    for imc_id, address in hulls.items():
        scene.announce(imc_id, address)
        scene.live(1.0, (imc_id, address))
    for node in scene.bridge.nodes():
        with pytest.raises(RefusedError, match="id 0x001E and id 0x001F announce one name, 'lauv-x': rename one"):
            await scene.bridge.engage(node.name)
    assert set(judge(scene.bridge, 1.0).causes) == {Cause.SAME_NAME_TWICE}
    # One of them has gone.
    scene.live(60.0, (first, HERE), announced=True)
    assert [node.conflict for node in scene.bridge.nodes()] == [None, None]


def dived(scene: Scene) -> None:
    """A vehicle goes down in a plan of its own console, and falls silent."""
    scene.announce()
    scene.live(15.0, (0x1E, HERE), announced=True)
    scene.plan, scene.depth_m = "survey", 5.0
    scene.live(1.0, (0x1E, HERE))
    scene.plan, scene.depth_m = "", 0.0
    scene.live(60.0)


async def test_a_vehicle_with_another_computer_at_the_same_address_is_led_by_its_name() -> None:
    scene = Scene()
    dived(scene)
    (old,) = scene.bridge.nodes()
    assert old.state is NodeState.EXPECTED_OFFLINE
    told: list[LinkChange] = []
    scene.bridge.listen(lambda event: told.append(event) if isinstance(event, LinkChange) else None)
    scene.announce(0x1F, uid=2)
    scene.live(15.0, (0x1F, HERE), announced=True)
    names = {node.imc_id: node.name for node in scene.bridge.nodes()}
    assert names == {0x1E: "lauv-x (0x001E)", 0x1F: "lauv-x"}
    assert [node.conflict for node in scene.bridge.nodes()] == [None, None]
    assert [change.state for change in told if change.vehicle == "lauv-x"][-1] is NodeState.READY
    assert scene.bridge._registry.at(HERE) is scene.bridge._registry[0x1F]
    # The other one was not gone.
    scene.announce()
    scene.live(1.0, (0x1E, HERE), (0x1F, HERE))
    with pytest.raises(RefusedError, match="announce one name"):
        await scene.bridge.engage("lauv-x")


@pytest.mark.parametrize("speakers", [(0x1F,), (0x1E, 0x1F)])
async def test_who_comes_while_another_of_its_name_dives_or_is_heard_is_not_engaged(speakers: tuple[int, ...]) -> None:
    """A vehicle under water is as silent as one that has another computer; elsewhere another vehicle speaks."""
    scene = Scene()
    dived(scene)
    address = ("10.0.0.2", 6002) if speakers == (0x1F,) else HERE
    scene.announce(0x1F, address, uid=2)
    scene.live(60.0, *((imc_id, address) for imc_id in speakers), announced=True)
    for node in scene.bridge.nodes():
        if node.imc_id not in speakers:
            continue
        with pytest.raises(RefusedError, match="announce one name"):
            await scene.bridge.engage(node.name)


async def test_a_vehicle_that_we_lead_keeps_its_name_as_long_as_it_may_be_under_water() -> None:
    """Its plan ends by itself within minutes; that nobody leads it any more does not mean that another one is it."""
    scene = Scene()
    scene.announce()
    scene.live(15.0, (0x1E, HERE), announced=True)
    first = scene.bridge._registry[0x1E]
    engaging = asyncio.create_task(scene.bridge.engage("lauv-x"))
    await asyncio.sleep(0)
    control = scene.bridge._controls.of(first)
    while control.phase in (Phase.WAITING, Phase.STARTING):
        scene.live(0.2, (0x1E, HERE), announced=True)
        asked = [message.plan_id for message, _ in scene.sent if isinstance(message, imcpy.PlanControl)]
        scene.plan = asked[-1] if asked else ""
    assert control.phase is Phase.FOLLOWING
    engaging.cancel()
    scene.depth_m = 5.0
    scene.live(2.0, (0x1E, HERE), announced=True)
    scene.plan, scene.depth_m = "", 0.0
    elsewhere = ("10.0.0.2", 6002)
    scene.announce(0x1F, elsewhere, uid=2)
    scene.live(300.0, (0x1F, elsewhere), announced=True)
    assert first.given_up(scene.now_s)
    assert not scene.bridge._controls.engaged(first)
    assert {node.imc_id: node.name for node in scene.bridge.nodes()} == {0x1E: "lauv-x", 0x1F: "lauv-x (0x001F)"}


def test_a_vehicle_that_is_led_is_not_called_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, elsewhere = Scene(), ("10.0.0.2", 6002)
    registry = scene.bridge._registry
    dived(scene)
    scene.announce(0x1F, elsewhere)
    scene.live(1.0, (0x1F, elsewhere))
    monkeypatch.setattr(registry.capacity, "in_use", lambda node: node.imc_id == 0x1F)
    scene.now_s += LONGEST_DIVE_S
    scene.live(1.0, (0x1F, elsewhere))
    assert registry[0x1F].name == "lauv-x (0x001F)"
    monkeypatch.setattr(registry.capacity, "in_use", lambda _node: False)
    scene.live(1.0, (0x1F, elsewhere))
    assert registry[0x1F].name == "lauv-x"


def test_a_vehicle_that_was_given_up_leaves_its_name_to_the_one_that_is_heard() -> None:
    scene = Scene()
    dived(scene)
    scene.announce(0x1F, ("10.0.0.2", 6002))
    scene.live(1.0, (0x1F, ("10.0.0.2", 6002)))
    scene.now_s += LONGEST_DIVE_S
    scene.live(1.0, (0x1F, ("10.0.0.2", 6002)))
    assert {node.imc_id: node.name for node in scene.bridge.nodes()}[0x1F] == "lauv-x"


def test_a_name_that_is_announced_and_under_which_nothing_speaks_blocks_no_vehicle() -> None:
    scene = Scene()
    scene.announce()
    scene.live(1.0, (0x1E, HERE))
    scene.announce(0x1F, ("10.0.0.2", 6002))
    scene.live(1.0, (0x1E, HERE))
    assert [node.conflict for node in scene.bridge.nodes()] == [None, None]


def test_a_vehicle_that_gets_another_address_is_led_on_there() -> None:
    scene = Scene()
    scene.announce()
    scene.live(15.0, (0x1E, HERE), announced=True)
    node = scene.bridge._registry[0x1E]
    control = scene.bridge._controls.of(node)
    assert control.engage(scene.now_s)
    scene.live(1.0, (0x1E, HERE))
    scene.plan = "bathyfleet-3F01"
    scene.live(1.0, (0x1E, HERE))
    assert control.phase is Phase.FOLLOWING
    scene.live(11.0, (0x1E, THERE), announced=True)
    assert node.address == THERE
    assert control.engaged
    scene.sent.clear()
    scene.live(2.0, (0x1E, THERE))
    assert scene.sent_to(THERE, "Heartbeat") >= 1
    assert scene.sent_to(HERE, "Heartbeat") == 0


def test_a_vehicle_that_speaks_from_its_address_is_not_moved_and_returns_to_it() -> None:
    scene = Scene()
    scene.announce()
    scene.live(15.0, (0x1E, HERE), announced=True)
    node = scene.bridge._registry[0x1E]
    scene.live(30.0, (0x1E, HERE), (0x1E, THERE), announced=True)
    assert node.address == HERE
    # Somebody speaks in its name as long as it is silent, and no longer.
    scene.live(11.0, (0x1E, THERE), announced=True)
    assert node.address == THERE
    scene.live(1.0, (0x1E, HERE), (0x1E, THERE))
    assert node.address == HERE


def test_a_vehicle_that_began_anew_elsewhere_is_not_taken_for_one_that_moved() -> None:
    scene = Scene()
    scene.announce()
    scene.live(15.0, (0x1E, HERE), announced=True)
    scene.announce(address=THERE, uid=2)
    scene.live(8.0, (0x1E, THERE))
    assert scene.bridge._registry[0x1E].address == HERE
