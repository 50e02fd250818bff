"""The sea floor below the surface of the water as it is now: what maps tell from the datum, at the tide's level."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom

UNCERTAINTY_FACTOR = 2.0
"""The bottom is taken to be this many standard deviations shallower than estimated."""


def below_surface_m(depth_m: FloatArray, water_level_m: float) -> FloatArray:
    """Return depths below the datum as depths below the water's surface now, on the safe side.

    Vehicles count their depth from the surface. Water below the datum leaves them less room; the room that water above
    it would give is not used, for it goes again.

    Parameters
    ----------
    depth_m
        Below the datum, positive down.
    water_level_m
        How high the water stands above the datum: :meth:`.Corrections.water_level_m`, which
        knows of tide tables and datum offsets.
    """
    return depth_m + min(water_level_m, 0.0)


@dataclass(frozen=True)
class BottomNow:
    """The sea floor below the surface at one level of the water.

    Attributes
    ----------
    likely
        As the map estimates it.
    cautious
        :data:`UNCERTAINTY_FACTOR` deviations shallower.
    """

    likely: Bottom
    cautious: Bottom

    @classmethod
    def of(cls, xy_m: FloatArray, depth_m: FloatArray, sd_m: FloatArray, water_level_m: float) -> "BottomNow":
        """Return the sea floor of estimates below the datum with their deviations, each (n,), at places (n, 2)."""
        below_m = below_surface_m(depth_m, water_level_m)
        shallow_m = np.where(np.isfinite(sd_m), below_m - UNCERTAINTY_FACTOR * sd_m, np.nan)
        return cls(Bottom.from_landmarks(xy_m, below_m), Bottom.from_landmarks(xy_m, shallow_m))


class FallingTide:
    """Keeps a sea floor while the water falls.

    Parameters
    ----------
    water_level_m
        Returns how high the water stands above the datum now.
    """

    def __init__(self, water_level_m: Callable[[], float]) -> None:
        self._water_level_m = water_level_m
        self._bottom, self._below_datum_m = Bottom.unknown(), 0.0

    def take(self, bottom: Bottom) -> None:
        """Go by another sea floor, below the surface as it is now."""
        self._bottom, self._below_datum_m = bottom, self._water_below_datum_m()

    @property
    def bottom(self) -> Bottom:
        """The sea floor, less deep by what the water has fallen since it was taken."""
        fallen_m = self._water_below_datum_m() - self._below_datum_m
        return replace(self._bottom, depth_m=self._bottom.depth_m - fallen_m) if fallen_m > 0.0 else self._bottom

    def _water_below_datum_m(self) -> float:
        return -float(below_surface_m(np.zeros(1), self._water_level_m())[0])
