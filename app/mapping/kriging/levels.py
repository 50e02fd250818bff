"""Soundings at two levels of detail: single ones nearby, merged ones farther away."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from app.arrays import FloatArray, IntArray
from app.mapping.cell_index import cell_by_cell
from app.mapping.kriging.neighbours import nearest
from app.mapping.kriging.supersoundings import merge_soundings
from app.mapping.types import Soundings


@dataclass(frozen=True)
class TwoLevels:
    """Fine soundings and the coarse ones that groups of them merge into.

    Along a track soundings are much closer to each other than tracks are: the nearest few dozen all lie on
    one or two tracks and repeat each other. Merged soundings let the same number of neighbours reach several
    tracks.

    Attributes
    ----------
    soundings : Soundings
        ``n_fine`` fine ones, then the coarse ones.
    coarse_m
        Side of the squares that coarse soundings are merged from.
    members, start
        ``members[start[g]:start[g + 1]]`` are the fine soundings of coarse sounding g.
    """

    soundings: Soundings
    n_fine: int
    members: IntArray
    start: IntArray
    coarse_tree: cKDTree
    coarse_m: float

    @cached_property
    def fine(self) -> Soundings:
        """The fine soundings."""
        return self.soundings.take(np.arange(self.n_fine))

    @cached_property
    def fine_tree(self) -> cKDTree:
        """The fine soundings' positions, for looking up neighbours."""
        return cKDTree(self.points[: self.n_fine])

    @cached_property
    def points(self) -> FloatArray:
        """Positions of all, (n, 2)."""
        return np.column_stack([self.soundings.east_m, self.soundings.north_m])

    def neighbours(self, at: FloatArray, n_fine: int, n_coarse: int) -> IntArray:
        """Choose neighbours for the places ``at`` (m, 2): rows of ``soundings``, (m, n_fine + n_coarse), -1 for none.

        The nearest groups are taken with all their members while these number at most ``n_fine``, the
        following groups as one merged sounding each: no sounding is used twice.
        """
        _, groups = nearest(self.coarse_tree, at, n_fine + n_coarse)
        return _expand(groups, self.members, self.start, self.n_fine, n_fine, n_coarse)

    def neighbours_beyond(
        self, at: FloatArray, radius_m: FloatArray, n_fine: int, n_coarse: int, towards: FloatArray | None = None
    ) -> IntArray:
        """Choose neighbours as ``neighbours`` does, as if nothing had been sounded within ``radius_m`` (m,).

        With unit vectors ``towards`` (m, 2): as if soundings began only ``radius_m`` away in that direction.
        """
        inside = int(np.ceil(np.pi * (float(radius_m.max()) / self.coarse_m + 1.5) ** 2))
        wanted = n_fine + n_coarse + inside if towards is None else 3 * (n_fine + n_coarse) + 2 * inside
        _, groups = nearest(self.coarse_tree, at, wanted)
        if towards is None:
            towards = np.zeros_like(at)
        return _expand_beyond(
            groups, self.members, self.start, self.n_fine, n_fine, n_coarse, self.points, at, radius_m, towards
        )


def two_levels(soundings: Soundings, fine_m: float, coarse_m: float) -> TwoLevels:
    """Merge soundings in squares of ``fine_m``, and these in squares of ``coarse_m``."""
    fine, _ = merge_soundings(soundings, fine_m)
    coarse, group = merge_soundings(fine, coarse_m)
    both = Soundings(
        *(
            np.concatenate([getattr(fine, name), getattr(coarse, name)])
            for name in ("east_m", "north_m", "depth_m", "sd_m")
        )
    )
    members, start = cell_by_cell(group, len(coarse))
    return TwoLevels(
        soundings=both,
        n_fine=len(fine),
        members=members,
        start=start,
        coarse_tree=cKDTree(np.column_stack([coarse.east_m, coarse.north_m])),
        coarse_m=coarse_m,
    )


@njit(cache=True, nogil=True)
def _expand(
    groups: IntArray, members: IntArray, start: IntArray, first_coarse: int, n_fine: int, n_coarse: int
) -> IntArray:
    result = np.full((groups.shape[0], n_fine + n_coarse), -1, np.int64)
    for t in range(groups.shape[0]):
        used = 0
        merged = 0
        for c in range(groups.shape[1]):
            g = groups[t, c]
            size = start[g + 1] - start[g]
            if merged == 0 and (used + size <= n_fine or size == 1 or n_coarse == 0):
                for i in range(start[g], start[g + 1]):
                    if used < n_fine + n_coarse:
                        result[t, used] = members[i]
                        used += 1
            elif used < n_fine + n_coarse and merged < n_coarse:
                result[t, used] = first_coarse + g
                used += 1
                merged += 1
    return result


@njit(cache=True, nogil=True)
def _expand_beyond(
    groups: IntArray,
    members: IntArray,
    start: IntArray,
    first_coarse: int,
    n_fine: int,
    n_coarse: int,
    points: FloatArray,
    at: FloatArray,
    radius: FloatArray,
    towards: FloatArray,
) -> IntArray:
    result = np.full((groups.shape[0], n_fine + n_coarse), -1, np.int64)
    left = np.empty(0, np.int64)
    for t in range(groups.shape[0]):
        used = 0
        merged = 0
        hole = towards[t, 0] == 0.0 and towards[t, 1] == 0.0
        for c in range(groups.shape[1]):
            g = groups[t, c]
            size = start[g + 1] - start[g]
            if size > len(left):
                left = np.empty(size, np.int64)
            n = 0
            for i in range(start[g], start[g + 1]):
                dx = points[members[i], 0] - at[t, 0]
                dy = points[members[i], 1] - at[t, 1]
                away = np.sqrt(dx * dx + dy * dy) if hole else dx * towards[t, 0] + dy * towards[t, 1]
                if away >= radius[t]:
                    left[n] = members[i]
                    n += 1
            if (merged == 0 and used + n <= n_fine) or n < size or size == 1 or n_coarse == 0:
                for i in range(n):
                    if used < n_fine + n_coarse:
                        result[t, used] = left[i]
                        used += 1
            elif used < n_fine + n_coarse and merged < n_coarse:
                result[t, used] = first_coarse + g
                used += 1
                merged += 1
    return result
