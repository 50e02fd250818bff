"""One task flown once over one unseen floor, and what is kept of it."""

from dataclasses import dataclass, field

import numpy as np

from app.arrays import BoolArray, FloatArray

DECIMALS = 3
MOST_POINTS = 160
"""Points that are kept of a vehicle's track, for pictures."""


@dataclass(frozen=True)
class Trial:
    """What came of it.

    Attributes
    ----------
    ours, yardstick : float
        The figure that is compared, less being better, and the yardstick's: flown on the same floor, or what is asked.
    kept : bool
        Whether the floor is within what the project asks of itself.
    facts : dict
        Further figures by name.
    tracks : list of (n, 2) lists
        Where the vehicles were, in the picture's frame.
    missed : (k, 2) list
        Places that were left.
    """

    ours: float
    yardstick: float
    kept: bool
    facts: dict[str, float] = field(default_factory=dict)
    tracks: list[list[list[float]]] = field(default_factory=list)
    missed: list[list[float]] = field(default_factory=list)


class Recorder:
    """Keeps where vehicles were, and at last which landmarks were left, of a run in the cube."""

    def __init__(self) -> None:
        self._places: list[FloatArray] = []
        self._left = np.zeros((0, 2))

    def __call__(self, positions: FloatArray, accurate: BoolArray, landmarks: FloatArray) -> None:
        """Take in a step."""
        self._places.append(positions[:, :2].copy())
        self._left = landmarks[~accurate, :2]

    def tracks(self, half: FloatArray) -> list[list[list[float]]]:
        """Return the tracks, of a floor of half the size (2,) in the cube, as parts of its extent."""
        return thinned(np.stack(self._places, axis=1) / (2.0 * half) + 0.5) if self._places else []

    def missed(self, half: FloatArray) -> list[list[float]]:
        """Return what was left, likewise."""
        return rounded(self._left / (2.0 * half) + 0.5)


def thinned(tracks: FloatArray) -> list[list[list[float]]]:
    """Return tracks (n_vehicles, k, 2) as lists of at most ``MOST_POINTS`` points, their ends among them."""
    k = tracks.shape[1]
    chosen = np.unique(np.linspace(0, k - 1, min(k, MOST_POINTS)).astype(int))
    return [rounded(track[chosen]) for track in tracks]


def rounded(points: FloatArray) -> list[list[float]]:
    """Return points (k, 2) as short numbers."""
    return [[round(float(x), DECIMALS) for x in point] for point in points]
