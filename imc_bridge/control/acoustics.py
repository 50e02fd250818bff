"""Speaking to a vehicle by sound, through a gateway that has a modem.

A message goes to the gateway in a TransmissionRequest; it answers at once that it queued it, and some seconds later
whether it was sent. What the vehicle then says to the gateway does not come back here: only a short report does, when
asked for, which the gateway turns into an EstimatedState under the vehicle's id. One message at a time is under way:
sound carries some hundred bytes per second.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import imcpy

from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text
from imc_bridge.telemetry.positions import told_place

DEADLINE_S = 20.0
"""After this long the gateway gives a message up, and so do we."""
REPORT_PERIOD_S = 30.0
SENT = frozenset({1, 51, 52})
"""Sent, delivered, perhaps delivered."""
QUEUED = 0
ACOUSTIC_INTERFACE = 0x01
FRAME_BYTES = 5
"""What a frame has more than the message's packet."""
ABORT_BYTES = 3
INSTANT_BYTES = 64
"""The longest instant message of the modems that DUNE drives; longer ones take a burst, which is acknowledged."""
STATES = {
    52: "perhaps delivered",
    101: "refused by the gateway",
    102: "failed for now",
    103: "failed for good",
    104: "no such system",
}


@dataclass(frozen=True, slots=True)
class SoundReport:
    """Where a vehicle says by sound that it is; whole metres."""

    lat_deg: float
    lon_deg: float
    depth_m: float


@dataclass(slots=True)
class _Transmission:
    request_id: int
    what: str
    since: float
    urgent: bool
    size: int


def transmission(message: Message, vehicle: str, request_id: int, deadline_s: float) -> Message:
    """The request to a gateway to send a message to a vehicle by sound; ``deadline_s``: Unix seconds."""
    request = imcpy.TransmissionRequest()
    request.req_id = request_id
    request.comm_mean = imcpy.TransmissionRequest.CommunicationMeanEnum.ACOUSTIC
    request.destination = vehicle
    request.deadline = deadline_s
    if isinstance(message, imcpy.Abort):
        # Three bytes, which the vehicle acknowledges.
        request.data_mode = imcpy.TransmissionRequest.DataModeEnum.ABORT
    else:
        request.data_mode = imcpy.TransmissionRequest.DataModeEnum.INLINEMSG
        request.msg_data = message
    return request


def frame_bytes(message: Message) -> int:
    """How many bytes DUNE's modem sends for a message; up to ``INSTANT_BYTES`` at once, more as a burst."""
    if isinstance(message, imcpy.Abort):
        return ABORT_BYTES
    return len(imcpy.Packet.serialize(message)) + FRAME_BYTES


def report_request(gateway: str) -> Message:
    """Ask a vehicle for one report by sound to a gateway."""
    request = imcpy.ReportControl()
    request.op = imcpy.ReportControl.OperationEnum.REQUEST_REPORT
    request.comm_interface = ACOUSTIC_INTERFACE
    request.period = 0
    request.sys_dst = gateway
    return request


class SoundPath:
    """The way to one vehicle by sound.

    Parameters
    ----------
    vehicle, gateway
        Their names.
    send
        Sends a message to the gateway.
    next_id
        Numbers for requests.
    gateway_clock
        Unix seconds by the gateway's own clock: it holds deadlines against that.
    """

    def __init__(
        self,
        vehicle: str,
        gateway: str,
        send: Callable[[Message], None],
        next_id: Callable[[], int],
        gateway_clock: Callable[[], float],
    ) -> None:
        self.vehicle = vehicle
        self.gateway = gateway
        self.outcomes: Counter[str] = Counter()
        self.last_problem = ""
        self.report: SoundReport | None = None
        self._send = send
        self._next_id = next_id
        self._gateway_clock = gateway_clock
        self._under_way: _Transmission | None = None
        self._asked_at = -math.inf

    def send(self, message: Message, now: float) -> bool:
        """Send a message unless another one is under way; commands go before reports."""
        urgent = not isinstance(message, imcpy.ReportControl)
        busy = self._under_way
        if busy is not None and now - busy.since < DEADLINE_S and (busy.urgent or not urgent):
            return False
        request_id = self._next_id()
        self._under_way = _Transmission(request_id, type(message).__name__, now, urgent, frame_bytes(message))
        self._send(transmission(message, self.vehicle, request_id, self._gateway_clock() + DEADLINE_S))
        return True

    def status(self, message: Message) -> str:
        """Take a TransmissionStatus of the gateway; returns what was sent when it left now, else ''."""
        busy = self._under_way
        if busy is None or int(message.req_id) != busy.request_id:
            return ""
        state = int(message.status)
        if state == QUEUED:
            return ""
        self._under_way = None
        if state in SENT:
            self.outcomes["sent"] += 1
            return busy.what
        words = STATES.get(state, f"status {state}")
        self.outcomes[words] += 1
        self.last_problem = f"{busy.what} by sound ({busy.size} bytes): {words}" + (
            f" ({info})" if (info := text(message, "info")) else ""
        )
        return ""

    def take_report(self, message: Message) -> SoundReport | None:
        """Take an EstimatedState that the gateway made of a report; None when it holds no position."""
        place = told_place(message)
        if place is None:
            return None
        self.report = SoundReport(math.degrees(place[0]), math.degrees(place[1]), float(message.depth))
        return self.report

    def ask(self, now: float) -> None:
        """Ask for a report when it is time."""
        if now - self._asked_at >= REPORT_PERIOD_S and self.send(report_request(self.gateway), now):
            self._asked_at = now
