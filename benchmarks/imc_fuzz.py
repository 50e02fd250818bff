"""Mutated packets for the bridge: ``python benchmarks/imc_fuzz.py [--packets 1000000] [--seed 0] [--captures DIR]``.

Packets of recorded sessions (or, without any, of every message the bridge takes in) are flipped, cut, spliced and
filled with extreme numbers; most get a right checksum afterwards, so that they reach the parsers and gates. Printed
is one JSON object: what became of them, errors of the handlers (must be 0) and the process's memory after each tenth,
with its growth over the second half, in which every bounded store is full (must stay below 4 MB). ``--write`` puts
it into a page. A crash ends the command with a traceback.
"""

import argparse
import asyncio
import contextlib
import dataclasses
import gzip
import json
import math
import resource
import struct
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import imcpy
import numpy as np
from imc_report import write_section
from numba import njit

from imc_bridge import Bridge, BridgeSettings, RefusedError, Sounding, StateReport, Waypoint
from imc_bridge.codec import message_ids
from imc_bridge.hearing import WANTED
from imc_bridge.transport import Address

VEHICLE_ID, VEHICLE = 0x1E, ("127.0.0.1", 6002)
EXTREMES = [0.0, -1.0, 1e9, -1e9, 1e38, float("inf"), float("-inf"), float("nan")]
Packet = tuple[bytes, Address]
ANNOUNCE = imcpy.Announce().msg_id.to_bytes(2, "little")


MARKS = 10
"""Moments at which memory is measured."""
MOST_GROWTH_MB = 4.0


@njit(cache=True)  # type: ignore[untyped-decorator]
def crc(data: np.ndarray) -> int:
    """CRC-16/ARC."""
    value = 0
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value


def with_checksum(packet: bytearray) -> bytes:
    """The packet with its own length in the header and the checksum that belongs to it."""
    struct.pack_into("<H", packet, 4, max(len(packet) - 22, 0) & 0xFFFF)
    struct.pack_into("<H", packet, len(packet) - 2, crc(np.frombuffer(packet, np.uint8, len(packet) - 2)))
    return bytes(packet)


def seeds(captures: Path | None) -> list[Packet]:
    """Good packets with the address they came from."""
    found: dict[tuple[object, ...], Packet] = {}
    for path in sorted(captures.glob("*.jsonl.gz")) if captures else []:
        with gzip.open(path, "rt") as lines:
            for line in lines:
                item = json.loads(line)
                host, port = item["src"].split(":")
                packet = bytes.fromhex(item["hex"])
                key = (packet[2:4], item["src"], len(packet) // 8)
                found.setdefault(key, (packet, (host, int(port))))
    if not found:
        for name in (*WANTED, "Announce", "ServoPosition", "GpsFix"):
            message = getattr(imcpy, name)()
            message.src, message.timestamp = VEHICLE_ID, 1.7e9
            if name == "Announce":
                message.sys_name, message.sys_type = "lauv-fuzz", imcpy.SystemType.UUV
                message.services = f"imc+udp://{VEHICLE[0]}:{VEHICLE[1]}/"
            found[(name,)] = (bytes(message.serialize()), VEHICLE)
    return list(found.values())


def mutated(pool: list[Packet], rng: np.random.Generator) -> Iterator[Packet]:
    """Mutated packets without end, most of them of messages that are taken in, by a clock that goes on."""
    wanted = message_ids((*WANTED, "Announce"))
    known = [item for item in pool if int.from_bytes(item[0][2:4], "little") in wanted]
    clock = 1.8e9
    while True:
        for which, stranger, whole, checked in rng.random((4096, 4)):
            some = pool if stranger > 0.9 else known
            packet, address = some[int(which * len(some))]
            data = bytearray(packet)
            clock += 0.01
            struct.pack_into("<d", data, 6, clock)
            if whole < 0.7:
                for _ in range(rng.integers(1, 4)):
                    mutate(data, some[rng.integers(len(some))][0], rng)
                    data.extend(bytes(max(24 - len(data), 0)))
            if stranger < 0.02:
                address = ("10.0.0.1", int(rng.integers(1, 65536)))
            yield (with_checksum(data) if checked < 0.9 else bytes(data)), address


def mutate(data: bytearray, donor: bytes, rng: np.random.Generator) -> None:
    """Change one thing about a packet of at least 24 bytes."""
    begin = 0 if rng.random() < 0.2 else 20
    spot = begin + int(rng.random() * (len(data) - begin))
    match int(10 * rng.random()):
        case 0 | 1 | 2:
            data[spot] ^= 1 << int(rng.integers(8))
        case 3 | 4:
            data[spot] = int(rng.integers(256))
        case 5 | 6:
            number = EXTREMES[rng.integers(len(EXTREMES))]
            packed = struct.pack("<d", number) if rng.random() < 0.5 else np.float32(number).tobytes()
            data[spot : spot + len(packed)] = packed
        case 7:
            del data[spot : spot + int(rng.integers(1, 17))]
        case 8:
            data[spot:spot] = donor[int(rng.integers(len(donor))) :][:64]
        case _:
            # Another time, another sender.
            time_s = EXTREMES[rng.integers(len(EXTREMES))] if rng.random() < 0.5 else 2e9 * rng.random()
            struct.pack_into("<d", data, 6, time_s)
            struct.pack_into("<H", data, 14, int(rng.integers(65536)))


def memory_mb() -> float:
    """Resident memory of this process now."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 2**20
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10


class Target:
    """A bridge whose vehicles are engaged as far as they say that they can be."""

    def __init__(self) -> None:
        self.now = 0.0
        self.events = self.impossible = 0
        self.bridge = Bridge(BridgeSettings(loopback_only=True), clock=lambda: self.now)
        self.bridge.listen(self._note)
        self._engaging: dict[int, asyncio.Task[None]] = {}

    def _note(self, event: object) -> None:
        self.events += 1
        if isinstance(event, StateReport | Sounding):
            numbers = [value for value in dataclasses.astuple(event) if isinstance(value, float)]
            if not (all(map(math.isfinite, numbers)) and abs(event.lat_deg) <= 90.0):
                self.impossible += 1
                print(event, file=sys.stderr)

    def take(self, packet: bytes, address: Address, *, announce: bool) -> None:
        """One packet a millisecond after the last."""
        self.now += 0.001
        self.bridge.on_packet(packet, address)
        if announce:
            self.bridge.on_announce(packet, address)

    async def live(self, step: int) -> None:
        """Let time pass, and order every vehicle about."""
        self.bridge.pass_time()
        for node in self.bridge.nodes():
            task = self._engaging.get(node.imc_id)
            if task is None or (task.done() and not node.engaged):
                if task is not None and not task.cancelled():
                    task.exception()
                self._engaging[node.imc_id] = asyncio.create_task(self.bridge.engage(node.name))
            with contextlib.suppress(RefusedError):
                self.bridge.goto(node.name, Waypoint("fuzz", step, 41.185, -8.706, 3.0))
        await asyncio.sleep(0)

    async def end(self) -> None:
        """Leave no task behind."""
        for task in self._engaging.values():
            task.cancel()
        await asyncio.gather(*self._engaging.values(), return_exceptions=True)


async def fuzz(packets: int, seed: int, captures: Path | None = None) -> dict[str, Any]:
    """Feed that many packets to a bridge; what became of them."""
    target = Target()
    bridge = target.bridge
    pool = seeds(captures)
    stream = mutated(pool, np.random.default_rng(seed))
    begun, marks_mb = time.process_time(), []
    for packet, address in pool:
        target.take(packet, address, announce=True)
    for number in range(packets):
        packet, address = next(stream)
        target.take(packet, address, announce=packet[2:4] == ANNOUNCE or number % 7 == 0)
        if number % 200 == 0:
            await target.live(number // 5000)
        if (number + 1) % max(packets // MARKS, 1) == 0:
            marks_mb.append(round(memory_mb(), 1))
    await target.end()
    return {
        "packets": packets,
        "seed": seed,
        "from_captures": captures is not None,
        "decoded": bridge.decoder.decoded.total() + bridge.announces.decoded.total(),
        "unwanted": bridge.decoder.unwanted.total(),
        "faults": {fault.value: n for fault, n in (bridge.decoder.faults + bridge.announces.faults).items()},
        "events": target.events,
        "impossible_events": target.impossible,
        "handler_errors": dict(bridge.handler_errors),
        "nodes": len(bridge.nodes()),
        "memory_mb": marks_mb,
        "growth_mb": round(marks_mb[-1] - marks_mb[MARKS // 2 - 1], 2),
        "cpu_s": round(time.process_time() - begun, 1),
    }


def main() -> None:
    """Run and print; exit code 1 when a handler failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--packets", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--captures", type=Path)
    parser.add_argument("--write", type=Path, help="page of results in which this run gets a section")
    options = parser.parse_args()
    result = asyncio.run(fuzz(options.packets, options.seed, options.captures))
    print(json.dumps(result))
    if options.write is not None:
        title = f"{options.packets:,} mutated packets".replace(",", " ")
        write_section(options.write, title, result, {options.captures: "CAPTURES"})
    grown = result["growth_mb"] > MOST_GROWTH_MB
    sys.exit(1 if result["handler_errors"] or result["impossible_events"] or grown else 0)


if __name__ == "__main__":
    main()
