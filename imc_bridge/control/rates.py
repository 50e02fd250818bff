"""Asks a vehicle to send often what is needed and seldom what is not, and gives it its own rates back afterwards."""

from __future__ import annotations

from collections.abc import Callable

import imcpy

from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text

ENTITY = "UDP"
PARAMETER = "Rate Limiters"
RETRY_S = 2.0
MAX_TRIES = 5
QUERY_TRIES = 5
"""A list takes the place of the one before: without the former one, what only that limits comes unlimited."""
DUNE_DEFAULTS = (
    "CpuUsage:0.2, Distance:0.2, EntityState:1, EstimatedState:2, FuelLevel:0.1, Rpm:1, SimulatedState:0.5, "
    "StorageUsage:0.05, Temperature:0.1, Voltage:0.1"
)
"""Likely rates of a vehicle that never reported them."""
RESTORE_TRIES = 20
"""How often the former rates are sent until the vehicle reports them: one that is gone is not asked for ever."""
RESTORE_TRIES_AT_ONCE = 3
"""How often they are sent where nobody will hear an answer."""
RESTORE_RETRY_S = 1.0


def merge_limiters(former: str, wanted: str) -> str:
    """The former list with the wanted limits in it: ``"GpsFix:1, Distance:0.2"`` + ``"Distance:5"``."""
    limits: dict[str, str] = {}
    for limits_text in (former, wanted):
        for item in limits_text.split(","):
            name, separator, value = item.partition(":")
            if separator:
                limits[name.strip()] = value.strip()
    return ", ".join(f"{name}:{value}" for name, value in limits.items())


class RateRequest:
    """The rate limiters of one vehicle: read, set until confirmed, restored.

    Parameters
    ----------
    wanted
        :data:`imc_bridge.settings.DEFAULT_RATE_LIMITERS` or the like; empty asks for nothing.
    send
        Sends a message to the vehicle.
    """

    def __init__(self, wanted: str, send: Callable[[Message], None]) -> None:
        self._wanted = wanted
        self._send = send
        self._former: str | None = None
        self._set: str | None = None
        self._active = False
        self._confirmed = False
        self._tries = 0
        self._due = 0.0
        self._restores = 0

    @property
    def restoring(self) -> bool:
        """Whether the former rates are still to be sent again."""
        return self._restores > 0

    @property
    def pending(self) -> bool:
        """Whether something is still to be sent or confirmed."""
        return self._active and not self._confirmed

    @property
    def text(self) -> str:
        """How far it has come, in words."""
        if not self._active:
            return "as the vehicle has them"
        if self._confirmed:
            return f"set to {self._set}"
        return "asked for" if self._tries < MAX_TRIES + QUERY_TRIES else "not confirmed by the vehicle"

    def begin(self) -> None:
        """Start asking; also after a restart of the vehicle, which forgets."""
        self._restores = 0
        if self._wanted:
            self._active = True
            self._confirmed = False
            self._tries = 0
            self._due = 0.0

    def tick(self, now: float) -> None:
        """Send what is due: first the query of the former value, then the request; in the end the former value."""
        if self._restores and self._former is not None and now >= self._due:
            self._restores -= 1
            self._due = now + RESTORE_RETRY_S
            self._send(_set_message(self._former))
            # DUNE says nothing to a new value: asked for, it tells the one that holds.
            self._send(parameter_query(ENTITY))
        if not self._active or self._confirmed or now < self._due or self._tries >= MAX_TRIES + QUERY_TRIES:
            return
        self._due = now + RETRY_S
        self._tries += 1
        if self._former is None and self._tries <= QUERY_TRIES:
            self._send(parameter_query(ENTITY))
            return
        self._set = merge_limiters(self._former or DUNE_DEFAULTS, self._wanted)
        self._send(_set_message(self._set))

    def answered(self, message: Message, now: float) -> None:
        """EntityParameters of the vehicle: the former value, or the confirmation."""
        if text(message, "name") != ENTITY:
            return
        for parameter in message.params:
            if isinstance(parameter, imcpy.EntityParameter) and text(parameter, "name") == PARAMETER:
                value = text(parameter, "value")
                if self._set is not None and _same(value, self._set):
                    self._confirmed = True
                elif self._former is None and self._set is None:
                    self._former = value
                    self._due = now
                elif self._former is not None and not self._active and _same(value, self._former):
                    self._restores = 0

    def observed(self, state_rate_hz: float) -> None:
        """Let a vehicle that does not answer confirm by what it sends."""
        for item in self._wanted.split(","):
            name, _, value = item.partition(":")
            if name.strip() == "EstimatedState" and self._set is not None:
                self._confirmed = self._confirmed or state_rate_hz >= 0.6 * float(value)

    def restore(self) -> None:
        """Give the vehicle its former rates back: sent until it reports them, since packets get lost."""
        if self._active and self._set is not None:
            self._former = self._former or DUNE_DEFAULTS
            self._send(_set_message(self._former))
            self._restores = RESTORE_TRIES
            self._due = 0.0
        self._active = False
        self._set = None

    def restore_now(self) -> None:
        """Give the former rates back with the last message."""
        self.restore()
        if self._restores and self._former is not None:
            for _ in range(RESTORE_TRIES_AT_ONCE - 1):
                self._send(_set_message(self._former))
        self._restores = 0


def parameter_query(entity: str) -> Message:
    """The question for an entity's parameters."""
    query = imcpy.QueryEntityParameters()
    query.name = entity
    # DUNE answers with every parameter visible to users in the global scope.
    query.visibility = "developer"
    query.scope = "global"
    return query


def _same(a: str, b: str) -> bool:
    return a.replace(" ", "") == b.replace(" ", "")


def _set_message(value: str) -> Message:
    parameter = imcpy.EntityParameter()
    parameter.name = PARAMETER
    parameter.value = value
    message = imcpy.SetEntityParameters()
    message.name = ENTITY
    message.params.append(parameter)
    return message
