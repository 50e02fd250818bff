"""Short passes over what lines have missed: a tour of them, each in a direction, and to a side, that make it short."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import find_objects, label

from app.arrays import BoolArray, FloatArray
from app.exploration.motion.dubins import lengths_m
from app.exploration.swath.raster import Flying, LineRaster

HEADINGS = 16
MOST_PIECES, MOST_TOURED = 30, 5
"""At most so many pieces of missed ground, the nearest, are shared out, and so many of one's own toured at a time."""

BUSY = 0.25
"""A piece is left to a vehicle though its way is longer by this part of what another has still to fly before."""

FILLING_OVERLAP = 0.4
"""Holes lie within so large a share less of half a swath: a pass over them sees them well."""

ASIDE = (-1.0, 0.0, 1.0)
"""Sides that a pass leaves a piece on, in what the swath is wider."""


@dataclass(frozen=True)
class Pass:
    """One straight way over a piece of ground that sees all of it.

    Attributes
    ----------
    path : (2, 2)
        East and north, as flown.
    away_m
        The way to its beginning.
    overlap
        Share of half a swath that it keeps within.
    """

    path: FloatArray
    away_m: float
    overlap: float

    @property
    def way_m(self) -> float:
        """The way to its end."""
        return self.away_m + float(np.hypot(*(self.path[1] - self.path[0])))


@dataclass(frozen=True)
class Passable:
    """A piece of ground that one pass can see.

    Attributes
    ----------
    middle_m : (2,)
        East and north.
    begins, ends : (n, 3)
        Poses at both ends of all passes that see it, headings clockwise from north.
    overlap
        Share of half a swath that these keep within.
    """

    middle_m: FloatArray
    begins: FloatArray
    ends: FloatArray
    overlap: float

    @property
    def lengths_m(self) -> FloatArray:
        """Lengths (n,) of the passes."""
        return np.asarray(np.hypot(*(self.ends - self.begins)[:, :2].T))


def pieces(
    raster: LineRaster, missed: BoolArray, flying: Flying, near_m: FloatArray | None = None
) -> tuple[list[Passable], BoolArray]:
    """Return the pieces of missed cells (along, across) that one pass sees, and the cells that none does.

    Those nearest to a place ``near_m`` (2,), or the largest.
    """
    number, _ = label(missed, np.ones((3, 3)))
    found = []
    for k, where in enumerate(find_objects(number), start=1):
        cells = np.argwhere(number[where] == k) + np.array([where[0].start, where[1].start])
        places = raster.axes.to_en(raster.corner_m + (cells + 0.5) * raster.cell_m)
        rank = -float(len(cells)) if near_m is None else float(np.hypot(*(places - near_m).T).min())
        found.append((rank, cells, places))
    found.sort(key=lambda one: one[0])
    wide = np.zeros_like(missed)
    passable = []
    for _, cells, places in found[:MOST_PIECES]:
        width_m = float(raster.half_width_m(flying)[cells[:, 0], cells[:, 1]].min())
        one = _passable(raster, places, width_m, flying.overlap)
        if one is None:
            wide[cells[:, 0], cells[:, 1]] = True
        else:
            passable.append(one)
    return passable, wide


def shared(
    found: list[Passable], starts: Mapping[str, FloatArray], busy_m: Mapping[str, float]
) -> dict[str, list[Passable]]:
    """Return who passes which pieces, in which order: each is inserted where it makes the team's way least longer.

    Parameters
    ----------
    starts : (2,) each
        Where vehicles will be when they are free, by name.
    busy_m
        How far each has to fly until then.
    """
    places = {name: [start] for name, start in starts.items()}
    order: dict[str, list[int]] = {name: [] for name in starts}
    way_m = dict.fromkeys(starts, 0.0)
    left = set(range(len(found)))
    while left:
        best: tuple[float, float, str, int, int] | None = None
        for name, path in places.items():
            way = np.array(path)
            for k in sorted(left):
                away_m = np.hypot(*(way - found[k].middle_m).T)
                longer_m = away_m.copy()
                longer_m[:-1] += away_m[1:] - np.hypot(*np.diff(way, axis=0).T)
                at = int(longer_m.argmin())
                cost_m = float(longer_m[at]) + BUSY * (busy_m[name] + way_m[name])
                if best is None or cost_m < best[0]:
                    best = cost_m, float(longer_m[at]), name, k, at
        if best is None:
            break
        _, longer, name, k, at = best
        places[name].insert(at + 1, found[k].middle_m)
        order[name].insert(at, k)
        way_m[name] += longer
        left.remove(k)
    return {name: [found[k] for k in order[name]] for name in starts}


def tour(found: list[Passable], pose: FloatArray, radius_m: float) -> list[Pass]:
    """Return one pass over each of the first pieces in the order that is shortest from a pose (3,) on.

    Dynamic programming over all of them; a pose without a heading (NaN) may begin in any.
    """
    toured = found[:MOST_TOURED]
    if not toured:
        return []
    owner = np.repeat(np.arange(len(toured)), [len(piece.begins) for piece in toured])
    begins = np.concatenate([piece.begins for piece in toured])
    ends = np.concatenate([piece.ends for piece in toured])
    over_m = np.concatenate([piece.lengths_m for piece in toured])
    away_m = np.hypot(*(begins - pose)[:, :2].T) if np.isnan(pose[2]) else lengths_m(pose, begins, radius_m)
    between_m = lengths_m(ends[:, None], begins[None], radius_m) if len(toured) > 1 else np.zeros((0, 0))
    # Over which pieces it has led, and which pass it ends with: how long it is, and the pass before.
    best_m = {1 << k: np.where(owner == k, away_m + over_m, np.inf) for k in range(len(toured))}
    before = {}
    for seen in range(1, 1 << len(toured)):
        if seen not in best_m:
            reached, came = np.full(len(owner), np.inf), np.zeros(len(owner), dtype=np.int64)
            for k in range(len(toured)):
                if not seen >> k & 1:
                    continue
                of_k = np.flatnonzero(owner == k)
                by_m = best_m[seen ^ (1 << k)][:, None] + between_m[:, of_k]
                came[of_k] = by_m.argmin(axis=0)
                reached[of_k] = by_m.min(axis=0) + over_m[of_k]
            best_m[seen], before[seen] = reached, came
    seen = (1 << len(toured)) - 1
    order = [int(best_m[seen].argmin())]
    while seen in before:
        last = order[-1]
        order.append(int(before[seen][last]))
        seen ^= 1 << int(owner[last])
    return [
        Pass(np.stack([begins[k, :2], ends[k, :2]]), float(away_m[k]), toured[owner[k]].overlap)
        for k in reversed(order)
    ]


def _passable(raster: LineRaster, places: FloatArray, width_m: float, overlap: float) -> Passable | None:
    """Return the passes that have all places (n, 2) within half a swath; None where they lie too far apart."""
    reach_m = max((1.0 - overlap) * width_m, raster.cell_m)
    headings = np.arange(HEADINGS) * 2.0 * np.pi / HEADINGS
    towards = np.column_stack([np.sin(headings), np.cos(headings)])
    aside = np.column_stack([-towards[:, 1], towards[:, 0]])
    along_m, across_m = places @ towards.T, places @ aside.T
    slack_m = reach_m - 0.5 * (np.ptp(across_m, axis=0) + raster.cell_m)
    middle_m = 0.5 * (across_m.min(axis=0) + across_m.max(axis=0))
    at_m = middle_m + np.array(ASIDE)[:, None] * slack_m
    half = np.sqrt(0.5) * raster.cell_m
    begin = at_m[..., None] * aside + (along_m.min(axis=0) - half)[:, None] * towards
    end = at_m[..., None] * aside + (along_m.max(axis=0) + half)[:, None] * towards
    fit = (slack_m >= 0.0) & _inside(raster, begin) & _inside(raster, end)
    if not fit.any():
        return None
    heading = np.broadcast_to(headings[:, None], (*begin.shape[:2], 1))
    begins, ends = (np.concatenate([place, heading], axis=-1)[fit] for place in (begin, end))
    return Passable(places.mean(axis=0), begins, ends, overlap)


def _inside(raster: LineRaster, places: FloatArray) -> BoolArray:
    """Return which places (..., 2), east and north, lie in the area, or hardly beyond it."""
    turned = raster.axes.turned(places)
    at = np.floor((turned - raster.corner_m) / raster.cell_m).astype(np.int64)
    shape = np.array(raster.wanted.shape)
    near = ((at >= -1) & (at <= shape)).all(axis=-1)
    at = np.clip(at, 0, shape - 1)
    return np.asarray(near & raster.wanted[at[..., 0], at[..., 1]])
