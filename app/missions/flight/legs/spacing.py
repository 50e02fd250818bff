"""Decided legs that keep vehicles apart: who would come too close to another one waits, and at last goes aside."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from shapely import Polygon

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.missions.flight.decisions.decision import Decision
from app.missions.flight.decisions.leg import Leg
from app.missions.flight.decisions.separation import too_close, ways_aside
from app.missions.live.mission import LiveMission
from app.missions.safety import room
from app.missions.task.constraints import INSET_M

PATIENCE = 1
"""How often a vehicle waits for others to pass before it goes aside."""


class LegSpacing:
    """Refuses decided legs on which vehicles would come too close, and remembers whom it refused."""

    def __init__(self, live: LiveMission, constraints: Constraints) -> None:
        self._live = live
        self._constraints = constraints
        self._refusals: dict[str, int] = {}
        """How often in a row vehicles got no leg because of others."""

    def most_refusals(self, names: Iterable[str]) -> int:
        """Return how often in a row that vehicle got no leg which was refused most often."""
        return max(self._refusals.get(name, 0) for name in names)

    def is_first_refusal(self, decision: Decision) -> bool:
        """Whether somebody of a decision got no leg for the first time in a row."""
        return any(self._refusals.get(leg.vehicle) == 1 for leg in decision.legs)

    def apart(self, decision: Decision) -> Decision:
        """Give no leg to a vehicle that would come too close to another one on the way."""
        close = too_close(decision, self._live, self._live.spec)
        for name in {leg.vehicle for leg in decision.legs} - close.keys():
            self._refusals.pop(name, None)
        if not close:
            return decision
        for name in close:
            self._refusals[name] = self._refusals.get(name, 0) + 1
            aside = self._step_aside(decision, name) if self._refusals[name] > PATIENCE else None
            if aside is not None:
                return aside
        legs = [replace(leg, refusal=close.get(leg.vehicle, leg.refusal)) for leg in decision.legs]
        notes = [f"{name}: {reason}; it waits" for name, reason in close.items()]
        return replace(decision, legs=legs, notes=[*decision.notes, *notes])

    def _step_aside(self, decision: Decision, name: str) -> Decision | None:
        """Return a decision in which one vehicle goes somewhere else, so that nobody waits for each other for ever."""
        [planned] = [leg for leg in decision.legs if leg.vehicle == name]
        start = np.append(decision.origin_m[name], planned.target_m[2])
        others = [leg for leg in decision.legs if leg.vehicle != name and not leg.refusal]
        for target in self._ways_aside(start, planned, decision.bottom):
            legs = [*others, replace(planned, target_m=target)]
            tried = replace(decision, legs=legs)
            close = too_close(tried, self._live, self._live.spec)
            if name not in close:
                left = [replace(leg, refusal=close.get(leg.vehicle, "")) for leg in legs]
                return replace(tried, legs=left, notes=[*decision.notes, f"{name} goes aside to let others pass"])
        return None

    def _ways_aside(self, start: FloatArray, planned: Leg, bottom: Bottom) -> FloatArray:
        """Return where a vehicle may go in place of the end of its leg, (k, 3).

        Who comes in comes in elsewhere, or goes beside where it is: zones may bar all ways in but one.
        """
        if not planned.unplanned:
            return ways_aside(start, planned.target_m, self._constraints.for_plans, bottom)
        if room.distance_outside_m(Polygon(self._constraints.area), start[:2]) == 0.0:
            return np.zeros((0, 3))
        beside = room.ways_beside(self._constraints, start[:2], self._live.spec.limits.max_step_m)
        beside = beside[np.argsort(np.hypot(*(beside - planned.target_m[:2]).T), kind="stable")]
        ends = [*room.ways_in(self._constraints, start[:2], INSET_M), *beside]
        return np.array([np.append(end, planned.target_m[2]) for end in ends]).reshape(-1, 3)
