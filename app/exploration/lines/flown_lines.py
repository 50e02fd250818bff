"""Lines as vehicles fly them: which legs make one, and what is left of a route after the line that is flown."""

from itertools import pairwise

import numpy as np

from app.arrays import FloatArray

STRAIGHT_RAD = np.deg2rad(25.0)
"""Legs are of one line where neither the next nor the whole line turns by more: lines along a slope bend a little."""

HOP = 0.5
"""A stretch shorter than this part of the next one leads from a line to the next."""

SAME_M = 1e-6


def flown_lines(ends_m: FloatArray) -> list[FloatArray]:
    """Return the straight parts of a way, each (k, 2) with its begin first, in the order in which they were flown.

    Parameters
    ----------
    ends_m : (n, 2)
        Where the legs ended, the first one's begin not among them.
    """
    lines: list[list[FloatArray]] = []
    for begin, end in pairwise(ends_m):
        if np.hypot(*(end - begin)) <= SAME_M:
            continue
        line = lines[-1] if lines else None
        if (
            line is not None
            and _straight(line[-1] - line[-2], end - begin)
            and _straight(line[-1] - line[0], end - begin)
        ):
            line.append(end)
        else:
            lines.append([begin, end])
    return [np.array(line) for line in lines]


def line_now(lines: list[FloatArray]) -> FloatArray | None:
    """Return the line that is flown, or was last where the newest part only leads to the next; None where none is."""
    if not lines:
        return None
    if len(lines) > 1 and length_m(lines[-1]) < HOP * length_m(lines[-2]) and len(lines[-1]) == 2:
        return lines[-2]
    return lines[-1]


def line_near(lines: list[FloatArray], place_m: FloatArray) -> FloatArray | None:
    """Return the line that passes a place (2,) closest, the newest of equals; None where there is none."""
    return min(reversed(lines), key=lambda line: _distance_m(line, place_m), default=None)


def after_line(begin_m: FloatArray, here_m: FloatArray, route: FloatArray) -> FloatArray | None:
    """Return what is left of a route (k, 2) without the line that is flown now; None where there is no line.

    Parameters
    ----------
    begin_m, here_m : (2,)
        Where the line began, and where its vehicle is. Where the way only leads to a line, that one is left out.
    """
    route = route[int(np.argmax(np.append(np.hypot(*(route - here_m).T) > SAME_M, True))) :]
    if not len(route):
        return None
    last = _last_straight(here_m, route, 0)
    if last + 1 < len(route):
        ahead = _last_straight(route[last], route, last + 1)
        leads = np.hypot(*(route[last] - begin_m)) < HOP * np.hypot(*(route[ahead] - route[last]))
        last = ahead if leads else last
    return route[last + 1 :]


def length_m(way: FloatArray) -> float:
    """Return how long a way (k, 2) is."""
    return float(np.hypot(*np.diff(way, axis=0).T).sum()) if len(way) > 1 else 0.0


def _last_straight(here_m: FloatArray, route: FloatArray, first: int) -> int:
    course = route[first] - here_m
    last = first
    while last + 1 < len(route) and _straight(course, route[last + 1] - route[last]):
        last += 1
    return last


def _straight(a: FloatArray, b: FloatArray) -> bool:
    turn = abs(float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)))
    return bool(turn <= STRAIGHT_RAD)


def _distance_m(line: FloatArray, place_m: FloatArray) -> float:
    begins, along = line[:-1], np.diff(line, axis=0)
    part = np.einsum("ij,ij->i", place_m - begins, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-12)
    nearest = begins + np.clip(part, 0.0, 1.0)[:, None] * along
    return float(np.hypot(*(nearest - place_m).T).min())
