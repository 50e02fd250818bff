"""What a vehicle says is broken on board: its operation mode ERROR, and leak sensors that fail."""

from __future__ import annotations

import math

import imcpy

from imc_bridge.events import Fault, FaultKind
from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text
from imc_bridge.printable import printable

ERROR_MODE = 2
"""VehicleState.op_mode."""
ERROR_LASTS_S = 5.0
"""A plan that fails and an abort put a vehicle into ERROR for a second; that is no fault."""
FAILURE = int(imcpy.EntityState.StateEnum.FAILURE)
MAX_TEXT = 200


def is_leak_sensor(entity: str | None) -> bool:
    """Whether an entity tells of water on board, by its name ("Leak Sensor - Nose")."""
    return entity is not None and "leak" in entity.casefold()


class Faults:
    """The faults of one vehicle. Each is told once, and once more when it is over."""

    def __init__(self, vehicle: str) -> None:
        self.vehicle = vehicle
        self._leaks: dict[str, str] = {}
        self._present: dict[FaultKind, Fault] = {}
        self._in_error_since_s = math.inf

    @property
    def present(self) -> tuple[Fault, ...]:
        """Those that are not over."""
        return tuple(self._present.values())

    def take_entity(self, entity: str, message: Message) -> Fault | None:
        """EntityState of a leak sensor."""
        if int(message.state) == FAILURE:
            self._leaks[entity] = printable(text(message, "description"), most=MAX_TEXT)
        else:
            self._leaks.pop(entity, None)
        reason = "; ".join(f"{name}: {words}" if words else name for name, words in self._leaks.items())
        return self._judge(FaultKind.LEAK, reason, message.timestamp)

    def take_vehicle_state(self, message: Message, error_text: str) -> Fault | None:
        """VehicleState: an ERROR that lasts."""
        if int(message.op_mode) != ERROR_MODE:
            self._in_error_since_s = math.inf
            return self._judge(FaultKind.ERROR, "", message.timestamp)
        self._in_error_since_s = min(self._in_error_since_s, message.timestamp)
        if message.timestamp - self._in_error_since_s < ERROR_LASTS_S:
            return None
        return self._judge(FaultKind.ERROR, error_text or "no text given", message.timestamp)

    def clock_jumped(self) -> None:
        """Forget what goes by the vehicle's clock, which was set."""
        self._in_error_since_s = math.inf

    def _judge(self, kind: FaultKind, reason: str, time_s: float) -> Fault | None:
        known = self._present.get(kind)
        if reason and known is None:
            self._present[kind] = fault = Fault(self.vehicle, time_s, kind, reason)
            return fault
        if not reason and known is not None:
            del self._present[kind]
            return Fault(self.vehicle, time_s, kind, known.reason, over=True)
        return None
