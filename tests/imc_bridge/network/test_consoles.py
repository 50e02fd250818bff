"""What a Neptus on the same network hears of us: a console that announces itself, and the mission's places."""

import asyncio
import math

import imcpy

from imc_bridge import Bridge
from imc_bridge.network.consoles import MAX_MARKS, SHOW_PERIOD_S, Board, Mark
from tests.support.imc.sea import Peer, open_sea
from tests.support.waiting import until


def test_marks_are_shown_again_and_again_until_they_are_taken_down() -> None:
    board = Board("bathyfleet")
    assert board.due(0.0) == []
    board.show("waypoint of a", Mark("Waypoint", 41.185, -8.705, 3.0))
    [message] = board.due(0.0)
    again = imcpy.Packet.deserialize(imcpy.Packet.serialize(message))
    assert (again.id, again.sensor_class, again.alt) == ("bathyfleet waypoint of a", "Waypoint", -3.0)
    assert (math.degrees(again.lat), math.degrees(again.lon)) == (41.185, -8.705)
    assert board.due(SHOW_PERIOD_S / 2) == []
    assert len(board.due(SHOW_PERIOD_S)) == 1
    board.show("waypoint of a", None)
    assert board.due(3 * SHOW_PERIOD_S) == []


def test_there_are_never_more_marks_than_a_console_can_show() -> None:
    board = Board("x")
    for index in range(3 * MAX_MARKS):
        board.show(str(index), Mark("Area", 0.0, 0.0))
    assert len(board.due(0.0)) == MAX_MARKS


async def test_another_console_hears_our_announce_and_where_vehicles_are_sent() -> None:
    async with open_sea() as sea:
        neptus = Peer(sea.settings, 0x4001, "neptus")
        try:
            bridge: Bridge = sea.bridge
            bridge.board.show("quay corner 1", Mark("Area", 41.185, -8.705))
            neptus.announce(bridge.transport.announce_port, sys_type=imcpy.SystemType.CCU)
            await until(lambda: bool(neptus.take("RemoteSensorInfo")), "the mark is heard")
            [name] = [node.name for node in bridge.nodes() if node.is_vehicle]
            assert {m.id for m in neptus.take("RemoteSensorInfo")} == {"bathyfleet quay corner 1"}
            assert name not in {m.id for m in neptus.take("RemoteSensorInfo")}, "no vehicle is moved on its map"
            assert not neptus.take("Heartbeat"), "nothing else goes to consoles"
            await asyncio.sleep(0)
        finally:
            neptus.sock.close()
