"""Full coverage as missions plan it: the survey's lines, kept inside the area and off its keep-out zones."""

from typing import Any, ClassVar

import numpy as np

from app.arrays import FloatArray
from app.estimation.swath import SwathSonar
from app.exploration.core.bottom import Bottom
from app.exploration.core.coverage import Coverage, SwathTask
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.problem import Proposal, Situation
from app.exploration.lines.lattice import direction_of_lines_rad
from app.exploration.planner.base import PlannerBase, settle
from app.exploration.swath.near_zones import BarredGround
from app.exploration.swath.raster import Flying
from app.exploration.swath.survey import STILL_M, SwathSurvey

LEG_WIDTHS = 1.0
"""Longest leg along a line, in half widths of the swath."""

SHORTEST_LEG = 0.5
"""Legs along a line are at least this part of the longest that a vehicle may be given."""

MOST_BARRED = 5
"""After so many lines in a row that begin with a leg of no length there is none for now."""

GUESSED_ALTITUDE_M = 5.0
"""How high above the bottom vehicles are taken to be as long as no depth is known."""


class SwathPlanner(PlannerBase):
    """Full coverage with swath sonars: lines as far apart as the measured depth allows, gaps filled last."""

    name: ClassVar[str] = "swath"
    own_options: ClassVar[frozenset[str]] = frozenset({"line_heading_deg"})
    runs_errands: ClassVar[bool] = False
    plans_for_all = True
    flies_lines = True
    decides_apart = True

    def __init__(self, options: Any, sensor: Any) -> None:
        super().__init__(options, sensor)
        self._survey: SwathSurvey | None = None
        self._kept: dict[str, Any] | None = None
        self._free: FreeSpace | None = None
        self._barred: BarredGround | None = None
        self._sighted: tuple[Coverage, Flying, Coverage] | None = None
        """What was to be seen, how, and what of it can be: the same for the same question."""

    def _decide(self, team: Situation, bottom: Bottom, seed: int) -> Proposal:
        task = team.swath
        if task is None:
            return Proposal(team.positions.copy(), 0.0, done=frozenset(team.vehicles))
        survey = self._begin(team, task)
        for name in team.at_rest:
            survey.expect_nothing(name)
        wish = team.positions[:, :2].copy()
        poses = {
            name: np.array([*team.positions[i, :2], team.headings_rad[i]])
            for i, name in enumerate(team.vehicles)
            # What one without a way left was to see is everybody's.
            if name in task.sonars and (team.left_m is None or team.left_m[i] > 0.0)
        }
        done = set(team.vehicles) - poses.keys()
        for i, name in enumerate(team.vehicles):
            if not team.moves[i] or name in done:
                continue
            flying = self._flying(team, name, task)
            coverage = self._within_sight(team, task, flying)
            end = self._next_end(name, poses, flying, coverage, self._leg_m(team, i, bottom, flying), team)
            if end is None:
                done.add(name)
                continue
            wish[i] = end
        positions, _ = settle(team, bottom, self._at_cruise(team, bottom, wish)[None])
        left_pct = 100.0 * float(task.coverage.left.sum()) / max(int(task.coverage.wanted.sum()), 1)
        return Proposal(positions, 0.0, {"left_pct": left_pct}, done=frozenset(done))

    def _next_end(
        self,
        name: str,
        poses: dict[str, FloatArray],
        flying: Flying,
        coverage: Coverage,
        leg_m: float,
        team: Situation,
    ) -> FloatArray | None:
        """Return where a vehicle goes next, (2,); None when nothing is left for it."""
        survey, space, here = self._survey, self._space(team), poses[name][:2]
        if survey is None:
            raise ValueError("the survey has not begun")
        for _ in range(MOST_BARRED):
            end = survey.next_leg(name, poses[name], flying, coverage, poses, leg_m, team.constraints.max_step_m)
            if end is None:
                return None
            corner = space.corner(here, space.nearest(end), STILL_M)
            if np.hypot(*(corner - here)) > STILL_M:
                return corner
            # It would stay where it is for ever: it gets another line.
            survey.skip_line(name, here)
        return None

    def put_back(self, vehicle: str, ends_m: FloatArray, resume_at_m: FloatArray | None) -> None:
        """See :meth:`app.exploration.planner.base.PlannerBase.put_back`; lines are found anew in what is left."""
        if self._survey is not None:
            self._survey.put_back(vehicle, ends_m, keeps_line=resume_at_m is None)

    def skip_line(self, vehicle: str, begin_m: FloatArray, here_m: FloatArray) -> bool:
        """See :meth:`app.exploration.planner.base.PlannerBase.skip_line`."""
        return self._survey is not None and self._survey.skip_line(vehicle, here_m)

    def _begin(self, team: Situation, task: SwathTask) -> SwathSurvey:
        if self._survey is None:
            altitude_m = max(GUESSED_ALTITUDE_M, team.constraints.min_altitude_m)
            guess_m = float(np.median(list(self._cruise.values()))) + altitude_m
            heading_deg = self.options.line_heading_deg
            self._survey = SwathSurvey(
                direction_of_lines_rad(team.constraints.area, heading_deg),
                task.coverage.cell_m,
                guess_m,
                team.crosslines,
                self._space(team),
                turned=heading_deg is None,
            )
            if self._kept is not None:
                self._survey.recall(self._kept)
                self._kept = None
        return self._survey

    def _within_sight(self, team: Situation, task: SwathTask, flying: Flying) -> Coverage:
        """Return what is to be ensonified and can be from outside of keep-out zones."""
        if not team.constraints.keep_out:
            return task.coverage
        if self._barred is None or not self._barred.is_of(task.coverage):
            self._barred = BarredGround(team.constraints, task.coverage)
        if self._sighted is None or self._sighted[0] is not task.coverage or self._sighted[1] != flying:
            self._sighted = task.coverage, flying, self._barred.within_sight(task.coverage, flying)
        return self._sighted[2]

    def _flying(self, team: Situation, name: str, task: SwathTask) -> Flying:
        sonar: SwathSonar = task.sonars[name]
        radius_m = max(self.options.turn_radius_m, 0.5)
        depth_m, altitude_m = self._cruise[name], team.constraints.min_altitude_m
        if name in task.altitudes_m:
            depth_m, altitude_m = team.constraints.max_depth_m, max(task.altitudes_m[name], altitude_m)
        return Flying(sonar, depth_m, altitude_m, radius_m, task.overlap)

    def _leg_m(self, team: Situation, row: int, bottom: Bottom, flying: Flying) -> float:
        below_m: FloatArray = bottom.at(team.positions[row : row + 1, :2])
        most_m = team.constraints.max_step_m
        if not np.isfinite(below_m).all():
            return most_m
        width_m = float(flying.half_width_m(below_m)[0])
        return float(np.clip(LEG_WIDTHS * width_m, min(SHORTEST_LEG * most_m, 10.0), most_m))

    def _space(self, team: Situation) -> FreeSpace:
        if self._free is None:
            self._free = FreeSpace(team.constraints, 0.0)
        return self._free

    def _remember(self) -> dict[str, Any]:
        if self._survey is not None:
            return {"survey": self._survey.remember()}
        return {} if self._kept is None else {"survey": self._kept}

    def _recall(self, state: dict[str, Any]) -> None:
        self._kept = state.pop("survey", None)
        self._survey = None
