"""The energy of a simulated vehicle: what its computers and its motor draw, and how long the rest of it lasts."""

from __future__ import annotations

import math
from dataclasses import dataclass

HOTEL_SHARE = 0.3
"""Of what is drawn at the nominal speed: computers, sensors, radio. The rest drives the vehicle."""


@dataclass(frozen=True, slots=True)
class BatterySpec:
    """A battery as its maker and its owner describe it.

    Attributes
    ----------
    endurance_min
        How long it lasts at the nominal speed.
    nominal_mps
        That speed, through the water.
    level_pct
        Where it starts.
    consumption_factor
        How much is really drawn, as a multiple of what the endurance says.
    confidence_pct
        How sure the vehicle says that it is of the level.
    """

    endurance_min: float = 480.0
    nominal_mps: float = 1.2
    level_pct: float = 100.0
    consumption_factor: float = 1.0
    confidence_pct: float = 90.0

    def __post_init__(self) -> None:
        for name in ("endurance_min", "nominal_mps", "consumption_factor"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} is {value:g}; it must be a number above 0")
        for name in ("level_pct", "confidence_pct"):
            value = getattr(self, name)
            if not 0.0 <= value <= 100.0:
                raise ValueError(f"{name} is {value:g}; it must be 0 to 100")


class Battery:
    """A battery that empties. The level is true; the time left is by the specification, which may be too good."""

    def __init__(self, spec: BatterySpec) -> None:
        self.spec = spec
        self.level_pct = spec.level_pct
        self._full_s = 60.0 * spec.endurance_min

    @property
    def empty(self) -> bool:
        """Whether nothing is left."""
        return self.level_pct <= 0.0

    def drain(self, dt_s: float, water_mps: float) -> None:
        """Draw what ``dt_s`` seconds take; ``water_mps`` is 0 with the motor off."""
        drawn = self.spec.consumption_factor * self._draw(water_mps) * dt_s / self._full_s
        self.level_pct = max(0.0, self.level_pct - 100.0 * drawn)

    def recharge(self, level_pct: float = 100.0) -> None:
        """Fill it up to a level."""
        if not 0.0 <= level_pct <= 100.0:
            raise ValueError(f"level_pct is {level_pct:g}; it must be 0 to 100")
        self.level_pct = level_pct

    def time_left_s(self, water_mps: float | None = None) -> float:
        """How long the rest should last at a speed through the water; None: the nominal one."""
        speed = self.spec.nominal_mps if water_mps is None else water_mps
        return 0.01 * self.level_pct * self._full_s / self._draw(speed)

    def _draw(self, water_mps: float) -> float:
        """What is drawn at a speed, as a share of what is drawn at the nominal one."""
        return HOTEL_SHARE + (1.0 - HOTEL_SHARE) * (water_mps / self.spec.nominal_mps) ** 3
