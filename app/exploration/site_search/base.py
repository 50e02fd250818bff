"""What all planners of search missions share: legs over known ground only, everybody back in time, ways given."""

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.problem import Proposal, Situation
from app.exploration.planner.base import PlannerBase
from app.exploration.site_search.criteria import Weights, terms
from app.exploration.site_search.right_of_way import give_way
from app.exploration.site_search.scene import Scene


class SearchPlanner(PlannerBase):
    """Brings all vehicles back in time, keeps off what is not known to be free, and lets vehicles give way.

    Positions only change where the whole leg lies over explored ground; a vehicle that may be late otherwise goes now.
    """

    runs_errands: ClassVar[bool] = False

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        scene = Scene.of(team)
        wishes = self._seek(scene, seed)
        here = team.positions[:, :2]
        gone = max(scene.step_m, float(np.hypot(*(wishes - here).T).max()))
        late = np.zeros(len(here), dtype=np.bool_)
        for i in range(len(here)):
            clear = scene.ground.clear(here[i], wishes[i : i + 1])[0]
            if not clear or not scene.in_time(wishes[i], gone):
                late[i] = True
                wishes[i] = scene.ground.towards(here[i], scene.home, scene.step_m)
        positions = give_way(scene, bottom, wishes, seed, late | self._homewards)
        task = scene.task
        at_home = scene.back_from(positions[:, :2])
        figures = {
            "F_1": task.explored_part,
            "F_2": task.explored_goal_part,
            "homebound": float(late.sum()),
            "homewards": float(self._homewards),
            "at_home": float(at_home.sum()),
        }
        return Proposal(positions, self._objective(scene, positions), figures)

    @property
    def _homewards(self) -> bool:
        """Whether the planner has begun to come home by itself: no view is left to go to, or a criterion says so."""
        return False

    @abstractmethod
    def _seek(self, scene: Scene, seed: int) -> FloatArray:
        """Return where every vehicle should go next, (n_vehicles, 2), within one step; they may hold."""

    def _objective(self, scene: Scene, positions: FloatArray) -> float:
        """Return the criterion that is being followed; ``CF_1`` unless a planner switches."""
        return float(terms(scene.task, positions[:, :2], homewards=False, weights=Weights()).sum())


def hold(scene: Scene) -> FloatArray:
    """Return where the vehicles are, (n_vehicles, 2)."""
    return np.array(scene.team.positions[:, :2])
