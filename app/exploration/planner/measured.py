"""The objective as it can be measured after a step, from the belief alone (AURO15 eq. 17)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.estimation import LandmarkSets, RangeSensor
from app.exploration.core.moving_targets import dynamic_cost
from app.exploration.core.objective import (
    MED13_K,
    ObjectiveWeights,
    closest_squared,
    med13_objective,
    objective,
    with_depths,
)
from app.exploration.core.problem import Belief, Situation
from app.exploration.planner.options import PlannerOptions


class MeasuredObjective:
    """Eq. (9) or MED13's cost for sensors that see landmarks; for bathymeters the share of variance a step removed.

    Every switch of eq. (9) stays open (infinite eps, which the paper leaves free): an estimator fits what changes with
    the positions, and a term that comes and goes with the progress two steps ago would hide that.

    A belief does not hold which vehicle brought a landmark into ``A``: the closest one is credited with it.
    """

    def __init__(self, sensor: RangeSensor | None, options: PlannerOptions) -> None:
        self._sensor = sensor
        self._terms = options.objective
        self._by_vehicle = options.contribution == "vehicle" and sensor is not None
        self._accurate: NDArray[np.bool_] | None = None
        self._names: tuple[str, ...] = ()
        self._positions = np.zeros((0, 3))
        self._variance: float | None = None

    def update(self, team: Situation) -> FloatArray:
        """Return the objective of the step that led to this situation, (1,), or each vehicle's contribution, (n,).

        The contribution of a vehicle is the objective less what it would be had the vehicle stayed where it was. NaN
        for the first step, and when the team changed.
        """
        return self._landmarks(team, self._sensor) if self._sensor is not None else self._bathymeter(team)

    def _bathymeter(self, team: Situation) -> FloatArray:
        sd = team.belief.sd_m
        finite = sd[np.isfinite(sd)]
        ceiling = float((finite**2).max()) if len(finite) else 1.0
        variance = float(np.minimum(sd**2, ceiling).mean() / ceiling) if ceiling > 0 else 0.0
        before, self._variance = self._variance, variance
        return np.array([np.nan if before is None else before - variance])

    def _landmarks(self, team: Situation, sensor: RangeSensor) -> FloatArray:
        belief, n = team.belief, len(team.vehicles)
        points = np.column_stack([belief.xy_m, belief.depth_m])
        measured = np.isfinite(belief.sd_m)
        visible_by = sensor.visible(team.positions, points) & measured
        first = self._accurate is None or len(self._accurate) != len(belief.accurate)
        known_before = belief.accurate if self._accurate is None or first else self._accurate
        fresh = belief.accurate & ~known_before
        seen_before = sensor.visible(self._positions, points) & measured
        points = with_depths(points)
        value = self._evaluate(team, team.positions, points, visible_by, int(fresh.sum()))
        if not self._by_vehicle:
            result = np.array([np.nan if first else value])
        elif first or self._names != team.vehicles:
            result = np.full(n, np.nan)
        else:
            gained = np.zeros(n, dtype=np.int64)
            if fresh.any():
                gained = np.bincount(closest_squared(team.positions, points[fresh])[1], minlength=n)
            result = np.empty(n)
            for j in range(n):
                without, visible_without = team.positions.copy(), visible_by.copy()
                without[j], visible_without[j] = self._positions[j], seen_before[j]
                left_behind = self._evaluate(team, without, points, visible_without, int(fresh.sum() - gained[j]))
                result[j] = value - left_behind
        self._accurate, self._names, self._positions = belief.accurate.copy(), team.vehicles, team.positions.copy()
        return result

    def _evaluate(
        self, team: Situation, positions: FloatArray, points: FloatArray, visible_by: NDArray[np.bool_], gained: int
    ) -> float:
        belief = team.belief
        sets = belief_sets(belief, visible_by)
        if self._terms == "med13":
            moving = dynamic_cost(positions, team.targets, team.localization, MED13_K)
            return med13_objective(positions, points, sets).total - moving
        weights = ObjectiveWeights.of(self._terms, switched=False)
        return objective(positions, points, sets, int(belief.accurate.sum()) - gained, weights=weights).total

    def remember(self) -> dict[str, Any]:
        """Return the memory as plain values."""
        return {
            "accurate": None if self._accurate is None else np.flatnonzero(self._accurate).tolist(),
            "landmarks": 0 if self._accurate is None else len(self._accurate),
            "names": list(self._names),
            "positions": self._positions.tolist(),
            "variance": self._variance,
        }

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self._accurate = None
        if state["accurate"] is not None:
            self._accurate = np.zeros(int(state["landmarks"]), dtype=np.bool_)
            self._accurate[np.array(state["accurate"], dtype=np.int64)] = True
        self._names = tuple(state["names"])
        self._positions = np.array(state["positions"], dtype=np.float64).reshape(-1, 3)
        self._variance = state["variance"]


def belief_sets(belief: Belief, visible_by: NDArray[np.bool_]) -> LandmarkSets:
    """Return the sets of AURO15 as far as a belief knows them: no vehicle is credited with a landmark."""
    hidden = ~visible_by.any(axis=0) & ~belief.accurate
    seen = hidden & np.isfinite(belief.depth_m)
    nobody = np.zeros(len(visible_by), dtype=np.int64)
    return LandmarkSets(belief.accurate, nobody, visible_by, seen if seen.any() else hidden)
