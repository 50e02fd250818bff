"""What a vehicle has flown of its part of a mission, and what it is at."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum


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
    """Of those along planned legs that sound new ground, metres."""
    idle_s: float = 0.0
    """Vehicle time in which it waited for a decision, seconds."""
    left_m: float | None = None
    """What it may fly yet, metres; None where that is not known."""
    phase: Phase = Phase.TRANSIT

    def after_way(self, way_m: float, on_plan_m: float = 0.0) -> "Flown":
        """Return the same ``way_m`` metres of track later, ``on_plan_m`` of them on plan; so much less is left."""
        left_m = None if self.left_m is None else max(self.left_m - way_m, 0.0)
        flown_m, planned_m = self.flown_m + way_m, self.on_plan_m + on_plan_m
        return replace(self, flown_m=flown_m, on_plan_m=planned_m, left_m=left_m)

    def after_waiting(self, seconds: float) -> "Flown":
        """Return the same after it waited so many seconds of vehicle time for a decision."""
        return replace(self, idle_s=self.idle_s + seconds)

    def minutes_left(self, speed_mps: float) -> float | None:
        """Return how long what is left takes at a speed in m/s, minutes; None where that is not known."""
        return None if self.left_m is None else self.left_m / speed_mps / 60


def efficiency_pct(team: Iterable[Flown]) -> float | None:
    """Return the share of a team's metres that were flown on plan, percent; None while nothing was flown."""
    flown_m = on_plan_m = 0.0
    for one in team:
        flown_m, on_plan_m = flown_m + one.flown_m, on_plan_m + one.on_plan_m
    return 100 * on_plan_m / flown_m if flown_m > 0 else None
