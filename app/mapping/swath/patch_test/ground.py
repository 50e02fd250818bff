"""Ground that several lines saw, chosen so that its beams fit into memory."""

from dataclasses import dataclass

import numpy as np

from app.arrays import BoolArray, FloatArray, IntArray

MOST_BEAMS, BEAMS_OF_BLOCK = 300_000, 800
"""Beams that are kept; of a block with more only some are, so that there can be many blocks."""

MOST_PASSES = 60
"""Of more lines those count that share most ground with others."""

LEAST_OF_BLOCK = 12
"""A line that has fewer beams in a block has not seen it."""

SPAN = 1 << 22
"""Blocks reach so far to each side of the origin."""


def block_of(en_m: FloatArray, size_m: float) -> IntArray:
    """Return a number for the square that each place (n, 2) lies in, (n,)."""
    at = np.clip(np.floor(en_m / size_m).astype(np.int64) + SPAN, 0, 2 * SPAN - 1)
    return np.asarray(at[:, 0] * (2 * SPAN) + at[:, 1])


@dataclass(frozen=True)
class ChosenGround:
    """Blocks, and the lines that are compared there.

    Attributes
    ----------
    size_m
        Side of a block.
    blocks : (k,)
        Their numbers, ascending.
    passes : (p,)
        Numbers of the lines, ascending.
    share
        Of the beams there, how many are kept.
    """

    size_m: float
    blocks: IntArray
    passes: IntArray
    share: float

    def takes(self, en_m: FloatArray, line: IntArray, rng: np.random.Generator) -> BoolArray:
        """Return which beams are kept, (n,), of places (n, 2) and lines (n,)."""
        kept = np.isin(line, self.passes) & np.isin(block_of(en_m, self.size_m), self.blocks)
        if self.share < 1.0:
            kept &= rng.random(len(kept)) < self.share
        return np.asarray(kept)


class SharedGround:
    """Counts the beams of each line in squares; memory grows with the ground alone.

    Parameters
    ----------
    size_m
        Side of a square.
    """

    def __init__(self, size_m: float) -> None:
        self._size_m = size_m
        self._block, self._line = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self._count = np.zeros(0, np.int64)

    def add(self, en_m: FloatArray, line: IntArray) -> None:
        """Take in beams: places (n, 2) and lines (n,); -1: of none."""
        known = line >= 0
        block = np.concatenate([self._block, block_of(en_m[known], self._size_m)])
        number = np.concatenate([self._line, line[known]])
        count = np.concatenate([self._count, np.ones(int(known.sum()), np.int64)])
        order = np.lexsort((number, block))
        block, number, count = block[order], number[order], count[order]
        first = np.flatnonzero((np.diff(block, prepend=-1) != 0) | (np.diff(number, prepend=-1) != 0))
        self._block, self._line = block[first], number[first]
        self._count = np.add.reduceat(count, first) if len(first) else count

    def chosen(self, rng: np.random.Generator) -> ChosenGround | None:
        """Return which of it is compared; None where no two lines saw the same."""
        seen = self._count >= LEAST_OF_BLOCK
        block, line, count = self._block[seen], self._line[seen], self._count[seen]
        both = _shared(block)
        lines, ground = np.unique(line[both], return_counts=True)
        kept = np.isin(line, lines[np.argsort(-ground, kind="stable")[:MOST_PASSES]])
        block, line, count = block[kept], line[kept], count[kept]
        both = _shared(block)
        if not both.any():
            return None
        block, line, count = block[both], line[both], count[both]
        blocks, of = np.unique(block, return_inverse=True)
        beams = np.bincount(of, count)
        share = min(1.0, BEAMS_OF_BLOCK / float(beams.mean()))
        order = rng.permutation(len(blocks))
        fit = order[np.cumsum(share * beams[order]) <= MOST_BEAMS]
        blocks = np.sort(blocks[fit])
        return ChosenGround(self._size_m, blocks, np.unique(line[np.isin(block, blocks)]), share)


def _shared(block: IntArray) -> BoolArray:
    """Return which rows are of blocks that have another row, too."""
    _, of, count = np.unique(block, return_inverse=True, return_counts=True)
    return np.asarray(count[of] > 1)
