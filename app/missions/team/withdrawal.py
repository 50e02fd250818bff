"""Why a vehicle does not survey any more, and its way home."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.missions.spec.failsafes import Response


class WithdrawalCause(StrEnum):
    """What kind of reason ended a vehicle's survey."""

    CALLED = "called"
    """A person, a failsafe, or energy that lasts for the way home only: some of its part is left."""
    PART_DONE = "part_done"
    """It has done its part; others may still survey."""
    MISSION_END = "mission_end"
    """Its mission was flown to its end."""


@dataclass
class Withdrawal:
    """A vehicle surveys no more, for now or for good.

    Attributes
    ----------
    response
        What it does instead: never ``WARN``.
    why
        Shown to the operator.
    over
        Whether it has come to where that leads: home, up, stopped.
    led
        Whether it was sent on its way in this run.
    asked
        Whether a person wanted it: then only a person ends it.
    below
        Whether it waits below for ships to pass: it would come up where it is.
    cause
        What kind of reason that was.
    told
        Whether the mission's log says so, that of an earlier run of the service too.
    """

    response: Response
    why: str
    over: bool = False
    led: bool = False
    asked: bool = False
    below: bool = False
    cause: WithdrawalCause = WithdrawalCause.CALLED
    told: bool = False

    @property
    def done(self) -> bool:
        """Whether it has flown its part, or its mission was flown to its end."""
        return self.cause is not WithdrawalCause.CALLED

    def remember(self) -> dict[str, Any]:
        """Return what is stored, so that a restart goes on with it."""
        facts = {"response": self.response, "why": self.why, "over": self.over, "asked": self.asked}
        return facts | {"cause": self.cause}

    @classmethod
    def recall(cls, stored: dict[str, Any] | None) -> "Withdrawal | None":
        """Return what was stored."""
        if not stored:
            return None
        response, cause = Response(stored["response"]), WithdrawalCause(stored["cause"])
        return cls(response, stored["why"], stored["over"], asked=stored["asked"], cause=cause, told=True)


@dataclass(frozen=True, slots=True)
class WayHome:
    """A vehicle's way home from about where it is.

    Attributes
    ----------
    corners_m : (n, 2)
        None: it has none, or it is not known yet.
    needs_s
        How long it takes; None as for the corners.
    drift_reserve_s
        What the vehicle's reserve has for a drift while nobody hears it.
    left_alone_m : (n, 2)
        Its corners from anywhere on the vehicle's leg, for one that gets no further order.
    turn_back_m : (2,)
        Where on its planned legs it has to turn back at the latest; None: on none of them, or not known.
    """

    corners_m: NDArray[np.float64] | None = None
    needs_s: float | None = None
    drift_reserve_s: float = 0.0
    left_alone_m: NDArray[np.float64] | None = None
    turn_back_m: NDArray[np.float64] | None = None
