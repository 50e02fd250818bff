"""The lawnmower of a team that must stay in communication range: side by side, at a spacing that keeps the links."""

from typing import Any, ClassVar

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.estimation import RangeSensor, Sensor
from app.exploration.core.bottom import Bottom
from app.exploration.core.bottom_contacts import FeltBottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.problem import Proposal, Situation
from app.exploration.lines.formation_lines import EDGE, RowSpace, lines_over
from app.exploration.lines.lattice import longer_axis_rad
from app.exploration.planner.base import PlannerBase, at_depth, settle
from app.exploration.planner.options import PlannerOptions

GAP_OF_RANGE, GAP_OF_VISIBILITY = 0.85, 0.64
LINK_OF_RANGE = 0.97
CLOSED_OF_GAP = 0.45
"""Gap of a row that has closed up for a narrow passage or for what single lines left over."""

INSET_OF_VISIBILITY = 0.4
"""How far before the end of what is to be seen a line ends."""

HEIGHT_OF_VISIBILITY = 0.45
SMOOTHING_OF_VISIBILITY = 0.375
LOOKOUT_OF_VISIBILITY = 0.75
RING = 0.15
"""Of the visibility: pitch of the places around a vehicle at which the bottom is asked for."""

MARGIN_OF_CLEARANCE, MARGIN_OF_VISIBILITY = 0.8, 0.1
"""Added to the least altitude above the estimated bottom, which is uncertain: the lesser of these parts."""

STEEPEST = 1.2
"""Slope at which vehicles climb ahead of rising ground."""

DESCENT_OF_STEP = 0.6
ESCAPE_OF_STEP = 0.9
"""Of a step: how much a vehicle climbs that has just been lifted by its altimeter."""

ADVANCE = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0)
SLOT_TOLERANCE = 0.05
"""Of a step: how close to its slot a vehicle must get before the row goes on."""

CLOSING_IN = 0.5
"""Of a step: by so much the vehicles must come closer to their slots while the row goes on."""

GAPS_TRIED = 12
STUCK_STEPS = 4
LOOKS = 12
"""Steps over a place after which it is left for later."""

WORTH_LINES = 0.08
"""Part of all landmarks that must be unfinished for another set of lines; fewer are visited one by one."""


class FormationLawnmower(PlannerBase):
    """A row of vehicles sweeps the area along parallel lines, and then goes to what the lines left over.

    The row keeps its direction, its height above the (smoothed) bottom and its links, slows down where a vehicle has to
    climb, and closes up to pass obstacles. When the team changes, lines for the new row are laid over what is
    unfinished.
    """

    name: ClassVar[str] = "lawnmower"

    def __init__(self, options: PlannerOptions, sensor: Sensor) -> None:
        if not isinstance(sensor, RangeSensor):
            raise ValueError(f"sensor: the formation needs a RangeSensor, not {type(sensor).__name__}")
        super().__init__(options, sensor)
        self._reach = sensor.visibility_m
        self._names: tuple[str, ...] = ()
        self._row = np.zeros(3)
        self._route = np.zeros((0, 3))
        self._order: list[int] = []
        self._target = -1
        self._looks = 0
        self._idle = 0
        self._later: list[int] = []
        self._space: RowSpace | None = None
        self._felt = FeltBottom()
        r = np.arange(-5, 6) * RING
        ring = np.stack(np.meshgrid(r, r), axis=-1).reshape(-1, 2)
        self._ring = ring[np.hypot(*ring.T) <= LOOKOUT_OF_VISIBILITY] * self._reach

    def _remember(self) -> dict[str, Any]:
        return {
            "names": list(self._names),
            "row": self._row,
            "route": self._route,
            "order": self._order,
            "target": self._target,
            "looks": self._looks,
            "idle": self._idle,
            "later": self._later,
            "felt": self._felt.remember(),
        }

    def _recall(self, state: dict[str, Any]) -> None:
        self._names, self._row = tuple(state["names"]), np.array(state["row"], dtype=np.float64)
        self._route = np.array(state["route"], dtype=np.float64).reshape(-1, 3)
        self._order, self._later = ([int(k) for k in state[key]] for key in ("order", "later"))
        self._felt.recall(state["felt"])
        self._target, self._looks, self._idle = (int(state[key]) for key in ("target", "looks", "idle"))

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        constraints, origin, n = team.constraints, team.positions, len(team.vehicles)
        gap = min(GAP_OF_RANGE * constraints.com_range_m, GAP_OF_VISIBILITY * self._reach)
        closed = max(CLOSED_OF_GAP * gap, min(gap, 1.2 * constraints.min_separation_m))
        space = self._space_of(constraints, n, closed)
        if self._names != team.vehicles:
            self._form_up(team, space, gap)
        self._next_target(team, space, gap)

        lifted = self._felt.feel(team)
        step = constraints.max_step_m * (1 - 1e-9)
        lag_now = self._lag(origin, space.slots(self._row))
        wishes, rows, passed, ranks = [], [], [], []
        ahead = origin[:, 2]
        for advance in ADVANCE:
            row, behind = space.along(self._row, self._route, advance * step)
            slots = space.slots(row)[self._order]
            depths = self._depths(team, bottom, slots, lifted)
            # A row that waits gets ready for what comes: by itself the place where it is never lets it go on.
            ahead = depths if advance == ADVANCE[0] else ahead
            wish = at_depth(constraints, bottom, origin, slots, np.minimum(depths, ahead) if advance == 0.0 else depths)
            lag = self._lag(wish, space.slots(row))
            kept = lag <= max(SLOT_TOLERANCE * step, lag_now - CLOSING_IN * step)
            wishes.append(wish)
            rows.append(row)
            passed.append(behind)
            ranks.append((not kept, advance if not kept else -advance))
        best = sorted(range(len(wishes)), key=lambda k: ranks[k])
        positions, first = settle(team, bottom, np.array([wishes[k] for k in best]))
        taken = best[first]
        if np.allclose(positions, wishes[taken]):
            self._row, self._route = rows[taken], self._route[passed[taken] :]
        moved = float(np.linalg.norm(positions - origin, axis=1).max())
        self._felt.ask(team.vehicles, positions)
        self._idle = self._idle + 1 if moved < SLOT_TOLERANCE * step else 0
        return Proposal(positions, 0.0, {"left": float(len(self._route))})

    def _space_of(self, constraints: Constraints, n: int, closed: float) -> RowSpace:
        """Return the space for rows, the same object as long as nothing changes: preparing it takes time."""
        if self._space is None or self._space.constraints is not constraints or self._space.n != n:
            self._space = RowSpace(constraints, longer_axis_rad(constraints.area), n, closed, EDGE * self._reach)
        return self._space

    def _lag(self, positions: FloatArray, slots: FloatArray) -> float:
        return float(np.hypot(*(positions[:, :2] - slots[self._order]).T).max())

    def _form_up(self, team: Situation, space: RowSpace, gap: float) -> None:
        """Begin a row where the vehicles are, and lay lines over what is unfinished."""
        en = team.positions[:, :2]
        rank = np.argsort(np.argsort(space.to_uv(en)[:, 0], kind="stable"))
        self._names, self._order = team.vehicles, [int(k) for k in rank]
        spread = float(np.ptp(space.to_uv(en)[:, 0])) / max(1, space.n - 1)
        gaps = np.linspace(np.clip(spread, space.closed_m, gap), 0.0, GAPS_TRIED)
        rows = np.column_stack([np.tile(en.mean(axis=0), (GAPS_TRIED, 1)), gaps])
        self._row = rows[int(np.argmax(space.allowed(rows)))]  # beside a border it must begin narrow
        self._target, self._later = -1, []
        unfinished = team.belief.xy_m[~team.belief.accurate]
        self._route = self._lines(space, unfinished, gap) if len(unfinished) else np.zeros((0, 3))

    def _lines(self, space: RowSpace, unfinished: FloatArray, gap: float) -> FloatArray:
        return lines_over(space, self._row, unfinished, gap, INSET_OF_VISIBILITY * self._reach)

    def _next_target(self, team: Situation, space: RowSpace, gap: float) -> None:
        """Choose where to go once the lines are flown: more lines where much is left, else the closest place left."""
        done = team.belief.accurate
        if self._idle >= STUCK_STEPS:  # something is in the way: leave it for later
            self._idle, self._looks, rest = 0, LOOKS, self._route[1:]
            self._route = np.vstack([space.way(self._row, rest[0]), rest[1:]]) if len(rest) else rest
        if self._target >= 0:
            self._looks += len(self._route) == 0
            if not done[self._target] and self._looks < LOOKS:
                return
            self._later += [] if done[self._target] else [self._target]
            self._target, self._route = -1, np.zeros((0, 3))
        if len(self._route) or done.all():
            return
        left = np.setdiff1d(np.flatnonzero(~done), self._later)
        if len(left) == 0:
            left, self._later = np.flatnonzero(~done), []
        if len(left) > WORTH_LINES * len(done):
            self._route = self._lines(space, team.belief.xy_m[left], gap)
            return
        # A row for every place and every vehicle that could go there.
        k = np.arange(space.n) - (space.n - 1) / 2
        middles = team.belief.xy_m[left][:, None] - space.closed_m * k[:, None] * space.axes[0]
        rows = np.concatenate([middles, np.full((*middles.shape[:2], 1), space.closed_m)], axis=2).reshape(-1, 3)
        cost = np.hypot(*(rows[:, :2] - self._row[:2]).T) + np.where(space.allowed(rows), 0.0, 1e9)
        best = int(np.argmin(cost))
        self._target, self._looks = int(left[best // space.n]), 0
        self._route = space.way(self._row, rows[best])

    def _depths(self, team: Situation, bottom: Bottom, slots: FloatArray, lifted: BoolArray) -> FloatArray:
        """Return the depths (n,) at which the vehicles should be in the slots (n, 2)."""
        constraints, origin = team.constraints, team.positions
        step = constraints.max_step_m * (1 - 1e-9)
        around = np.hypot(*self._ring.T)
        floor = bottom.at(slots[:, None, :] + self._ring)
        near = np.where(around <= SMOOTHING_OF_VISIBILITY * self._reach, floor, np.nan)
        known = np.isfinite(near).any(axis=1)
        mean = np.where(known, np.nansum(near, axis=1) / np.maximum(1, np.isfinite(near).sum(axis=1)), 0.0)
        blind = origin[:, 2] + (DESCENT_OF_STEP * step if self._target >= 0 else 0.0)
        wish = np.where(known, mean - HEIGHT_OF_VISIBILITY * self._reach, blind)
        clearance = constraints.min_altitude_m
        clearance += min(MARGIN_OF_CLEARANCE * clearance, MARGIN_OF_VISIBILITY * self._reach)
        safe = floor - clearance + STEEPEST * around
        wish = np.fmin(wish, np.fmin.reduce(safe, axis=1))
        if len(self._felt.points_m):
            away = np.hypot(*(slots[:, None] - self._felt.points_m[:, :2]).transpose(2, 0, 1))
            above = self._felt.points_m[:, 2] - clearance + STEEPEST * away
            wish = np.minimum(wish, above.min(axis=1))
            wish = np.where(lifted, np.minimum(wish, origin[:, 2] - ESCAPE_OF_STEP * step), wish)
        wish = np.minimum(wish, origin[:, 2] + DESCENT_OF_STEP * step)
        return self._in_range(constraints, slots, wish)

    def _in_range(self, constraints: Constraints, slots: FloatArray, wish: FloatArray) -> FloatArray:
        """Return the depths (n,) with which neighbours in the row stay in range: the deeper one gives way, upwards."""
        by_rank = np.argsort(self._order)
        link = LINK_OF_RANGE * constraints.com_range_m
        if not np.isfinite(link):
            return wish
        drop = np.sqrt(np.maximum(0.0, link**2 - (np.diff(slots[by_rank], axis=0) ** 2).sum(axis=1)))
        depth = wish[by_rank]
        for k in range(1, len(depth)):
            depth[k] = min(depth[k], depth[k - 1] + drop[k - 1])
        for k in range(len(depth) - 1, 0, -1):
            depth[k - 1] = min(depth[k - 1], depth[k] + drop[k - 1])
        return np.asarray(depth[self._order])
