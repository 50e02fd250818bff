"""When messages are due: periods in vehicle time, and the rate limiters of DUNE's UDP transport."""

from __future__ import annotations

import math
from collections.abc import Mapping

DEFAULT_LIMITS_HZ: Mapping[str, float] = {
    "Distance": 0.2,
    "EstimatedState": 2.0,
    "SimulatedState": 0.5,
    "CpuUsage": 0.2,
    "EntityState": 1.0,
    "FuelLevel": 0.1,
    "Rpm": 1.0,
    "StorageUsage": 0.05,
    "Temperature": 0.1,
    "Voltage": 0.1,
}
"""What a LAUV limits unless asked otherwise. Servo positions and attitude are not among it: they come at full rate."""


class RateLimiterError(ValueError):
    """A "Rate Limiters" parameter that cannot be understood."""


def parse_limits(text: str) -> dict[str, float]:
    """Rates by message name from ``"Distance:5, EstimatedState:10"``.

    Raises
    ------
    RateLimiterError
        For an item that is not ``Message:frequency`` with a positive frequency.
    """
    limits: dict[str, float] = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        name, separator, value = item.partition(":")
        try:
            rate = float(value)
        except ValueError:
            rate = math.nan
        if not separator or not name.strip() or not (math.isfinite(rate) and rate > 0.0):
            raise RateLimiterError(f"rate limiter {item!r} is not of the form Message:frequency, frequency > 0")
        limits[name.strip()] = rate
    return limits


class RateLimiter:
    """Decides which messages pass, per message name and sending entity."""

    def __init__(self, limits: Mapping[str, float]) -> None:
        self._periods = {name: 1.0 / rate for name, rate in limits.items()}
        self._due: dict[tuple[str, int], float] = {}

    def passes(self, name: str, entity: int, now_s: float) -> bool:
        """Whether a message may be sent now; counts it as sent if so."""
        period = self._periods.get(name)
        if period is None:
            return True
        key = (name, entity)
        due = self._due.get(key, now_s)
        if now_s < due - 1e-6:
            return False
        # Keeps the mean rate when the clock ticks coarser than the period, without bursts after a gap.
        self._due[key] = max(due + period, now_s + 0.5 * period)
        return True


class Periodic:
    """Tells when something with a fixed period is due again."""

    def __init__(self, period_s: float, first_s: float) -> None:
        self.period_s = period_s
        self.next_s = first_s

    def due(self, now_s: float) -> bool:
        """Whether it is due; the next time is set if so."""
        if now_s < self.next_s - 1e-6:
            return False
        self.next_s = max(self.next_s + self.period_s, now_s + 0.5 * self.period_s)
        return True
