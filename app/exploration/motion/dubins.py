"""Shortest ways of a vehicle that goes forward and turns no tighter than a circle (Dubins 1957).

A pose is (east, north, heading), metres and radians clockwise from north. A shortest way is one of six words: an arc,
a straight line or an opposite arc, and an arc. Lengths of all six follow Shkel and Lumelsky (2001), section 2, for the
goal seen from the start and in radii.
"""

from typing import NamedTuple

import numpy as np

from app.arrays import FloatArray

WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")
TURN = {"L": -1.0, "S": 0.0, "R": 1.0}
"""How the heading changes along each kind of piece, radians a radius."""
TWO_PI = 2.0 * np.pi


class Way(NamedTuple):
    """A shortest way.

    Attributes
    ----------
    word : str
        One of ``WORDS``.
    pieces_m : (3,)
        Lengths of its pieces.
    """

    word: str
    pieces_m: FloatArray

    @property
    def length_m(self) -> float:
        """Length of the whole way."""
        return float(self.pieces_m.sum())


def lengths_m(start: FloatArray, goal: FloatArray, radius_m: float) -> FloatArray:
    """Return the lengths (...) of the shortest ways from poses ``start`` (..., 3) to ``goal`` (..., 3)."""
    pieces = _pieces(np.asarray(start, dtype=np.float64), np.asarray(goal, dtype=np.float64), radius_m)
    return np.asarray(radius_m * pieces.sum(axis=-1).min(axis=-1))


def shortest_way(start: FloatArray, goal: FloatArray, radius_m: float) -> Way:
    """Return the shortest way from pose ``start`` (3,) to ``goal`` (3,)."""
    pieces = _pieces(np.asarray(start, dtype=np.float64), np.asarray(goal, dtype=np.float64), radius_m)
    best = int(np.argmin(pieces.sum(axis=-1)))
    return Way(WORDS[best], radius_m * pieces[best])


def poses_along(start: FloatArray, way: Way, radius_m: float, at_m: FloatArray) -> FloatArray:
    """Return the poses (n, 3) after ``at_m`` (n,) metres of a way that begins at pose ``start`` (3,)."""
    begins = np.concatenate([[0.0], np.cumsum(way.pieces_m)])
    poses = np.empty((len(at_m), 3))
    here = np.asarray(start, dtype=np.float64)
    for k, kind in enumerate(way.word):
        of_piece = at_m >= begins[k]
        along = np.minimum(at_m[of_piece] - begins[k], way.pieces_m[k])
        poses[of_piece] = _advance(here, TURN[kind] / radius_m, along)
        here = _advance(here, TURN[kind] / radius_m, way.pieces_m[k : k + 1])[0]
    return poses


def _advance(pose: FloatArray, curvature: float, along_m: FloatArray) -> FloatArray:
    """Return the poses (n, 3) after ``along_m`` (n,) metres of a circle (1 / m, positive to starboard) or a line."""
    east, north, heading = pose
    headings = heading + curvature * along_m
    if curvature == 0.0:
        return np.column_stack([east + along_m * np.sin(heading), north + along_m * np.cos(heading), headings])
    return np.column_stack(
        [
            east + (np.cos(heading) - np.cos(headings)) / curvature,
            north + (np.sin(headings) - np.sin(heading)) / curvature,
            headings,
        ]
    )


def _pieces(start: FloatArray, goal: FloatArray, radius_m: float) -> FloatArray:
    """Return the lengths (..., 6, 3) in radii of the words' pieces, inf where a word does not lead there."""
    away = goal[..., :2] - start[..., :2]
    distance = np.hypot(away[..., 0], away[..., 1]) / radius_m
    bearing = np.arctan2(away[..., 0], away[..., 1])
    # As in the paper angles are counter-clockwise, from the line that joins both places.
    a, b = bearing - start[..., 2], bearing - goal[..., 2]
    sin_a, cos_a, sin_b, cos_b = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
    cos_ab = np.cos(a - b)
    words = []
    with np.errstate(invalid="ignore"):
        straight = np.sqrt(_reached(2.0 + distance**2 - 2.0 * cos_ab + 2.0 * distance * (sin_a - sin_b)))
        turn = np.arctan2(cos_b - cos_a, distance + sin_a - sin_b)
        words.append((turn - a, straight, b - turn))
        straight = np.sqrt(_reached(2.0 + distance**2 - 2.0 * cos_ab + 2.0 * distance * (sin_b - sin_a)))
        turn = np.arctan2(cos_a - cos_b, distance - sin_a + sin_b)
        words.append((a - turn, straight, turn - b))
        straight = np.sqrt(_reached(distance**2 - 2.0 + 2.0 * cos_ab + 2.0 * distance * (sin_a + sin_b)))
        turn = np.arctan2(-cos_a - cos_b, distance + sin_a + sin_b) - np.arctan2(-2.0, straight)
        words.append((turn - a, straight, turn - b))
        straight = np.sqrt(_reached(distance**2 - 2.0 + 2.0 * cos_ab - 2.0 * distance * (sin_a + sin_b)))
        turn = np.arctan2(cos_a + cos_b, distance - sin_a - sin_b) - np.arctan2(2.0, straight)
        words.append((a - turn, straight, b - turn))
        cosine = (6.0 - distance**2 + 2.0 * cos_ab + 2.0 * distance * (sin_a - sin_b)) / 8.0
        middle = TWO_PI - np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
        turn = a - np.arctan2(cos_a - cos_b, distance - sin_a + sin_b) + 0.5 * middle
        words.append((turn, middle, a - b - turn + middle))
        cosine = (6.0 - distance**2 + 2.0 * cos_ab + 2.0 * distance * (sin_b - sin_a)) / 8.0
        middle = TWO_PI - np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
        turn = -a + np.arctan2(-cos_a + cos_b, distance + sin_a - sin_b) + 0.5 * middle
        words.append((turn, middle, b - a - turn + middle))
    pieces = np.stack([np.stack(np.broadcast_arrays(*word), axis=-1) for word in words], axis=-2)
    pieces[..., [0, 2]] = _turned(pieces[..., [0, 2]])
    return np.where(np.isfinite(pieces).all(axis=-1, keepdims=True), pieces, np.inf)


def _reached(squared: FloatArray) -> FloatArray:
    """Return squared lengths, NaN where negative by more than rounding."""
    return np.where(squared >= 0.0, squared, np.where(squared > -1e-9, 0.0, np.nan))


def _turned(angle: FloatArray) -> FloatArray:
    """Return angles within one turn; a full turn less than rounding is none."""
    turned = np.mod(angle, TWO_PI)
    return np.where(turned > TWO_PI - 1e-9, 0.0, turned)
