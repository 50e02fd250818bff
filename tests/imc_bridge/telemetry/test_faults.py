"""Leaks and errors on board: told once when they come and once when they are over."""

from typing import Any

import imcpy
import pytest

from imc_bridge import Bridge, BridgeSettings, Fault, FaultKind, NodeState
from imc_bridge.telemetry.faults import ERROR_LASTS_S, Faults, is_leak_sensor
from tests.support.imc.sea import Sea, open_sea
from tests.support.waiting import until

LEAK, ERROR = FaultKind.LEAK, FaultKind.ERROR


def state(mode: int, time_s: float) -> imcpy.Message:
    message = imcpy.VehicleState()
    message.op_mode, message.timestamp = imcpy.VehicleState.OperationModeEnum(mode), time_s
    return message


def leak(failed: bool) -> imcpy.Message:
    message = imcpy.EntityState()
    kinds = imcpy.EntityState.StateEnum
    message.state, message.description = kinds.FAILURE if failed else kinds.NORMAL, "leak detected" if failed else ""
    return message


@pytest.mark.parametrize(
    ("name", "is_one"),
    [("Leak Sensor - Nose", True), ("Leak Sensor", True), ("Motor", False), ("", False), (None, False)],
)
def test_leak_sensors_are_known_by_their_names(name: str | None, is_one: bool) -> None:
    assert is_leak_sensor(name) is is_one


def test_an_error_counts_once_it_lasts() -> None:
    faults = Faults("a")
    assert faults.take_vehicle_state(state(2, 100.0), "aborted") is None
    assert faults.take_vehicle_state(state(0, 101.0), "") is None
    told = [faults.take_vehicle_state(state(2, 200.0 + 0.5 * k), "Motor") for k in range(30)]
    assert [fault for fault in told if fault] == [Fault("a", 200.0 + ERROR_LASTS_S, ERROR, "Motor")]
    assert [fault.kind for fault in faults.present] == [ERROR]
    assert faults.take_vehicle_state(state(0, 230.0), "") == Fault("a", 230.0, ERROR, "Motor", over=True)
    assert faults.present == ()


def test_a_leak_is_over_when_every_sensor_is_dry() -> None:
    faults = Faults("a")
    first = faults.take_entity("Leak Sensor - Nose", leak(True))
    assert first is not None
    assert (first.kind, first.reason, first.over) == (LEAK, "Leak Sensor - Nose: leak detected", False)
    assert faults.take_entity("Leak Sensor - Tail", leak(True)) is None
    assert faults.take_entity("Leak Sensor - Nose", leak(False)) is None
    last = faults.take_entity("Leak Sensor - Tail", leak(False))
    assert last is not None
    assert last.over


async def test_what_breaks_on_board_is_told_once_and_when_it_is_mended() -> None:
    async with open_sea() as sea:
        (name,) = await sea.ready()
        await until(lambda: sea.bridge.nodes()[0].entities, "its entities are known")
        for what, kind, words in (("leak", LEAK, "Leak Sensor - Nose: leak detected"), ("error", ERROR, "Motor")):
            await broken(sea, what, kind, words)
        await until(lambda: sea.state(name) is NodeState.READY, "it is ready again")
        await sea.bridge.engage(name)


async def broken(sea: Sea, what: str, kind: FaultKind, words: str) -> None:
    def told() -> list[Any]:
        return [(fault.kind, fault.over) for fault in sea.of(Fault) if fault.kind is kind]

    (node,) = sea.fleet.nodes
    node.fail(what)
    await until(lambda: told() == [(kind, False)], f"the {what} is told")
    (fault,) = sea.bridge.nodes()[0].faults
    assert words in fault.reason
    node.mend()
    await until(lambda: told() == [(kind, False), (kind, True)], f"the {what} is over")
    assert sea.bridge.nodes()[0].faults == ()


def test_a_fault_is_told_under_the_vehicles_name_also_where_telemetry_came_before_the_announce() -> None:
    """As after a restart of this service: DUNE goes on sending, and announces itself up to 10 s later."""
    now_s, told = 1000.0, list[Any]()
    bridge = Bridge(BridgeSettings(loopback_only=True), clock=lambda: now_s, wall_clock=lambda: 1.7e9 + now_s)
    bridge.listen(told.append)
    address = "127.0.0.1", 6002

    def packet(message: imcpy.Message) -> bytes:
        message.src, message.dst, message.timestamp = 0x15, 0xFFFF, 1.7e9 + now_s
        return bytes(imcpy.Packet.serialize(message))

    bridge.on_packet(packet(state(0, 0.0)), address)
    announce = imcpy.Announce()
    announce.sys_name, announce.sys_type, announce.services = "a", imcpy.SystemType.UUV, "imc+udp://127.0.0.1:6002/"
    bridge.on_announce(packet(announce), address)
    for _ in range(12):
        now_s += 0.5
        bridge.on_packet(packet(state(2, 0.0)), address)
    assert [(fault.vehicle, fault.kind) for fault in told if isinstance(fault, Fault)] == [("a", ERROR)]
