"""Depths at which vehicles of a team travel to the same place, so that none meets another."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class DepthLayer:
    """The depths at which one vehicle of a team goes home: apart from the others', whatever the bottom leaves.

    Attributes
    ----------
    cruise_m
        Depths at which the team travels, the least first.
    place
        Which of them is this vehicle's.
    spacing_m
        Difference in depth that keeps vehicles apart.
    """

    cruise_m: tuple[float, ...]
    place: int
    spacing_m: float

    @property
    def deepest_m(self) -> float:
        """Depth of the deepest one."""
        return self.cruise_m[-1]

    def depth_m(self, limit_m: float) -> float:
        """Return this vehicle's depth where none may be deeper than a limit.

        Nobody goes deeper than it travels. Where there is too little water for the whole spacing all of them have a
        smaller one, below the surface: there wait those that are home.
        """
        allowed = [min(depth, limit_m) for depth in self.cruise_m]
        spacing = min(self.spacing_m, *(depth / (k + 1) for k, depth in enumerate(allowed)))
        return min(depth - k * spacing for k, depth in enumerate(allowed[self.place :]))


ALONE = DepthLayer((math.inf,), 0, 0.0)
"""Of a vehicle that meets nobody: as deep as it likes."""
