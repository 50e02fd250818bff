"""How often each kind of message arrives."""

from __future__ import annotations

from collections import deque

RATE_WINDOW_S = 10.0


class RateMeter:
    """Messages per second over the last window, by name."""

    def __init__(self) -> None:
        self._arrivals: dict[str, deque[float]] = {}

    def count(self, name: str, now: float) -> None:
        """Note one message."""
        arrivals = self._arrivals.get(name)
        if arrivals is None:
            arrivals = self._arrivals[name] = deque(maxlen=256)
        arrivals.append(now)

    def rates_hz(self, now: float) -> dict[str, float]:
        """Rate of every message seen within the window."""
        rates = {}
        for name, arrivals in self._arrivals.items():
            while arrivals and now - arrivals[0] > RATE_WINDOW_S:
                arrivals.popleft()
            if len(arrivals) > 1:
                rates[name] = (len(arrivals) - 1) / max(now - arrivals[0], 1e-3)
            elif arrivals:
                rates[name] = 1.0 / RATE_WINDOW_S
        return rates
