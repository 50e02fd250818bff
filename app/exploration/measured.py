"""The objective as it can be measured after a step, from the belief alone (AURO15 eq. 17)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.estimation import LandmarkSets, RangeSensor
from app.exploration.objective import ObjectiveWeights, VehicleProgress, closest_squared, objective
from app.exploration.problem import Situation

FloatArray = NDArray[np.float64]


class MeasuredObjective:
    """Eq. (9) for sensors that see landmarks; the share of the map's variance that a step removed for bathymeters.

    Who brought a landmark into ``A`` is not part of the belief: it is credited to the vehicle closest to it.
    """

    def __init__(self, sensor: RangeSensor | None) -> None:
        self._sensor = sensor
        self._weights = ObjectiveWeights()
        self._accurate: NDArray[np.bool_] | None = None
        self._credits: dict[str, int] = {}
        self._progress: list[VehicleProgress] = []
        self._names: tuple[str, ...] = ()
        self._variance: float | None = None

    def update(self, team: Situation) -> float:
        """Return the objective of the step that led to this situation; NaN for the first one."""
        return self._landmarks(team, self._sensor) if self._sensor is not None else self._bathymeter(team)

    def _bathymeter(self, team: Situation) -> float:
        sd = team.belief.sd_m
        finite = sd[np.isfinite(sd)]
        ceiling = float((finite**2).max()) if len(finite) else 1.0
        variance = float(np.minimum(sd**2, ceiling).mean() / ceiling) if ceiling > 0 else 0.0
        before, self._variance = self._variance, variance
        return np.nan if before is None else before - variance

    def _landmarks(self, team: Situation, sensor: RangeSensor) -> float:
        belief = team.belief
        points = np.column_stack([belief.xy_m, belief.depth_m])
        visible_by = sensor.visible(team.positions, points)
        hidden = ~visible_by.any(axis=0) & ~belief.accurate
        seen = hidden & np.isfinite(belief.depth_m)
        first = self._accurate is None or len(self._accurate) != len(belief.accurate)
        before = belief.accurate if self._accurate is None or first else self._accurate
        fresh = belief.accurate & ~before
        if fresh.any():
            _, closest = closest_squared(team.positions, points[fresh])
            for j, count in enumerate(np.bincount(closest, minlength=len(team.vehicles))):
                name = team.vehicles[j]
                self._credits[name] = self._credits.get(name, 0) + int(count)
        counts = np.array([self._credits.get(name, 0) for name in team.vehicles], dtype=np.int64)
        sets = LandmarkSets(belief.accurate, counts, visible_by, seen if seen.any() else hidden)
        if self._names != team.vehicles:
            self._progress = []
        earlier, last = self._progress if len(self._progress) == 2 else (None, None)
        result = objective(team.positions, points, sets, int(before.sum()), earlier, last, self._weights)
        self._accurate, self._names = belief.accurate.copy(), team.vehicles
        self._progress = [*self._progress[-1:], result.progress]
        return np.nan if first else result.total

    def remember(self) -> dict[str, Any]:
        """Return the memory as plain values."""
        return {
            "accurate": None if self._accurate is None else np.flatnonzero(self._accurate).tolist(),
            "landmarks": 0 if self._accurate is None else len(self._accurate),
            "credits": self._credits,
            "progress": [[p.accurate.tolist(), p.J1.tolist(), p.J2.tolist()] for p in self._progress],
            "names": list(self._names),
            "variance": self._variance,
        }

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self._accurate = None
        if state["accurate"] is not None:
            self._accurate = np.zeros(int(state["landmarks"]), dtype=np.bool_)
            self._accurate[np.array(state["accurate"], dtype=np.int64)] = True
        self._credits = {str(k): int(v) for k, v in state["credits"].items()}
        self._progress = [VehicleProgress(*(np.array(x, dtype=np.float64) for x in row)) for row in state["progress"]]
        self._names = tuple(state["names"])
        self._variance = state["variance"]
