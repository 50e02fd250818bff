"""Errands: what takes single vehicles out of the team's plan for a while, the same for every planner.

MED13's cost has two parts that do not wait for the sweep over the landmarks: targets that are not accurately known (any
more), each drawing its closest vehicle, and the fictitious target that draws the shallowest vehicle up when
localization fades. Both are given to one vehicle each; the others go on with the plan without it. Where vehicles have
to keep within communication range the whole team goes along.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.estimation.targets import foretold_sd
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.moving_targets import Localization, Targets

LEAVES_AT = 0.9
"""Part of the accuracy threshold at which a target is about to leave ``A``."""

LOST = 1.0
"""Part of it from which one more vehicle than usual may go, as long as another one goes on with the plan."""

ENOUGH = 0.6
"""Part of it at which the vehicle that went for it comes back."""

CLOSE = 0.5
"""Closer than this part of (accuracy over noise) a vehicle need not be: from there on geometry counts."""

VEHICLES_PER_CHASER = 3
PARTS = (1.0, 0.5)
RISE = -1


@dataclass(frozen=True)
class Errand:
    """A vehicle's task: ``target`` is the number of a target, or ``RISE``."""

    vehicle: str
    target: int


class Errands:
    """Remembers which vehicle is on which errand."""

    def __init__(self) -> None:
        self._on: dict[str, int] = {}

    def assign(
        self,
        vehicles: tuple[str, ...],
        positions: FloatArray,
        targets: Targets | None,
        localization: Localization | None,
    ) -> list[Errand]:
        """Return the errands of this step, for vehicles at ``positions`` (n_vehicles, 3)."""
        self._on = {name: what for name, what in self._on.items() if name in vehicles}
        self._rise(vehicles, positions, localization)
        self._chase(vehicles, positions, targets)
        return [Errand(name, self._on[name]) for name in vehicles if name in self._on]

    def _rise(self, vehicles: tuple[str, ...], positions: FloatArray, localization: Localization | None) -> None:
        rising = {name for name, what in self._on.items() if what == RISE}
        if localization is None:
            needed: set[str] = set()
        else:
            due = due_to_rise(localization)
            # A vehicle that has begun to rise goes on until a fix has made its position good.
            needed = {name for name, late in zip(vehicles, due, strict=True) if late}
            if localization.shared:
                still = rising if needed else set()
                shallowest = vehicles[int(np.argmin(positions[:, 2]))]
                needed = still or ({shallowest} if needed else set())
        for name in rising - needed:
            del self._on[name]
        for name in needed:
            self._on[name] = RISE

    def _chase(self, vehicles: tuple[str, ...], positions: FloatArray, targets: Targets | None) -> None:
        chasing = {name: what for name, what in self._on.items() if what != RISE}
        count = 0 if targets is None else len(targets.state)
        if targets is None or not all(what < count for what in chasing.values()):
            self._on = {name: what for name, what in self._on.items() if what == RISE}
            return
        part = np.where(np.isfinite(targets.state).all(axis=1), targets.sd_m / targets.accuracy_sd_m, 0.0)
        for name, what in chasing.items():
            if part[what] < ENOUGH:
                del self._on[name]
        for target in np.argsort(-part):
            taken = [what for what in self._on.values() if what != RISE]
            if part[target] <= LEAVES_AT or int(target) in taken:
                continue
            # A target that is lost is not left waiting for the vehicle that is with another one.
            if len(taken) >= most_away(len(vehicles)) + (part[target] > LOST and len(taken) < len(vehicles) - 1):
                continue
            # A vehicle coming back from another target is on the way already.
            free = [i for i, name in enumerate(vehicles) if name not in self._on]
            free = [i for i in free if vehicles[i] in chasing] or free
            if free:
                distance = np.linalg.norm(positions[free] - targets.state[target, :3], axis=1)
                self._on[vehicles[free[int(np.argmin(distance))]]] = int(target)

    def remember(self) -> dict[str, int]:
        """Return the memory."""
        return dict(self._on)

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self._on = {str(name): int(what) for name, what in state.items()}


def most_away(vehicles: int) -> int:
    """Return how many of a team may be away for targets: the others must be able to go on with the plan.

    One vehicle that goes from target to target serves all of them, because every vehicle ranges to each.
    """
    return max(1, vehicles // VEHICLES_PER_CHASER) if vehicles > 1 else 0


def due_to_rise(localization: Localization) -> NDArray[np.bool_]:
    """Return which vehicles have to rise now so as to be at the surface before they are lost, (n_vehicles,)."""
    return np.asarray(localization.foretold_sd_m >= localization.threshold_sd_m, dtype=np.bool_)


def errand_move(
    row: int,
    errand: Errand,
    origin: FloatArray,
    planned: FloatArray,
    constraints: Constraints,
    bottom: Bottom,
    targets: Targets | None,
    localization: Localization | None,
    at_depth: Callable[[FloatArray], FloatArray] | None = None,
) -> FloatArray:
    """Return where the vehicle in a row goes on its errand, (3,); where it is, when nothing else is feasible.

    Parameters
    ----------
    origin, planned : (n_vehicles, 3)
        Where the vehicles are, and where the others go.
    at_depth
        Gives team configurations (k, n_vehicles, 3) the depths that they have to have; None: any depth is free.
    """
    goal = np.append(origin[row, :2], localization.surface_m) if localization is not None else origin[row]
    if errand.target != RISE and targets is not None:
        goal = targets.state[errand.target, :3]
    candidates = np.repeat(planned[None], len(PARTS) * (1 + len(_DIRECTIONS)) + 1, axis=0)
    way = goal - origin[row]
    if at_depth is not None:
        way = np.append(way[:2], 0.0)
    candidates[:, row] = origin[row] + _moves(way, constraints.max_step_m * (1.0 - 1e-9))
    if at_depth is not None:
        candidates[:, row] = at_depth(candidates)[:, row]
    if targets is not None and errand.target != RISE:
        candidates = candidates[_keeps_off(candidates[:, row], origin[row], targets)]
    candidates = candidates[constraints.feasible(origin, candidates, bottom)]
    if len(candidates) == 0:
        return np.asarray(origin[row])
    distance = np.linalg.norm(candidates[:, row] - goal, axis=1)
    if errand.target == RISE or targets is None:
        return np.asarray(candidates[np.argmin(distance), row])
    close = CLOSE * targets.accuracy_sd_m / targets.relative_noise
    value = np.maximum(distance - close, 0.0) / constraints.max_step_m
    for state, covariance in zip(targets.state, targets.covariance, strict=True):
        if np.isfinite(state).all():
            sd = foretold_sd(
                state, covariance, candidates, targets.relative_noise, targets.hearing_m, targets.range_sd_m
            )
            value += sd / targets.accuracy_sd_m
    return np.asarray(candidates[np.argmin(value), row])


def _keeps_off(places: FloatArray, here: FloatArray, targets: Targets) -> NDArray[np.bool_]:
    """Return which legs from ``here`` (3,) to places (k, 3) keep off where every target is expected, all along.

    Where a vehicle is too close to one already, legs only lead away from it.
    """
    kept = np.ones(len(places), dtype=np.bool_)
    legs = places - here
    squared = np.maximum((legs**2).sum(axis=1), 1e-12)
    for target in targets.state[np.isfinite(targets.state).all(axis=1), :3]:
        away = target - here
        nearest = here + np.clip(legs @ away / squared, 0.0, 1.0)[:, None] * legs
        distance = np.linalg.norm(nearest - target, axis=1)
        kept &= distance >= min(targets.standoff_m, float(np.linalg.norm(away)) - 1e-9)
    return kept


def _directions() -> FloatArray:
    """Return the directions to the neighbours in a cube of 27, (26, 3)."""
    axis = np.array([-1.0, 0.0, 1.0])
    around = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    around = around[np.abs(around).sum(axis=1) > 0]
    return np.asarray(around / np.linalg.norm(around, axis=1, keepdims=True))


_DIRECTIONS = _directions()


def neighbouring_moves(step: float) -> FloatArray:
    """Return the moves of a vehicle on a lattice of 27: to stay, and a whole step in each direction, (27, 3)."""
    return np.vstack([np.zeros(3), step * _DIRECTIONS])


def _moves(way: FloatArray, step: float) -> FloatArray:
    """Return the moves to choose from: to stay, straight along the way, and all around."""
    length = float(np.linalg.norm(way))
    straight = way / max(length, 1e-12) * min(1.0, length / step)
    whole = step * np.vstack([straight, _DIRECTIONS])
    return np.vstack([np.zeros(3), *(part * whole for part in PARTS)])
