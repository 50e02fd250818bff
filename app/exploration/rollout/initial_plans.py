"""First plans: the team in a row sweeps what is left in parallel strips, from every corner, along both axes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.arrays import FloatArray
from app.exploration.lines.lattice import longer_axis_rad

MOST_STRIPS = 5
INSET = 0.4
"""How far from the end of what is left lines turn, in visibilities."""


@dataclass(frozen=True)
class Backbone:
    """Team waypoints (k, n_vehicles, 2) in the order of ``chain`` (n_vehicles,)."""

    at_m: FloatArray
    chain: NDArray[np.int64]


def backbones(
    left_m: FloatArray,
    here_m: FloatArray,
    area: FloatArray,
    visibility_m: float,
    com_range_m: float,
    link_m: float,
) -> list[Backbone]:
    """Return sweeps over the landmarks that are left.

    Parameters
    ----------
    left_m : (m, 2)
        Positions of the landmarks to be done, at least one.
    here_m : (n_vehicles, 2)
        Where the vehicles are.
    area : (k, 2)
        Its longer axis and the one across it are the directions of the lines.
    com_range_m, link_m : float
        Range within which vehicles are linked now, and distance of neighbours that plans keep to.
    """
    n = len(here_m)
    gap_limit = min(link_m, visibility_m)
    direction = longer_axis_rad(area)
    chains = row_orders(here_m, com_range_m)
    found: list[Backbone] = []
    for angle in (direction, direction + np.pi / 2):
        along = np.array([np.cos(angle), np.sin(angle)])
        axes = np.stack([np.array([along[1], -along[0]]), along])
        u, v = (left_m @ axes.T).T
        inset = min(INSET * visibility_m, np.ptp(v) / 2)
        ends = np.array([v.min() + inset, v.max() - inset])
        width = float(np.ptp(u))
        row = here_m @ axes[0]
        chain = min(chains, key=lambda order: float(np.abs(row[order] - np.sort(row)).sum()))
        for strips in range(1, MOST_STRIPS + 1):
            gap = min(gap_limit, width / (n * strips))
            offsets = np.empty(n)
            offsets[chain] = (np.arange(n) - (n - 1) / 2) * gap
            lines = u.min() + (np.arange(strips) + 0.5) * width / strips
            for middles in (lines, lines[::-1]) if strips > 1 else (lines,):
                for upwards in (True, False):
                    uv = np.empty((2 * strips, n, 2))
                    for k, middle in enumerate(middles):
                        way = ends if upwards == (k % 2 == 0) else ends[::-1]
                        uv[2 * k : 2 * k + 2, :, 0] = middle + offsets
                        uv[2 * k : 2 * k + 2, :, 1] = way[:, None]
                    found.append(Backbone(uv @ axes, chain))
            if strips * n * gap_limit > 2 * width:
                break
    return found


def row_orders(here_m: FloatArray, com_range_m: float) -> list[NDArray[np.int64]]:
    """Return orders of the vehicles in which neighbours are in range now; the closest thing to one when none is.

    The order of vehicles that are all in range of each other is free: any sorting along a direction is offered.
    """
    n = len(here_m)
    distance = np.hypot(*(here_m[:, None] - here_m[None]).transpose(2, 0, 1))
    if (distance <= com_range_m).all():
        orders = [np.argsort(here_m @ [np.cos(a), np.sin(a)], kind="stable") for a in np.arange(0, np.pi, np.pi / 8)]
        unique = {tuple(order): order.astype(np.int64) for order in orders}
        return [chain for order in unique.values() for chain in (order, order[::-1].copy())]
    best: list[int] = []
    cost = np.inf
    for first in range(n):
        order = [first]
        while len(order) < n:
            rest = [k for k in range(n) if k not in order]
            order.append(min(rest, key=lambda k: float(distance[order[-1], k])))
        links = distance[order[:-1], order[1:]]
        total = float(np.maximum(0.0, links - com_range_m).sum() * 1e3 + links.sum())
        if total < cost:
            best, cost = order, total
    chain = np.array(best, dtype=np.int64)
    return [chain, chain[::-1].copy()]


def with_team(plan: Backbone, before: tuple[str, ...], now: tuple[str, ...]) -> Backbone | None:
    """Return a plan for a team that has changed: those left close up, newcomers lengthen the row; None without any.

    Parameters
    ----------
    plan : Backbone
        For the vehicles ``before``, in that order.
    now : tuple of str
        The vehicles from now on.
    """
    row = [before[k] for k in plan.chain if before[k] in now]
    if not row or len(plan.at_m) == 0:
        return None
    columns = {name: plan.at_m[:, before.index(name)] for name in row}
    for name in now:
        if name not in columns:
            end, inner = columns[row[-1]], columns[row[-2 if len(row) > 1 else -1]]
            columns[name] = 2 * end - inner
            row.append(name)
    at = np.stack([columns[name] for name in now], axis=1)
    return Backbone(at, np.array([now.index(name) for name in row], dtype=np.int64))
