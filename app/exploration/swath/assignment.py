"""What the vehicles of a swath survey are at: their shares, their lines, and what they were sent along."""

from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from app.arrays import BoolArray, FloatArray
from app.exploration.core.coverage import Coverage
from app.exploration.swath.raster import Flying
from app.exploration.swath.tries import packed, unpacked


@dataclass
class Strip:
    """What a vehicle sweeps: between two places across the lines, towards ``sign`` (1 or -1)."""

    low_m: float
    high_m: float
    sign: int


@dataclass
class FlownLine:
    """A line as it is flown: what is left of it, (k, 2) east and north, and how it was found."""

    direction_rad: float
    sign: int
    path: FloatArray
    overlap: float
    begun: bool = False
    sent_from: tuple[float, float] | None = None
    """Where the vehicle was when it was sent to the beginning of a line that is begun; None: it came there."""


@dataclass(frozen=True)
class Piece:
    """A piece of a line that a vehicle was sent along.

    Attributes
    ----------
    path : (k, 2)
        East and north.
    open_m : (n, 2)
        Places across its end that nobody had seen when it was sent.
    """

    path: FloatArray
    open_m: FloatArray


@dataclass
class Assignment:
    """What one vehicle is at, and the pieces of lines that it was sent along and may not have flown yet."""

    share: Strip | None = None
    course: FlownLine | None = None
    expected: list[Piece] = field(default_factory=list)
    refused: int = 0
    """How often in a row it was not sent where it was to go."""
    laid_on: Coverage | None = None
    """What its line was laid by last."""
    skipped: FloatArray | None = None
    """A line (k, 2) that its operator wants left out, until that is noted."""
    hidden: BoolArray | None = None
    """Cells (rows, cols) that its line leaves alone, since two lines before did not see them."""
    counted: BoolArray | None = None
    """Cells (rows, cols) that its line was begun for, which is a try of them; None: it has begun none."""
    idle: bool = False
    """Whether there was nothing for it when it was last asked for."""

    def remember(self) -> dict[str, Any]:
        """Return what has to outlive the program, for ``recalled``."""
        course = self.course
        return {
            "share": None if self.share is None else asdict(self.share),
            "course": None if course is None else asdict(replace(course, path=course.path.tolist())),
            "expected": [piece.path.tolist() for piece in self.expected],
            "ends": [piece.open_m.tolist() for piece in self.expected],
            "refused": self.refused,
            "skipped": None if self.skipped is None else self.skipped.tolist(),
            "hidden": None if self.hidden is None else packed(self.hidden.astype(np.int64)),
            "counted": None if self.counted is None else packed(self.counted.astype(np.int64)),
        }


def recalled(kept: dict[str, Any]) -> Assignment:
    """Return what was remembered. Raises KeyError, TypeError or ValueError when it is not that."""
    course, skipped, hidden, counted = kept["course"], kept.get("skipped"), kept.get("hidden"), kept.get("counted")
    return Assignment(
        None if kept["share"] is None else Strip(**kept["share"]),
        None
        if course is None
        else FlownLine(
            float(course["direction_rad"]),
            int(course["sign"]),
            _path(course["path"]),
            float(course["overlap"]),
            bool(course["begun"]),
            _place(course.get("sent_from")),
        ),
        _pieces(kept["expected"], kept.get("ends", [])),
        int(kept.get("refused", 0)),
        skipped=None if skipped is None else _path(skipped),
        hidden=None if hidden is None else unpacked(hidden) > 0,
        counted=None if counted is None else unpacked(counted) > 0,
    )


def _place(kept: Any) -> tuple[float, float] | None:
    return None if kept is None else (float(kept[0]), float(kept[1]))


@dataclass(frozen=True)
class Question:
    """A vehicle that asks where to go.

    Attributes
    ----------
    vehicle
    pose : (3,)
        East, north, heading; NaN for a heading that is not known.
    flying
    coverage
        What is left to see.
    team
        The poses of all vehicles that survey, by name.
    """

    vehicle: str
    pose: FloatArray
    flying: Flying
    coverage: Coverage
    team: dict[str, FloatArray]


def _path(values: Any) -> FloatArray:
    return np.array(values, dtype=np.float64).reshape(-1, 2)


def _pieces(paths: list[Any], ends: list[Any]) -> list[Piece]:
    """Return pieces as they were remembered; earlier versions noted nothing of their ends."""
    places = [*ends, *([[]] * (len(paths) - len(ends)))]
    return [Piece(_path(path), _path(end)) for path, end in zip(paths, places, strict=True)]
