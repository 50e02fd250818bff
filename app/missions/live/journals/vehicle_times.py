"""One time for all vehicles of a mission: their clocks differ, and simulated ones run fast or are held up.

Each clock is set against the service's when the vehicle is first heard, and then followed: what two vehicles measured
between two moments of their clocks lies between the same two moments here, however late it came. Only a clock that has
gone far astray is set anew.
"""

import math
from collections.abc import Callable

ASTRAY_S, ASTRAY_WALL_S = 60.0, 20.0
"""How far a clock may go astray: so much of its own time, and so much of the wall clock."""


class VehicleTimes:
    """Turns vehicles' times into the mission's.

    Parameters
    ----------
    time_scale
        How much faster than the wall clock the vehicles live.
    wall
        Unix seconds.
    """

    def __init__(self, time_scale: float, wall: Callable[[], float]) -> None:
        self._scale = time_scale
        self._wall = wall
        self._offsets: dict[str, float] = {}
        self._newest_s = -math.inf
        self._newest_at_s = 0.0

    def now_s(self) -> float:
        """Return the time now; it goes on over restarts."""
        service_s = self._wall() * self._scale
        return self._newest_s + service_s - self._newest_at_s if math.isfinite(self._newest_s) else service_s

    def heard(self, vehicle: str, time_s: float) -> float:
        """Return the time of something that was heard of a vehicle just now."""
        now_s = self.now_s()
        offset = self._offsets.get(vehicle)
        if offset is None or abs(time_s + offset - now_s) > ASTRAY_S + ASTRAY_WALL_S * self._scale:
            offset = self._offsets[vehicle] = now_s - time_s
        at_s = time_s + offset
        if at_s > self._newest_s:
            self._newest_s, self._newest_at_s = at_s, self._wall() * self._scale
        return at_s

    def of(self, vehicle: str, time_s: float) -> float:
        """Return the time of what a vehicle measured at a time of its clock, once the vehicle was heard."""
        return time_s + self._offsets.get(vehicle, 0.0)
