"""A vehicle's own clock, as its packets show it: it may run ahead of ours, run faster (a simulation) or be reset."""

from __future__ import annotations

from collections import deque
from enum import Enum

LATE_S = 5.0
"""A timestamp further back than this is no late packet: a recording, or a clock that was set back, once it repeats."""
LEAP_S = 60.0
"""A timestamp further ahead than this, and than what passed meanwhile explains, is a clock set forward, if repeated."""
FASTEST = 50.0
"""No simulation runs this many times faster than the bridge's ``time_scale``."""
CONFIRMATIONS = 3
QUIET_S = 1.0
"""Nor is a clock believed to have been set while packets of the old one go on arriving: one of both is not its own."""
SAMPLE_S = 1.0
SAMPLES = 32
MIN_SPAN_S = 4.0


class Tick(Enum):
    """The verdict on a timestamp."""

    GOOD = "good"
    DOUBTFUL = "doubtful"
    """Far from everything before and not confirmed: a recording, or damaged. Its message is to be dropped."""
    JUMPED = "jumped"
    """The clock was set; whatever was ordered by it before is void."""


class VehicleClock:
    """Keeps up with one vehicle's clock.

    Parameters
    ----------
    quiet_s
        How long packets of the old time must have ceased until a new one is believed.

    Attributes
    ----------
    time_s : float or None
        The newest time of the vehicle, Unix seconds.
    offset_s : float or None
        How far it is ahead of our wall clock.
    jumps : int
        How often it was set.
    """

    def __init__(self, quiet_s: float = QUIET_S) -> None:
        self._quiet_s = quiet_s
        self.time_s: float | None = None
        self.offset_s: float | None = None
        self.jumps = 0
        self._arrived = 0.0
        self._in_time = 0.0
        self._odd: deque[float] = deque(maxlen=CONFIRMATIONS)
        self._samples: deque[tuple[float, float]] = deque(maxlen=SAMPLES)

    def take(self, timestamp: float, now: float, wall_time_s: float) -> Tick:
        """Take a message's timestamp in; ``now`` is its arrival by the bridge's clock."""
        if self.time_s is not None and not self.goes_on(timestamp, now):
            tick = self._odd_time(timestamp, now)
            if tick is Tick.JUMPED:
                self._in_time = now
                self._adopt(timestamp, now, wall_time_s)
            return tick
        self._odd.clear()
        self._in_time = now
        if self.time_s is None or timestamp >= self.time_s:
            self._adopt(timestamp, now, wall_time_s)
        return Tick.GOOD

    def rate(self, time_scale: float) -> float | None:
        """Seconds of the vehicle per second of the wall clock, None until contact has lasted long enough."""
        if len(self._samples) < 2:
            return None
        (first_now, first), (last_now, last) = self._samples[0], self._samples[-1]
        span = last_now - first_now
        return (last - first) / span * time_scale if span >= MIN_SPAN_S else None

    def is_old(self, timestamp: float) -> bool:
        """Whether a packet was sent long before others of the vehicle that have arrived."""
        return self.time_s is not None and timestamp < self.time_s - LATE_S

    def goes_on(self, timestamp: float, now: float) -> bool:
        """Whether a packet's timestamp goes on from those before: neither a recording's nor another clock's."""
        if self.time_s is None:
            return False
        return -LATE_S <= timestamp - self.time_s <= LEAP_S + FASTEST * max(now - self._arrived, 0.0)

    def _odd_time(self, timestamp: float, now: float) -> Tick:
        """Whether an odd timestamp is confirmed by those before it, which must lie close by, and by nothing else."""
        if self._odd and abs(timestamp - self._odd[-1]) > LEAP_S:
            self._odd.clear()
        self._odd.append(timestamp)
        if len(self._odd) < CONFIRMATIONS or now - self._in_time < self._quiet_s:
            return Tick.DOUBTFUL
        self.jumps += 1
        self._odd.clear()
        self._samples.clear()
        return Tick.JUMPED

    def _adopt(self, timestamp: float, now: float, wall_time_s: float) -> None:
        self.time_s, self._arrived = timestamp, now
        self.offset_s = timestamp - wall_time_s
        if not self._samples or now - self._samples[-1][0] >= SAMPLE_S:
            self._samples.append((now, timestamp))
