"""The default planner of search missions: views that show most for the way there, shared among the vehicles."""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from app.arrays import FloatArray, IntArray
from app.exploration.site_search.base import SearchPlanner, hold
from app.exploration.site_search.gains import Gains, take
from app.exploration.site_search.goal_parts import GoalPart, goal_left, parts_left
from app.exploration.site_search.ground import UNREACHED, SiteGround
from app.exploration.site_search.scene import Scene

ELSEWHERE = 0.02
"""Worth of a cell outside the goal area while something in it is left to see; within it 1."""
LATTICE = 2
"""Cells between the views that are weighed."""
NEAR = 0.5
"""Added to every distance, as a part of the scanner's reach, so that very small gains next door attract no vehicle."""
KEEP = 2.0
"""How much a view is favoured that a vehicle is under way to."""
LEAST = 1.0
"""Cells that a view must show."""


class FrontierSearch(SearchPlanner):
    """Looks at the goal area first, then at the rest: every vehicle goes for the view with most to see per metre."""

    name: ClassVar[str] = "rollout"
    own_options: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._views: dict[str, tuple[int, int]] = {}
        self._spent: list[tuple[int, int]] = []
        self._gains = Gains()  # no memory of the search: it can be computed again

    @property
    def _homewards(self) -> bool:
        return not self._views

    def _seek(self, scene: Scene, seed: int) -> FloatArray:
        ground, team = scene.ground, scene.team
        self._note_spent(scene)
        ways = [ground.distances(ground.beside(place)) for place in team.positions[:, :2]]
        places = self._views_to_weigh(ground, ways)
        far = [ground.metres(way[places[:, 0], places[:, 1]]) for way in ways]
        in_time = np.array(
            [d + scene.home_m[places[:, 0], places[:, 1]] <= scene.task.left_m - scene.step_m for d in far]
        )
        chosen = self._share(scene, places, np.array(far), in_time.reshape(len(far), -1))
        wishes = hold(scene)
        self._views = {}
        for i, name in enumerate(team.vehicles):
            if chosen[i] is None:
                wishes[i] = ground.towards(wishes[i], scene.home, scene.step_m)
                continue
            place = places[chosen[i]]
            self._views[name] = (int(place[0]), int(place[1]))
            here = wishes[i].copy()
            way = ground.distances(place[None], until=ground.beside(here))
            wishes[i] = ground.towards(here, way, scene.step_m)
            if np.array_equal(wishes[i], here):
                self._spent.append(self._views[name])  # nothing leads closer
        return wishes

    def _note_spent(self, scene: Scene) -> None:
        """Remember views that were reached: what could not be seen from there then, cannot be seen from there now."""
        for name, place in zip(scene.team.vehicles, scene.ground.places(scene.team.positions), strict=True):
            if self._views.get(name) == (int(place[0]), int(place[1])):
                self._spent.append(self._views[name])

    def _views_to_weigh(self, ground: SiteGround, ways: list[NDArray[np.int32]]) -> IntArray:
        """Return cells (n, 2) of a lattice that a vehicle can get to, and those that vehicles are under way to."""
        reached = np.minimum.reduce(ways) < UNREACHED
        lattice = np.zeros_like(reached)
        lattice[::LATTICE, ::LATTICE] = True
        for row, col in self._views.values():
            if row < reached.shape[0] and col < reached.shape[1]:
                lattice[row, col] = True
        for row, col in self._spent:
            lattice[row, col] = False
        return np.argwhere(reached & lattice)

    def _share(self, scene: Scene, places: IntArray, far: FloatArray, in_time: NDArray[np.bool_]) -> list[int | None]:
        """Return the view (an index into ``places``) of every vehicle, None where none is worth it.

        The vehicle with the best view takes it first; what is seen from there counts nothing for the others.
        """
        task = scene.task
        worth = np.where(task.in_goal, 1.0, ELSEWHERE if goal_left(scene).any() else 1.0)
        chosen: list[int | None] = [None] * len(far)
        if len(places) == 0:
            return chosen
        under_way = np.ones_like(far)
        for i, name in enumerate(scene.team.vehicles):
            if name in self._views:
                under_way[i, (places == np.array(self._views[name])).all(axis=1)] = KEEP
        near = NEAR * task.scanner.reach_m
        parts = parts_left(scene)
        waiting = set(range(len(far)))
        while waiting:
            seen = self._gains.of(task, worth, places)
            seen = np.where(seen >= LEAST * worth.max(initial=0.0) * ELSEWHERE, seen, 0.0)
            # By what is seen from there, or on the way to a part of the goal area by that as well.
            values = [under_way * seen / (far + near)]
            values += [_on_the_way(part, seen, far, part.way_m[tuple(places.T)], task.left_m, near) for part in parts]
            values = [np.where(in_time, value, 0.0) for value in values]
            for value in values:
                value[[i for i in range(len(far)) if i not in waiting]] = 0.0
            why, who, which = np.unravel_index(int(np.argmax(values)), (len(values), *far.shape))
            if values[why][who, which] <= 0.0:
                break
            chosen[int(who)] = int(which)
            waiting.remove(int(who))
            take(task, worth, places[which])
            if why > 0:
                parts[why - 1] = parts[why - 1].halved()
        return chosen

    def _remember(self) -> dict[str, Any]:
        return {"views": {name: list(view) for name, view in self._views.items()}, "spent": self._spent}

    def _recall(self, state: dict[str, Any]) -> None:
        self._views = {str(name): (int(row), int(col)) for name, (row, col) in state["views"].items()}
        self._spent = [(int(row), int(col)) for row, col in state["spent"]]


def _on_the_way(
    part: GoalPart, seen: FloatArray, far_m: FloatArray, beyond_m: FloatArray, left_m: float, near_m: float
) -> FloatArray:
    """Return what views are worth as a beginning of the way to a part of the goal area, per metre.

    ``seen`` (n,) is what they show, ``far_m`` (vehicles, n) how far they are, ``beyond_m`` (n,) how far the part may be
    from there. Worth nothing is what shows nothing new, and what is too far to be home in ``left_m``.
    """
    way_m = far_m + beyond_m
    value = (seen + part.cells) / (near_m + way_m + part.sweep_m)
    return np.where((seen > 0.0) & (way_m + part.home_m <= left_m), value, 0.0)
