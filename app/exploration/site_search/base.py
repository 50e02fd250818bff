"""What all planners of search missions share: where one may go, being back in time, and giving way to each other."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.problem import Proposal, Situation
from app.exploration.core.search_task import SearchTask
from app.exploration.planner.base import PlannerBase, vehicle_rng
from app.exploration.site_search.criteria import Weights, terms
from app.exploration.site_search.ground import Ground

HOME_STEPS = 3.0
"""Steps from the entry, times vehicles, within which a vehicle counts as being there."""
ASIDE = 12
"""Directions in which a vehicle may step aside for another."""
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
    ground: Ground
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
        ground = Ground.of(task)
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


def give_way(scene: Scene, bottom: Bottom, wishes: FloatArray, seed: int, homebound: NDArray[np.bool_]) -> FloatArray:
    """Return the team's next positions (n_vehicles, 3): the wishes (n_vehicles, 2), a step aside, or where it is.

    One after the other vehicles take the first place at which no limit is broken while the others go where they have
    decided to, or stand: those first that have to go home now, the nearest to the entry before the others, then
    beginning with another one each step. For who goes home others go out of the way that have not decided yet; where
    nobody could move, for anybody. Standing breaks no limit, since it changes nothing.

    Parameters
    ----------
    homebound : (n_vehicles,)
        Who has to go home now.
    """
    team = scene.team
    ways_m = [scene.ground.way_m(here, scene.home) if goes else np.inf for here, goes in _pairs(team, homebound)]
    rolled = np.roll(np.arange(len(wishes)), -team.step)
    order = [int(i) for i in rolled[np.argsort(np.array(ways_m)[rolled], kind="stable")]]
    yields = _Yields(scene, bottom, wishes, seed, homebound & scene.is_back)
    decided = yields.decided(order, homebound)
    if len(order) > 1 and np.array_equal(decided, team.positions):
        decided = yields.decided(order, np.ones_like(homebound))
    return decided


def _pairs(team: Situation, homebound: NDArray[np.bool_]) -> Iterator[tuple[FloatArray, bool]]:
    return zip(team.positions[:, :2], homebound.tolist(), strict=True)


@dataclass(frozen=True)
class _Yields:
    """The vehicles of one decision, which go where they wish to, or out of each other's way.

    Attributes
    ----------
    wishes : (n_vehicles, 2)
    rests : (n_vehicles,)
        Who is back at the entry, and steps aside only to come nearer to it.
    """

    scene: Scene
    bottom: Bottom
    wishes: FloatArray
    seed: int
    rests: NDArray[np.bool_]

    def decided(self, order: Sequence[int], has_way: NDArray[np.bool_]) -> FloatArray:
        """Return the next positions (n_vehicles, 3), decided in that order.

        ``has_way`` (n_vehicles,): who can have others go out of the way.
        """
        positions, settled = self.scene.team.positions.copy(), set[int]()
        for i in order:
            if i in settled:
                continue
            settled.add(i)
            taken = self._first(positions, {i: self.wishes[i : i + 1]})
            if taken is None and has_way[i]:
                for j in (j for j in order if j not in settled):
                    taken = self._first(positions, {i: self.wishes[i : i + 1], j: self._out_of_the_way(j)})
                    if taken is not None:
                        settled.add(j)
                        break
            if taken is None and len(order) > 1:  # a step aside is dear to work out
                taken = self._first(positions, {i: self._aside(i)})
            positions = positions if taken is None else taken
        return positions

    def _first(self, positions: FloatArray, ends: Mapping[int, FloatArray]) -> FloatArray | None:
        """Return the positions (n_vehicles, 3) with the first ends that break no limit; None: all of them break one.

        ``ends``: by vehicle, each (k, 2), or (1, 2) for all of the others' ends.
        """
        most = min(len(of_one) for of_one in ends.values()) and max(len(of_one) for of_one in ends.values())
        options = np.repeat(positions[None], most, axis=0)
        for i, of_one in ends.items():
            options[:, i, :2] = of_one
        if most == 0:
            return None
        team = self.scene.team
        ok = team.constraints.feasible(team.positions, options, self.bottom)
        return np.asarray(options[int(np.argmax(ok))]) if ok.any() else None

    def _aside(self, i: int) -> FloatArray:
        """Return places (k, 2) a step away, those closest to the wish first, from where the vehicle is still in time.

        Who is late where it is may go anywhere.
        """
        scene, ends = self.scene, self._out_of_the_way(i)
        if self.rests[i]:
            ways_m = np.array([scene.ground.way_m(end, scene.home) for end in ends])
            here_m = scene.ground.way_m(scene.team.positions[i, :2], scene.home)
            return ends[ways_m < here_m - scene.task.grid.cell_m] if len(ends) else ends
        if not len(ends) or not scene.in_time(scene.team.positions[i, :2], 0.0):
            return ends
        return ends[[scene.in_time(end, scene.step_m) for end in ends]]

    def _out_of_the_way(self, i: int) -> FloatArray:
        """Return places (k, 2) a step away to which clear legs lead, those closest to the wish first."""
        here = self.scene.team.positions[i, :2]
        turn = vehicle_rng(self.seed, self.scene.team.vehicles[i]).uniform(0.0, 2.0 * np.pi)
        bearing = turn + np.linspace(0.0, 2.0 * np.pi, ASIDE, endpoint=False)
        ends = here + self.scene.step_m * np.column_stack([np.sin(bearing), np.cos(bearing)])
        ends = ends[self.scene.ground.clear(here, ends)]
        return ends[np.argsort(np.hypot(*(ends - self.wishes[i]).T))]


def hold(scene: Scene) -> FloatArray:
    """Return where the vehicles are, (n_vehicles, 2)."""
    return np.array(scene.team.positions[:, :2])
