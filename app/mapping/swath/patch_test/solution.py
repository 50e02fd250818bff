"""One step of the adjustment: the change of the mounting with which lines agree best on the cells that they share.

Each line may lie a little aside, and a little deeper or shallower, as a whole: positions and water levels of different
times are never quite the same, and that must not be taken for a mounting. Calibration on surfaces of any shape follows
Seube and Keyetieu (2017, Marine Geodesy 40), least squares with robust weights Huber (1964).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.arrays import FloatArray, IntArray
from app.mapping.swath.patch_test.cells import SharedCells

HUBER, ROUNDS = 1.5, 8
"""Differences of more than so many standard deviations count less."""

VARIES = 0.06
"""How far parts of a line lie off beside the line, as a share of how far lines do. It is not solved for: it makes what
is found less sure."""

LEAST_SCALE = 1.0
"""Differences are never taken to be smaller than what beams and ground account for: errors in that are not random."""

UNKNOWN_SD = np.array([np.radians(2.0), np.radians(2.0), np.radians(3.0), 0.0, 0.002])
"""How wrong roll, pitch and heading may be where lines do not tell them, and how far swaths may be bent. Latency is
taken as it is stated then: with lines of one speed nothing else tells pitch from it, and clocks are synchronised."""


@dataclass(frozen=True)
class LineErrors:
    """How well lines fit each other besides the mounting: standard deviations, metres.

    Within a line they vary by ``VARIES`` of that from quarter to quarter.
    """

    position_m: float
    level_m: float


@dataclass(frozen=True)
class Step:
    """What the cells say.

    Attributes
    ----------
    change : (p,)
        Of the parameters that are free.
    sd : (p,)
        Of these: the larger one of what the scatter of the beams says, and of what blocks of ground do.
    line_m : (l, 3)
        By how much each line lies to the east, to the north and deeper.
    """

    change: FloatArray
    sd: FloatArray
    line_m: FloatArray


class Equations:
    """The differences of lines in their cells, as equations that are weighted and solved for some parameters."""

    def __init__(self, cells: SharedCells, errors: LineErrors) -> None:
        self._cells = cells
        self._errors = errors
        lines, of = np.unique(cells.line, return_inverse=True)
        moved = np.zeros((len(cells), len(lines), 3))
        moved[np.arange(len(cells)), of] = np.column_stack([-cells.slope, np.ones(len(cells))])
        self._moved = moved.reshape(len(cells), -1)
        self._lines = len(lines)

    def differences_m(self, *, shifted: bool = False) -> FloatArray:
        """Return the lines' depths beside the mean of their cell, (g,); each shifted as a whole to where it fits."""
        cells = self._cells
        depth = cells.depth_m
        if shifted:
            depth = depth + self._moved @ self._solved([], []).line_m.ravel()
        mean = np.bincount(cells.cell, depth) / np.maximum(np.bincount(cells.cell), 1)
        return np.asarray(depth - mean[cells.cell])

    def misfit(self) -> FloatArray:
        """Return Huber's loss of each row (g,) when lines are shifted to where they fit, in variances."""
        off = np.abs(self.differences_m(shifted=True)) / self._cells.sd_m
        return np.where(off <= HUBER, off**2, 2.0 * HUBER * off - HUBER**2)

    def solve(self, free: Sequence[int]) -> Step:
        """Return the best change of parameters, which are numbered as in ``SharedCells.change``.

        Those that are not free may be wrong all the same, as far as ``UNKNOWN_SD`` says: what cannot be told from them
        is not known either.
        """
        doubted = [number for number, sd in enumerate(UNKNOWN_SD) if number not in free and sd > 0.0]
        return self._solved(free, doubted)

    def _solved(self, free: Sequence[int], doubted: Sequence[int]) -> Step:
        """Return the best change of what is free; ``doubted`` is solved for with what is known of it."""
        cells, count = self._cells, len(free)
        free = [*free, *doubted]
        own = np.concatenate([np.full(count, 1e-6), UNKNOWN_SD[list(doubted)] ** -2.0])
        weight = cells.sd_m**-2.0
        scale, robust, line_m = 1.0, np.ones(len(cells)), np.zeros((self._lines, 3))
        dof = max(1.0, len(cells) - cells.cells - len(free)) / len(cells)
        for _ in range(ROUNDS):
            w = weight * robust / scale**2
            design, off = self._centred(free, w)
            prior = np.concatenate([own, np.tile(self._expected(line_m) ** -2.0, self._lines)])
            normal = (design * w[:, None]).T @ design + np.diag(prior)
            x = np.asarray(-np.linalg.solve(normal, design.T @ (w * off)), dtype=np.float64)
            line_m = x[len(free) :].reshape(-1, 3)
            left = (off + design @ x) / cells.sd_m
            scale = max(1.4826 * float(np.median(np.abs(left))) / np.sqrt(dof), LEAST_SCALE)
            robust = np.minimum(1.0, HUBER * scale / np.maximum(np.abs(left), 1e-12))
        inverse = np.asarray(np.linalg.inv(normal), dtype=np.float64)
        left = np.asarray(off + design @ x, dtype=np.float64)
        return Step(x[:count], self._sd(inverse[:count], design * w[:, None], left), line_m)

    def _expected(self, line_m: FloatArray) -> FloatArray:
        """Return how far lines may lie off, (3,): as is said, or as far as they do where that is more."""
        position_m = max(self._errors.position_m, float(np.sqrt((line_m[:, :2] ** 2).mean())))
        level_m = max(self._errors.level_m, float(np.sqrt((line_m[:, 2] ** 2).mean())))
        return np.array([position_m, position_m, level_m])

    def _centred(self, free: Sequence[int], w: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the equations without what a cell's own depth says: design (g, p + 3 l) and depths (g,)."""
        cells = self._cells
        table = np.column_stack([cells.change[:, free], self._moved, cells.depth_m])
        order = np.argsort(cells.cell, kind="stable")
        first = np.flatnonzero(np.diff(cells.cell[order], prepend=-1))
        sums = np.add.reduceat((table * w[:, None])[order], first) / np.add.reduceat(w[order], first)[:, None]
        table = table - sums[cells.cell]
        return table[:, :-1], table[:, -1]

    def _sd(self, inverse: FloatArray, weighted: FloatArray, left: FloatArray) -> FloatArray:
        """Return standard deviations: by the weights, or by how blocks of ground pull at the parameters (sandwich)."""
        count = len(inverse)
        by_weight = np.diag(inverse[:, :count])
        pull = (weighted * left[:, None]) @ inverse.T
        _, block = np.unique(self._cells.block, return_inverse=True)
        blocks = int(block.max(initial=0)) + 1
        by_block = _sums(pull, block)
        spread = (by_block**2).sum(axis=0) * blocks / max(blocks - 1, 1)
        return np.asarray(np.sqrt(np.maximum(by_weight, spread) + self._from_parts(weighted @ inverse.T)))

    def _from_parts(self, influence: FloatArray) -> FloatArray:
        """Return variances (p,) that come of parts of lines lying off, by the influence of each row (g, p)."""
        cells = self._cells
        quarter = np.clip(np.floor(2.0 * (cells.along + 1.0)), 0, 3).astype(np.int64)
        part = 4 * np.unique(cells.line, return_inverse=True)[1] + quarter
        errors = self._errors
        variance = np.zeros(influence.shape[1])
        for moved, sd in (
            (cells.slope[:, :1], errors.position_m),
            (cells.slope[:, 1:], errors.position_m),
            (np.ones((len(cells), 1)), errors.level_m),
        ):
            variance += (_sums(influence * moved, part) ** 2).sum(axis=0) * (VARIES * sd) ** 2
        return variance


def _sums(values: FloatArray, of: IntArray) -> FloatArray:
    """Return sums of rows (n, m) by their numbers (n,)."""
    found = np.zeros((int(of.max(initial=0)) + 1, values.shape[1]))
    np.add.at(found, of, values)
    return found
