"""What a vehicle has flown of its part of a mission, and what it is at."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from app.arrays import BoolArray
from app.exploration.motion.on_leg import Place, along_leg

FASTEST_MPS = 10.0
"""A position that is farther from the last one than this speed makes was corrected, not flown to."""


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


@dataclass
class Flown:
    """What one vehicle has flown."""

    flown_m: float = 0.0
    """Along its track, metres."""
    on_plan_m: float = 0.0
    """Of those along planned legs, metres."""
    idle_s: float = 0.0
    """Vehicle time in which it had no leg to fly and was to get one, seconds."""
    survey_s: float = 0.0
    """Vehicle time in which it surveyed, seconds: without the way there and home, and without fixes at the surface."""
    used_s: float = 0.0
    """Energy used, in seconds at its usual speed."""
    legs_reached: int = 0
    """Legs of the survey to whose end it came."""
    legs_missed: int = 0
    missed_last: int = 0
    """How many of its last legs in a row it missed."""
    left_m: float | None = None
    """What it may fly yet, metres; None where that is not known."""
    phase: Phase = Phase.STOPPED

    @property
    def surveyed(self) -> bool:
        """Whether it ever surveyed: who only was on its way did not."""
        return self.survey_s > 0.0 or self.legs_reached > 0

    def add_way(self, start: Place, end: Place, leg: tuple[Place, Place] | None) -> None:
        """Add a piece of track while a leg was flown; None: it had none."""
        length_m = math.hypot(end[0] - start[0], end[1] - start[1])
        self.flown_m += length_m
        if leg is not None and along_leg(start, end, leg):
            self.on_plan_m += length_m

    def reach_leg(self) -> None:
        """Count a leg to whose end it came."""
        self.legs_reached += 1
        self.missed_last = 0

    def miss_leg(self) -> None:
        """Count a leg that it did not get to the end of."""
        self.legs_missed += 1
        self.missed_last += 1

    def remember(self) -> dict[str, float]:
        """Return what is stored, so that a restart goes on counting."""
        kept = asdict(self)
        names = ("flown_m", "on_plan_m", "idle_s", "survey_s", "used_s", "left_m")
        counts = {name: kept[name] for name in ("legs_reached", "legs_missed", "missed_last")}
        return {name: round(kept[name], 2) for name in names if kept[name] is not None} | counts

    @classmethod
    def recall(cls, stored: dict[str, Any] | None) -> "Flown":
        """Return what was stored; nothing flown where nothing was."""
        return cls(**(stored or {}))


def is_flown(away_m: ArrayLike, passed_s: ArrayLike) -> BoolArray:
    """Tell, for each, whether a vehicle flew from one position to the next, or only its position was corrected."""
    away, passed = np.asarray(away_m), np.asarray(passed_s)
    return np.asarray((passed > 0.0) & (away <= FASTEST_MPS * passed))


def efficiency_pct(team: Iterable[Flown]) -> float | None:
    """Return the share of a team's metres that were flown on plan, percent; None while nothing was flown."""
    flown_m = on_plan_m = 0.0
    for one in team:
        flown_m, on_plan_m = flown_m + one.flown_m, on_plan_m + one.on_plan_m
    return 100 * on_plan_m / flown_m if flown_m > 0 else None
