"""Keep-out zones drawn at random for the papers' scenario: rectangles that a team of three can always get round."""

import numpy as np

from app.arrays import FloatArray

PASSAGE = 0.35
"""Least width of every way between two zones, between a zone and the border, and around the start."""

MAX_FRACTION = 0.3
DRAWS = 4000
COUNTS = (4, 3)


def draw_keep_out(
    half: FloatArray, fraction: float, start: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, ...]:
    """Return rectangles (4, 2), axis-aligned and counter-clockwise, that together cover a fraction of the area.

    A rectangle either touches the border or leaves a passage to it, and never touches two opposite borders; so the rest
    of the area stays in one piece.

    Parameters
    ----------
    half : (2,)
        Half the extent of the area in x and y; its middle is the origin.
    fraction : float
        Part of the area to be covered, 0 to ``MAX_FRACTION``.
    start : (2, 2)
        Lower and upper corner of the region in which the vehicles start.
    rng : numpy.random.Generator
        Of places and shapes.

    Raises
    ------
    ValueError
        When the fraction is out of range, or the zones with passages between them do not fit into the area.
    """
    if fraction == 0.0:
        return ()
    if not 0.0 < fraction <= MAX_FRACTION:
        raise ValueError(f"a fraction of {fraction:g} of the area cannot be kept out; it must be 0 to {MAX_FRACTION:g}")
    for count in COUNTS:
        for _ in range(DRAWS):
            boxes = _draw(half, fraction, start, count, rng)
            if boxes is not None:
                return tuple(np.array([[w, s], [e, s], [e, n], [w, n]]) for (w, s), (e, n) in boxes)
    raise ValueError(
        f"no {COUNTS[-1]} zones with passages of {PASSAGE:g} between them cover a fraction of {fraction:g} of an area "
        f"of {2 * half[0]:g} x {2 * half[1]:g}; choose a smaller fraction"
    )


def _draw(
    half: FloatArray, fraction: float, start: FloatArray, count: int, rng: np.random.Generator
) -> FloatArray | None:
    """Return one draw of ``count`` rectangles (count, 2, 2), lower and upper corners; None when it breaks a rule."""
    share = rng.uniform(0.7, 1.3, count)
    areas = share / share.sum() * fraction * 4.0 * half.prod()
    aspect = np.exp(rng.uniform(-np.log(2.0), np.log(2.0), count))
    boxes = np.empty((0, 2, 2))
    for size in np.stack([np.sqrt(areas * aspect), np.sqrt(areas / aspect)], axis=1):
        if (size > 2.0 * half - PASSAGE).any():
            return None
        low = rng.uniform(-half, half - size)
        # What would leave less than a passage to the border touches it instead.
        low = np.where(low + half < PASSAGE, -half, low)
        low = np.where(half - low - size < PASSAGE, half - size, low)
        box = np.stack([low, low + size])
        at_both_borders = ((low + half < PASSAGE / 2) & (half - low - size < PASSAGE / 2)).any()
        too_close = _gaps(box, np.concatenate([boxes, start[None]])) < PASSAGE
        if at_both_borders or too_close.any():
            return None
        boxes = np.concatenate([boxes, box[None]])
    return boxes


def _gaps(box: FloatArray, others: FloatArray) -> FloatArray:
    """Return the distances (k,) of a rectangle (2, 2) to others (k, 2, 2)."""
    apart = np.maximum(0.0, np.maximum(others[:, 0] - box[1], box[0] - others[:, 1]))
    return np.asarray(np.hypot(apart[:, 0], apart[:, 1]))
