"""Who goes first where vehicles of a search are in each other's way, and who goes out of the way for whom."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.planner.base import vehicle_rng
from app.exploration.site_search.scene import Scene

ASIDE = 12
"""Directions in which a vehicle may step aside for another."""


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
    goes = zip(team.positions[:, :2], homebound.tolist(), strict=True)
    ways_m = [scene.ground.way_m(here, scene.home) if bound else np.inf for here, bound in goes]
    rolled = np.roll(np.arange(len(wishes)), -team.step)
    order = [int(i) for i in rolled[np.argsort(np.array(ways_m)[rolled], kind="stable")]]
    yields = _Yields(scene, bottom, wishes, seed, homebound & scene.is_back)
    decided = yields.decided(order, homebound)
    if len(order) > 1 and np.array_equal(decided, team.positions):
        decided = yields.decided(order, np.ones_like(homebound))
    return decided


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
