"""Beams that did not meet the bottom are told from those that did."""

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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


def over(roll_rad: np.ndarray, angles: np.ndarray, ranges: np.ndarray, depth_m: np.ndarray | None = None) -> Pings:
    """Pings of beams (b,) at angles from straight down in a vehicle that rolls by (n,); ranges (n, b)."""
    nothing = np.zeros(len(roll_rad))
    return Pings(
        nothing,
        nothing,
        nothing,
        nothing if depth_m is None else depth_m,
        roll_rad,
        nothing,
        nothing,
        nothing,
        np.tile(angles, (len(roll_rad), 1)).astype(np.float32),
        ranges.astype(np.float32),
    )


def ranges_of_plane(height_m: float, slope: float, aside: np.ndarray) -> np.ndarray:
    """How far beams that point so far aside of straight down go to a plane; NaN beyond 500 m."""
    toward = np.cos(aside) - slope * np.sin(aside)
    ranges = height_m / np.where(toward > 1e-3, toward, np.nan)
    return np.where(ranges < 500.0, ranges, np.nan)


def angles_of(beams: int, half_rad: float, even: bool) -> np.ndarray:
    """Beams at even angles, or that meet a level bottom at even distances."""
    if even:
        return np.linspace(-half_rad, half_rad, beams)
    return np.arctan(np.linspace(-np.tan(half_rad), np.tan(half_rad), beams))


@given(
    beams=st.integers(1, 512),
    half_deg=st.floats(5.0, 80.0),
    even=st.booleans(),
    height_m=st.floats(1.0, 100.0),
    slope_deg=st.floats(-45.0, 45.0),
    rolls_deg=st.lists(st.floats(-45.0, 45.0), min_size=1, max_size=4),
    told=st.booleans(),
    missed=st.floats(0.0, 0.9),
    seed=st.integers(0, 2**32 - 1),
)
def test_of_an_even_floor_no_beam_is_lost_whatever_the_roll_and_the_slope(
    beams: int,
    half_deg: float,
    even: bool,
    height_m: float,
    slope_deg: float,
    rolls_deg: list[float],
    told: bool,
    missed: float,
    seed: int,
) -> None:
    angles = angles_of(beams, np.radians(half_deg), even)
    roll = np.radians(rolls_deg)
    ranges = ranges_of_plane(height_m, np.tan(np.radians(slope_deg)), angles - roll[:, None])
    ranges[np.random.default_rng(seed).random(ranges.shape) < missed] = np.nan
    assert not spikes(over(roll if told else 0.0 * roll, angles, ranges)).any()


@given(
    beams=st.integers(24, 512),
    roll_deg=st.floats(-15.0, 15.0),
    slope_deg=st.floats(-20.0, 20.0),
    wide=st.integers(1, 4),
    at=st.floats(0.1, 0.9),
    share=st.floats(0.2, 0.6),
)
def test_what_one_ping_alone_met_is_a_spike_on_slopes_too(
    beams: int, roll_deg: float, slope_deg: float, wide: int, at: float, share: float
) -> None:
    angles, roll = angles_of(beams, np.radians(60.0), even=False), np.full(5, np.radians(roll_deg))
    ranges = ranges_of_plane(20.0, np.tan(np.radians(slope_deg)), angles - roll[:, None])
    first = int(at * (beams - wide - 8)) + 4
    ranges[2, first : first + wide] *= share
    found = spikes(over(roll, angles, ranges))
    expected = np.zeros_like(found)
    expected[2, first : first + wide] = True
    assert (found == expected).all()


@pytest.mark.parametrize("wide", [1, 2, 4])
@pytest.mark.parametrize("beams", [32, 64, 256])
@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_what_ping_after_ping_meets_in_the_same_place_stays(wide: int, beams: int, slope: float) -> None:
    """A rock a few beams wide, from a vehicle that rolls and heaves: other beams meet it each time."""
    angles, roll = angles_of(beams, np.radians(60.0), even=True), 0.15 * np.sin(np.arange(9))
    heave = 0.3 * np.cos(np.arange(9))
    aside = angles - roll[:, None]
    ranges = ranges_of_plane(20.0, slope, aside) * (1.0 - heave[:, None] / 20.0)
    half = 0.5 * wide * (angles[1] - angles[0])
    hit = np.abs(aside - 0.2) <= half
    hit[:3] = hit[7:] = False
    rock = np.where(hit, ranges - 5.0, ranges)
    kept = ~spikes(over(roll, angles, rock, 2.0 + heave))
    assert hit.sum() >= 3
    assert kept.all()
    alone = np.where(hit & (np.arange(9) == 4)[:, None], ranges - 5.0, ranges)
    assert (spikes(over(roll, angles, alone, 2.0 + heave)) == (alone != ranges)).all()


def test_fish_that_ping_after_ping_meets_elsewhere_are_spikes() -> None:
    rng = np.random.default_rng(0)
    down = np.full((200, 121), 15.0)
    fish = rng.random(down.shape) < 0.01
    down[fish] = rng.uniform(2.0, 10.0, int(fish.sum()))
    found = spikes(pings(down))
    assert not found[~fish].any()
    assert found[fish].mean() > 0.995


def test_double_echoes_are_spikes_though_they_stay() -> None:
    down = np.full((20, 121), 15.0)
    down[:, 59:62] = 30.0
    down[:, 20:22] = 18.0
    found = spikes(pings(down))
    assert found[:, 59:62].all()
    assert found.sum() == 60, "a hole stays"


def test_at_the_ends_the_ping_that_is_there_tells() -> None:
    down = np.full((2, 121), 15.0)
    down[:, 70:72] = 10.0
    assert not spikes(pings(down)).any()
    assert spikes(pings(down[:1]))[0, 70:72].all()


def test_four_vehicles_are_kept_up_with() -> None:
    rng = np.random.default_rng(0)
    down = np.full((200, 256), 20.0) + 0.1 * rng.standard_normal((200, 256))
    wrong = rng.random(down.shape) < 0.05
    down[wrong] *= 0.5
    angles = angles_of(256, np.radians(60.0), even=False)
    many = over(np.zeros(200), angles, down / np.cos(angles))
    began_s = time.process_time()
    spikes(many)
    assert time.process_time() - began_s < 2.0, "ten seconds of four vehicles' pings, five a second"
