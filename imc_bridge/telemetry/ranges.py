"""Ranges to other systems that vehicles measure by sound, placed where the vehicle was when it measured.

DUNE reports a range in one of five messages. By default its UDP transport passes on three of them: AcousticOperation
(the answer to a range request), LblRangeAcceptance (a transponder's range with what the navigation made of it) and
UsblPositionExtended (of which only the distance is used here). UamRxRange and LblRange stay on board unless the
vehicle's configuration adds them. Where two of them report the same measurement it is taken once.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import imcpy

from imc_bridge.events import TargetRange
from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text
from imc_bridge.telemetry.soundings import Awaiting, StateHistory

MESSAGES = ("AcousticOperation", "LblRange", "LblRangeAcceptance", "UamRxRange", "UsblPositionExtended")

LBL = "lbl-"
"""A transponder of a long base line has a number only; this and the number is the name it gets."""

SAME_S, SAME_M = 0.5, 0.05
"""Ranges to one system that are this close together are one measurement, reported twice."""

MAX_PENDING = 64
REMEMBERED = 64
GREATEST_M = 20_000.0
"""No acoustic modem reaches farther."""


@dataclass(frozen=True, slots=True)
class RangePing:
    """One range that awaits the vehicle's state."""

    time_s: float
    target: str
    range_m: float
    source: str


def read_range(name: str, message: Message) -> tuple[str, float] | None:
    """Return the target of a range in a message of :data:`MESSAGES`, and the range; None without one."""
    match name:
        case "AcousticOperation":
            if int(message.op) != int(imcpy.AcousticOperation.OperationEnum.RANGE_RECVED):
                return None
            return text(message, "system"), float(message.range)
        case "UamRxRange":
            return text(message, "sys"), float(message.value)
        case "LblRange" | "LblRangeAcceptance":
            return f"{LBL}{int(message.id)}", float(message.range)
        case "UsblPositionExtended":
            return text(message, "target"), math.hypot(message.x, message.y, message.z)
        case _:
            return None


class RangeIntake:
    """One vehicle's ranges: what cannot be one is dropped and counted, the others wait for the state around them."""

    def __init__(self, vehicle: str) -> None:
        self.vehicle = vehicle
        self.accepted = 0
        self.refused = 0
        self._pending: Awaiting[RangePing] = Awaiting(MAX_PENDING)
        self._last: deque[RangePing] = deque(maxlen=REMEMBERED)

    def clear(self) -> None:
        """Forget what is pending, as after a jump of the vehicle's clock."""
        self._pending.clear()
        self._last.clear()

    def offer(self, name: str, message: Message) -> None:
        """Take a message of :data:`MESSAGES` in."""
        told = read_range(name, message)
        if told is None:
            return
        target, range_m = told
        if not target or not math.isfinite(range_m) or not 0.0 < range_m <= GREATEST_M:
            self.refused += 1
            return
        ping = RangePing(float(message.timestamp), target, range_m, name)
        if any(_same(ping, other) for other in self._last):
            return
        self._last.append(ping)
        self._pending.add(ping)

    def resolve(self, history: StateHistory, position_sd_m: float | None = None) -> Iterator[TargetRange]:
        """Yield the pending ranges that ``history`` can place now; those it never will are dropped."""
        for ping, state in self._pending.decided(history):
            if state is None:
                self.refused += 1
                continue
            self.accepted += 1
            yield TargetRange(
                vehicle=self.vehicle,
                time_s=ping.time_s,
                target=ping.target,
                range_m=ping.range_m,
                vehicle_lat_deg=math.degrees(state.lat_rad),
                vehicle_lon_deg=math.degrees(state.lon_rad),
                vehicle_depth_m=state.depth_m,
                source=ping.source,
                position_sd_m=position_sd_m,
            )


def _same(ping: RangePing, other: RangePing) -> bool:
    if ping.target != other.target:
        return False
    repeated = ping.source == other.source and ping.time_s == other.time_s
    told_twice = (
        ping.source != other.source
        and abs(ping.time_s - other.time_s) <= SAME_S
        and abs(ping.range_m - other.range_m) <= SAME_M
    )
    return repeated or told_twice
