"""One decision of a search: where one may go, how far home is from there, and who is back in time."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.exploration.core.problem import Situation
from app.exploration.core.search_task import SearchTask
from app.exploration.site_search.ground import SiteGround

HOME_STEPS = 3.0
"""Steps from the entry, times vehicles, within which a vehicle counts as being there."""
SPARE_CELLS, SPARE_PART = 3.0, 0.03
"""By how much the way home is taken to be longer than measured: cells per vehicle (they may be in the way), a part."""


@dataclass(frozen=True)
class Scene:
    """One decision of a search: the team, its task, where it may go, and how far home is from there.

    Attributes
    ----------
    home_m : (rows, cols)
        Length of the way to the entry from each cell, with something to spare; inf where there is none.
    """

    team: Situation
    task: SearchTask
    ground: SiteGround
    home: NDArray[np.int32]
    home_m: FloatArray

    @classmethod
    def of(cls, team: Situation) -> "Scene":
        """Make it. Raises ValueError when the situation is not that of a search.

        Where somebody has no way home that keeps what is spared beside the safety distance, nothing is spared: what was
        wide enough on the way in may look narrower since.
        """
        task = team.search
        if task is None:
            raise ValueError("search: the situation holds no search task; this planner is for missions of that kind")
        scene = cls._made(team, task)
        if task.spare_m > 0.0 and scene.cut_off:
            narrow = cls._made(team, replace(task, spare_m=0.0))
            scene = narrow if narrow.cut_off < scene.cut_off else scene
        return scene

    @classmethod
    def _made(cls, team: Situation, task: SearchTask) -> "Scene":
        ground = SiteGround.of(task)
        home = ground.distances(ground.places(task.entry_m[None]))
        return cls(team, task, ground, home, _with_spare(team, task, ground.metres(home)))

    @property
    def cut_off(self) -> int:
        """How many vehicles have no way home that is known."""
        return sum(not np.isfinite(self.ground.way_m(here, self.home)) for here in self.team.positions[:, :2])

    @property
    def step_m(self) -> float:
        """Length of a leg while alpha is 1."""
        return min(self.task.step_m, self.longest_m)

    @property
    def longest_m(self) -> float:
        """Largest leg that the constraints allow."""
        return float(self.team.constraints.max_step_m) * (1.0 - 1e-9)

    @property
    def is_back(self) -> NDArray[np.bool_]:
        """Which vehicles are back at the entry, (n_vehicles,)."""
        return self.back_from(self.team.positions[:, :2])

    def back_from(self, places_m: FloatArray) -> NDArray[np.bool_]:
        """Return which places (n, 2) of a team of n are at the entry, (n,)."""
        away_m = np.hypot(*(places_m - self.task.entry_m).T)
        return np.asarray(away_m <= HOME_STEPS * self.step_m * len(places_m))

    def in_time(self, end_m: FloatArray, gone_m: float) -> bool:
        """Return whether from a place (2,) the entry is within the time that is left after a step of ``gone_m``."""
        way = _with_spare(self.team, self.task, np.array(self.ground.way_m(end_m, self.home)))
        return gone_m + float(way) <= self.task.left_m


def _with_spare(team: Situation, task: SearchTask, way_m: FloatArray) -> FloatArray:
    return np.asarray(way_m * (1.0 + SPARE_PART) + SPARE_CELLS * len(team.vehicles) * task.grid.cell_m)
