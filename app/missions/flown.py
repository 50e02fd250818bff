"""What a vehicle has flown of its part of a mission, and what it is at."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

ASIDE_M = 4.0
"""A vehicle that is no farther than this from its leg's line is on it."""
LEAST_COSINE = math.cos(math.radians(45.0))
"""And its course leads no farther aside than this."""


class Phase(StrEnum):
    """What a vehicle is at."""

    TRANSIT = "transit"
    """On its way to where it surveys."""
    SURVEY = "survey"
    SURFACING = "surfacing"
    """On its way up for a GPS fix, or waiting for one."""
    RETURNING = "returning"
    HOME = "home"
    STOPPED = "stopped"


Place = tuple[float, float]
"""East and north in the mission's frame, metres."""


@dataclass
class Flown:
    """What one vehicle has flown."""

    flown_m: float = 0.0
    """Along its track, metres."""
    on_plan_m: float = 0.0
    """Of those along planned legs, metres."""
    idle_s: float = 0.0
    """Vehicle time in which it had no leg to fly and was to get one, seconds."""
    left_m: float | None = None
    """What it may fly yet, metres; None where that is not known."""
    phase: Phase = Phase.STOPPED

    def add_way(self, start: Place, end: Place, leg: tuple[Place, Place] | None) -> None:
        """Add a piece of track while a leg was flown; None: it had none."""
        length_m = math.hypot(end[0] - start[0], end[1] - start[1])
        self.flown_m += length_m
        if leg is not None and _along(start, end, leg):
            self.on_plan_m += length_m

    def remember(self) -> dict[str, float]:
        """Return what is stored, so that a restart goes on counting."""
        kept = asdict(self)
        return {name: round(kept[name], 2) for name in ("flown_m", "on_plan_m", "idle_s")}

    @classmethod
    def recall(cls, stored: dict[str, Any] | None) -> "Flown":
        """Return what was stored; nothing flown where nothing was."""
        return cls(**(stored or {}))


def _along(start: Place, end: Place, leg: tuple[Place, Place]) -> bool:
    """Whether a piece of track leads along a leg, close to its line."""
    (from_e, from_n), (to_e, to_n) = leg
    leg_e, leg_n = to_e - from_e, to_n - from_n
    way_e, way_n = end[0] - start[0], end[1] - start[1]
    leg_m, way_m = math.hypot(leg_e, leg_n), math.hypot(way_e, way_n)
    if leg_m == 0.0 or way_m == 0.0:
        return False
    aside_m = abs((end[0] - from_e) * leg_n - (end[1] - from_n) * leg_e) / leg_m
    return aside_m <= ASIDE_M and (leg_e * way_e + leg_n * way_n) / (leg_m * way_m) >= LEAST_COSINE


def efficiency_pct(team: Iterable[Flown]) -> float | None:
    """Return the share of a team's metres that were flown on plan, percent; None while nothing was flown."""
    flown_m = on_plan_m = 0.0
    for one in team:
        flown_m, on_plan_m = flown_m + one.flown_m, on_plan_m + one.on_plan_m
    return 100 * on_plan_m / flown_m if flown_m > 0 else None
