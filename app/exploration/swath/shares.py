"""Who sweeps what: blocks of an area, parts of what another has left, and the lines that are nearest to whom."""

from collections.abc import Mapping

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.exploration.swath.assignment import Assignment, Question, Strip
from app.exploration.swath.entries import path_m
from app.exploration.swath.lines import ALMOST, needed_lines
from app.exploration.swath.passes import BUSY
from app.exploration.swath.raster import Flying, LineRaster

WORTH_HELPING = 1.2
"""What another has left is shared where it is more than so many lines of it."""

DETOUR = 1.5
"""A line is left to another vehicle where the way there is longer than so many times the other's detour, and ``BUSY``
of what the other has still to fly of its own line."""

BEYOND_M = 1e9
"""Farther across than any area."""

NEAR_M = 0.5
"""Who is so near the beginning of a line is there."""

FEW_LINES = 4.0
"""Shares are whole lines where there are fewer lines than so many for each vehicle."""


def share_out(
    sweeps: Mapping[str, Assignment], raster: LineRaster, flying: Flying, team: Mapping[str, FloatArray]
) -> None:
    """Give pairs of neighbours a block each, of as much work as they are; both begin at its sides."""
    names = sorted(team, key=lambda name: (float(raster.axes.turned(team[name][:2])[1]), name))
    work = work_m(raster, raster.open, flying).sum(axis=0)
    whole = float(needed_lines(raster, raster.open, flying).max(initial=1.0))
    for name in names:
        sweeps[name].share = None
    # There is a line for each, if not a whole one.
    names = names[: max(1, int(np.ceil(whole - ALMOST)))]
    if len(names) == 1:
        across = float(raster.axes.turned(team[names[0]][:2])[1])
        low, high = float(raster.across_m[0]), float(raster.across_m[-1])
        sweeps[names[0]].share = Strip(-BEYOND_M, BEYOND_M, 1 if across - low <= high - across else -1)
        return
    upto = np.cumsum(work) / max(float(work.sum()), 1e-9)
    parts = np.arange(len(names) + 1) / len(names)
    if whole < FEW_LINES * len(names):
        # Few lines are shared as whole ones: parts of lines at every border would be lines more.
        parts = np.round(parts * np.ceil(whole)) / np.ceil(whole)
    first = 0
    while first < len(names):
        pair = names[first : first + 2]
        low, high = (
            -BEYOND_M if k == 0 else BEYOND_M if k == len(names) else float(np.interp(parts[k], upto, raster.across_m))
            for k in (first, first + len(pair))
        )
        sweeps[pair[0]].share = Strip(low, high, 1)
        if len(pair) == 2:
            sweeps[pair[1]].share = Strip(low, high, -1)
        first += 2


def part_of_others(
    sweeps: Mapping[str, Assignment], vehicle: str, left: LineRaster, large: BoolArray, flying: Flying
) -> Strip | None:
    """Return a part of what another has left to sweep; None where nobody has much."""
    shares = {name: s.share for name, s in sweeps.items() if s.share is not None and name != vehicle}
    best: tuple[float, Strip] | None = None
    for share in shares.values():
        inside = large & between(left, share)
        work = work_m(left, inside, flying)
        lines_long = inside.any(axis=1).sum() * left.cell_m
        if work.sum() > max(WORTH_HELPING * lines_long, 1e-9) and (best is None or work.sum() > best[0]):
            best = float(work.sum()), share
    if best is None:
        # Nobody sweeps what is left: whoever comes first.
        alone = large.copy()
        for share in shares.values():
            alone &= ~between(left, share)
        return Strip(-BEYOND_M, BEYOND_M, 1) if alone.any() else None
    found = best[1]
    both = [share for share in shares.values() if (share.low_m, share.high_m) == (found.low_m, found.high_m)]
    if len(both) == 1:
        return Strip(found.low_m, found.high_m, -found.sign)
    across = work_m(left, large & between(left, found), flying).sum(axis=0)
    middle_m = float(np.interp(0.5, np.cumsum(across) / across.sum(), left.across_m))
    for share in both:
        if share.sign > 0:
            share.high_m = middle_m
        else:
            share.low_m = middle_m
    return Strip(found.low_m, middle_m, -1)


def free_at(
    sweeps: Mapping[str, Assignment], vehicle: str, team: Mapping[str, FloatArray]
) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """Return where all vehicles are next free for another line, (2,), and how far it is there for them."""
    places, busy_m = {vehicle: team[vehicle][:2]}, {vehicle: 0.0}
    for name, at in team.items():
        course = sweeps[name].course
        if name == vehicle:
            continue
        flies = course is not None and len(course.path) > 1
        places[name] = course.path[-1] if course is not None and flies else at[:2]
        busy_m[name] = path_m(np.vstack([at[:2], course.path])) if course is not None and flies else 0.0
    return places, busy_m


def better_by_another(sweeps: Mapping[str, Assignment], asked: Question, path: FloatArray, away_m: float) -> bool:
    """Return whether another vehicle had better fly a line: one that waits nearer to it, or a busy one later."""
    here = asked.pose
    for name, pose in asked.team.items():
        course = sweeps[name].course
        if name == asked.vehicle:
            continue
        if course is None:
            waits_m = min(float(np.hypot(*(end - pose[:2]))) for end in (path[0], path[-1]))
            if float(np.hypot(*(path[0] - here[:2]))) > DETOUR * waits_m + NEAR_M:
                return True
            continue
        if len(course.path) < 2:
            continue
        detour_m = min(float(np.hypot(*(end - course.path[-1]))) for end in (path[0], path[-1]))
        if away_m > DETOUR * detour_m + BUSY * path_m(np.vstack([pose[:2], course.path])):
            return True
    return False


def between(raster: LineRaster, share: Strip) -> BoolArray:
    """Return which cells (along, across) lie in a share."""
    inside = (raster.across_m >= share.low_m) & (raster.across_m <= share.high_m)
    return np.broadcast_to(inside, raster.open.shape)


def work_m(raster: LineRaster, cells: BoolArray, flying: Flying) -> FloatArray:
    """Return how long lines over cells are, metres, (along, across)."""
    return np.asarray(np.where(cells, raster.work_m(flying), 0.0))
