"""How far the ground of an area lies from where vehicles have been, and the leg that helps it most."""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from app.arrays import FloatArray
from app.exploration.core.constraints import Constraints, inside_area
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.routes import Turns, flown_m

NODES = 5000
"""In the rectangle around an area."""
ENDS = 250
"""Of these nodes, so many are places where a leg may lead."""
PLASTIC = 1.32471795724474602596
"""The real root of x^3 = x + 1: nodes at multiples of its inverse and that squared are evenly spread, and stand in no
rows that lines could lie along or between (Roberts, The unreasonable effectiveness of quasirandom sequences, 2018)."""
APART = 0.25
"""Places along a way are taken so many distances of nodes apart."""


@dataclass(frozen=True)
class Ground:
    """The ground of an area without its keep-out zones.

    Attributes
    ----------
    en_m : (n, 2)
        Nodes, evenly spread, about ``apart_m`` from each other.
    ends_m : (k, 2)
        Some of them, where legs may lead.
    """

    en_m: FloatArray
    ends_m: FloatArray
    apart_m: float

    @classmethod
    def of(cls, constraints: Constraints) -> "Ground":
        """Return the ground that a mission's limits leave."""
        low, high = constraints.area.min(axis=0), constraints.area.max(axis=0)
        k = np.arange(1, NODES + 1)
        nodes = low + (high - low) * np.column_stack([(0.5 + k / PLASTIC) % 1.0, (0.5 + k / PLASTIC**2) % 1.0])
        inside = inside_area(constraints, nodes)
        apart_m = float(np.sqrt(np.prod(high - low) / NODES))
        return cls(nodes[inside], nodes[:ENDS][inside[:ENDS]], apart_m)

    def away_m(self, ways: list[FloatArray]) -> FloatArray:
        """Return how far each node is from the closest of some ways (k, 2), (n,); inf where there are none."""
        places = [self._places(way) for way in ways if len(way)]
        if not places:
            return np.full(len(self.en_m), np.inf)
        return np.asarray(cKDTree(np.vstack(places)).query(self.en_m)[0], dtype=np.float64)

    def best_end(
        self,
        free: FreeSpace,
        away_m: FloatArray,
        here_m: FloatArray,
        heading_rad: float,
        budget_m: float,
        turn_radius_m: float,
    ) -> FloatArray | None:
        """Return where the straight leg ends, (2,), that brings most ground nearer to where vehicles were.

        None where no leg does.

        Parameters
        ----------
        away_m : (n,)
            How far the nodes are from where vehicles were.
        here_m : (2,)
            Where the leg begins, with ``heading_rad``, clockwise from north, NaN where unknown.
        budget_m
            How long it may be, the turn into it included, in circles of ``turn_radius_m``.
        """
        turns, best, most_m2 = Turns(turn_radius_m, 0.0), None, 0.0
        away_m2 = np.minimum(away_m, np.sqrt(NODES) * self.apart_m) ** 2
        for end in self._reached(free, here_m, budget_m):
            way_m = flown_m(here_m[0], here_m[1], heading_rad, end[None], turns)
            if way_m > budget_m:
                leg_m = float(np.hypot(*(end - here_m)))
                end = here_m + (end - here_m) * max(0.0, 1.0 - (way_m - budget_m) / leg_m)
            gain_m2 = float(np.maximum(away_m2 - _away_m2(self.en_m, here_m, end), 0.0).sum())
            if gain_m2 > most_m2:
                best, most_m2 = end, gain_m2
        return best

    def _reached(self, free: FreeSpace, here_m: FloatArray, budget_m: float) -> FloatArray:
        """Return the ends (j, 2) of legs in the free space towards ``ends_m``, none of them too long."""
        legs = self.ends_m - here_m
        length_m = np.hypot(*legs.T)
        some = length_m > self.apart_m
        ends = here_m + legs[some] * np.minimum(1.0, budget_m / length_m[some])[:, None]
        lines = shapely.linestrings(np.stack([np.broadcast_to(here_m, ends.shape), ends], axis=1))
        return np.asarray(ends[shapely.covers(free.region.buffer(1e-6), lines)])

    def _places(self, way: FloatArray) -> FloatArray:
        at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
        along = np.linspace(0.0, at[-1], 2 + int(at[-1] / (APART * self.apart_m)))
        return np.column_stack([np.interp(along, at, way[:, k]) for k in (0, 1)])


def _away_m2(en_m: FloatArray, begin_m: FloatArray, end_m: FloatArray) -> FloatArray:
    """Return how far places (n, 2) are from a leg, squared, (n,)."""
    leg = end_m - begin_m
    part = np.clip((en_m - begin_m) @ leg / max(float(leg @ leg), 1e-12), 0.0, 1.0)
    off = en_m - begin_m - part[:, None] * leg
    return np.asarray((off**2).sum(axis=1))
