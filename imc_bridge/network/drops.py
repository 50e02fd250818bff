"""Packets that this machine threw away because our sockets were full: our loss, and no vehicle's fault."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

RECENT_WALL_S = 60.0
LOOK_WALL_S = 1.0


class DropMeter:
    """Follows the system's count of packets that it could not queue for us.

    Parameters
    ----------
    read
        Returns the count since the sockets were opened.

    Attributes
    ----------
    total : int
        Packets lost so far.
    """

    def __init__(self, read: Callable[[], int]) -> None:
        self.total = 0
        self._read = read
        self._looked_s = -LOOK_WALL_S
        self._lately: deque[tuple[float, int]] = deque()

    def look(self, now_s: float) -> int:
        """Look at the count, once a second; returns how many were lost since the last look. ``now_s``: wall clock."""
        if now_s - self._looked_s < LOOK_WALL_S:
            return 0
        self._looked_s = now_s
        while self._lately and now_s - self._lately[0][0] > RECENT_WALL_S:
            self._lately.popleft()
        lost = max(self._read() - self.total, 0)
        if lost:
            self.total += lost
            self._lately.append((now_s, lost))
        return lost

    @property
    def recent(self) -> int:
        """How many were lost in the last minute before the last look."""
        return sum(lost for _, lost in self._lately)
