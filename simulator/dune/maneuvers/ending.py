"""Maneuvers that end by themselves."""

from __future__ import annotations

from abc import ABC, abstractmethod

import imcpy

from simulator.dune.maneuvers.follow_reference import DEFAULT_SPEED_MPS


class EndingManeuver(ABC):
    """One execution of a maneuver that ends by itself.

    Each is made of its IMC specification, the vehicle that it steers, where that one's local frame lies, and the
    vehicle's clock at the start.
    """

    @abstractmethod
    def failure(self, now_s: float) -> tuple[str, bool] | None:
        """Why the maneuver fails now, None while it goes on; the flag as in FollowReference."""

    @abstractmethod
    def done(self, now_s: float) -> bool:
        """Whether it is over; steers the vehicle where it is not."""


def speed_mps(spec: imcpy.Message) -> float:
    """Speed that a specification asks for; the vehicle's usual one where it does not say it in metres a second."""
    in_metres = int(spec.speed_units) == int(imcpy.SpeedUnits.METERS_PS)
    return float(spec.speed) if in_metres else DEFAULT_SPEED_MPS
