"""How the flight of a mission stands in this process: whether it goes on, may send anything, and came to its end."""

import asyncio


class FlightStatus:
    """How one mission's flight stands.

    Attributes
    ----------
    counting
        Whether what vehicles fly is counted: while it goes on, until that is stored at its end.
    halted
        While vehicles are being stopped: it must not send them off again as it ends.
    flown_out
        Whether it came to its end: nothing changes any more how long it is.
    standstill
        Why no vehicle may be sent anywhere now; empty while at least one may.
    """

    def __init__(self) -> None:
        self._unstored_since_s: float | None = None
        """Since when it has not been stored, the event loop's time; None while it does not go on here."""
        self.counting = False
        self.halted = False
        self.flown_out = False
        self.standstill = ""

    @property
    def goes_on(self) -> bool:
        """Whether it goes on in this process."""
        return self._unstored_since_s is not None

    @property
    def unstored_s(self) -> float:
        """How long it has gone on since that was stored, on the wall clock."""
        since_s = self._unstored_since_s
        return 0.0 if since_s is None else asyncio.get_running_loop().time() - since_s

    def set_off(self) -> None:
        """Let it send vehicles off again."""
        self.halted = False

    def begin(self) -> None:
        """Note that it goes on in this process from now on."""
        self._unstored_since_s = asyncio.get_running_loop().time()
        self.counting, self.flown_out = True, False

    def store(self, seconds: float) -> None:
        """Note that so many of its seconds are stored now."""
        if self._unstored_since_s is not None:
            self._unstored_since_s += seconds

    def stand_still(self, why: str) -> None:
        """Note why no vehicle may be sent anywhere; empty: at least one may again."""
        self.standstill = why

    def halt(self) -> None:
        """Keep it from sending anything more."""
        self.halted = True

    def come_to_end(self) -> None:
        """Note that it came to its end."""
        self.flown_out = True

    def stop_counting(self) -> None:
        """Count nothing any more of what vehicles fly: what is stored now is what was flown."""
        self.counting = False

    def end(self) -> None:
        """Note that nobody flies it here any more."""
        self._unstored_since_s = None
        self.standstill = ""
