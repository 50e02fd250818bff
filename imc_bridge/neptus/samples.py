"""Which vehicle each of the panel's samples belongs to, and which of them are depths.

The panel makes a sample of every range that any system reports, also of an echo sounder that looks ahead, and takes
whatever it does not know for a beam 22.5 degrees ahead. It says neither which vehicle nor which sensor a sample is of.
What the vehicles themselves say of the bottom under them (`Bathymeter`) is right, so samples are held against that.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from imc_bridge.neptus.values import Bottom, CellPosition, CellSounding

FloatArray = NDArray[np.float64]

REACH_M = 60.0
"""Farther than this from every place whose bottom is known, a sample cannot be judged."""
SLOPE = 0.3
"""Of the sea floor between a sample and the place that it is held against."""
MOST_M = 6.0
"""So much of that at most, or far from a vehicle an echo sounder's range would pass for a depth."""
SURE = 3.0
"""So many standard deviations of the `Bathymeter` a sample may be off."""
WHOLE_METRE_M = 0.5
"""How far a depth that was cut to whole metres may be off."""
DEPTH_NOISE_M = 0.25
"""How much a vehicle's depth changes from one of its samples to the next."""
NEWEST = 0.3
"""Weight of a sample in what is known of its vehicle's place."""
METRES_PER_METRE = 40.0
"""So far beside a vehicle a sample is as little likely to be the vehicle's as 1 m above or below it."""
BESIDE_M = 10.0
"""As near to a vehicle as this its samples are compared with its own altitude."""
ASSUMED_SLANT = math.cos(math.radians(22.5))
"""What the panel multiplies every range by whose sensor it does not know."""
SLANT_TOLERANCE = 0.03


def owners(samples: Sequence[CellSounding], now: Sequence[CellPosition], cell_m: float) -> list[int]:
    """Return the index of each sample's vehicle: from one to the next a vehicle moves and dives little.

    Samples come in the order in which they were taken, so they are followed back from where the vehicles are now.

    Parameters
    ----------
    now
        Where the vehicles are, their depths cut to whole metres.
    """
    tracks = [[place.row, place.col, place.depth_m, WHOLE_METRE_M + DEPTH_NOISE_M] for place in now]
    found: list[int] = []
    for sample in reversed(samples):
        costs = [
            math.hypot(row - sample.row, col - sample.col) * cell_m
            + METRES_PER_METRE * max(abs(depth_m - sample.vehicle_depth_m) - unsure_m, 0.0)
            for row, col, depth_m, unsure_m in tracks
        ]
        nearest = costs.index(min(costs))
        row, col, *_ = tracks[nearest]
        # Beams lie all round the vehicle.
        tracks[nearest] = [
            row + NEWEST * (sample.row - row),
            col + NEWEST * (sample.col - col),
            sample.vehicle_depth_m,
            DEPTH_NOISE_M,
        ]
        found.append(nearest)
    return found[::-1]


def exact_depths(places: Sequence[CellPosition], samples: Sequence[CellSounding]) -> list[tuple[CellPosition, bool]]:
    """Return the places with the vehicles' depths as their newest samples have them, and whether they have one.

    The panel cuts the depth of a place to whole metres, not that of a sample.
    """
    newest = {sample.vehicle: sample.vehicle_depth_m for sample in samples}
    found = []
    for index, place in enumerate(places):
        depth_m = newest.get(index)
        known = depth_m is not None and abs(depth_m - place.depth_m) <= WHOLE_METRE_M + 0.1
        found.append((replace(place, depth_m=depth_m) if known and depth_m is not None else place, known))
    return found


def checked(
    samples: Sequence[CellSounding], bottoms: Sequence[Bottom | None], cell_m: float, refused: Counter[str]
) -> list[CellSounding]:
    """Return the samples that agree with the nearest known bottom; the others are counted in ``refused``."""
    known = [bottom for bottom in bottoms if bottom is not None]
    if not samples:
        return []
    if not known:
        refused["without a Bathymeter that they could be held against"] += len(samples)
        return []
    where = np.array([[s.row, s.col] for s in samples]) * cell_m
    depth_m = np.array([s.bottom_depth_m for s in samples])
    away_m = np.array([np.hypot(*(where - np.array([b.row, b.col]) * cell_m).T) for b in known])
    nearest = away_m.argmin(axis=0)
    nearest_m = away_m.min(axis=0)
    expected_m = np.array([b.depth_m for b in known])[nearest]
    allowed_m = SURE * np.array([b.sd_m for b in known])[nearest] + np.minimum(SLOPE * nearest_m, MOST_M)
    far = nearest_m > REACH_M
    wrong = ~far & (np.abs(depth_m - expected_m) > allowed_m)
    if far.any():
        refused[f"more than {REACH_M:g} m from where a vehicle knows the bottom"] += int(far.sum())
    if wrong.any():
        refused[
            f"other than the Bathymeter of the nearest vehicle ({_span(depth_m[wrong])} m, where it has "
            f"{_span(expected_m[wrong])} m)"
        ] += int(wrong.sum())
    return [sample for sample, out in zip(samples, far | wrong, strict=True) if not out]


def altitude_ratios(
    samples: Sequence[CellSounding], bottoms: Sequence[Bottom | None], cell_m: float
) -> tuple[float | None, ...]:
    """Return for each vehicle how high its samples have it above the bottom, by how high it has itself.

    The median of those beside it; None where there are none.
    """
    found: list[float | None] = []
    for index, bottom in enumerate(bottoms):
        ratios = [
            (s.bottom_depth_m - s.vehicle_depth_m) / (bottom.depth_m - s.vehicle_depth_m)
            for s in (samples if bottom is not None else ())
            if bottom is not None
            and s.vehicle == index
            and bottom.depth_m > s.vehicle_depth_m
            and math.hypot(s.row - bottom.row, s.col - bottom.col) * cell_m <= BESIDE_M
        ]
        found.append(float(np.median(ratios)) if ratios else None)
    return tuple(found)


def looks_slanted(ratio: float) -> bool:
    """Tell whether samples are short as ranges straight down are that the panel took for slanted beams."""
    return abs(ratio - ASSUMED_SLANT) <= SLANT_TOLERANCE


def _span(values: FloatArray) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.1f}" if high - low < 0.05 else f"{low:.1f} to {high:.1f}"
