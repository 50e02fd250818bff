"""Tracks are cut into lines where a hydrographer would, and crosslines are those that cross the others."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.mapping.quality.crossovers import crossings
from app.mapping.quality.tracks import Lines, Tracks, crosslines, cut, dominant_rad
from tests.support.mapping.tracks import flown, lawnmower


def lines_of(*corners_m: tuple[float, float], spacing_m: float = 1.0) -> Lines:
    return cut(Tracks.of({"a": flown(corners_m, spacing_m=spacing_m)}))


def test_a_line_ends_at_a_turn() -> None:
    lines = lines_of((0, 0), (0, 50), (10, 50), (10, 0))
    assert lines.length_m == pytest.approx([50.0, 10.0, 50.0])
    assert np.degrees(lines.heading_rad) == pytest.approx([0.0, 90.0, 180.0])
    assert lines.number.tolist() == [1, 2, 3]
    assert lines.start_s.tolist() == [0.0, 50.0, 60.0]
    assert lines.end_s.tolist() == [50.0, 60.0, 110.0]


def test_a_slow_turn_ends_a_line_too() -> None:
    angle = np.radians(np.arange(0.0, 181.0, 2.0))
    arc = [(40.0 - 40.0 * np.cos(a), 40.0 * np.sin(a)) for a in angle.tolist()]
    lines = lines_of((0, -100), *arc, (80, -100))
    assert lines.length_m[[0, -1]] == pytest.approx([100.0, 100.0], abs=25.0)
    assert 4 <= len(lines) <= 9


def test_scatter_of_positions_is_no_turn() -> None:
    table = flown([(0, 0), (300, 0)])
    table[:, 1:3] += np.random.default_rng(3).normal(0.0, 0.5, (len(table), 2))
    assert len(cut(Tracks.of({"a": table}))) == 1


def test_a_line_ends_at_a_gap_and_nothing_crosses_there() -> None:
    table = flown([(0, 0), (200, 0)])
    gone = (table[:, 1] > 80) & (table[:, 1] < 120)
    tracks = Tracks.of({"a": table[~gone], "b": flown([(100, -30), (100, 30)], start_s=1e4)})
    lines = cut(tracks)
    assert lines.length_m == pytest.approx([80.0, 80.0, 60.0])
    assert len(crossings(tracks, lines)) == 0


def test_soundings_that_are_usually_far_apart_are_no_gaps() -> None:
    assert len(lines_of((0, 0), (1000, 0), spacing_m=50.0)) == 1


def test_beams_of_the_same_moment_are_one_sounding_in_their_middle() -> None:
    table = flown([(0, 0), (20, 0)])
    beams = np.concatenate([table + np.array([0, 0, side, side, 0.1]) for side in (-2.0, 2.0)])
    tracks = Tracks.of({"a": beams})
    assert len(tracks) == len(table)
    assert np.allclose(tracks.north_m, 0.0)
    assert np.allclose(tracks.sd_m, 0.2 / np.sqrt(2))


def test_nothing_and_single_soundings_make_no_line() -> None:
    assert len(cut(Tracks.of({}))) == 0
    one = cut(Tracks.of({"a": flown([(0, 0), (5, 0)])[:1], "b": np.zeros((0, 5))}))
    assert len(one) == 0
    assert dominant_rad(one) == 0.0


@given(st.floats(0, 179.9), st.floats(0.2, 0.9))
def test_the_dominant_direction_is_that_of_most_of_the_way(direction_deg: float, share: float) -> None:
    heading = np.radians([direction_deg, direction_deg + 180.0, direction_deg + 90.0])
    length = np.array([100.0, 100.0, 200.0 * share])
    none, zeros = np.zeros(3, dtype=np.int64), np.zeros(3)
    lines = Lines(none, none.astype(bool), none, none, zeros, zeros, length, heading)
    off = abs(np.degrees(dominant_rad(lines)) - direction_deg) % 180.0
    assert min(off, 180.0 - off) < 0.01


def test_crosslines_cross_main_lines_and_ways_between_lines_are_none() -> None:
    way = [*lawnmower(100, 200, 10), (110, 100), (-10, 100)]
    tracks = Tracks.of({"a": flown(way)})
    lines = cut(tracks)
    found = crosslines(lines, crossings(tracks, lines).line)
    assert lines.length_m[found] == pytest.approx([120.0], abs=1.5)


def test_a_survey_without_crosslines_has_none() -> None:
    tracks = Tracks.of({"a": flown(lawnmower(100, 200, 10)), "b": flown([(5, 0), (5, 200)])})
    lines = cut(tracks)
    assert not crosslines(lines, crossings(tracks, lines).line).any()
