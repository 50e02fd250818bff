"""Beams that did not meet the bottom are told from those that did."""

import numpy as np

from app.mapping.swath.pings import Pings
from app.mapping.swath.spikes import spikes

ANGLES = np.radians(np.linspace(-60.0, 60.0, 121)).astype(np.float32)


def pings(down_m: np.ndarray) -> Pings:
    n = len(down_m)
    nothing = np.zeros(n)
    angles = np.tile(ANGLES, (n, 1))
    ranges = (down_m / np.cos(angles)).astype(np.float32)
    return Pings(nothing, nothing, nothing, nothing, nothing, nothing, nothing, nothing, angles, ranges)


def test_a_slope_and_a_step_stay() -> None:
    slope = np.tile(np.linspace(8.0, 20.0, 121), (3, 1))
    step = np.where(np.arange(121) < 60, 10.0, 14.0)[None].repeat(3, axis=0)
    assert not spikes(pings(slope)).any()
    assert not spikes(pings(step)).any()


def test_single_beams_far_off_are_spikes() -> None:
    down = np.full((2, 121), 12.0)
    down[0, 30], down[1, 90], down[1, 0] = 3.0, 24.0, 5.0
    found = spikes(pings(down))
    assert found.sum() == 3
    assert found[0, 30]
    assert found[1, 90]
    assert found[1, 0]


def test_what_was_not_detected_is_none_and_hides_none() -> None:
    down = np.full((1, 121), 12.0)
    down[0, 40:80] = np.nan
    down[0, 85] = 2.0
    found = spikes(pings(down))
    assert found.sum() == 1
    assert found[0, 85]
    assert not spikes(pings(np.full((1, 121), np.nan))).any()
