"""What operators say of beams: these do not count, those do, whatever their neighbours are like.

Beams are told by the time of their ping and their place in it, so that they stay the same ones however they are placed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.arrays import BoolArray, FloatArray

Bits = NDArray[np.uint8]


@dataclass(frozen=True)
class BeamSet:
    """Some beams of one vehicle.

    Attributes
    ----------
    time_s : (n,)
        The times of their pings, ascending, no two alike.
    bits : (n, w)
        Eight beams a byte, as ``numpy.packbits`` writes them.
    """

    time_s: FloatArray
    bits: Bits

    @classmethod
    def of(cls, time_s: FloatArray, chosen: BoolArray) -> "BeamSet":
        """Return the chosen ones of pings (n,) with beams (n, b); each ping comes once."""
        some = chosen.any(axis=1)
        order = np.argsort(time_s[some], kind="stable")
        return cls(time_s[some][order], np.packbits(chosen[some][order], axis=1))

    @cached_property
    def count(self) -> int:
        """How many beams these are."""
        return int(np.bitwise_count(self.bits).sum())

    def __len__(self) -> int:
        """Return how many beams these are."""
        return self.count

    def among(self, time_s: FloatArray, beams: int) -> BoolArray:
        """Return which beams of pings (n,), of so many beams each, are of them, (n, beams)."""
        found = np.zeros((len(time_s), beams), dtype=np.bool_)
        if len(self.time_s):
            at = np.minimum(np.searchsorted(self.time_s, time_s), len(self.time_s) - 1)
            known = np.flatnonzero(self.time_s[at] == time_s)
            bits = np.unpackbits(self.bits[at[known]], axis=1)[:, :beams]
            found[known, : bits.shape[1]] = bits
        return found


def joined(sets: Sequence[BeamSet]) -> BeamSet:
    """Return all beams of some sets."""
    time_s, wide = _times_and_bytes(sets)
    bits = np.zeros((len(time_s), wide), np.uint8)
    for one in sets:
        rows, own = np.searchsorted(time_s, one.time_s), one.bits.shape[1]
        bits[rows, :own] |= one.bits
    return BeamSet(time_s, bits)


def _times_and_bytes(sets: Sequence[BeamSet]) -> tuple[FloatArray, int]:
    times = [one.time_s for one in sets]
    return np.unique(np.concatenate(times)) if times else np.zeros(0), max(
        (one.bits.shape[1] for one in sets), default=0
    )


@dataclass(frozen=True)
class Edit:
    """What was once said of some beams, by vehicle: they are rejected, or restored."""

    rejects: bool
    beams: Mapping[str, BeamSet]


class BeamRulings:
    """All that was said of the beams of a mission: of each the last word counts.

    Parameters
    ----------
    edits
        In the order in which they were made.
    """

    def __init__(self, edits: Sequence[Edit] = ()) -> None:
        vehicles = sorted({name for edit in edits for name in edit.beams})
        found = {
            name: _last_words([(one.rejects, one.beams[name]) for one in edits if name in one.beams])
            for name in vehicles
        }
        self.rejected: Mapping[str, BeamSet] = {name: rejected for name, (rejected, _) in found.items()}
        """By vehicle the beams that do not count."""
        self.restored: Mapping[str, BeamSet] = {name: restored for name, (_, restored) in found.items()}
        """By vehicle the beams that count whatever their neighbours are like."""
        self.rejected_beams = sum(len(one) for one in self.rejected.values())
        self.restored_beams = sum(len(one) for one in self.restored.values())


NO_RULINGS = BeamRulings()


def _last_words(said: Sequence[tuple[bool, BeamSet]]) -> tuple[BeamSet, BeamSet]:
    """Return the beams of one vehicle that are rejected in the end, and those that are restored."""
    time_s, wide = _times_and_bytes([beams for _, beams in said])
    rejected, restored = (np.zeros((len(time_s), wide), np.uint8) for _ in range(2))
    for rejects, beams in said:
        rows, own = np.searchsorted(time_s, beams.time_s), beams.bits.shape[1]
        to, other = (rejected, restored) if rejects else (restored, rejected)
        to[rows, :own] |= beams.bits
        other[rows, :own] &= ~beams.bits
    return BeamSet(time_s, rejected), BeamSet(time_s, restored)
