"""Mutated packets for the bridge: ``python -m benchmarks.imc.fuzz [--packets 1000000] [--seeds 0] [--captures DIR]``.

Packets of recorded sessions (or, without any, of every message the bridge takes in) are flipped, cut, spliced and
filled with extreme numbers; most get a right checksum afterwards, so that they reach the parsers and gates. Printed
is one JSON object: what became of them, errors of the handlers (must be 0) and the process's memory after each tenth,
with its growth over the second half, in which every bounded store is full (must stay below 4 MB). ``--write`` puts
it into a page. A crash ends the command with a traceback.

Behind the bridge stands a mission's gate, as in the service: what it lets through must be finite, inside its zone and
no deeper than any ocean. ``--keep FILE`` writes the first packet of every kind of outcome (message, what the decoder,
the bridge and the gate said to it) into a corpus, which the tests feed in again; take it without ``--captures``.
"""

import asyncio
import contextlib
import dataclasses
import gzip
import json
import math
import re
import resource
import struct
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import imcpy
import numpy as np
from numba import njit
from shapely.geometry import Polygon

from app.mapping.coordinates.georeference import LocalFrame
from app.missions.fleet.links.imc import sounding_report
from app.missions.soundings.corrections import Corrections
from app.missions.soundings.gate import MAX_OCEAN_DEPTH_M, Gate
from app.missions.spec.water import Tide
from benchmarks.common.report import IMC, make_parser, write_section
from imc_bridge import Bridge, BridgeSettings, LinkChange, RefusedError, Sounding, StateReport, SwathPing, Waypoint
from imc_bridge.events import PingRefused, SoundingRefused
from imc_bridge.network.codec import message_ids, message_name
from imc_bridge.network.transport import Address
from imc_bridge.receiver import WANTED

VEHICLE_ID, VEHICLE, ALTIMETER, MULTIBEAM = 0x1E, ("127.0.0.1", 6002), 11, 13
PLACE_DEG = (41.185, -8.706)
SIDE_M, MARGIN_M = 2000.0, 100.0
EXTREMES = [0.0, -1.0, 1e9, -1e9, 1e38, float("inf"), float("-inf"), float("nan")]
Packet = tuple[bytes, Address]
ANNOUNCE = imcpy.Announce().msg_id.to_bytes(2, "little")
STATE = imcpy.EstimatedState().msg_id.to_bytes(2, "little")


ROUNDS, BETWEEN = 3, 4096
"""How often good packets come in a row, and after how many mutated ones they come again."""
MARKS = 10
"""Moments at which memory is measured."""
MOST_GROWTH_MB = 4.0


@njit(cache=True)
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


def stamped(packet: bytes, time_s: float) -> bytes:
    """The packet as sent at another time of its sender's clock."""
    data = bytearray(packet)
    struct.pack_into("<d", data, 6, time_s)
    return with_checksum(data)


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
    return list(found.values()) or [(bytes(message.serialize()), VEHICLE) for message in made_up()]


def made_up() -> list[Any]:
    """One message of every kind that is taken in and some that are not, of a vehicle that sounds and could follow."""
    messages = []
    for name in ("Announce", "EntityList", *WANTED, "ServoPosition", "GpsFix"):
        message = getattr(imcpy, name)()
        message.src, message.timestamp = VEHICLE_ID, 1.7e9
        match name:
            case "Announce":
                message.sys_name, message.sys_type = "lauv-fuzz", imcpy.SystemType.UUV
                message.services = f"imc+udp://{VEHICLE[0]}:{VEHICLE[1]}/"
            case "EntityList":
                message.op, message.list = (
                    imcpy.EntityList.OperationEnum.REPORT,
                    f"Altimeter={ALTIMETER};GPS=12;Multibeam={MULTIBEAM}",
                )
            case "EstimatedState":
                message.lat, message.lon = map(math.radians, PLACE_DEG)
                message.depth, message.alt = 3.0, 10.0
            case "Distance":
                message.src_ent, message.value = ALTIMETER, 10.0
                message.validity = imcpy.Distance.ValidityEnum.VALID
            case "SonarData":
                message.src_ent, message.type = MULTIBEAM, imcpy.SonarData.TypeEnum.MULTIBEAM
                message.bits_per_point, message.scale_factor = 16, 0.01
                message.beam_config.append(imcpy.BeamConfig())
                message.beam_config[0].beam_width = 0.1
                message.data = struct.pack("<HfB20H", 20, -1.0, 0, *[1000] * 20)
            case "PlanControlState":
                message.state = imcpy.PlanControlState.StateEnum.READY
        messages.append(message)
    return messages


def mutated(pool: list[Packet], rng: np.random.Generator) -> Iterator[Packet]:
    """Mutated packets without end, most of them of messages that are taken in, by a clock that goes on.

    Now and then the good packets come again, so that there is a vehicle whose soundings are worth a gate's while.
    """
    wanted = message_ids((*WANTED, "Announce"))
    known = [item for item in pool if int.from_bytes(item[0][2:4], "little") in wanted]
    clock = 1.8e9
    while True:
        for packet, address in known * ROUNDS:
            clock += 0.02
            yield stamped(packet, clock), address
        for which, stranger, whole, checked in rng.random((BETWEEN, 4)):
            some = pool if stranger > 0.9 else known
            packet, address = some[int(which * len(some))]
            data = bytearray(packet)
            clock += 0.01
            struct.pack_into("<d", data, 6, clock)
            # A forged announce bars its vehicle for a while; with many of them nothing else would be tried.
            if whole < (0.03 if packet[2:4] == ANNOUNCE else 0.7):
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
    """A bridge whose vehicles are engaged as far as they say that they can be, and a mission's gate behind it."""

    def __init__(self) -> None:
        self.now = 0.0
        self.events = self.impossible = 0
        self.gated: Counter[str] = Counter()
        self.heard: set[str] = set()
        """What was said since the last packet, without names and figures."""
        self.bridge = Bridge(BridgeSettings(loopback_only=True), clock=lambda: self.now)
        self.bridge.listen(self._note)
        self._engaging: dict[int, asyncio.Task[None]] = {}
        corner = LocalFrame(*PLACE_DEG)
        lat, lon = corner.to_geographic(np.array(-SIDE_M / 2), np.array(-SIDE_M / 2))
        area = Polygon([(0, 0), (SIDE_M, 0), (SIDE_M, SIDE_M), (0, SIDE_M)])
        corrections = Corrections(LocalFrame(float(lat), float(lon)), Tide())
        self._gate = Gate(corrections, area, margin_m=MARGIN_M, noise=0.01)

    def _note(self, event: object) -> None:
        self.events += 1
        said = type(event).__name__
        if isinstance(event, LinkChange | PingRefused | SoundingRefused):
            said += f": {wordy(getattr(event, 'state', ''))} {wordy(event.reason)}"
        if isinstance(event, StateReport | Sounding | SwathPing):
            numbers = [value for value in dataclasses.astuple(event) if isinstance(value, float)]
            if isinstance(event, SwathPing):
                numbers += event.angles_rad.tolist()
            if not (all(map(math.isfinite, numbers)) and abs(event.lat_deg) <= 90.0):
                self._count_impossible(event)
        if isinstance(event, Sounding):
            said += f": {self._judge(event)}"
        self.heard.add(said)

    def _judge(self, event: Sounding) -> str:
        (found,) = self._gate.check([sounding_report(event)])
        verdict = wordy(found.reason) or "accepted"
        self.gated[verdict] += 1
        inside = max(abs(found.east_m - SIDE_M / 2), abs(found.north_m - SIDE_M / 2)) <= SIDE_M / 2 + MARGIN_M
        if found.accepted and not (inside and 0.0 < found.depth_m <= MAX_OCEAN_DEPTH_M and 0.0 < found.sd_m < math.inf):
            self._count_impossible(found)
        return verdict

    def _count_impossible(self, what: object) -> None:
        self.impossible += 1
        print(what, file=sys.stderr)

    def take(self, packet: bytes, address: Address, *, announce: bool) -> None:
        """One packet a hundredth of a second after the last."""
        self.now += 0.01
        self.heard.clear()
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


def wordy(text: object) -> str:
    """Return a reason without what differs from one time to the next."""
    return re.sub(r"'[^']*'|[-+]?\d[\w.:+-]*|\b(nan|inf)\b", "_", str(text))[:80]


class Corpus:
    """The first packet of every kind, each in the order it came.

    Parameters
    ----------
    target
        What takes the packets.
    """

    def __init__(self, target: Target) -> None:
        self._target = target
        self._known: set[tuple[str, ...]] = set()
        self._faults = 0
        self.lines: list[str] = []

    def offer(self, packet: bytes, address: Address, *, announce: bool) -> None:
        """Keep a packet that was just taken when none of its kind was kept."""
        faults = self._target.bridge.decoder.faults.total()
        fault, self._faults = faults > self._faults, faults
        name = message_name(int.from_bytes(packet[2:4], "little")) or "unknown"
        for kind in sorted(self._target.heard) or [""]:
            key = (name, "fault" if fault else "", kind)
            if key not in self._known:
                self._known.add(key)
                item = {"kind": [*key], "from": address, "announce": announce, "hex": packet.hex()}
                self.lines.append(json.dumps(item))
                return


async def replay(lines: Iterable[str]) -> list[Target]:
    """Feed each packet of a kept corpus to a bridge of its own, good packets around it; returns what became of them."""
    good = seeds(None)
    states = [item for item in good if item[0][2:4] == STATE]
    others = [item for item in good if item[0][2:4] != STATE]
    # When the corpus's packet comes a range waits for the next state; whatever it is, a good state follows.
    before = [*others, *states, *others]
    ended = []
    for line in lines:
        target = Target()
        item = json.loads(line)
        packet = bytes.fromhex(item["hex"])
        (time_s,) = struct.unpack_from("<d", packet.ljust(14, b"\0"), 6)
        for number, (usual, address) in enumerate(before):
            target.take(stamped(usual, time_s + 0.02 * (number - len(before))), address, announce=True)
        target.take(packet, (item["from"][0], item["from"][1]), announce=item["announce"])
        for usual, address in states:
            target.take(stamped(usual, time_s + 0.02), address, announce=False)
        await target.live(0)
        await target.end()
        ended.append(target)
    return ended


async def fuzz(packets: int, seed: int, captures: Path | None = None, keep: Path | None = None) -> dict[str, Any]:
    """Feed that many packets to a bridge; what became of them."""
    target = Target()
    corpus = Corpus(target) if keep is not None else None
    bridge = target.bridge
    pool = seeds(captures)
    stream = mutated(pool, np.random.default_rng(seed))
    begun, marks_mb = time.process_time(), []
    for packet, address in pool:
        target.take(packet, address, announce=True)
    for number in range(packets):
        packet, address = next(stream)
        announce = packet[2:4] == ANNOUNCE or number % 7 == 0
        target.take(packet, address, announce=announce)
        if corpus is not None:
            corpus.offer(packet, address, announce=announce)
        if number % 200 == 0:
            target.bridge.pass_time()
        if number % 1000 == 0:
            await target.live(number // 5000)
        if (number + 1) % max(packets // MARKS, 1) == 0:
            marks_mb.append(round(memory_mb(), 1))
    await target.end()
    if keep is not None and corpus is not None:
        await asyncio.to_thread(keep.write_text, "\n".join(corpus.lines) + "\n", encoding="utf-8")
    return {
        "packets": packets,
        "seed": seed,
        "from_captures": captures is not None,
        "decoded": bridge.decoder.decoded.total() + bridge.announces.decoded.total(),
        "unwanted": bridge.decoder.unwanted.total(),
        "faults": {fault.value: n for fault, n in (bridge.decoder.faults + bridge.announces.faults).items()},
        "events": target.events,
        "gate": dict(target.gated),
        "impossible_events": target.impossible,
        "handler_errors": dict(bridge.handler_errors),
        "nodes": len(bridge.nodes()),
        "memory_mb": marks_mb,
        "growth_mb": round(marks_mb[-1] - marks_mb[MARKS // 2 - 1], 2),
        "cpu_s": round(time.process_time() - begun, 1),
    }


def main() -> None:
    """Run and print; exit code 1 when a handler failed."""
    parser = make_parser(__doc__, IMC, seeds=[0])
    parser.add_argument("--packets", type=int, default=1_000_000)
    parser.add_argument("--captures", type=Path)
    parser.add_argument("--keep", type=Path, help="file that the first packet of each kind is written to")
    options = parser.parse_args()
    failed = False
    for seed in options.seeds:
        result = asyncio.run(fuzz(options.packets, seed, options.captures, options.keep))
        print(json.dumps(result), flush=True)
        of = "made-up messages" if options.captures is None else "recorded sessions"
        title = f"{options.packets:,} mutated packets of {of}".replace(",", " ")
        write_section(options.write, IMC, title, result, seeds=[seed], hidden={options.captures: "CAPTURES"})
        grown = result["growth_mb"] > MOST_GROWTH_MB
        failed |= bool(result["handler_errors"] or result["impossible_events"] or grown)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
