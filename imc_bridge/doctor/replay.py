"""Recorded sessions: what a bridge in the place of the recorded console would have made of them.

A recording is a file of JSON lines ``{"t": seconds, "src": "host:port", "dst": "host:port", "hex": packet}``, packed
by gzip or not.
"""

from __future__ import annotations

import gzip
import json
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import imcpy

from imc_bridge.bridge import Bridge
from imc_bridge.events import BridgeEvent
from imc_bridge.network.codec import Header, peek
from imc_bridge.network.discovery import read_announce
from imc_bridge.network.transport import Address
from imc_bridge.nodes.vehicle_clock import VehicleClock
from imc_bridge.settings import BridgeSettings

ANNOUNCE = int(imcpy.Announce().msg_id)
PLAN_CONTROL = int(imcpy.PlanControl().msg_id)
RATE_TOLERANCE = 0.2
"""A vehicle's clock that differs more from the recording's is a simulation's."""


class RecordingError(ValueError):
    """A file that is no recording."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """One recorded packet; ``time_s`` is Unix seconds."""

    time_s: float
    src: Address
    dst: Address
    packet: bytes


@dataclass(frozen=True, slots=True)
class Session:
    """A recording as a bridge understood it."""

    bridge: Bridge
    seconds: float
    packets: int
    taken: int
    """Packets that were for the console."""


def read_recording(path: str | Path) -> Iterator[Recorded]:
    """Yield the packets of a recording in order.

    Raises
    ------
    RecordingError
        Naming the line and what it should look like.
    """
    path = Path(path)
    number = 0
    try:
        with gzip.open(path, "rt") if path.suffix == ".gz" else path.open() as lines:
            for number, line in enumerate(lines, 1):  # noqa: B007 - named when a line cannot be read
                if line.strip():
                    item = json.loads(line)
                    packet = bytes.fromhex(item["hex"])
                    yield Recorded(float(item["t"]), _address(item["src"]), _address(item["dst"]), packet)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}") from None
    except (ValueError, KeyError, TypeError, EOFError, zlib.error) as error:
        raise RecordingError(
            f'{path}, line {number + 1 if number == 0 else number}: {error}; a line must be {{"t": seconds, "src": '
            '"host:port", "dst": "host:port", "hex": "54fe…"}'
        ) from None


def replay(
    path: str | Path, settings: BridgeSettings, on_event: Callable[[BridgeEvent], None] = lambda _event: None
) -> Session:
    """Feed a recording to a bridge at the recording's pace.

    The recorded console is the one of our id, or else the receiver of most packets; the bridge takes its id and port.
    The clocks of simulated vehicles that ran faster than the recording's set the time scale.
    """
    records = list(read_recording(path))
    if not records:
        raise RecordingError(f"{path} holds no packet")
    console, imc_id = _console(records, settings)
    plan_id = _plan_id(records, console)
    settings = settings.changed(
        id=imc_id,
        port=console[1],
        vehicles=(),
        state_events_per_s=1000.0,
        time_scale=_time_scale(records, console, settings),
        **({"plan_id": plan_id} if plan_id else {}),
    )
    now = records[0].time_s
    bridge = Bridge(settings, commanding=False, clock=lambda: now, wall_clock=lambda: now)
    bridge.listen(on_event)
    own_runs = {_run(record) for record in records if record.src == console and _announces(record, imc_id)}
    taken = 0
    for record in records:
        now = record.time_s
        if record.dst[1] in settings.announce_ports:
            # Our own announces went to every port and interface, and taught us nothing.
            if record.src != console and not (_announces(record, imc_id) and _run(record) in own_runs):
                bridge.on_announce(record.packet, record.src)
        elif record.dst == console:
            taken += 1
            bridge.on_packet(record.packet, record.src)
        bridge.pass_time()
    return Session(bridge, now - records[0].time_s, len(records), taken)


def _address(text: str) -> Address:
    host, _, port = str(text).rpartition(":")
    return host, int(port)


def _console(records: list[Recorded], settings: BridgeSettings) -> tuple[Address, int]:
    """Address and id of the console whose session was recorded."""
    speakers: Counter[tuple[Address, int]] = Counter()
    listeners: Counter[Address] = Counter()
    for record in records:
        header = peek(record.packet)
        if not isinstance(header, Header):
            continue
        speakers[(record.src, header.src)] += 1
        if record.dst[1] not in settings.announce_ports:
            listeners[record.dst] += 1
    for (address, imc_id), _ in speakers.most_common():
        if imc_id == settings.id and address in listeners:
            return address, imc_id
    if not listeners:
        return ("127.0.0.1", settings.port), settings.id
    address = listeners.most_common(1)[0][0]
    ids = [imc_id for (src, imc_id), _ in speakers.most_common() if src == address]
    return address, ids[0] if ids else settings.id


def _announces(record: Recorded, imc_id: int) -> bool:
    """Whether a packet is an announce of an id."""
    header = peek(record.packet)
    return isinstance(header, Header) and header.msg_id == ANNOUNCE and header.src == imc_id


def _run(record: Recorded) -> str | None:
    """Which run of a service like ours an announce is of; None when it does not tell."""
    try:
        return read_announce(imcpy.Packet.deserialize(record.packet)).run
    except RuntimeError:
        return None


def _time_scale(records: list[Recorded], console: Address, settings: BridgeSettings) -> float:
    clocks: dict[tuple[Address, int], VehicleClock] = {}
    for record in records:
        header = peek(record.packet)
        if isinstance(header, Header) and record.dst == console and header.msg_id != ANNOUNCE:
            clock = clocks.setdefault((record.src, header.src), VehicleClock())
            clock.take(header.timestamp, record.time_s, record.time_s)
    rates = sorted(rate for clock in clocks.values() if (rate := clock.rate(1.0)) is not None)
    if not rates or abs(rates[-1] - 1.0) < RATE_TOLERANCE:
        return settings.time_scale if settings.time_scale != 1.0 else 1.0
    return min(max(float(round(rates[-1], 1)), 0.01), 1000.0)


def _plan_id(records: list[Recorded], console: Address) -> str:
    """Name of the plan that the console started first."""
    for record in records:
        header = peek(record.packet)
        if record.src == console and isinstance(header, Header) and header.msg_id == PLAN_CONTROL:
            try:
                return str(imcpy.Packet.deserialize(record.packet).plan_id)
            except RuntimeError:
                continue
    return ""
