"""Knowledge of landmarks that came from several parties: independent Gaussian estimates, fused by information."""

from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray
from app.exploration.communication.messages import Entries


@dataclass
class Contribution:
    """What one party is known to have found out, (n,) each: ``depth_m`` (0 where nothing) and ``information``.

    A later entry replaces an earlier one, because it sums up all looks of its sender; one that knows less arrived late
    and is ignored, so information never decreases.
    """

    depth_m: FloatArray
    information: FloatArray

    @classmethod
    def nothing(cls, n: int) -> "Contribution":
        """Return a contribution about none of ``n`` landmarks."""
        return cls(np.zeros(n), np.zeros(n))

    def take(self, entries: Entries) -> None:
        """Take in what the party sent."""
        information = np.where(np.isfinite(entries.sd_m), 1.0 / entries.sd_m**2, 0.0)
        more = information >= self.information[entries.index]
        index = entries.index[more]
        self.depth_m[index] = entries.depth_m[more]
        self.information[index] = information[more]


def fuse(contributions: list[Contribution], n: int) -> tuple[FloatArray, FloatArray]:
    """Return fused depths (n,), NaN where unknown, and their information (n,)."""
    total, weighted = np.zeros(n), np.zeros(n)
    for part in contributions:
        total += part.information
        weighted += part.information * part.depth_m
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(total > 0.0, weighted / total, np.nan), total
