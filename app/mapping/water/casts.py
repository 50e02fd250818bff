"""Several sound speed casts of one survey: which of them corrects which ping, and how far neighbours differ.

The rules are those of the usual processing software: of CARIS HIPS and SIPS "nearest in time" and "nearest distance
within time", which Qimera and MB-System's mbsvplist and mbprocess know under similar names.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from app.arrays import FloatArray, IntArray
from app.mapping.water.sound_speed import SoundSpeedProfile


class CastRule(StrEnum):
    """How the cast of a ping is chosen."""

    NEAREST_IN_TIME = "nearest_in_time"
    NEAREST_IN_DISTANCE = "nearest_in_distance_within_time"

    @property
    def spoken(self) -> str:
        """Return it as a sentence says it."""
        return self.value.replace("_", " ")


@dataclass(frozen=True)
class CastPlaces:
    """When and where casts were taken, each array of shape (k,).

    Attributes
    ----------
    time_s
        Unix seconds; NaN of one that is alone and states none.
    east_m, north_m
        In the local frame; NaN where unknown.
    """

    time_s: FloatArray
    east_m: FloatArray
    north_m: FloatArray


class Casts:
    """The casts of one survey; one that is alone corrects everything.

    Parameters
    ----------
    profiles
        k of them, all for the same assumed speed.
    within_s
        With the rule nearest in distance: how far a cast may be away in time. Where none is as near, the nearest in
        time is taken.
    """

    def __init__(
        self,
        profiles: Sequence[SoundSpeedProfile],
        places: CastPlaces,
        rule: CastRule = CastRule.NEAREST_IN_TIME,
        within_s: float = np.inf,
    ) -> None:
        self.profiles = tuple(profiles)
        self.places, self.rule, self.within_s = places, rule, within_s
        # Casts with the same profile are traced together: a cast that equals another one changes nothing at all.
        first: dict[tuple[float, bytes, bytes], int] = {}
        self._like = np.array([first.setdefault(_content(one), number) for number, one in enumerate(self.profiles)])

    def __len__(self) -> int:
        return len(self.profiles)

    def chosen(self, time_s: FloatArray, east_m: FloatArray, north_m: FloatArray) -> IntArray:
        """Return the number of the cast that corrects each ping, (n,), counted from 0 in the order of the profiles.

        Parameters
        ----------
        time_s, east_m, north_m
            When and where each ping was made, (n,). A place may be NaN: then the nearest in time is taken.
        """
        if len(self) == 1:
            return np.zeros(len(time_s), dtype=np.int64)
        in_time = self._nearest_in_time(time_s)
        if self.rule is CastRule.NEAREST_IN_TIME:
            return in_time
        best, best_m, best_s = in_time, np.full(len(time_s), np.inf), np.full(len(time_s), np.inf)
        for number in range(len(self)):
            away_m = np.hypot(east_m - self.places.east_m[number], north_m - self.places.north_m[number])
            away_s = np.abs(time_s - self.places.time_s[number])
            nearer = (away_m < best_m) | ((away_m == best_m) & (away_s < best_s))
            better = (away_s <= self.within_s) & nearer
            best = np.where(better, number, best)
            best_m, best_s = np.where(better, away_m, best_m), np.where(better, away_s, best_s)
        return best

    def _nearest_in_time(self, time_s: FloatArray) -> IntArray:
        """Return the number of the cast nearest in time, (n,): of two that are as near the earlier one."""
        times, first = np.unique(self.places.time_s, return_index=True)
        return first[np.searchsorted(0.5 * (times[1:] + times[:-1]), time_s, side="left")].astype(np.int64)

    def trace(
        self, cast: IntArray, depth_m: FloatArray, across_m: FloatArray, down_m: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return horizontal and vertical distance from sonar to bottom, corrected, each by its ``cast``; all are (n,).

        The other parameters are those of :meth:`SoundSpeedProfile.trace`.
        """
        across, down = np.zeros(len(cast)), np.zeros(len(cast))
        like = self._like[cast]
        for number in np.unique(like).tolist():
            rows = np.flatnonzero(like == number)
            across[rows], down[rows] = self.profiles[number].trace(depth_m[rows], across_m[rows], down_m[rows])
        return across, down


def _content(profile: SoundSpeedProfile) -> tuple[float, bytes, bytes]:
    """Return what profiles that are the same have in common."""
    # Zero is added so that it has one sign only.
    depths, speeds = (np.asarray(values, dtype=float) + 0.0 for values in (profile.depths_m, profile.speeds_mps))
    return float(profile.assumed_mps), depths.tobytes(), speeds.tobytes()


def depth_difference_m(
    one: SoundSpeedProfile, other: SoundSpeedProfile, sonar_m: float, bottom_m: float, angle_rad: float
) -> float:
    """Return by how much the depth of one and the same beam differs between two profiles.

    Parameters
    ----------
    sonar_m, bottom_m
        Depth of the sonar, and of the bottom with the assumed speed.
    angle_rad
        Of the beam, from straight down.
    """
    down_m = max(bottom_m - sonar_m, 0.0)
    beam = (np.array([sonar_m]), np.array([down_m * np.tan(angle_rad)]), np.array([down_m]))
    return abs(float(one.trace(*beam)[1][0]) - float(other.trace(*beam)[1][0]))
