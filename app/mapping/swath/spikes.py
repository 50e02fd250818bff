"""Beams that did not meet the bottom: fish, bubbles, double echoes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from app.arrays import BoolArray, FloatArray, IntArray
from app.mapping.swath.pings import Pings, PlacedPings

NEIGHBOURS = 9
"""Beams of a ping that tell together where the bottom is."""

LEAST_BEAMS = 5
"""In a ping with fewer detected beams nothing tells which of them is wrong: all stay."""

FAR_M, FAR_OF_DEPTH = 0.6, 0.12
"""A beam is a spike when it is farther from the bottom than the larger of these: metres, and share of the height."""

SAME_OF_FAR = 0.25
"""Beams of the next ping agree with one when they are no farther from it than this share of that, and of the one after
when they are no farther than twice as much."""

BESIDE = (-2, -1, 1, 2)
AGREEING = 2
"""So many of these pings beside its own have to agree with a beam: fish do so by chance, where there are many."""

NEXT_BEAMS = 1.5
"""And when they point no farther aside than so many beams lie apart."""

ECHO_OF_DEPTH = 0.5
"""Farther below the bottom than this share of the height lie double echoes, which stay ping after ping, too."""

_AT_ONCE = 4096
"""Doubted beams that are looked at together: it limits memory."""


@dataclass(frozen=True)
class BeamStates:
    """What became of beams that met something, each of shape (m,); at most one of the three holds of each."""

    spike: BoolArray
    """Left out, because its neighbours say otherwise."""
    rejected: BoolArray
    """Left out by an operator."""
    restored: BoolArray
    """Counts because an operator says so."""

    @property
    def used(self) -> BoolArray:
        """Which of them count."""
        return np.asarray(~self.spike & ~self.rejected)


def states_of(placed: PlacedPings) -> BeamStates:
    """Return what became of beams, (m,) as their footprints; which are spikes does not depend on what operators say."""
    pings = placed.pings
    spike = spikes(pings)[np.isfinite(pings.range_m) & np.isfinite(pings.angle_rad)]
    none = np.zeros(len(spike), dtype=np.bool_)
    rejected = none if placed.rejected is None else placed.rejected
    restored = none if placed.restored is None else placed.restored
    return BeamStates(spike & ~rejected & ~restored, rejected, restored)


def spikes(pings: Pings) -> BoolArray:
    """Return which beams (n, b) lie far above or below their neighbours in the same ping, and in that ping alone.

    Neighbours are a level median, or the straight line that most of them lie on: slopes stay, of however few beams.
    Steps of the bottom are wider than a few beams and stay, and so does what ping after ping met in the same place: a
    wreck's mast, a rock. A single ping's beam, or a few, do not.
    """
    aside = pings.angle_rad.astype(np.float64) - np.nan_to_num(pings.roll_rad)[:, None]
    slant = pings.range_m.astype(np.float64)
    down, across = slant * np.cos(aside), slant * np.sin(aside)
    known = np.isfinite(down)
    middle = median_filter(_filled(down), size=(1, NEIGHBOURS), mode="mirror")
    with np.errstate(invalid="ignore"):
        doubted = known & (np.abs(down - middle) > _far(middle))
    doubted &= (known.sum(axis=1) >= LEAST_BEAMS)[:, None]
    below = down + np.nan_to_num(pings.depth_m)[:, None]
    found = np.zeros_like(doubted)
    ping, beam = np.nonzero(doubted)
    for start in range(0, len(ping), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        k, i = ping[part], beam[part]
        slope, height = _line(across, down, known, k, i)
        off, far = down[k, i] - height, _far(height)
        wrong = np.abs(off) > far
        echo = (off > ECHO_OF_DEPTH * height)[wrong]
        k, i, slope, far = k[wrong], i[wrong], slope[wrong], far[wrong]
        found[k, i] = echo | ~_met_again((aside, across, below), k, i, slope, SAME_OF_FAR * far)
    return found


def _far(height_m: FloatArray) -> FloatArray:
    return np.asarray(np.maximum(FAR_M, FAR_OF_DEPTH * height_m))


def _line(
    across: FloatArray, down: FloatArray, known: BoolArray, ping: IntArray, beam: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return slope and height, (m,), of the line through the neighbours of beams (m,) where these are.

    It is that of repeated medians (Siegel 1982): of the slopes from each of them to the others, and of those of all, so
    that nearly half of them are let be wrong.
    """
    detected = np.argsort(~known, axis=1, kind="stable")
    number = known.sum(axis=1)[ping]
    rank = (np.cumsum(known, axis=1) - 1)[ping, beam]
    first = np.clip(rank - NEIGHBOURS // 2, 0, np.maximum(number - NEIGHBOURS, 0))
    places = first[:, None] + np.arange(NEIGHBOURS)
    of = np.take_along_axis(detected[ping], np.minimum(places, down.shape[1] - 1), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        others = (places < number[:, None]) & (of != beam[:, None])
        x = np.where(others, across[ping[:, None], of] - across[ping, beam][:, None], np.nan)
        z = np.where(others, down[ping[:, None], of], np.nan)
        apart = x[:, :, None] - x[:, None, :]
        slopes = np.where(apart != 0.0, (z[:, :, None] - z[:, None, :]) / apart, np.nan)
        slope = _median(_median(slopes.reshape(-1, NEIGHBOURS)).reshape(-1, NEIGHBOURS))
        return slope, _median(z - slope[:, None] * x)


def _met_again(
    swath: tuple[FloatArray, FloatArray, FloatArray],
    ping: IntArray,
    beam: IntArray,
    slope: FloatArray,
    same: FloatArray,
) -> BoolArray:
    """Return which beams, (m,), pings beside theirs agree with, along the slope of the bottom.

    ``swath`` has the directions of all beams, how far across they met something, and how deep.
    """
    aside, across, below = swath
    pings, beams = aside.shape
    agreeing, asked = np.zeros(len(ping), dtype=int), np.zeros(len(ping), dtype=int)
    with np.errstate(invalid="ignore"):
        step = NEXT_BEAMS * _median(np.abs(np.diff(aside, axis=1)))[ping] if beams > 1 else np.zeros(len(ping))
        for away in BESIDE:
            there = np.clip(ping + away, 0, pings - 1)
            turned = np.abs(aside[there] - aside[ping, beam][:, None])
            line = slope[:, None] * (across[there] - across[ping, beam][:, None])
            off = np.abs(below[there] - below[ping, beam][:, None] - line)
            near = (turned <= step[:, None]) & (off <= abs(away) * same[:, None])
            is_there = ping + away == there
            agreeing += near.any(axis=1) & is_there
            asked += is_there
    # Of two pings alone the one tells of the other.
    return np.asarray(agreeing >= np.clip(asked, 1, AGREEING))


def _median(values: NDArray[np.float64]) -> FloatArray:
    """Return the median of each row, NaN left out; NaN where all are."""
    ordered = np.sort(values, axis=1)
    number = np.isfinite(values).sum(axis=1)
    at = np.column_stack([np.maximum(number - 1, 0) // 2, np.minimum(number // 2, values.shape[1] - 1)])
    return np.asarray(np.take_along_axis(ordered, at, axis=1).mean(axis=1))


def _filled(down: FloatArray) -> FloatArray:
    """Return the heights with that of the nearest beam before it, or after it, where nothing was detected."""
    known = np.isfinite(down)
    columns = np.arange(down.shape[1])
    before = np.maximum.accumulate(np.where(known, columns, -1), axis=1)
    last = down.shape[1] - 1
    after = last - np.maximum.accumulate(np.where(known[:, ::-1], columns, -1), axis=1)[:, ::-1]
    index = np.where(before >= 0, before, np.minimum(after, last))
    filled = np.take_along_axis(down, index, axis=1)
    return np.nan_to_num(filled, nan=0.0)
