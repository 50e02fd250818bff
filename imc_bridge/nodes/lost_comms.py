"""How DUNE's task Supervisors/AUV/LostComms is configured on board, as it tells when it is asked."""

from __future__ import annotations

import imcpy

from imc_bridge.events import LostComms
from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text
from imc_bridge.printable import printable

DEFAULT_PLAN_NAME = "lostcomms"
PLAN_NAME, TIMEOUT = "Plan Name", "Lost Comms Timeout"
MAX_TEXT = 100
DUNE_CONSOLE_IDS = range(0x4000, 0x6000)
"""Only heartbeats under these ids keep the task from starting its plan."""


def is_lost_comms(entity: str) -> bool:
    """Whether an entity is that task, by its name ("Lost Comms", "LostComms Supervisor ASV")."""
    return entity.casefold().replace(" ", "").startswith("lostcomms")


def read_lost_comms(message: Message) -> LostComms:
    """Read the task's EntityParameters."""
    values = {
        text(parameter, "name"): printable(text(parameter, "value"), most=MAX_TEXT)
        for parameter in message.params
        if isinstance(parameter, imcpy.EntityParameter)
    }
    return LostComms(values.get(PLAN_NAME) or DEFAULT_PLAN_NAME, values.get(TIMEOUT) or "?")
