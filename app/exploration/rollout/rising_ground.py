"""Moves that keep their limits even where the sea floor between the landmarks is shoaler than estimated.

A vehicle that comes too close to the floor is lifted by its altimeter. What breaks a limit is the lift: the step
becomes longer than allowed, or the vehicle leaves the range of those below it.
"""

import numpy as np

from app.arrays import FloatArray
from app.exploration.core.bottom import Bottom
from app.exploration.core.constraints import TOLERANCE_M
from app.exploration.core.problem import Situation

NEAR = 0.15
"""Landmarks so close to a place tell how shoal the floor may be there, in visibilities."""

STEEPEST = 4.0
"""Steepest rise of the floor that is presumed: rise over run."""


def presumed_tops_m(team: Situation, ends_m: FloatArray, felt_m: FloatArray, visibility_m: float) -> FloatArray:
    """Return how shoal the floor may be under the ends of moves (k, n_vehicles, 2), as depths (k, n_vehicles).

    That is as shoal as the shoalest landmark close by, but no more than ``STEEPEST`` above any landmark, above what a
    vehicle has under it now, or above where altimeters felt the bottom, (m, 3). inf where nothing is known.
    """
    belief, origin = team.belief, team.positions
    known = np.isfinite(belief.depth_m) & belief.on_floor
    places = np.vstack([belief.xy_m[known], felt_m[:, :2]])
    depths = np.append(belief.depth_m[known], felt_m[:, 2])
    if not len(depths):
        return np.full(ends_m.shape[:2], np.inf)
    away = np.linalg.norm(ends_m[..., None, :] - places, axis=-1)
    shoalest = np.where(away < NEAR * visibility_m, depths, np.inf).min(axis=-1)
    beside = (depths - STEEPEST * away).max(axis=-1)
    flown = np.linalg.norm(ends_m - origin[:, :2], axis=-1)
    below = origin[:, 2] + team.constraints.lowest_m - STEEPEST * flown
    tops = np.maximum(shoalest, np.maximum(beside, below))
    felt = (felt_m[:, 2] + STEEPEST * away[..., int(known.sum()) :]).min(axis=-1, initial=np.inf)
    return np.asarray(np.minimum(tops, felt))


def excess_if_lifted(team: Situation, moves: FloatArray, tops_m: FloatArray) -> FloatArray:
    """Return by how much (k,) a step or a link of moves (k, n_vehicles, 3) is too long at worst, if any are lifted.

    Negative where room is left. A link that is too long now counts by how much longer it may become.
    """
    constraints, origin = team.constraints, team.positions
    low = moves[..., 2]
    high = np.minimum(low, tops_m - constraints.min_altitude_m)
    ahead = np.linalg.norm(moves[..., :2] - origin[:, :2], axis=-1)
    rise = np.maximum(abs(low - origin[:, 2]), abs(high - origin[:, 2]))
    worst = (np.hypot(ahead, rise) - constraints.max_step_m).max(axis=1)
    if len(origin) > 1 and np.isfinite(constraints.com_range_m):
        now = _links_m(origin[None, :, :2], origin[None, :, 2], origin[None, :, 2])
        links = _links_m(moves[..., :2], low, high)
        worst = np.maximum(worst, (links - np.maximum(constraints.com_range_m, now)).max(axis=1))
    return np.asarray(worst)


def safest(
    team: Situation, bottom: Bottom, wishes: FloatArray, felt_m: FloatArray, visibility_m: float
) -> tuple[FloatArray, int] | None:
    """Return the first wish that keeps all limits even if vehicles are lifted, else the one that breaks them least.

    Each of the wishes (k, n_vehicles, 3) is tried as it is, and as high as presumed tops of the floor ask for. Returns
    the move (n_vehicles, 3) and the number of the wish; None where no wish is feasible over the floor as estimated.
    """
    tops = presumed_tops_m(team, wishes[..., :2], felt_m, visibility_m)
    tries = np.stack([wishes, _raised(team, wishes, tops)], axis=1).reshape(-1, *wishes.shape[1:])
    feasible = np.flatnonzero(team.constraints.feasible(team.positions, tries, bottom))
    if not len(feasible):
        return None
    worst = excess_if_lifted(team, tries[feasible], np.repeat(tops, 2, axis=0)[feasible])
    best = int(feasible[np.argmin(np.maximum(worst, TOLERANCE_M))])
    return tries[best], best // 2


def _raised(team: Situation, wishes: FloatArray, tops_m: FloatArray) -> FloatArray:
    """Return the wishes as high as presumed tops of the floor ask for, and as the step lets the vehicles come."""
    constraints, origin = team.constraints, team.positions
    ahead = np.linalg.norm(wishes[..., :2] - origin[:, :2], axis=-1)
    reach = constraints.max_step_m * (1.0 - 1e-9)
    highest = origin[:, 2] - np.sqrt(np.maximum(0.0, reach**2 - ahead**2))
    safe = np.maximum(highest, tops_m - constraints.min_altitude_m)
    raised = wishes.copy()
    raised[..., 2] = np.maximum(np.minimum(wishes[..., 2], safe), constraints.min_depth_m)
    return raised


def _links_m(en_m: FloatArray, low_m: FloatArray, high_m: FloatArray) -> FloatArray:
    """Return how far (k, n_vehicles) each vehicle is at most from its closest one, depths lying between two bounds."""
    apart = np.linalg.norm(en_m[:, :, None] - en_m[:, None], axis=-1)
    above = np.maximum(low_m[:, :, None] - high_m[:, None], low_m[:, None] - high_m[:, :, None])
    to_others = np.hypot(apart, above) + np.where(np.eye(apart.shape[1], dtype=np.bool_), np.inf, 0.0)
    return np.asarray(to_others.min(axis=2))
