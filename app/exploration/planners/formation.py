"""The lawnmower of a team that must stay in communication range: side by side, at a spacing that keeps the links."""

import itertools
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from app.estimation import RangeSensor, Sensor
from app.exploration.bottom import Bottom
from app.exploration.lattice import Sweep, boustrophedon, even_lines, longer_axis_rad
from app.exploration.options import PlannerOptions
from app.exploration.planners.base import PlannerBase, at_depth, settle
from app.exploration.problem import Proposal, Situation
from app.exploration.routes import FreeSpace, next_waypoint

FloatArray = NDArray[np.float64]

SPACING_OF_RANGE = 0.85
HEIGHT_OF_VISIBILITY = 0.45
ADVANCE = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0)
CLIMB_OF_STEP = 0.6
LIFTS = (0.0, 0.5, 1.0)
SLOT_TOLERANCE = 0.02
"""Of a step: how close to its slot a vehicle must get before the formation goes on."""


class FormationLawnmower(PlannerBase):
    """A rigid row of vehicles sweeps the area; its middle follows the lines, every vehicle keeps its height.

    A finished sweep is followed by one across it, as an operator would do with what is left.
    """

    name: ClassVar[str] = "lawnmower"

    def __init__(self, options: PlannerOptions, sensor: Sensor) -> None:
        if not isinstance(sensor, RangeSensor):
            raise ValueError(f"sensor: the formation needs a RangeSensor, not {type(sensor).__name__}")
        super().__init__(options, sensor)
        self._height = HEIGHT_OF_VISIBILITY * sensor.visibility_m
        self._reach = sensor.visibility_m
        self._names: tuple[str, ...] = ()
        self._turned = False
        self._offsets = np.zeros((0, 2))
        self._middle = np.zeros(2)
        self._route = np.zeros((0, 2))

    def _remember(self) -> dict[str, Any]:
        return {
            "names": list(self._names),
            "turned": self._turned,
            "offsets": self._offsets,
            "middle": self._middle,
            "route": self._route,
        }

    def _recall(self, state: dict[str, Any]) -> None:
        self._names, self._turned = tuple(state["names"]), bool(state["turned"])
        self._offsets, self._route = (np.array(state[k], dtype=np.float64).reshape(-1, 2) for k in ("offsets", "route"))
        self._middle = np.array(state["middle"], dtype=np.float64)

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        if self._names != team.vehicles:
            self._form_up(team)
        elif len(self._route) == 0:
            self._turned = not self._turned
            self._form_up(team)
        constraints, origin = team.constraints, team.positions
        step = constraints.max_step_m * (1 - 1e-9)
        climb = CLIMB_OF_STEP * step
        wishes: list[FloatArray] = []
        ends: list[tuple[FloatArray, int]] = []
        ranks: list[tuple[bool, bool, float]] = []
        for lift, advance in itertools.product(LIFTS, ADVANCE):
            x, y, passed = next_waypoint(
                self._middle[0], self._middle[1], self._route, 0, len(self._route), max(1e-9, advance * step)
            )
            middle = np.array([x, y]) if advance > 0 else self._middle
            slots = middle + self._offsets
            depths = self._depths(team, bottom, slots) - lift * self._height
            wish = at_depth(
                constraints, bottom, origin, slots, np.clip(depths, origin[:, 2] - climb, origin[:, 2] + climb)
            )
            lag = float(np.hypot(*(wish[:, :2] - slots).T).max())
            # Holding the row comes last: only going on, if need be with a gap or higher, brings other ground below it.
            ranks.append((advance == 0.0, lag > SLOT_TOLERANCE * step, lift))
            wishes.append(wish)
            ends.append((middle, passed if advance > 0 else 0))
        order = sorted(range(len(wishes)), key=lambda k: ranks[k])
        wishes, ends = [wishes[k] for k in order], [ends[k] for k in order]
        positions, taken = settle(team, bottom, np.array(wishes))
        if np.allclose(positions, wishes[taken]):
            self._middle, passed = ends[taken]
            self._route = self._route[passed:]
        return Proposal(positions, 0.0, {"left": float(len(self._route))})

    def _form_up(self, team: Situation) -> None:
        constraints, n = team.constraints, len(team.vehicles)
        en = team.positions[:, :2]
        gap = min(SPACING_OF_RANGE * constraints.com_range_m, self._reach)
        direction = longer_axis_rad(constraints.area) + (np.pi / 2 if self._turned else 0.0)
        sweep = Sweep(constraints, FreeSpace(constraints, 0.0), direction)
        u = sweep.to_uv(constraints.area)[:, 0]
        passes = max(1, int(np.ceil(np.ptp(u) / (n * gap) - 1e-9)))
        # The outermost vehicles keep half a gap from the border, whatever the width.
        gap = min(gap, float(np.ptp(u)) / (n * passes))
        across = (np.argsort(np.argsort(sweep.to_uv(en)[:, 0], kind="stable")) - (n - 1) / 2) * gap
        self._offsets = sweep.to_en(np.column_stack([across, np.zeros(n)]))
        self._middle = en.mean(axis=0)
        self._names = team.vehicles
        if len(self._route) == 0:
            low, high = float(u.min()), float(u.max())
            self._route = boustrophedon(sweep, self._middle, low, high, np.inf, lines=even_lines(low, high, passes))
            inset = min(self._reach / 2, float(np.ptp(sweep.to_uv(constraints.area)[:, 1])) / 4)
            v = sweep.to_uv(self._route)
            ends = sweep.to_uv(constraints.area)[:, 1]
            v[:, 1] = np.clip(v[:, 1], ends.min() + inset, ends.max() - inset)
            self._route = sweep.to_en(v)

    def _depths(self, team: Situation, bottom: Bottom, slots: FloatArray) -> FloatArray:
        """Return depths at the survey height above the mean known bottom around the slots; unknown: as deep as now."""
        ring = np.array([[0.0, 0.0], [1, 0], [-1, 0], [0, 1], [0, -1]]) * 0.25 * self._reach
        floor = bottom.at(slots[:, None, :] + ring)
        known = np.isfinite(floor).any(axis=1)
        mean = np.where(known, np.nansum(floor, axis=1) / np.maximum(1, np.isfinite(floor).sum(axis=1)), 0.0)
        return np.where(known, mean - self._height, team.positions[:, 2])
