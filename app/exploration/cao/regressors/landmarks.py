"""Predictions for sensors that see landmarks from afar, from the current estimates (method of AURO15, map regressors).

phi = (expected progress of landmarks in sight towards accuracy, expected newly accurate ones, minus the sum over the
vehicles of the distance to the closest open landmark, in steps). Unseen landmarks are taken to be as deep as the
closest seen one. While nothing is gained each vehicle heads for the open landmark that is closest to it; under a
communication limit the whole team for one common landmark, because vehicles that pull towards different ones would
hold each other back for ever. Each goes there round keep-out zones, and so high that it comes over what lies between:
of small changes none leads out from behind a wall. Landmarks that are not seen where they are estimated are set aside
while there are others.
"""

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from app.arrays import FloatArray, IntArray
from app.estimation import RangeSensor, Sensor
from app.exploration.cao.regressors.landmark_predictions import Listed, predict, within_reach
from app.exploration.cao.regressors.missed import MissedLandmarks
from app.exploration.cao.regressors.moves import team_moves
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import Constraints
from app.exploration.core.free_space import FreeSpace
from app.exploration.core.information_need import Lacking, lacking
from app.exploration.core.problem import Situation
from app.exploration.planner.measured import MeasuredObjective
from app.exploration.planner.options import PlannerOptions

PATIENCE = 3
"""Steps without a new accurate landmark after which vehicles head for landmarks as such."""

AGAIN = 30
"""Steps without a new accurate landmark after which those that were set aside are looked for again."""

THERE_STEPS = 1.5
"""A vehicle this close to where a landmark is estimated, in steps over ground, has come to it."""

SAME_OF_STEP = 1e-3
"""A corner of a way this close, in steps, is passed."""


class LandmarkRegressors:
    """Regressors of sensors that see landmarks from afar, from the current estimates of the landmarks.

    The module's text tells what is expected of the open ones, and which one the team heads for.
    """

    def __init__(self, options: PlannerOptions, sensor: Sensor) -> None:
        if not isinstance(sensor, RangeSensor):
            raise ValueError(f"sensor: landmark regressors need a RangeSensor, not {type(sensor).__name__}")
        self._options = options
        self._sensor = sensor
        self._measured = MeasuredObjective(sensor, options)
        self._accurate = 0
        self._idle = 0
        self._missed = MissedLandmarks()
        self._space: tuple[Constraints, FreeSpace] | None = None

    def begin(self, team: Situation, bottom: Bottom, seed: int) -> FloatArray:
        """See :class:`app.exploration.cao.planner.Regressors`."""
        self._team, self._seed = team, seed
        belief = team.belief
        depth = belief.depth_m.copy()
        known = np.isfinite(depth)
        if known.any() and not known.all():
            _, nearest = cKDTree(belief.xy_m[known], balanced_tree=False, compact_nodes=False).query(
                belief.xy_m[~known]
            )
            depth[~known] = depth[known][nearest]
        elif not known.any():
            depth[:] = team.positions[:, 2].max() + self._sensor.visibility_m / 2
        points = np.column_stack([belief.xy_m, depth])
        self._missed.update(belief, points, team.positions, self._sensor.visibility_m)
        left = self._promising(lacking(belief, self._options.accuracy_sd_m))
        self._points = np.ascontiguousarray(points[left.row])
        self._needed = left.need
        self._direction = None if belief.covariance_m2 is None else left.direction
        J = self._measured.update(team)
        gained = int(belief.accurate.sum()) > self._accurate
        self._accurate = int(belief.accurate.sum())
        self._idle = 0 if gained else self._idle + 1
        self._goals: FloatArray | None = None
        if self._idle >= PATIENCE and len(self._points):
            self._goals = self._ways_to(self._goal_points(left.row), bottom)
        return J

    def _promising(self, left: Lacking) -> Lacking:
        """Return the tasks without those of landmarks that are set aside; all of them where nothing else is left."""
        if self._idle and self._idle % AGAIN == 0:
            self._missed.forget()
        wanted = ~self._missed.set_aside[left.row]
        if not wanted.any():
            self._missed.forget()
            return left
        return Lacking(left.row[wanted], left.direction[wanted], left.need[wanted])

    def _goal_points(self, rows: IntArray) -> FloatArray:
        """Return where the landmark is estimated that each vehicle heads for, (n_vehicles, 3).

        ``rows`` (k,) are the landmarks of ``self._points``.
        """
        team = self._team
        squared = ((self._points[None, :, :2] - team.positions[:, None, :2]) ** 2).sum(axis=2)
        goals = squared.argmin(axis=1)
        if np.isfinite(team.constraints.com_range_m):
            goals[:] = squared.min(axis=0).argmin()
        away = np.sqrt(squared[np.arange(len(goals)), goals])
        self._missed.count(np.unique(rows[goals[away < THERE_STEPS * team.constraints.max_step_m]]))
        return np.asarray(self._points[goals])

    def _ways_to(self, goals: FloatArray, bottom: Bottom) -> FloatArray:
        """Return where each vehicle heads (n_vehicles, 3) to come to its landmark (n_vehicles, 3)."""
        team = self._team
        ends = goals.copy()
        if team.constraints.keep_out:
            space = self._free(team.constraints)
            same, here = SAME_OF_STEP * team.constraints.max_step_m, team.positions[:, :2]
            ends[:, :2] = [space.corner(a, space.nearest(b), same) for a, b in zip(here, goals[:, :2], strict=True)]
        away = np.hypot(*(ends - team.positions)[:, :2].T).max()
        along = np.linspace(0.0, 1.0, 2 + int(2.0 * away / bottom.cell_m))[:, None, None]
        ways = team.positions[:, :2] + along * (ends - team.positions)[:, :2]
        highest = np.fmin.reduce(bottom.at(ways), axis=0, initial=np.inf) - team.constraints.min_altitude_m
        ends[:, 2] = np.maximum(np.minimum(ends[:, 2], highest), team.constraints.min_depth_m)
        return ends

    def _free(self, constraints: Constraints) -> FreeSpace:
        if self._space is None or self._space[0] is not constraints:
            self._space = constraints, FreeSpace(constraints, 0.0)
        return self._space[1]

    def prior(self, team: Situation) -> tuple[FloatArray, float]:
        """Progress and completed landmarks count alike; the pull of far ones is gentle."""
        return np.array([1.0, 1.0, 1.0]), 20.0

    def trusted(self, theta: FloatArray) -> FloatArray:
        """No prediction counts against what it predicts, and none is switched off altogether."""
        return np.maximum(theta, 0.2)

    def candidates(self, alpha: float) -> FloatArray:
        """Whole steps, the team's common heading mixed with each vehicle's own, and random moves of size alpha."""
        team, step = self._team, self._team.constraints.max_step_m * (1 - 1e-9)
        n = self._options.candidates * len(team.vehicles)
        return team.positions + team_moves(self._seed, team.vehicles, n, 3, step, alpha)

    def regressors(self, candidates: FloatArray) -> FloatArray:
        """Return phi of each candidate, (c, 3): progress and newly accurate ones in sight, nearness of open ones."""
        if len(self._points) == 0:
            return np.zeros((len(candidates), 3))
        configurations = np.ascontiguousarray(candidates)
        reach = np.linalg.norm(configurations - self._team.positions, axis=2).max(axis=0, initial=0.0)
        starts, index = within_reach(self._team.positions, self._points, reach, self._sensor.visibility_m)
        direction = None if self._direction is None else self._direction[index]
        return predict(
            self._team.positions,
            configurations,
            Listed(self._points[index], index, starts, self._needed, direction),
            self._goals,
            self._sensor.visibility_m,
            self._sensor.relative_noise,
            self._team.constraints.max_step_m,
        )

    def chosen(self, positions: FloatArray) -> None:
        """Nothing to keep."""

    def remember(self) -> dict[str, Any]:
        """Return the memory."""
        return {
            "measured": self._measured.remember(),
            "accurate": self._accurate,
            "idle": self._idle,
            "missed": self._missed.remember(),
        }

    def recall(self, state: dict[str, Any]) -> None:
        """Take up what :meth:`remember` returned."""
        self._measured.recall(state["measured"])
        self._accurate, self._idle = int(state["accurate"]), int(state["idle"])
        if "missed" in state:  # not in missions of older versions
            self._missed.recall(state["missed"])
