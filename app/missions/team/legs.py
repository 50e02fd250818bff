"""Legs of a vehicle: those that are decided, the one that it flies, and how far all of them are."""

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from app.missions.fleet.interface import Position
from app.missions.spec.orders import OrderKind, OrderState


@dataclass(frozen=True, slots=True)
class CommittedLeg:
    """A leg that is decided and written down, and not begun yet; ``number`` counts its vehicle's legs."""

    number: int
    position: Position
    target_m: NDArray[np.float64]
    """Where it ends in the mission's frame, (2,): east, north."""
    surfacing: bool = False
    """Whether it brings its vehicle up for a fix."""
    homeward: bool = False
    """Whether it leads home, or up: it takes nothing of its vehicle's way."""


@dataclass
class OrderedLeg:
    """The leg that a vehicle was ordered to fly.

    Attributes
    ----------
    start_m : (2,)
        Where it begins.
    began_s
        When it was ordered, the event loop's time.
    allowed_s
        How long it may take, by the vehicles' clock.
    """

    start_m: NDArray[np.float64] | None = None
    began_s: float = 0.0
    allowed_s: float = 0.0

    def begin(self, now_s: float, allowed_s: float) -> None:
        """Let its time begin."""
        self.began_s, self.allowed_s = now_s, allowed_s

    def stand_still(self, seconds: float) -> None:
        """Leave so much out of its time, by the event loop's clock."""
        self.began_s += seconds


@dataclass
class CommittedWay:
    """What was committed for a vehicle: what is left of its way is counted from that.

    Attributes
    ----------
    legs
        Number of the last leg.
    way_m
        How long all legs are together, but for those that it was spared.
    spared
        How many legs were given up before it began them: they take nothing of how far it may be sent.
    late_m
        How much farther it could have come in the time that a mission of so many minutes counts: turns, waiting.
    """

    legs: int = 0
    way_m: float = 0.0
    spared: int = 0
    late_m: float = 0.0

    def commit(self, number: int) -> None:
        """Count a leg of this number; it may be committed after one of a higher number, by who was away meanwhile."""
        self.legs = max(self.legs, number)

    def spare(self, legs: int, way_m: float) -> None:
        """Give legs back that are this long together."""
        self.spared += legs
        self.way_m = max(self.way_m - way_m, 0.0)


@dataclass
class OperatorOrder:
    """What an operator ordered a vehicle to do, as long as that is not over; ``corners_m`` (k, 2) is its way."""

    id: int
    kind: OrderKind
    state: OrderState
    corners_m: NDArray[np.float64]
    asked_by: str
    asked_at: datetime
