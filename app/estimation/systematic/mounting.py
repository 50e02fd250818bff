"""Roll of a swath sonar in its vehicle and sound speed at it, from beams beside what others sounded straight down.

A wrong roll tilts every swath; a wrong sound speed at a sonar, by which it steers its beams, bends it (a smile or a
frown).
"""

from collections import defaultdict
from collections.abc import Hashable
from dataclasses import dataclass, field

import numpy as np

from app.arrays import FloatArray, IntArray
from app.estimation.systematic.jackknife import Estimate, jackknife_sd, solved

LEAST_BLOCKS = 4
"""Fewer pieces of tracks that cross others tell nothing."""

ROLL_PRIOR_RAD, SPEED_PRIOR = np.radians(2.0), 0.02
"""Standard deviations before anything is known: of the roll, and of the sound speed as a part of it."""

FAR_OF_HEIGHT = 0.1
"""Beams farther off than this share of their height are spikes or rocks."""


@dataclass(frozen=True)
class TiltErrors:
    """What is wrong with one vehicle's swath.

    Attributes
    ----------
    roll_offset_rad
        How far beams really point to starboard of where they are said to.
    sound_speed
        How much faster sound is at the sonar than it assumes, as a part of what it assumes.
    rms_before_m, rms_after_m
        Of outer beams beside what was sounded straight down, blocks' means left out.
    """

    roll_offset_rad: Estimate
    sound_speed: Estimate
    rms_before_m: float
    rms_after_m: float


@dataclass
class _Block:
    """Sums over the beams of one piece of a track: of both regressors, of depths, and of their products."""

    count: int = 0
    weight: float = 0.0
    means: FloatArray = field(default_factory=lambda: np.zeros(3))
    products: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    squares_m2: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    sums_m: FloatArray = field(default_factory=lambda: np.zeros(3))

    def centred(self) -> FloatArray:
        """Return the products (3, 3) about the means: what the whole block is off by is no tilt."""
        return self.products - np.outer(self.means, self.means) / max(self.weight, 1e-12)

    def centred_m2(self) -> FloatArray:
        """Return these products (3, 3) in square metres, every beam counting alike."""
        return self.squares_m2 - np.outer(self.sums_m, self.sums_m) / max(self.count, 1)


class SwathTilt:
    """Collects beams, of all vehicles; memory does not grow with their number."""

    def __init__(self) -> None:
        self._blocks: defaultdict[Hashable, defaultdict[int, _Block]] = defaultdict(lambda: defaultdict(_Block))

    def add(
        self,
        vehicle: Hashable,
        block: IntArray,
        angle_rad: FloatArray,
        roll_rad: FloatArray,
        height_m: FloatArray,
        off_m: FloatArray,
    ) -> None:
        """Take in beams, arrays (n,).

        Parameters
        ----------
        block
            Number of the piece of track; errors of place and level are shared within.
        angle_rad
            From straight down in the vehicle, positive to starboard.
        roll_rad
            Of the vehicle, starboard down.
        height_m
            Of the sonar above where the beam met the bottom.
        off_m
            Depth of the beam minus that which others sounded straight down there; NaN where nobody did.
        """
        known = np.isfinite(off_m) & (height_m > 0.1)
        known[known] &= np.abs(off_m[known]) <= FAR_OF_HEIGHT * height_m[known]
        across = np.tan(angle_rad[known] - roll_rad[known])
        columns = np.stack([across, across * np.tan(angle_rad[known]), off_m[known] / height_m[known]])
        weight = 1.0 / (1.0 + across**2)
        height = height_m[known]
        number = block[known]
        for one in np.unique(number).tolist():
            own = number == one
            sums, c, w = self._blocks[vehicle][one], columns[:, own], weight[own]
            sums.count += int(own.sum())
            sums.weight += float(w.sum())
            sums.means += (c * w).sum(axis=1)
            sums.products += (c * w) @ c.T
            metres = c * height[own]
            sums.squares_m2 += metres @ metres.T
            sums.sums_m += metres.sum(axis=1)

    def errors(self) -> dict[Hashable, TiltErrors]:
        """Return what is wrong with the swath of each vehicle that was compared often enough."""
        found = {}
        for vehicle, blocks in self._blocks.items():
            used = [block for block in blocks.values() if block.count > 3]
            if len(used) >= LEAST_BLOCKS:
                found[vehicle] = _errors(used)
        return found


def _errors(blocks: list[_Block]) -> TiltErrors:
    """Return roll offset and sound speed from centred sums.

    A beam at ``x`` across that really points ``e`` farther to starboard was placed ``e x`` too deep. With sound faster
    by a part ``s`` it leaves flatter, ``sin(angle)`` being larger by ``s``, and was placed ``s x tan(angle)`` too deep.
    """
    centred = [block.centred() for block in blocks]
    count = sum(block.count for block in blocks)
    total = np.sum(centred, axis=0)
    variance = max(float(total[2, 2]) / max(count, 1), 1e-8)
    prior = np.diag([variance / ROLL_PRIOR_RAD**2, variance / SPEED_PRIOR**2])
    parts = [(part[:2, :2], part[:2, 2]) for part in centred]
    solutions = solved(total[:2, :2] + prior, total[:2, 2], parts)
    sd = jackknife_sd(solutions[1:])
    tilt, bend = solutions[0]
    metres = np.sum([block.centred_m2() for block in blocks], axis=0)
    x = np.array([-tilt, -bend, 1.0])
    return TiltErrors(
        roll_offset_rad=Estimate(float(tilt), float(sd[0]), count, len(blocks)),
        sound_speed=Estimate(float(bend), float(sd[1]), count, len(blocks)),
        rms_before_m=float(np.sqrt(max(metres[2, 2], 0.0) / count)),
        rms_after_m=float(np.sqrt(max(float(x @ metres @ x), 0.0) / count)),
    )
