"""Throws mutated packets at the bridge: ``python benchmarks/imc_fuzz.py [--packets 1000000] [--seed 0] [--captures DIR]``.

Packets of recorded sessions (or, without any, of every message the bridge takes in) are flipped, cut, spliced and
filled with extreme numbers; most get a right checksum afterwards, so that they reach the parsers and gates. Printed
is one JSON object: what became of them, errors of the handlers (must be 0) and growth of the process's memory between
the first tenth and the end. A crash ends the command with a traceback.
"""

import argparse
import asyncio
import gzip
import json
import resource
import struct
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import imcpy
import numpy as np

from imc_bridge import Bridge, BridgeSettings, StateReport, Waypoint
from imc_bridge.bridge import WANTED

CONSOLE = ("127.0.0.1", 6101)
VEHICLE_ID, VEHICLE = 0x1E, ("127.0.0.1", 6002)
EXTREMES = [0.0, -1.0, 1e9, -1e9, 1e38, 1e300, float("inf"), float("-inf"), float("nan")]
SHIFTS = (16, 24)


def crc_table() -> list[int]:
    """CRC-16/ARC, byte by byte."""
    table = []
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
        table.append(value)
    return table


TABLE = crc_table()


def with_checksum(packet: bytearray) -> bytes:
    """The packet with its own length in the header and the checksum that belongs to it."""
    struct.pack_into("<H", packet, 4, max(len(packet) - 22, 0) & 0xFFFF)
    crc = 0
    for byte in packet[:-2]:
        crc = crc >> 8 ^ TABLE[(crc ^ byte) & 0xFF]
    struct.pack_into("<H", packet, len(packet) - 2, crc)
    return bytes(packet)


def seeds(captures: Path | None) -> list[tuple[bytes, tuple[str, int]]]:
    """Good packets with the address they came from."""
    found: dict[tuple[object, ...], tuple[bytes, tuple[str, int]]] = {}
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
            found[(name,)] = (bytes(message.serialize()), VEHICLE)
    return list(found.values())


def mutated(pool: list[tuple[bytes, tuple[str, int]]], rng: np.random.Generator) -> Iterator[tuple[bytes, object]]:
    """Mutated packets without end."""
    while True:
        draws = rng.random((4096, 8))
        for which, kind, at, value, other, fix, copies, where in draws:
            packet, address = pool[int(which * len(pool))]
            data = bytearray(packet)
            for _ in range(1 + int(3 * copies)):
                spot = int(at * len(data))
                if kind < 0.3:
                    data[spot] ^= 1 << int(8 * value)
                elif kind < 0.5:
                    data[spot] = int(256 * value)
                elif kind < 0.7 and len(data) > 30:
                    size = 8 if other < 0.5 else 4
                    spot = 20 + int(at * max(len(data) - 22 - size, 1))
                    number = EXTREMES[int(value * len(EXTREMES))]
                    with_size = struct.pack("<d" if size == 8 else "<f", np.float32(number) if size == 4 else number)
                    data[spot : spot + size] = with_size
                elif kind < 0.8:
                    del data[spot : spot + int(16 * value) + 1]
                elif kind < 0.9:
                    donor = pool[int(other * len(pool))][0]
                    data[spot:spot] = donor[int(value * len(donor)) :][:64]
                else:
                    # A plausible packet of another time or system.
                    struct.pack_into("<d", data, 6, EXTREMES[int(value * len(EXTREMES))] if other < 0.5 else 2e9 * value)
                    struct.pack_into("<H", data, SHIFTS[int(2 * copies) % 1], int(65536 * other))
                at = (at * 7.3) % 1.0
                if len(data) < 24:
                    data.extend(bytes(24 - len(data)))
            if len(data) > 65_000:
                del data[65_000:]
            packet = with_checksum(data) if fix < 0.9 else bytes(data)
            yield packet, (("10.0.0.1", 1 + int(65534 * other)) if where < 0.02 else address)


def memory_mb() -> float:
    """Resident memory of this process now."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 2**20
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10


def run(packets: int, seed: int, captures: Path | None) -> dict[str, object]:
    """Feed that many packets to a bridge whose vehicles are engaged, as far as they say so."""
    now = 0.0
    bridge = Bridge(BridgeSettings(loopback_only=True), clock=lambda: now)
    events = bad_positions = 0

    def note(event: object) -> None:
        nonlocal events, bad_positions
        events += 1
        if isinstance(event, StateReport) and not (abs(event.lat_deg) <= 90.0 and abs(event.depth_m) < 1e9):
            bad_positions += 1

    bridge.listen(note)
    pool = seeds(captures)
    stream = mutated(pool, np.random.default_rng(seed))
    begun, early_mb = time.process_time(), 0.0
    for packet, address in pool:
        (bridge.on_announce if packet[2:4] == b"\x97\x00" else bridge.on_packet)(packet, address)
    for number in range(packets):
        packet, address = next(stream)
        now += 0.001
        bridge.on_packet(packet, address)
        if packet[2:4] == b"\x97\x00" or number % 7 == 0:
            bridge.on_announce(packet, address)
        if number % 200 == 0:
            bridge.pass_time()
        if number % 5000 == 0:
            for node in bridge.nodes():
                bridge.offer(node.name, Waypoint("fuzz", number, 41.185, -8.706, 3.0))
        if number == packets // 10:
            early_mb = memory_mb()
    return {
        "packets": packets,
        "seed": seed,
        "from_captures": captures is not None,
        "decoded": bridge.decoder.decoded.total() + bridge.announces.decoded.total(),
        "unwanted": bridge.decoder.unwanted.total(),
        "faults": {fault.value: n for fault, n in (bridge.decoder.faults + bridge.announces.faults).items()},
        "events": events,
        "handler_errors": dict(bridge.handler_errors),
        "impossible_states_passed_on": bad_positions,
        "nodes": len(bridge.nodes()),
        "growth_mb": round(memory_mb() - early_mb, 2),
        "cpu_s": round(time.process_time() - begun, 1),
    }


async def _run(packets: int, seed: int, captures: Path | None) -> dict[str, object]:
    return run(packets, seed, captures)


def main() -> None:
    """Run and print; exit code 1 when a handler failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--packets", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--captures", type=Path)
    options = parser.parse_args()
    result = asyncio.run(_run(options.packets, options.seed, options.captures))
    print(json.dumps(result))
    sys.exit(1 if result["handler_errors"] else 0)


if __name__ == "__main__":
    main()
