"""Knowledge of landmarks that came from several parties: independent Gaussian estimates, fused by information."""

from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.exploration.communication.messages import Entries

WORTH_TELLING = 1.1
"""An estimate is sent again when its information has changed by this factor since the receiver confirmed it: a look may
also make it less sure, where it speaks for another depth."""


@dataclass
class Contribution:
    """What one party is known to have found out, (n,) each: ``depth_m`` (0 where nothing) and ``information``.

    A later entry replaces an earlier one, because it sums up all looks of its sender, also where these made it less
    sure; messages that arrive late are not taken in at all.
    """

    depth_m: FloatArray
    information: FloatArray

    @classmethod
    def nothing(cls, n: int) -> "Contribution":
        """Return a contribution about none of ``n`` landmarks."""
        return cls(np.zeros(n), np.zeros(n))

    def take(self, entries: Entries) -> None:
        """Take in what the party sent."""
        self.depth_m[entries.index] = entries.depth_m
        self.information[entries.index] = np.where(np.isfinite(entries.sd_m), 1.0 / entries.sd_m**2, 0.0)


def news(information: FloatArray, confirmed: FloatArray) -> BoolArray:
    """Return whether information (n,) differs enough from what was ``confirmed`` (n,) to be told again."""
    return np.asarray((information > WORTH_TELLING * confirmed) | (WORTH_TELLING * information < confirmed))


def fuse(contributions: list[Contribution], n: int) -> tuple[FloatArray, FloatArray]:
    """Return fused depths (n,), NaN where unknown, and their information (n,)."""
    total, weighted = np.zeros(n), np.zeros(n)
    for part in contributions:
        total += part.information
        weighted += part.information * part.depth_m
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(total > 0.0, weighted / total, np.nan), total
