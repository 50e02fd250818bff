"""Simulated time that runs a constant factor faster than the wall clock."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

log = logging.getLogger(__name__)


class SimulationClock:
    """Vehicle time: starts at the wall clock's time and runs ``speed`` times as fast.

    Parameters
    ----------
    speed
        Seconds of vehicle time per second of wall time.
    start_s
        Vehicle time at the start, Unix seconds; now by default.
    monotonic
        Source of wall time, for tests.
    """

    def __init__(
        self,
        speed: float = 1.0,
        *,
        start_s: float | None = None,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        if not 0.0 < speed <= 1000.0:
            raise ValueError(f"speed is {speed}; it must be above 0 and at most 1000")
        self.speed = speed
        self.start_s = time.time() if start_s is None else start_s
        self.lost_s = 0.0
        """Vehicle time that was left out because the machine could not keep up."""
        self._monotonic = monotonic
        self._origin = monotonic()

    def now(self) -> float:
        """Vehicle time, Unix seconds."""
        return self.start_s + (self._monotonic() - self._origin) * self.speed - self.lost_s

    def give_up(self, seconds: float) -> None:
        """Leave out some vehicle time."""
        if self.lost_s == 0.0:
            log.warning("the machine does not keep up with %g times real time; vehicle time falls behind", self.speed)
        self.lost_s += seconds
