"""What a fleet at DUNE's full rate costs the bridge: ``python -m benchmarks.imc.fleet [--vehicles 50] [--rate 400]``.

A second process plays the vehicles on real UDP sockets: each announces itself, takes our FollowReference plan, echoes
every Reference and sends the mix of packets that DUNE sends, most of which nobody here needs. Printed is one JSON
object with the CPU seconds per second (``cpu_share``, of one core) of the process that holds the bridge. It counts
only where ``sent_per_s`` is what was asked for: a busy machine does not let the vehicles send as much.
``diverted_per_s`` are the loud messages that the system keeps from the bridge; of the others, ``received_of_sent``
came and ``dropped`` found its socket full. ``--before TREE`` compares with the bridge of another work tree, each
measured in turn.
"""

import argparse
import asyncio
import json
import math
import multiprocessing
import os
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import imcpy
import psutil

from benchmarks.common.report import IMC, make_parser, write_section
from imc_bridge import Bridge, BridgeSettings, NodeState, StateReport, Waypoint
from imc_bridge.network.packet_filter import LOUD
from tests.support.paths import PROJECT

ANNOUNCE_PORTS = (32100, 32101)
BRIDGE_PORT = 32110
FIRST_PORT = 33000
FIRST_ID = 0x0400
WANTED_HZ = {
    "EstimatedState": 10, "Distance": 10, "PlanControlState": 3, "VehicleState": 2, "GpsFix": 1, "VehicleMedium": 1,
    "NavigationUncertainty": 1, "Heartbeat": 1, "Rpm": 1, "EulerAngles": 94, "AngularVelocity": 94,
}  # fmt: skip
FEW_HZ = {"EstimatedState": 10, "Distance": 5, "PlanControlState": 2, "VehicleState": 1, "Heartbeat": 1}
"""What remains of it at a low rate: positions and depths."""
FILL = "ServoPosition"
SLOTS = 100
"""Moments within a second at which packets leave."""


class Vehicle:
    """One vehicle: a socket and its ready-made messages."""

    def __init__(self, number: int, rate_hz: int) -> None:
        self.imc_id = FIRST_ID + number
        self.name = f"lauv-bench-{number + 1}"
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.bind(("127.0.0.1", FIRST_PORT + number))
        self.sock.setblocking(False)
        self.executing = False
        self.messages = {name: getattr(imcpy, name)() for name in (*WANTED_HZ, FILL)}
        state = self.messages["EstimatedState"]
        state.lat, state.lon, state.depth = math.radians(41.0 + 0.01 * number), math.radians(-8.0), 2.0
        distance = self.messages["Distance"]
        distance.validity, distance.value, distance.src_ent = imcpy.Distance.ValidityEnum.VALID, 20.0, 58
        wanted = WANTED_HZ if rate_hz >= sum(WANTED_HZ.values()) else FEW_HZ
        if rate_hz < sum(wanted.values()):
            raise SystemExit(f"--rate {rate_hz} is too low: at least {sum(FEW_HZ.values())}")
        rates = {**wanted, FILL: rate_hz - sum(wanted.values())}
        self.slots: list[list[str]] = [[] for _ in range(SLOTS)]
        for name, rate in rates.items():
            for k in range(rate):
                self.slots[int(k * SLOTS / rate + number) % SLOTS].append(name)
        # Made once: nobody reads them, and to make them takes more than to send them.
        self.loud = {name: self._packet(self.messages[name]) for name in rates if name in LOUD}

    def _packet(self, message: Any, dst: int = 0xFFFF) -> bytes:
        message.src, message.dst, message.timestamp = self.imc_id, dst, time.time()
        return bytes(message.serialize())

    def send(self, message: Any, to: tuple[str, int], dst: int = 0xFFFF) -> None:
        self.sock.sendto(self._packet(message, dst), to)

    def announce(self) -> None:
        message = imcpy.Announce()
        message.sys_name, message.sys_type = self.name, imcpy.SystemType.UUV
        message.services = (
            f"dune://0.0.0.0/uid/{self.imc_id};imc+info://0.0.0.0/version/5.4.31;"
            f"imc+udp://127.0.0.1:{self.sock.getsockname()[1]}/"
        )
        self.send(message, ("127.0.0.1", ANNOUNCE_PORTS[0]))

    def speak(self, slot: int) -> tuple[int, int]:
        """Send what is due; how many packets that were, and how many of them loud."""
        loud = 0
        for name in self.slots[slot]:
            packet = self.loud.get(name)
            if packet is None:
                self.send(self.messages[name], ("127.0.0.1", BRIDGE_PORT))
            else:
                self.sock.sendto(packet, ("127.0.0.1", BRIDGE_PORT))
                loud += 1
        return len(self.slots[slot]), loud

    def listen(self) -> None:
        while True:
            try:
                message = imcpy.Packet.deserialize(self.sock.recvfrom(65536)[0])
            except BlockingIOError:
                return
            to = ("127.0.0.1", BRIDGE_PORT)
            if isinstance(message, imcpy.PlanControl):
                self.executing = message.op == imcpy.PlanControl.OperationEnum.START
                plan = self.messages["PlanControlState"]
                plan.state = imcpy.PlanControlState.StateEnum(3 if self.executing else 1)
                plan.plan_id = message.plan_id
                self.send(plan, to)
            elif isinstance(message, imcpy.Reference):
                echo = imcpy.FollowRefState()
                echo.control_src, echo.reference = message.src, message
                echo.state = imcpy.FollowRefState.StateEnum(2)
                self.send(echo, to)
            elif isinstance(message, imcpy.EntityList):
                names = imcpy.EntityList()
                names.op, names.list = imcpy.EntityList.OperationEnum.REPORT, "Altimeter=58"
                self.send(names, to)


def play(vehicles: int, rate_hz: int, done: Any, sent: Any, loud: Any) -> None:
    """Be the vehicles until ``done``."""
    fleet = [Vehicle(k, rate_hz) for k in range(vehicles)]
    for vehicle in fleet:
        vehicle.messages["PlanControlState"].state = imcpy.PlanControlState.StateEnum(1)
    begun, slot = time.monotonic(), 0
    while not done.is_set():
        if slot % (2 * SLOTS) == 0:
            for vehicle in fleet:
                vehicle.announce()
        count = of_these = 0
        for vehicle in fleet:
            vehicle.listen()
            spoken, noise = vehicle.speak(slot % SLOTS)
            count, of_these = count + spoken, of_these + noise
        sent.value += count
        loud.value += of_these
        slot += 1
        time.sleep(max(0.0, begun + slot / SLOTS - time.monotonic()))


async def measure(vehicles: int, seconds: float, sent: Any, loud: Any) -> dict[str, Any]:
    """Engage everyone, then count CPU seconds."""
    settings = BridgeSettings(port=BRIDGE_PORT, loopback_only=True, announce_ports=ANNOUNCE_PORTS)
    states: set[str] = set()

    def note(event: object) -> None:
        if isinstance(event, StateReport):
            states.add(event.vehicle)

    bridge = Bridge(settings)
    await bridge.start(note)
    try:
        async with asyncio.timeout(60.0):
            while sum(node.state is NodeState.READY for node in bridge.nodes()) < vehicles:  # noqa: ASYNC110
                await asyncio.sleep(0.2)
            names = [node.name for node in bridge.nodes()]
            await asyncio.gather(*(bridge.engage(name) for name in names))
        for k, name in enumerate(names):
            bridge.goto(name, Waypoint("bench", 0, 41.0 + 0.01 * k + 0.005, -8.0, 2.0))
        await asyncio.sleep(2.0)
        received = bridge.decoder.decoded.total() + bridge.decoder.unwanted.total()
        packets, noise, cpu, wall = sent.value, loud.value, time.process_time(), time.monotonic()
        lost, memory_mb = bridge.transport.dropped(), [round(psutil.Process().memory_info().rss / 1e6, 1)]
        for _ in range(10):
            await asyncio.sleep(seconds / 10)
            memory_mb.append(round(psutil.Process().memory_info().rss / 1e6, 1))
        cpu, wall = time.process_time() - cpu, time.monotonic() - wall
        packets, noise = sent.value - packets, loud.value - noise
        received = bridge.decoder.decoded.total() + bridge.decoder.unwanted.total() - received
        return {
            "vehicles": vehicles,
            "engaged": sum(node.engaged for node in bridge.nodes()),
            "reporting": len(states),
            "seconds": round(wall, 2),
            "packets_per_s": round(received / wall),
            "sent_per_s": round(packets / wall),
            "diverted_per_s": round(noise / wall),
            "dropped": bridge.transport.dropped() - lost,
            "received_of_sent": round(received / max(packets - noise, 1), 5),
            "memory_mb": memory_mb,
            "cpu_share": round(cpu / wall, 3),
            "us_per_packet": round(1e6 * cpu / max(received, 1), 2),
        }
    finally:
        await bridge.close()


def compare(options: argparse.Namespace) -> dict[str, Any]:
    """Measure another tree's bridge and this one's in turn: what else runs here changes meanwhile."""
    here = str(PROJECT)
    found: dict[str, list[dict[str, Any]]] = {"before": [], "now": []}
    for _ in range(options.rounds):
        for name, tree in (("before", str(options.before.resolve())), ("now", here)):
            code = (
                f"import sys; sys.path.insert(0, {tree!r}); import imc_bridge; sys.path[0] = {here!r}; "
                "from benchmarks.imc.fleet import main; main()"
            )
            told = ["--vehicles", f"{options.vehicles}", "--rate", f"{options.rate}", "--seconds", f"{options.seconds}"]
            done = subprocess.run(
                [sys.executable, "-c", code, *told], stdout=subprocess.PIPE, text=True, check=True, env=os.environ
            )
            found[name].append(json.loads(done.stdout))
    shown: dict[str, Any] = {
        name: {
            key: [one[key] for one in rounds]
            for key in ("cpu_share", "us_per_packet", "sent_per_s", "received_of_sent", "dropped")
        }
        for name, rounds in found.items()
    }
    ratio = [sum(shown[name]["us_per_packet"]) for name in ("now", "before")]
    return shown | {"us_per_packet_now_to_before": round(ratio[0] / ratio[1], 3)}


def main() -> None:
    """Run both processes and print the result."""
    parser = make_parser(__doc__, IMC)
    parser.add_argument("--vehicles", type=int, default=50)
    parser.add_argument("--rate", type=int, default=400, help="packets per second and vehicle")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--before", type=Path, metavar="TREE", help="compare with the bridge in another work tree")
    parser.add_argument("--rounds", type=int, default=2, help="of a comparison")
    options = parser.parse_args()
    title = f"{options.vehicles} vehicles, {options.rate} packets/s each"
    if options.before:
        result = compare(options)
        title += ", before and now"
    else:
        context = multiprocessing.get_context("spawn")
        done, sent, loud = context.Event(), context.Value("q", 0), context.Value("q", 0)
        told = (options.vehicles, options.rate, done, sent, loud)
        fleet = context.Process(target=play, args=told, daemon=True)
        fleet.start()
        try:
            result = asyncio.run(measure(options.vehicles, options.seconds, sent, loud))
        finally:
            done.set()
            fleet.join(5.0)
    print(json.dumps(result))
    write_section(options.write, IMC, title, result, hidden={options.before: "BEFORE"})


if __name__ == "__main__":
    main()
