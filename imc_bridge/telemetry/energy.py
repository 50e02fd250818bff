"""What a vehicle says of its energy: FuelLevel."""

from __future__ import annotations

import math
from dataclasses import dataclass

from imc_bridge.network.codec import Message
from imc_bridge.network.text_fields import text

MOTION = "motion"
"""The mode of operation in which a vehicle is under way, as IMC's definition of FuelLevel calls it."""
LONGEST_H = 24.0 * 365.0


@dataclass(frozen=True, slots=True)
class Energy:
    """Level and confidence in per cent, and for how long the rest lasts under way; None: not told."""

    level_pct: float
    confidence_pct: float | None = None
    left_s: float | None = None


def read_fuel(message: Message) -> Energy | None:
    """Read a FuelLevel; None where its level cannot be."""
    level, confidence = float(message.value), float(message.confidence)
    if not 0.0 <= level <= 100.0:
        return None
    return Energy(level, confidence if 0.0 <= confidence <= 100.0 else None, motion_left_s(text(message, "opmodes")))


def motion_left_s(opmodes: str) -> float | None:
    """For how long the energy lasts under way, seconds; None where it is not told.

    ``opmodes`` is DUNE's list of hours by mode, ``Hotel=12.5;Motion=4.1;``. Which modes there are is configured on
    board; DUNE's own configurations leave the list empty.
    """
    for item in opmodes.split(";"):
        mode, _, value = item.partition("=")
        if mode.strip().casefold() != MOTION:
            continue
        try:
            hours = float(value)
        except ValueError:
            return None
        # DUNE divides what is left by a power, and what is left may come out below zero.
        return 3600.0 * max(hours, 0.0) if math.isfinite(hours) and hours <= LONGEST_H else None
    return None
