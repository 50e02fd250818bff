"""How sure a least-squares solution is: what it becomes when one group of observations after the other is left out."""

from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray


@dataclass(frozen=True)
class Estimate:
    """A value with its standard deviation, from so many observations in so many groups that share errors."""

    value: float
    sd: float
    observations: int
    groups: int

    @property
    def significance(self) -> float:
        """By how many standard deviations it differs from zero."""
        return abs(self.value) / max(self.sd, 1e-12)


def solved(normal: FloatArray, right: FloatArray, groups: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Return solutions (1 + g, p) of normal equations: of all, then without each group's part of them.

    Parameters
    ----------
    normal : (p, p), right : (p,)
        Of all observations, priors among them.
    groups
        What each group adds to both.
    """
    normals = np.stack([normal, *(normal - part for part, _ in groups)])
    rights = np.stack([right, *(right - part for _, part in groups)])
    return np.asarray(np.linalg.solve(normals, rights[..., None])[..., 0])


def jackknife_sd(solutions: FloatArray) -> FloatArray:
    """Return standard deviations (p,) of a solution from those without one of g groups each, (g, p).

    Efron and Stein 1981, eq. 2.2; at least two groups.
    """
    g = len(solutions)
    return np.asarray(np.sqrt((g - 1) / g * ((solutions - solutions.mean(axis=0)) ** 2).sum(axis=0)))
